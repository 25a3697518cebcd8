//! Rendering effort of each quality, with an appearance and without.

use super::Quality;
use super::scene::RenderScene;

/// Rendering settings of a quality.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Tier {
    /// Side of the shadow map, texels; 1 without shadows.
    pub(super) shadow_size: u32,
    pub(super) shadow_taps: u32,
    /// Colour samples per pixel.
    pub(super) samples: u32,
    /// Whether edges are smoothed in the finished image.
    pub(super) smooth_edges: bool,
    /// Ambient light is sampled per pixel, and objects darken nearby surfaces.
    pub(super) ambient_per_pixel: bool,
    /// Highlights on rough surfaces too.
    pub(super) all_glossy: bool,
    /// With an appearance: ambient light, glass, metal that mirrors.
    pub(super) lit: bool,
    /// Whether there are more IDs than fit in a byte.
    wide_ids: bool,
}

/// Largest ID in the alpha byte.
const BYTE_IDS: u16 = 255;

impl Tier {
    pub(super) fn for_scene(quality: Quality, scene: &RenderScene) -> Self {
        let lit = scene.surrounding.is_some();
        let tier = |shadow_size, shadow_taps, samples| Self {
            shadow_size,
            // An appearance has softer shadows if that costs less than a tenth of the rate.
            shadow_taps: if lit && shadow_taps > 3 {
                16
            } else {
                shadow_taps
            },
            samples,
            smooth_edges: quality == Quality::Standard,
            ambient_per_pixel: matches!(quality, Quality::Standard | Quality::High),
            all_glossy: samples > 1,
            lit,
            wide_ids: scene.items.iter().any(|item| item.instance > BYTE_IDS),
        };
        match quality {
            Quality::Fast => tier(1, 0, 1),
            Quality::Draft => tier(2048, 1, 1),
            Quality::Standard => tier(2048, 3, 1),
            Quality::High => tier(4096, 9, 4),
        }
    }

    pub(super) fn has_shadows(self) -> bool {
        self.shadow_taps > 0
    }

    /// IDs have a texture of their own.
    pub(super) fn separate_ids(self) -> bool {
        self.samples > 1 || self.wide_ids
    }

    /// The pass of the colours writes that texture too: a pass of its own would render all
    /// triangles again. With several samples, which are averaged, IDs and depth need that.
    pub(super) fn ids_beside_colors(self) -> bool {
        self.samples == 1 && self.wide_ids
    }
}
