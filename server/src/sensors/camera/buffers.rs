//! The render scene as vertices, indices, materials and images, ready to upload.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use wheelarm_proto::exact;

use super::ambient_map::AmbientMap;
use super::ambient_occlusion::HomeLight;
use super::batch::{AMBIENT, Batch, Body, Caster, Finish, MATERIAL, Shine, Vertex};
use super::contact::Occluder;
use super::culling_clusters::{Cluster, Piece};
use super::part_cache::{Home, PartCache};
use super::parts::{Part, Share};
use super::scene::{Binding, RenderItem, RenderScene, RenderedPerson};
use super::tier::Tier;
use crate::geometry::{Material, texture};

/// Linear colour and roughness; metallic, emission, texture layer.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct GpuMaterial {
    color: [f32; 4],
    more: [f32; 4],
}

/// Largest deformation of a deformable, metres: culling allows for it.
const SOFT_REACH: f64 = 0.1;

/// All buffers of a scene.
pub(super) struct Buffers {
    pub(super) vertices: Vec<Vertex>,
    pub(super) indices: Vec<u32>,
    pub(super) materials: Vec<GpuMaterial>,
    /// Patterns in the order of texture layers.
    pub(super) patterns: Vec<String>,
    pub(super) bodies: Vec<Body>,
    pub(super) batches: Vec<Batch>,
    pub(super) ambient_map: AmbientMap,
    /// Capsules that approximate the objects.
    pub(super) occluders: Vec<Occluder>,
}

