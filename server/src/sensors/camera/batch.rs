//! Vertices, and the triangles of a body that are rendered together.

use std::ops::Range;

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::culling_clusters::Cluster;
use super::scene::Binding;
use super::tier::Tier;
use crate::geometry::Material;

/// One vertex, in the frame of its body.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Vertex {
    pub(super) position: [f32; 3],
    /// Octahedral.
    pub(super) normal: [i16; 2],
    pub(super) uv: [f32; 2],
    /// Body: 12 bits, ambient occlusion: 8 bits, material: 12 bits.
    pub(super) packed: u32,
    /// Coordinates in the ambient map.
    pub(super) ambient: [u16; 2],
}

/// First bit of the ambient occlusion in [`Vertex::packed`].
pub(super) const AMBIENT: u32 = 12;
/// First bit of the material in [`Vertex::packed`].
pub(super) const MATERIAL: u32 = 20;

/// Shading of a pixel beyond its diffuse colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Shine {
    /// Highlights, and an environment that is bright above and dark below.
    Glossy,
    /// None: lit per vertex.
    Matte,
    /// Reflects the room; only with an appearance.
    Mirror,
    /// Shows the background and reflects the room; only with an appearance.
    Glass,
}

/// Shading variant of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Finish {
    pub(super) textured: bool,
    pub(super) shine: Shine,
    /// May be lit by the sun; other surfaces are static and face away from it.
    pub(super) sunny: bool,
}

impl Finish {
    /// All, in rendering order; without an appearance the first [`Self::PLAIN`].
    pub(super) const ALL: [Self; 16] = {
        let mut all = [Self {
            textured: false,
            shine: Shine::Glossy,
            sunny: false,
        }; 16];
        let mut i = 0;
        while i < 16 {
            all[i].textured = i & 4 != 0;
            all[i].shine = match (i & 8 != 0, i & 2 == 0) {
                (false, true) => Shine::Glossy,
                (false, false) => Shine::Matte,
                (true, true) => Shine::Mirror,
                (true, false) => Shine::Glass,
            };
            all[i].sunny = i & 1 == 0;
            i += 1;
        }
        all
    };

    /// Number of variants without an appearance.
    pub(super) const PLAIN: usize = 8;

    /// Its index in [`Self::ALL`].
    pub(super) fn index(self) -> usize {
        let shine = match self.shine {
            Shine::Glossy => 0,
            Shine::Matte => 2,
            Shine::Mirror => 8,
            Shine::Glass => 10,
        };
        shine + 4 * usize::from(self.textured) + usize::from(!self.sunny)
    }

    /// Whether items of `material` use it.
    pub(super) fn suits(self, material: &Material, tier: Tier) -> bool {
        let metal = material.metallic >= MIRROR_METALLIC && material.roughness <= MIRROR_ROUGHNESS;
        let glossy = tier.all_glossy
            || material.metallic > MATTE_METALLIC
            || material.roughness < MATTE_ROUGHNESS;
        let shine = match glossy {
            _ if tier.lit && material.transmission > 0.0 => Shine::Glass,
            _ if tier.lit && metal => Shine::Mirror,
            true => Shine::Glossy,
            false => Shine::Matte,
        };
        self.textured == material.texture.is_some() && self.shine == shine
    }
}

/// Roughness above which highlights are not worth their cost.
const MATTE_ROUGHNESS: f32 = 0.4;
/// Roughness below which metal reflects the room, above it only light and dark.
const MIRROR_ROUGHNESS: f32 = 0.5;
const MIRROR_METALLIC: f32 = 0.5;
/// Metallic value below which reflections are not worth their cost.
const MATTE_METALLIC: f32 = 0.2;

/// Triangles of a body that are rendered together, with one shading variant.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Batch {
    pub(super) body: usize,
    pub(super) finish: Finish,
    /// Triangles at full detail.
    pub(super) full: Vec<Cluster>,
    /// Triangles for distant views.
    pub(super) coarse: Vec<Cluster>,
    /// Bounding sphere in the frame of its body.
    pub(super) centre: Point3<f64>,
    pub(super) radius: f64,
}

/// A body: binding, ID, part of the shadow.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) binding: Binding,
    pub(super) instance: u16,
    /// Centre of its bounding box, in its frame.
    pub(super) centre: Point3<f64>,
    /// Shadow casters.
    pub(super) casters: Vec<Caster>,
}

/// Triangles of a shadow caster, at coarse detail.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Caster {
    pub(super) indices: Range<u32>,
    /// Bounding sphere in the frame of its body.
    pub(super) centre: Point3<f64>,
    pub(super) radius: f64,
}

/// A unit vector as two 16-bit numbers (Cigolle et al. 2014).
pub(super) fn octahedral(n: [f64; 3]) -> [i16; 2] {
    let sum = n.iter().map(|x| x.abs()).sum::<f64>().max(1e-12);
    let (x, y) = (n[0] / sum, n[1] / sum);
    let sign = |v: f64| if v >= 0.0 { 1.0 } else { -1.0 };
    let (x, y) = if n[2] < 0.0 {
        ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y))
    } else {
        (x, y)
    };
    [x, y].map(|v| (v * 32767.0).round() as i16)
}
