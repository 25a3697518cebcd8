//! Why there are no pictures.

use crate::geometry::mesh::MeshError;
use crate::geometry::texture::TextureError;
use crate::scene::SceneError;

/// Why a scene or a picture cannot be drawn.
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
    /// A look that cannot be drawn.
    #[error(transparent)]
    Look(#[from] SceneError),
    /// A texture that cannot be used.
    #[error(transparent)]
    Texture(#[from] TextureError),
    /// More bodies than a vertex can name.
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
    /// A camera names a link that the robot lacks.
    #[error("camera '{camera}' is on link '{link}', which the robot does not have")]
    UnknownLink {
        /// Camera.
        camera: String,
        /// Link.
        link: String,
    },
    /// A camera that cannot be.
    #[error("camera '{camera}': {reason}")]
    BadCamera {
        /// Camera.
        camera: String,
        /// What is wrong and what is expected.
        reason: String,
    },
    /// A camera index beyond the list.
    #[error("camera {index} was asked for, there are {count}")]
    NoSuchCamera {
        /// Index asked for.
        index: usize,
        /// Cameras of this renderer.
        count: usize,
    },
    /// Batches that were begun must be collected first.
    #[error("pictures that were begun before are being drawn; collect them first")]
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
        "no Vulkan driver was found, so the cameras cannot be drawn; for drawing on the CPU \
         install it with 'apt-get install libvulkan1 mesa-vulkan-drivers', for a GPU install \
         its vendor's driver, or run without cameras (--no-cameras)"
    )]
    NoDriver,
    /// No such adapter.
    #[error(
        "no Vulkan adapter has the index, the PCI id or the part of a name '{wanted}'; present are: {present}"
    )]
    UnknownAdapter {
        /// What was asked for.
        wanted: String,
        /// Names of all adapters.
        present: String,
    },
    /// The adapter refused or failed.
    #[error("adapter '{adapter}' failed: {reason}")]
    Device {
        /// Adapter.
        adapter: String,
        /// Answer of the driver.
        reason: String,
    },
}
