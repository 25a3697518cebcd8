//! Cameras: colour, depth in metres and instance IDs, rendered headless with Vulkan
//! from snapshots. Only this folder uses wgpu.
//!
//! All images of a batch are one submission, rendered before the first is read back,
//! because a CPU adapter finishes its work at the end of a pass. On one adapter the
//! same snapshot gives the same bytes; adapters differ in single bits.

mod adapter;
mod ambient_map;
mod ambient_occlusion;
mod antialias;
mod batch;
mod buffers;
mod contact;
mod culling_clusters;
mod decoration;
mod deflate;
mod driver_lock;
mod error;
mod frame_data;
mod geometry;
mod graphics;
mod image_pass;
mod mapping;
mod mesh_cache;
mod packing;
mod part_cache;
mod parts;
mod patterns;
mod person;
mod pipelines;
mod planes;
mod prepare;
mod readback;
mod renderer;
mod ring;
pub mod scene;
mod shadow;
mod soft;
pub mod spec;
mod surroundings;
mod target;
mod tier;
mod timing;
mod uniform;
mod view;

use bytes::Bytes;
use nalgebra::Isometry3;

pub use adapter::{AdapterInfo, AdapterKind};
pub use deflate::Deflated;
pub use error::RenderError;
pub use graphics::Graphics;
pub use mesh_cache::MeshCache;
pub use packing::Packing;
pub use renderer::{IN_FLIGHT, Renderer};
pub use scene::{Binding, MOST_BODIES, RenderItem, RenderScene, RenderedPerson, Surrounding};
pub use spec::{CameraSpec, Intrinsics};
pub use wheelarm_proto::settings::Quality;

/// Environment variable and value that prevent Mesa's loader layer from searching for a
/// desktop and warning about `XDG_RUNTIME_DIR`. Set it when starting a process;
/// harmless everywhere.
pub const QUIET_LOADER: (&str, &str) = ("NODEVICE_SELECT", "1");

/// An image of one camera.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Index into the renderer's cameras.
    pub camera: usize,
    /// Lens.
    pub intrinsics: Intrinsics,
    /// Pose of the camera in `house` when the image was taken.
    pub world_from_optical: Isometry3<f64>,
    /// sRGB, height x width x 3 bytes, rows from the top.
    pub rgb: Bytes,
    /// Metres along the optical axis, height x width little-endian f32;
    /// `+inf` where nothing is within the camera's range.
    pub depth: Bytes,
    /// Instance ids, height x width little-endian u16; 0 where nothing is hit.
    pub ids: Bytes,
    /// The deflated planes, if requested and supported by the adapter.
    pub deflated: Deflated,
}

impl Frame {
    /// Instance ids of the pixels, row by row from the top.
    #[must_use]
    pub fn ids(&self) -> Vec<u16> {
        let (pairs, _) = self.ids.as_chunks::<2>();
        pairs.iter().map(|&pair| u16::from_le_bytes(pair)).collect()
    }
}

#[cfg(test)]
mod ambient_tests;
#[cfg(test)]
mod cache_tests;
#[cfg(test)]
mod deflate_tests;
#[cfg(test)]
mod home_tests;
#[cfg(test)]
mod packing_tests;
#[cfg(test)]
mod people_tests;
#[cfg(test)]
mod tests;
