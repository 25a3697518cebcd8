//! The render scene as vertices, indices, materials and pictures, ready to upload.

use std::ops::Range;

use nalgebra::{Isometry3, Point3};

use super::scene::{Binding, RenderItem, RenderScene};
use crate::geometry::{Material, TriMesh, texture};

/// One vertex, in the frame of its body.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Vertex {
    pub(super) position: [f32; 3],
    /// Octahedral.
    pub(super) normal: [i16; 2],
    pub(super) uv: [f32; 2],
    /// Body: 8 bits, openness: 8 bits, material: 16 bits.
    pub(super) packed: u32,
}

/// Linear colour and roughness; metallic, emission, texture layer.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct GpuMaterial {
    color: [f32; 4],
    more: [f32; 4],
}

/// How a pixel of a material is computed, cheapest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Finish {
    pub(super) textured: bool,
    /// Highlights and mirrored surroundings; others are lit at their vertices.
    pub(super) glossy: bool,
}

impl Finish {
    /// All, in drawing order.
    pub(super) const ALL: [Self; 4] = [
        Self {
            textured: false,
            glossy: true,
        },
        Self {
            textured: false,
            glossy: false,
        },
        Self {
            textured: true,
            glossy: true,
        },
        Self {
            textured: true,
            glossy: false,
        },
    ];

    fn of(material: &Material, all_glossy: bool) -> Self {
        Self {
            textured: material.texture.is_some(),
            glossy: all_glossy
                || material.metallic > MATTE_METALLIC
                || material.roughness < MATTE_ROUGHNESS,
        }
    }
}

/// Rougher surfaces show no highlight worth its pixels.
const MATTE_ROUGHNESS: f32 = 0.4;
/// Less metallic surfaces mirror nothing worth seeing.
const MATTE_METALLIC: f32 = 0.2;

/// Triangles of a body that are drawn together, those of one finish.
#[derive(Clone, Debug)]
pub(super) struct Batch {
    pub(super) body: usize,
    pub(super) finish: Finish,
    /// Indices at full detail.
    pub(super) full: Range<u32>,
    /// Indices for far away.
    pub(super) coarse: Range<u32>,
    /// Ball around it in the frame of its body.
    pub(super) centre: Point3<f64>,
    pub(super) radius: f64,
}

/// A body: what it moves with, its id, its part of the shadow.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) binding: Binding,
    pub(super) instance: u8,
    /// What throws a shadow.
    pub(super) casters: Vec<Caster>,
}

/// Triangles that throw a shadow, at coarse detail.
#[derive(Clone, Debug)]
pub(super) struct Caster {
    pub(super) indices: Range<u32>,
    /// Ball around it in the frame of its body.
    pub(super) centre: Point3<f64>,
    pub(super) radius: f64,
}

/// All of it.
pub(super) struct Buffers {
    pub(super) vertices: Vec<Vertex>,
    pub(super) indices: Vec<u32>,
    pub(super) materials: Vec<GpuMaterial>,
    /// Patterns in the order of texture layers.
    pub(super) patterns: Vec<String>,
    pub(super) bodies: Vec<Body>,
    pub(super) batches: Vec<Batch>,
}

