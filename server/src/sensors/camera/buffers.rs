//! The render scene as vertices, indices, materials and images, ready to upload.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{Point3, Vector3};
use wheelarm_proto::exact;

use super::ambient_map::{AmbientMap, Chart, ChartPoint, Plane, Planes, plane};
use super::ambient_occlusion::{AmbientCache, AmbientOcclusion, Corner, CornerLight, HomeLight};
use super::contact::Occluder;
use super::culling_clusters::{Cluster, Division, Piece, Triangle, bounds, clusters, pieces};
use super::parallel;
use super::scene::{Binding, RenderItem, RenderScene, RenderedPerson};
use super::tier::Tier;
use crate::geometry::{Material, TriMesh, texture};

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

/// Linear colour and roughness; metallic, emission, texture layer.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct GpuMaterial {
    color: [f32; 4],
    more: [f32; 4],
}

/// Shading of a pixel beyond its diffuse colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    fn suits(self, material: &Material, tier: Tier) -> bool {
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

/// Largest deformation of a deformable, metres: culling allows for it.
const SOFT_REACH: f64 = 0.1;
/// Roughness above which highlights are not worth their cost.
const MATTE_ROUGHNESS: f32 = 0.4;
/// Roughness below which metal reflects the room, above it only light and dark.
const MIRROR_ROUGHNESS: f32 = 0.5;
const MIRROR_METALLIC: f32 = 0.5;
/// Metallic value below which reflections are not worth their cost.
const MATTE_METALLIC: f32 = 0.2;

