//! The buffers of one body: its triangles by finish, with the ambient light of static
//! surfaces. They do not depend on the other bodies except by that light, so scenes share
//! them (`part_cache.rs`).

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::ambient_map::{Chart, ChartPoint, Plane, Planes, plane};
use super::ambient_occlusion::{AmbientCache, AmbientOcclusion, Corner, CornerLight};
use super::batch::{AMBIENT, Batch, Caster, Finish, MATERIAL, Shine, Vertex, octahedral};
use super::contact::Occluder;
use super::culling_clusters::{Cluster, Division, Triangle, bounds, clusters, pieces};
use super::scene::{Binding, RenderItem};
use crate::geometry::TriMesh;

/// Index of the chart of each plane.
type ChartIndices = BTreeMap<Plane, usize>;

/// Work of one body.
pub(super) struct Share<'a> {
    /// Direction towards the sun.
    pub(super) sun: Vector3<f32>,
    /// Wide planes have charts, ambient light of wide surfaces is smoothed, and objects
    /// darken planes as capsules.
    pub(super) ambient_per_pixel: bool,
    /// How far its vertices move in its frame, metres.
    pub(super) reach: f64,
    /// What the body moves with.
    pub(super) binding: Binding,
    /// Items by their finish, with their materials as indices into `materials`.
    pub(super) finished: Vec<(Finish, Vec<(&'a RenderItem, u32)>)>,
    /// Materials of the scene that the body uses.
    pub(super) materials: Vec<u32>,
}

/// The buffers of one body. Body and materials are numbered within it: the body is 0, the
/// materials are indices into [`Share::materials`].
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Part {
    #[serde(skip)]
    pub(super) vertices: Vec<Vertex>,
    #[serde(skip)]
    pub(super) indices: Vec<u32>,
    pub(super) batches: Vec<Batch>,
    pub(super) casters: Vec<Caster>,
    pub(super) occluders: Vec<Occluder>,
    pub(super) charts: Vec<Chart>,
    /// The point on a chart of each vertex, if it is on one; empty without charts.
    #[serde(skip)]
    pub(super) points: Vec<Option<ChartPoint>>,
    /// Centre of the bounding box, in the frame of the body.
    pub(super) centre: Point3<f64>,
}

/// Side of a wide surface, metres.
const WIDE: f32 = 1.0;
/// Largest diagonal of an object with a single capsule, metres. Larger objects have one
/// per item.
const LARGE_BODY: f64 = 0.6;

/// Whether rays determine the ambient light at every point of an item.
pub(super) fn is_lit_by_rays(item: &RenderItem) -> bool {
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
        self.ambient_per_pixel && (0..3).any(|k| side(k) > WIDE)
    }

    pub(super) fn worked_out(
        &self,
        mut ambient_occlusion: AmbientOcclusion<'_>,
    ) -> (Part, AmbientCache) {
        let mut part = Part::default();
        let mut planes = BTreeMap::new();
        if self.ambient_per_pixel {
            planes = self.compute_charts(&mut part, &mut ambient_occlusion);
            part.occluders = self.occluders();
        }
        for (finish, chosen) in &self.finished {
            self.append_finish(
                &mut part,
                *finish,
                (chosen, &planes),
                &mut ambient_occlusion,
            );
        }
        part.centre = ball(&part.vertices).0;
        (part, ambient_occlusion.into_known())
    }

    /// Computes the charts of the wide planes and returns their indices. Glass keeps light
    /// per vertex.
    fn compute_charts(
        &self,
        part: &mut Part,
        ambient_occlusion: &mut AmbientOcclusion<'_>,
    ) -> ChartIndices {
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
        let mut indices = ChartIndices::new();
        for (plane, chart) in charts {
            indices.insert(plane, part.charts.len());
            part.charts.push(chart);
        }
        indices
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
        let occluder = |(low, high): &(Point3<f64>, Point3<f64>)| Occluder::new(0, low, high);
        boxes.iter().filter_map(occluder).collect()
    }

    fn append_finish(
        &self,
        part: &mut Part,
        finish: Finish,
        (chosen, planes): (&[(&RenderItem, u32)], &ChartIndices),
        ambient_occlusion: &mut AmbientOcclusion<'_>,
    ) {
        let belongs = |item: &RenderItem, normals: [Vector3<f32>; 3]| {
            let sunny =
                item.binding != Binding::World || normals.iter().any(|n| n.dot(&self.sun) > 0.0);
            sunny == finish.sunny
        };
        let first_vertex = part.vertices.len();
        let start = part.indices.len() as u32;
        for (item, material) in chosen {
            let light = (&mut *ambient_occlusion, self.is_wide(item), planes);
            let packed = material << MATERIAL;
            part.append(item, &item.mesh, light, (packed, finish), &belongs);
        }
        let middle = part.indices.len() as u32;
        if middle == start {
            return;
        }
        let (centre, radius) = ball(&part.vertices[first_vertex..]);
        let mut caster_end = middle;
        for (item, material) in chosen {
            let light = (&mut *ambient_occlusion, self.is_wide(item), planes);
            let packed = material << MATERIAL;
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
            body: 0,
            finish,
            full,
            coarse,
            centre,
            radius: radius + self.reach,
        });
    }
}