impl Buffers {
    /// `all_glossy` computes highlights on every surface.
    pub(super) fn new(scene: &RenderScene, all_glossy: bool) -> Self {
        let mut built = Self {
            vertices: Vec::new(),
            indices: Vec::new(),
            materials: Vec::new(),
            patterns: Vec::new(),
            bodies: Vec::new(),
            batches: Vec::new(),
        };
        let mut known: Vec<Material> = Vec::new();
        let same =
            |a: &RenderItem, b: &RenderItem| a.instance == b.instance && a.binding == b.binding;
        for items in scene.items.chunk_by(same) {
            let body = built.bodies.len();
            let mut casters = Vec::new();
            for finish in Finish::ALL {
                let mut chosen: Vec<&RenderItem> = items
                    .iter()
                    .filter(|i| Finish::of(&i.material, all_glossy) == finish)
                    .collect();
                if chosen.is_empty() {
                    continue;
                }
                // Casters first, so that their part is one range.
                chosen.sort_by_key(|i| !i.casts_shadow);
                let materials: Vec<u32> = chosen
                    .iter()
                    .map(|item| built.material(&mut known, &item.material))
                    .collect();
                let first_vertex = built.vertices.len();
                let start = built.indices.len() as u32;
                for (item, &material) in chosen.iter().zip(&materials) {
                    built.append(&item.mesh, &item.body_from_mesh, body, material);
                }
                let middle = built.indices.len() as u32;
                let mut caster_end = middle;
                for (item, &material) in chosen.iter().zip(&materials) {
                    built.append(&item.coarse, &item.body_from_mesh, body, material);
                    if item.casts_shadow {
                        caster_end = built.indices.len() as u32;
                    }
                }
                let end = built.indices.len() as u32;
                let (centre, radius) = ball(&built.vertices[first_vertex..]);
                if caster_end > middle {
                    casters.push(Caster {
                        indices: middle..caster_end,
                        centre,
                        radius,
                    });
                }
                built.batches.push(Batch {
                    body,
                    finish,
                    full: start..middle,
                    coarse: middle..end,
                    centre,
                    radius,
                });
            }
            built.bodies.push(Body {
                binding: items[0].binding,
                instance: items[0].instance,
                casters,
            });
        }
        built
    }

    fn material(&mut self, known: &mut Vec<Material>, material: &Material) -> u32 {
        if let Some(i) = known.iter().position(|m| m == material) {
            return i as u32;
        }
        let mut color = material.color.map(linear);
        let mut layer = 0;
        if let Some(t) = &material.texture {
            if texture::is_label(&t.pattern) {
                color = [1.0; 3];
            }
            layer = match self.patterns.iter().position(|p| *p == t.pattern) {
                Some(layer) => layer,
                None => {
                    self.patterns.push(t.pattern.clone());
                    self.patterns.len() - 1
                }
            };
        }
        known.push(material.clone());
        self.materials.push(GpuMaterial {
            color: [
                color[0],
                color[1],
                color[2],
                material.roughness.clamp(0.12, 1.0),
            ],
            more: [
                material.metallic.clamp(0.0, 1.0),
                material.emission.max(0.0),
                layer as f32,
                0.0,
            ],
        });
        known.len() as u32 - 1
    }

    fn append(
        &mut self,
        mesh: &TriMesh,
        body_from_mesh: &Isometry3<f64>,
        body: usize,
        material: u32,
    ) {
        let first = self.vertices.len() as u32;
        let packed = body as u32 | 255 << 8 | material << 16;
        for ((p, n), uv) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.uvs) {
            let position = body_from_mesh * Point3::from(p.map(f64::from));
            let normal = body_from_mesh.rotation * nalgebra::Vector3::from(n.map(f64::from));
            self.vertices.push(Vertex {
                position: position.coords.cast::<f32>().into(),
                normal: octahedral(normal.into()),
                uv: *uv,
                packed,
            });
        }
        self.indices.extend(mesh.indices.iter().map(|i| i + first));
    }
}

/// Linear colour of an sRGB value.
pub(super) fn linear(c: f32) -> f32 {
    if c <= 0.040_45 {
        c / 12.92
    } else {
        ((c + 0.055) / 1.055).powf(2.4)
    }
}

/// A unit vector as two 16-bit numbers (Cigolle et al. 2014).
fn octahedral(n: [f64; 3]) -> [i16; 2] {
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

/// Ball about the middle of the bounding box.
fn ball(vertices: &[Vertex]) -> (Point3<f64>, f64) {
    let points = || {
        vertices
            .iter()
            .map(|v| Point3::from(v.position.map(f64::from)))
    };
    let low = points().fold(Point3::from([f64::INFINITY; 3]), |a, b| a.inf(&b));
    let high = points().fold(Point3::from([f64::NEG_INFINITY; 3]), |a, b| a.sup(&b));
    let centre = nalgebra::center(&low, &high);
    let radius = points().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    (centre, radius)
}