/// Triangles of a body that are rendered together, with one shading variant.
#[derive(Clone, Debug)]
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
#[derive(Clone, Debug)]
pub(super) struct Caster {
    pub(super) indices: Range<u32>,
    /// Bounding sphere in the frame of its body.
    pub(super) centre: Point3<f64>,
    pub(super) radius: f64,
}

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
    /// The tier determines the shading variants.
    pub(super) fn new(scene: &RenderScene, light: &mut HomeLight<'_>, tier: Tier) -> Self {
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
        for (body, items) in scene.items.chunk_by(same).enumerate() {
            let mut share = Share {
                body,
                sun,
                smooths_light: tier.ambient_per_pixel,
                ambient_per_pixel: tier.ambient_per_pixel,
                reach: match person.contains(&items[0].instance) {
                    true => RenderedPerson::REACH,
                    false if soft(items[0].binding) => SOFT_REACH,
                    false => 0.0,
                },
                finished: Vec::new(),
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
                    (item, material)
                });
                share.finished.push((finish, chosen.collect()));
            }
            shares.push(share);
            built.bodies.push(Body {
                binding: items[0].binding,
                instance: items[0].instance,
                centre: Point3::origin(),
                casters: Vec::new(),
            });
        }
        let mut fixed = 0..;
        let mut number = |body: &Body| {
            let is_fixed = body.binding == Binding::World;
            is_fixed.then(|| fixed.next()).flatten()
        };
        let numbers: Vec<Option<usize>> = built.bodies.iter().map(&mut number).collect();
        let shares = shares.into_iter().zip(&numbers).map(|(share, number)| {
            // Moving bodies have none.
            (share, light.of_body(number.unwrap_or(usize::MAX)))
        });
        let mut parts = parallel::map(shares.collect(), |(share, light): (Share<'_>, _)| {
            share.worked_out(light)
        });
        // Reserve all memory at once: growing copies and briefly doubles the memory.
        let lengths = |length: fn(&Part) -> usize| parts.iter().map(|(part, _)| length(part)).sum();
        built
            .vertices
            .reserve_exact(lengths(|part| part.vertices.len()));
        built
            .indices
            .reserve_exact(lengths(|part| part.indices.len()));
        let mut charts = Vec::new();
        let mut first_charts = Vec::new();
        for (part, _) in &mut parts {
            first_charts.push(charts.len());
            charts.append(&mut part.charts);
        }
        if tier.ambient_per_pixel {
            built.ambient_map = AmbientMap::new(&charts);
        }
        let parts = parts.into_iter().zip(first_charts).zip(numbers);
        for (body, (((mut part, known), first_chart), number)) in parts.enumerate() {
            part.place_on_map(&built.ambient_map, &charts, first_chart);
            built.take(body, part);
            if let Some(number) = number {
                light.put_back(number, known);
            }
        }
        built
    }

    /// Appends the part of a body.
    fn take(&mut self, body: usize, part: Part) {
        let (vertices, indices) = (self.vertices.len() as u32, self.indices.len() as u32);
        let moved = |range: Range<u32>| range.start + indices..range.end + indices;
        let all_moved = |clusters: Vec<Cluster>| {
            let moved = |mut cluster: Cluster| {
                for piece in &mut cluster.pieces {
                    piece.indices = moved(piece.indices.clone());
                }
                Cluster {
                    indices: moved(cluster.indices),
                    ..cluster
                }
            };
            clusters.into_iter().map(moved).collect()
        };
        let batches = part.batches.into_iter().map(|batch| Batch {
            full: all_moved(batch.full),
            coarse: all_moved(batch.coarse),
            ..batch
        });
        self.batches.extend(batches);
        let casters = part.casters.into_iter().map(|caster| Caster {
            indices: moved(caster.indices),
            ..caster
        });
        self.bodies[body].casters.extend(casters);
        self.bodies[body].centre = ball(&part.vertices).0;
        self.occluders.extend(part.occluders);
        self.vertices.extend(part.vertices);
        let shifted = part.indices.into_iter().map(|index| index + vertices);
        self.indices.extend(shifted);
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

/// Work of one body.
struct Share<'a> {
    body: usize,
    /// Direction towards the sun.
    sun: Vector3<f32>,
    /// Ambient light of wide surfaces is smoothed.
    smooths_light: bool,
    /// Wide planes have charts, and objects darken them as capsules.
    ambient_per_pixel: bool,
    /// How far its vertices move in its frame, metres.
    reach: f64,
    /// Items by their finish, with their materials.
    finished: Vec<(Finish, Vec<(&'a RenderItem, u32)>)>,
}

/// The buffers of one body.
#[derive(Default)]
struct Part {
    vertices: Vec<Vertex>,
    indices: Vec<u32>,
    batches: Vec<Batch>,
    casters: Vec<Caster>,
    occluders: Vec<Occluder>,
    charts: Vec<Chart>,
    /// Index of the chart of each plane.
    planes: BTreeMap<Plane, usize>,
    /// The point on a chart of each vertex, if it is on one; empty without charts.
    points: Vec<Option<ChartPoint>>,
}

/// Side of a wide surface, metres.
const WIDE: f32 = 1.0;
/// Largest diagonal of an object with a single capsule, metres. Larger objects have one
/// per item.
const LARGE_BODY: f64 = 0.6;

/// Whether rays determine the ambient light at every point of an item.
fn is_lit_by_rays(item: &RenderItem) -> bool {
    item.binding == Binding::World && item.material.emission < 0.3
}

/// Position and normal of a vertex in the frame of the body.
fn placed(item: &RenderItem, mesh: &TriMesh, vertex: usize) -> (Point3<f64>, Vector3<f64>) {
    (
        item.body_from_mesh * Point3::from(mesh.positions[vertex].map(f64::from)),
        item.body_from_mesh.rotation * Vector3::from(mesh.normals[vertex].map(f64::from)),
    )
}

impl Share<'_> {
    /// Whether the ambient light of an item is smoothed.
    fn is_wide(&self, item: &RenderItem) -> bool {
        let positions = &item.coarse.positions;
        let side = |k: usize| {
            let values = || positions.iter().map(|p| p[k]);
            values().fold(f32::MIN, f32::max) - values().fold(f32::MAX, f32::min)
        };
        self.smooths_light && (0..3).any(|k| side(k) > WIDE)
    }

    fn worked_out(&self, mut ambient_occlusion: AmbientOcclusion<'_>) -> (Part, AmbientCache) {
        let mut part = Part::default();
        if self.ambient_per_pixel {
            self.compute_charts(&mut part, &mut ambient_occlusion);
            part.occluders = self.occluders();
        }
        for (finish, chosen) in &self.finished {
            self.append_finish(&mut part, *finish, chosen, &mut ambient_occlusion);
        }
        (part, ambient_occlusion.into_known())
    }

    /// Computes the charts of the wide planes. Glass keeps light per vertex.
    fn compute_charts(&self, part: &mut Part, ambient_occlusion: &mut AmbientOcclusion<'_>) {
        let mut planes = Planes::default();
        let opaque = self
            .finished
            .iter()
            .filter(|(f, _)| f.shine != Shine::Glass);
        let items = opaque.flat_map(|(_, chosen)| chosen);
        for (item, _) in items.filter(|(item, _)| is_lit_by_rays(item)) {
            let coarse =
                (!std::sync::Arc::ptr_eq(&item.mesh, &item.coarse)).then_some(&item.coarse);
            for mesh in std::iter::once(&item.mesh).chain(coarse) {
                for triangle in mesh.indices.as_chunks::<3>().0 {
                    planes.add(triangle.map(|i| placed(item, mesh, i as usize)));
                }
            }
        }
        let known = ambient_occlusion.take_charts();
        let charts = planes.charts(ambient_occlusion.around(), &known);
        ambient_occlusion.keep_charts(&charts);
        for (plane, chart) in charts {
            part.planes.insert(plane, part.charts.len());
            part.charts.push(chart);
        }
    }

    /// The capsule of an object, or of each item of a large one.
    fn occluders(&self) -> Vec<Occluder> {
        let items: Vec<&RenderItem> = self
            .finished
            .iter()
            .flat_map(|(_, chosen)| chosen.iter().map(|(item, _)| *item))
            .filter(|item| matches!(item.binding, Binding::Object(_)))
            .collect();
        let box_of = |items: &[&RenderItem]| {
            bounds(items.iter().flat_map(|item| {
                let positions = item.coarse.positions.iter();
                positions.map(move |p| item.body_from_mesh * Point3::from(p.map(f64::from)))
            }))
        };
        let boxes: Vec<_> = match box_of(&items) {
            (low, high) if (high - low).norm() <= LARGE_BODY => vec![(low, high)],
            _ => items
                .iter()
                .map(|item| box_of(std::slice::from_ref(item)))
                .collect(),
        };
        let occluder =
            |(low, high): &(Point3<f64>, Point3<f64>)| Occluder::new(self.body, low, high);
        boxes.iter().filter_map(occluder).collect()
    }

    fn append_finish(
        &self,
        part: &mut Part,
        finish: Finish,
        chosen: &[(&RenderItem, u32)],
        ambient_occlusion: &mut AmbientOcclusion<'_>,
    ) {
        let belongs = |item: &RenderItem, normals: [Vector3<f32>; 3]| {
            let sunny =
                item.binding != Binding::World || normals.iter().any(|n| n.dot(&self.sun) > 0.0);
            sunny == finish.sunny
        };
        let body = self.body;
        let first_vertex = part.vertices.len();
        let start = part.indices.len() as u32;
        for (item, material) in chosen {
            let packed = body as u32 | material << 20;
            let light = (&mut *ambient_occlusion, self.is_wide(item));
            part.append(item, &item.mesh, light, (packed, finish), &belongs);
        }
        let middle = part.indices.len() as u32;
        if middle == start {
            return;
        }
        let (centre, radius) = ball(&part.vertices[first_vertex..]);
        let mut caster_end = middle;
        for (item, material) in chosen {
            let packed = body as u32 | material << 20;
            let light = (&mut *ambient_occlusion, self.is_wide(item));
            part.append(item, &item.coarse, light, (packed, finish), &belongs);
            if item.casts_shadow {
                caster_end = part.indices.len() as u32;
            }
        }
        let end = part.indices.len() as u32;
        let division = Division {
            free: finish.shine != Shine::Glass,
            reach: self.reach,
        };
        let [full, mut coarse, others] = [start..middle, middle..caster_end, caster_end..end]
            .map(|range| part.clusters(range, division));
        // Triangles that face away from the sun come after those that face it.
        if finish.sunny {
            part.casters.extend(coarse.iter().map(|cluster| Caster {
                indices: cluster.indices.clone(),
                centre: cluster.centre,
                radius: cluster.radius,
            }));
        }
        coarse.extend(others);
        part.batches.push(Batch {
            body,
            finish,
            full,
            coarse,
            centre,
            radius: radius + self.reach,
        });
    }
}

impl Part {
    /// Sets the coordinates of the vertices in the ambient map. The first chart of the part
    /// is `charts[first]`. Charts without room in the map keep light per vertex.
    fn place_on_map(&mut self, map: &AmbientMap, charts: &[Chart], first: usize) {
        let coordinates = |point: &ChartPoint| {
            let index = first + point.chart as usize;
            map.coordinates(index, &charts[index], point.local)
        };
        for (vertex, point) in self.vertices.iter_mut().zip(&self.points) {
            vertex.ambient = point.as_ref().and_then(coordinates).unwrap_or_default();
        }
        for batch in &mut self.batches {
            for cluster in batch.full.iter_mut().chain(&mut batch.coarse) {
                for piece in &mut cluster.pieces {
                    piece.chart += first;
                }
                let has_room = |piece: &Piece| map.charts.placed[piece.chart].is_some();
                if !cluster.pieces.iter().all(has_room) {
                    cluster.mapped = false;
                    cluster.pieces.retain(has_room);
                }
            }
        }
    }

    /// Triangles in clusters: those that need the ambient map come last, in their own.
    fn clusters(&mut self, range: Range<u32>, division: Division) -> Vec<Cluster> {
        let Self {
            vertices,
            indices,
            charts,
            points,
            ..
        } = self;
        let position = |i: u32| Point3::from(vertices[i as usize].position.map(f64::from));
        let chart = |triangle: &Triangle| {
            let point = points[triangle[0] as usize];
            point.map(|point| point.chart as usize)
        };
        let needs_map = |triangle: &Triangle| {
            let [Some(a), Some(b), Some(c)] = triangle.map(|i| points[i as usize]) else {
                return false;
            };
            charts[a.chart as usize].needs_map([a, b, c].map(|point| point.local))
        };
        let (start, end) = (range.start as usize, range.end as usize);
        if charts.is_empty() {
            return clusters(indices, start..end, &position, division);
        }
        let (triangles, _) = indices[start..end].as_chunks_mut::<3>();
        let (flat, mapped): (Vec<Triangle>, Vec<Triangle>) =
            triangles.iter().partition(|triangle| !needs_map(triangle));
        let middle = start + 3 * flat.len();
        if !mapped.is_empty() {
            triangles.copy_from_slice(&[flat, mapped].concat());
        }
        let mut found = clusters(indices, start..middle, &position, division);
        let flat_clusters = found.len();
        found.extend(clusters(indices, middle..end, &position, division));
        for (i, cluster) in found.iter_mut().enumerate() {
            cluster.mapped = i >= flat_clusters;
            let own = cluster.indices.start as usize..cluster.indices.end as usize;
            let (triangles, _) = indices[own].as_chunks::<3>();
            let mut first = cluster.indices.start;
            for part in triangles.chunk_by(|a, b| chart(a) == chart(b)) {
                if let Some(chart) = chart(&part[0]) {
                    pieces(part, first, &position, chart, &mut cluster.pieces);
                }
                first += 3 * part.len() as u32;
            }
        }
        found
    }

    /// Appends the matching triangles, by the normals of their corners.
    fn append(
        &mut self,
        item: &RenderItem,
        mesh: &TriMesh,
        (ambient_occlusion, is_wide): (&mut AmbientOcclusion<'_>, bool),
        (packed, finish): (u32, Finish),
        belongs: &dyn Fn(&RenderItem, [Vector3<f32>; 3]) -> bool,
    ) {
        let fixed = is_lit_by_rays(item);
        let own = CornerLight::Own { is_wide };
        let corners: Vec<Corner> = (0..mesh.positions.len())
            .map(|i| {
                let (position, normal) = placed(item, mesh, i);
                Corner {
                    position,
                    normal,
                    uv: mesh.uvs[i],
                    ambient_occlusion: 1.0,
                }
            })
            .collect();
        let mut lights = vec![None; corners.len()];
        let triangles = mesh.indices.as_chunks::<3>().0;
        let mut known = BTreeMap::new();
        for triangle in triangles {
            let at = triangle.map(|i| i as usize);
            let mut triangle = at.map(|i| corners[i]);
            if !belongs(item, triangle.map(|corner| corner.normal.cast())) {
                continue;
            }
            let chart = match finish.shine {
                Shine::Glass => None,
                _ => plane(triangle.map(|corner| (corner.position, corner.normal))),
            };
            let chart = chart
                .filter(|_| fixed)
                .and_then(|plane| self.planes.get(&plane).copied());
            let pieces = match (fixed, chart) {
                (false, _) => vec![triangle],
                (true, Some(_)) => ambient_occlusion.cut(triangle, CornerLight::Chart),
                (true, None) => {
                    for (corner, i) in triangle.iter_mut().zip(at) {
                        let (position, normal) = (&corner.position, &corner.normal);
                        corner.ambient_occlusion = *lights[i].get_or_insert_with(|| {
                            ambient_occlusion.of_surface(position, normal, is_wide)
                        });
                    }
                    ambient_occlusion.cut(triangle, own)
                }
            };
            for corner in pieces.iter().flatten() {
                let point = chart.map(|chart| ChartPoint {
                    chart: chart as u32,
                    local: self.charts[chart].local(&corner.position),
                });
                let light = match &point {
                    Some(point) => {
                        let chart = &self.charts[point.chart as usize];
                        chart.light_at(point.local.map(f64::from))
                    }
                    None => corner.ambient_occlusion.clamp(0.0, 1.0) * 255.0,
                };
                let ambient_occlusion = light.round() as u32;
                let vertex = Vertex {
                    position: corner.position.coords.cast::<f32>().into(),
                    normal: octahedral(corner.normal.into()),
                    uv: corner.uv,
                    packed: packed | ambient_occlusion << 12,
                    ambient: [0; 2],
                };
                let key: [u32; 8] = bytemuck::cast(vertex);
                let index = *known.entry((key, point)).or_insert_with(|| {
                    self.vertices.push(vertex);
                    if !self.charts.is_empty() {
                        self.points.push(point);
                    }
                    self.vertices.len() as u32 - 1
                });
                self.indices.push(index);
            }
        }
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

/// Ball about the middle of the bounding box.
fn ball(vertices: &[Vertex]) -> (Point3<f64>, f64) {
    let points = || {
        vertices
            .iter()
            .map(|v| Point3::from(v.position.map(f64::from)))
    };
    let (low, high) = bounds(points());
    let centre = nalgebra::center(&low, &high);
    let radius = points().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    (centre, radius)
}