impl Buffers {
    /// The tier determines the shading variants. Parts of earlier scenes are in `cache`.
    pub(super) fn new(
        scene: &RenderScene,
        (home, light): (&Home, &mut HomeLight<'_>),
        tier: Tier,
        cache: &PartCache,
    ) -> Self {
        let mut built = Self {
            vertices: Vec::new(),
            indices: Vec::new(),
            materials: Vec::new(),
            patterns: Vec::new(),
            bodies: Vec::new(),
            batches: Vec::new(),
            ambient_map: AmbientMap::empty(),
            occluders: Vec::new(),
        };
        let mut known: Vec<Material> = Vec::new();
        let same =
            |a: &RenderItem, b: &RenderItem| a.instance == b.instance && a.binding == b.binding;
        let person = scene.person.iter().flat_map(|p| &p.parts);
        let person: Vec<u16> = person.map(|(instance, _)| *instance).collect();
        let soft = |binding| {
            scene
                .skins
                .iter()
                .any(|(o, _)| binding == Binding::Object(*o))
        };
        let sun = Vector3::from(scene.lighting.sun_direction);
        let mut shares = Vec::new();
        for items in scene.items.chunk_by(same) {
            let mut share = Share {
                sun,
                ambient_per_pixel: tier.ambient_per_pixel,
                reach: match person.contains(&items[0].instance) {
                    true => RenderedPerson::REACH,
                    false if soft(items[0].binding) => SOFT_REACH,
                    false => 0.0,
                },
                binding: items[0].binding,
                finished: Vec::new(),
                materials: Vec::new(),
            };
            for finish in Finish::ALL {
                let mut chosen: Vec<&RenderItem> = items
                    .iter()
                    .filter(|i| finish.suits(&i.material, tier))
                    .collect();
                // Casters first, so that their part is one range.
                chosen.sort_by_key(|i| !i.casts_shadow);
                let chosen = chosen.into_iter().map(|item| {
                    let material = built.material(&mut known, &item.material, finish);
                    let own = share.materials.iter().position(|own| *own == material);
                    let own = own.unwrap_or_else(|| {
                        share.materials.push(material);
                        share.materials.len() - 1
                    });
                    (item, own as u32)
                });
                let chosen = chosen.collect();
                share.finished.push((finish, chosen));
            }
            shares.push(share);
            built.bodies.push(Body {
                binding: items[0].binding,
                instance: items[0].instance,
                centre: Point3::origin(),
                casters: Vec::new(),
            });
        }
        let with_appearance = scene.surrounding.is_some();
        let parts = cache.parts(&shares, home, light, with_appearance);
        // Reserve all memory at once: growing copies and briefly doubles the memory.
        let lengths = |length: fn(&Part) -> usize| parts.iter().map(|part| length(part)).sum();
        built
            .vertices
            .reserve_exact(lengths(|part| part.vertices.len()));
        built
            .indices
            .reserve_exact(lengths(|part| part.indices.len()));
        if tier.ambient_per_pixel {
            let charts = parts.iter().flat_map(|part| &part.charts);
            built.ambient_map = AmbientMap::new(&charts.collect::<Vec<_>>());
        }
        let mut first_chart = 0;
        for (body, (part, share)) in parts.iter().zip(&shares).enumerate() {
            built.take(body, part, &share.materials, first_chart);
            first_chart += part.charts.len();
        }
        built
    }

    /// Appends the part of a body. Its charts are numbered from `first_chart` on. Charts
    /// without room in the ambient map keep light per vertex.
    fn take(&mut self, body: usize, part: &Arc<Part>, materials: &[u32], first_chart: usize) {
        let (vertices, indices) = (self.vertices.len() as u32, self.indices.len() as u32);
        let moved = |range: &Range<u32>| range.start + indices..range.end + indices;
        let map = &self.ambient_map;
        let piece = |piece: &Piece| Piece {
            indices: moved(&piece.indices),
            chart: piece.chart + first_chart,
            outline: piece.outline.clone(),
        };
        let has_room = |piece: &Piece| map.charts.placed[piece.chart].is_some();
        let cluster = |cluster: &Cluster| {
            let mut pieces: Vec<Piece> = cluster.pieces.iter().map(piece).collect();
            let all_have_room = pieces.iter().all(has_room);
            if !all_have_room {
                pieces.retain(has_room);
            }
            Cluster {
                indices: moved(&cluster.indices),
                mapped: cluster.mapped && all_have_room,
                pieces,
                ..*cluster
            }
        };
        self.batches.extend(part.batches.iter().map(|batch| Batch {
            body,
            full: batch.full.iter().map(cluster).collect(),
            coarse: batch.coarse.iter().map(cluster).collect(),
            ..*batch
        }));
        self.bodies[body]
            .casters
            .extend(part.casters.iter().map(|caster| Caster {
                indices: moved(&caster.indices),
                ..*caster
            }));
        self.bodies[body].centre = part.centre;
        let occluders = part.occluders.iter();
        self.occluders
            .extend(occluders.map(|occluder| occluder.on_body(body)));
        let placed = part.vertices.iter().enumerate().map(|(i, vertex)| {
            let ambient = part.point(i).and_then(|point| {
                let chart = point.chart as usize;
                map.coordinates(first_chart + chart, &part.charts[chart], point.local)
            });
            let material = materials[(vertex.packed >> MATERIAL) as usize];
            let light = vertex.packed & (0xff << AMBIENT);
            Vertex {
                packed: body as u32 | light | material << MATERIAL,
                ambient: ambient.unwrap_or_default(),
                ..*vertex
            }
        });
        self.vertices.extend(placed);
        self.indices
            .extend(part.indices.iter().map(|index| index + vertices));
    }

    fn material(&mut self, known: &mut Vec<Material>, material: &Material, finish: Finish) -> u32 {
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
                match finish.shine {
                    Shine::Glass => material.transmission,
                    _ => material.metallic.clamp(0.0, 1.0),
                },
                material.emission.max(0.0),
                layer as f32,
                0.0,
            ],
        });
        known.len() as u32 - 1
    }
}

/// Linear colour of an sRGB value.
pub(super) fn linear(c: f32) -> f32 {
    if c <= 0.040_45 {
        c / 12.92
    } else {
        exact::powf((c + 0.055) / 1.055, 2.4)
    }
}
