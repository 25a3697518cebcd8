//! How much work a quality asks for, with a look and without.

use super::Quality;
use super::scene::RenderScene;

/// How a quality tier is drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Tier {
    /// Side of the shadow map, texels; 1 without shadows.
    pub(super) shadow_size: u32,
    pub(super) shadow_taps: u32,
    /// Colour samples per pixel.
    pub(super) samples: u32,
    /// Edges are smoothed in the finished image.
    pub(super) smooth_edges: bool,
    /// Ambient light is looked up per pixel, and objects darken what is near them.
    pub(super) ambient_per_pixel: bool,
    /// Highlights on rough surfaces too.
    pub(super) all_glossy: bool,
    /// A look is drawn: light from all around, glass, metal that mirrors.
    pub(super) lit: bool,
    /// There are more ids than a byte tells apart.
    wide_ids: bool,
}

/// Greatest id of the alpha byte.
const BYTE_IDS: u16 = 255;

impl Tier {
    pub(super) fn of(quality: Quality, scene: &RenderScene) -> Self {
        let lit = scene.surrounding.is_some();
        let tier = |shadow_size, shadow_taps, samples| Self {
            shadow_size,
            // A look has softer shadows where that does not cost a tenth of the rate.
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

    /// Ids and depth come from a pass of their own, without averaging.
    pub(super) fn separate_ids(self) -> bool {
        self.samples > 1 || self.wide_ids
    }
}
