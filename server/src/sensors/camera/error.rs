//! Errors of rendering.

use crate::geometry::mesh::MeshError;
use crate::geometry::texture::TextureError;
use crate::scene::SceneError;

/// Why a scene or an image cannot be rendered.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A shape of a body has no triangles.
    #[error("visual {index} of '{body}': {source}")]
    Mesh {
        /// Body, link or furniture.
        body: String,
        /// Index of its visual.
        index: usize,
        /// The reason.
        source: MeshError,
    },
    /// An invalid look.
    #[error(transparent)]
    Appearance(#[from] SceneError),
    /// An invalid texture.
    #[error(transparent)]
    Texture(#[from] TextureError),
    /// More bodies than a vertex can reference.
    #[error(
        "{objects} objects, {links} robot links and {furniture} pieces of furniture are drawn; \
         {} are too many: join pieces of furniture into one body",
        super::scene::MOST_BODIES
    )]
    TooManyInstances {
        /// Objects with visuals.
        objects: usize,
        /// Links with visuals.
        links: usize,
        /// Furniture with visuals.
        furniture: usize,
    },
    /// A camera on an unknown link.
    #[error("camera '{camera}' is on link '{link}', which the robot does not have")]
    UnknownLink {
        /// Camera.
        camera: String,
        /// Link.
        link: String,
    },
    /// An invalid camera.
    #[error("camera '{camera}': {reason}")]
    BadCamera {
        /// Camera.
        camera: String,
        /// What is wrong and what is expected.
        reason: String,
    },
    /// A camera index out of range.
    #[error("camera {index} does not exist: there are {count} cameras")]
    NoSuchCamera {
        /// Requested index.
        index: usize,
        /// Cameras of this renderer.
        count: usize,
    },
    /// Submitted batches must be collected first.
    #[error("submitted images are still being rendered; collect them first")]
    InFlight,
    /// A snapshot of another scene or robot.
    #[error("the snapshot has {found} {kind}, the render scene was built for {expected}")]
    SnapshotMismatch {
        /// `links` or `objects`.
        kind: &'static str,
        /// In the snapshot.
        found: usize,
        /// In the render scene.
        expected: usize,
    },
    /// No Vulkan driver at all.
    #[error(
        "no Vulkan driver was found, so the cameras cannot render; to render on the CPU \
         install it with 'apt-get install libvulkan1 mesa-vulkan-drivers', for a GPU install \
         its vendor's driver, or run without cameras (--no-cameras)"
    )]
    NoDriver,
    /// An unknown adapter.
    #[error(
        "no Vulkan adapter has the index, the PCI ID or the part of a name '{wanted}'; available: {present}"
    )]
    UnknownAdapter {
        /// Requested adapter.
        wanted: String,
        /// Names of all adapters.
        present: String,
    },
    /// The adapter failed.
    #[error("adapter '{adapter}' failed: {reason}")]
    Device {
        /// Adapter.
        adapter: String,
        /// Message of the driver.
        reason: String,
    },
}