impl Part {
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
        (ambient_occlusion, is_wide, planes): (&mut AmbientOcclusion<'_>, bool, &ChartIndices),
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
        let mut known = KnownVertices::new(self.vertices.len());
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
                .and_then(|plane| planes.get(&plane).copied());
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
                    packed: packed | ambient_occlusion << AMBIENT,
                    ambient: [0; 2],
                };
                let index = known.find_or_insert(self, &vertex, point);
                self.indices.push(index);
            }
        }
    }
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

/// Finds equal vertices of a part: an open-addressing table of their indices.
struct KnownVertices {
    /// First vertex that counts.
    first: usize,
    /// Indices plus one; 0 is empty. The length is a power of two.
    slots: Vec<u32>,
}

impl KnownVertices {
    /// A table of the vertices from `first` on, of which there are none yet.
    fn new(first: usize) -> Self {
        Self {
            first,
            slots: vec![0; 64],
        }
    }

    /// The index of a vertex of `part`, which is appended unless an equal one exists.
    fn find_or_insert(
        &mut self,
        part: &mut Part,
        vertex: &Vertex,
        point: Option<ChartPoint>,
    ) -> u32 {
        if 2 * (part.vertices.len() - self.first) >= self.slots.len() {
            self.grow(part);
        }
        let key: [u32; 8] = bytemuck::cast(*vertex);
        let mut slot = self.slot(&key, point);
        while let Some(index) = self.slots[slot].checked_sub(1) {
            let known: [u32; 8] = bytemuck::cast(part.vertices[index as usize]);
            if known == key && part.point(index as usize) == point {
                return index;
            }
            slot = (slot + 1) % self.slots.len();
        }
        part.vertices.push(*vertex);
        if !part.charts.is_empty() {
            part.points.push(point);
        }
        self.slots[slot] = part.vertices.len() as u32;
        part.vertices.len() as u32 - 1
    }

    fn grow(&mut self, part: &Part) {
        self.slots = vec![0; 4 * self.slots.len()];
        for index in self.first..part.vertices.len() {
            let key: [u32; 8] = bytemuck::cast(part.vertices[index]);
            let mut slot = self.slot(&key, part.point(index));
            while self.slots[slot] != 0 {
                slot = (slot + 1) % self.slots.len();
            }
            self.slots[slot] = index as u32 + 1;
        }
    }

    fn slot(&self, key: &[u32; 8], point: Option<ChartPoint>) -> usize {
        let point = point.map_or([0; 2], |point| {
            let [x, y] = point.local.map(u32::from);
            [point.chart + 1, x << 16 | y]
        });
        let words = key.iter().chain(&point);
        let hash = words.fold(0u64, |hash, word| {
            (hash.rotate_left(5) ^ u64::from(*word)).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        });
        // The highest bits depend on all words.
        (hash >> 32) as usize % self.slots.len()
    }
}

impl Part {
    /// The point of a vertex on a chart.
    pub(super) fn point(&self, vertex: usize) -> Option<ChartPoint> {
        self.points.get(vertex).copied().flatten()
    }
}
