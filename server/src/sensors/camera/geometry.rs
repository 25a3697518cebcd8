//! The scene on the GPU, and the part of it that a camera sees.

use std::ops::Range;

use nalgebra::{Isometry3, Point3};
use wgpu::util::DeviceExt;

use super::ambient_occlusion::Surroundings;
use super::batch::{Batch, Finish, Shine, Vertex};
use super::buffers::{Body, Buffers};
use super::contact::Contacts;
use super::culling_clusters::Cluster;
use super::pipelines::Ambient;
use super::scene::Binding;
use super::view::View;

/// Triangles of all bodies and the poses of the bodies.
pub(super) struct Geometry {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    pub(super) body_rows: wgpu::Buffer,
    pub(super) bodies: Vec<Body>,
    batches: Vec<Batch>,
}

/// World_from_body as rows; id, ambient occlusion.
pub(super) type BodyRow = [f32; 16];

/// Coarse triangles are used where 5 mm are less than a pixel.
const COARSE_BELOW: f64 = 0.005;

/// Sort key of large batches: beyond any distance.
const LARGE: f64 = 100.0;

/// Order of rendering.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// Strictly front to back, for a CPU adapter: overdraw costs more there than a
    /// pipeline change.
    Depth,
    /// By pipeline, each front to back, for a GPU: strictly front to back the robot's
    /// two cameras change the pipeline a hundred times in the home. Of two exactly
    /// coplanar surfaces the one rendered later is visible.
    Finish,
}

/// Triangles in view that are rendered together.
pub(super) struct VisibleRange {
    pub(super) finish: Finish,
    pub(super) ambient: Ambient,
    pub(super) indices: Range<u32>,
}

impl Geometry {
    pub(super) fn upload(device: &wgpu::Device, buffers: &Buffers) -> Self {
        let filled = |label, contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            })
        };
        Self {
            vertices: filled(
                "vertices",
                bytemuck::cast_slice(&buffers.vertices),
                wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            ),
            indices: filled(
                "indices",
                bytemuck::cast_slice(&buffers.indices),
                wgpu::BufferUsages::INDEX,
            ),
            body_rows: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("bodies"),
                size: (buffers.bodies.len().max(1) * std::mem::size_of::<BodyRow>()) as u64,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            bodies: buffers.bodies.clone(),
            batches: buffers.batches.clone(),
        }
    }

    /// Overwrites the vertices from `first` on.
    pub(super) fn write_vertices(&self, queue: &wgpu::Queue, first: usize, vertices: &[Vertex]) {
        let offset = (first * std::mem::size_of::<Vertex>()) as u64;
        queue.write_buffer(&self.vertices, offset, bytemuck::cast_slice(vertices));
    }

    pub(super) fn set(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
    }

    /// The geometry in view, batch by batch in `order`. Large batches (rugs, walls, the
    /// floor) come last because they are mostly hidden. With `contacts` ambient light is
    /// computed per pixel.
    pub(super) fn visible(
        &self,
        view: &View,
        poses: &[Isometry3<f64>],
        order: Order,
        mut contacts: Option<&mut Contacts<'_>>,
    ) -> Vec<VisibleRange> {
        let mut visible: Vec<(f64, Finish, Vec<LitRange>)> = self
            .batches
            .iter()
            .filter_map(|batch| {
                let centre: Point3<f64> = poses[batch.body] * batch.centre;
                let distance = view.distance(&centre, batch.radius)?;
                let rank = if batch.radius > 1.5 {
                    LARGE + batch.radius
                } else {
                    distance
                };
                let clusters = match distance > view.focal * COARSE_BELOW {
                    true => &batch.coarse,
                    false => &batch.full,
                };
                let placed = view.placed(&poses[batch.body]);
                let shown = clusters
                    .iter()
                    .filter(|cluster| view.shows(&placed, cluster));
                let glass = batch.finish.shine == Shine::Glass;
                let contacts = contacts.as_deref_mut().filter(|_| !glass);
                let ranges = self.lit_ranges(batch, shown, &centre, contacts);
                (!ranges.is_empty()).then_some((rank, batch.finish, ranges))
            })
            .collect();
        visible.sort_by(|a, b| a.0.total_cmp(&b.0));
        if order == Order::Finish {
            let finish = |of: Finish| Finish::ALL.iter().position(|f| *f == of);
            visible.sort_by_key(|(rank, of, _)| (*rank >= LARGE, finish(*of)));
        }
        // Glass comes last, from back to front.
        let (glass, mut visible): (Vec<_>, Vec<_>) = visible
            .into_iter()
            .partition(|(_, finish, _)| finish.shine == Shine::Glass);
        visible.extend(glass.into_iter().rev());
        let pieces = |(_, finish, ranges): (f64, Finish, Vec<LitRange>)| {
            let piece = move |(ambient, indices)| VisibleRange {
                finish,
                ambient,
                indices,
            };
            ranges.into_iter().map(piece)
        };
        visible.into_iter().flat_map(pieces).collect()
    }

    /// Triangles of the clusters of a batch, grouped by the source of their ambient
    /// light. Those with contacts come last.
    fn lit_ranges<'a>(
        &self,
        batch: &Batch,
        clusters: impl Iterator<Item = &'a Cluster>,
        centre: &Point3<f64>,
        contacts: Option<&mut Contacts<'_>>,
    ) -> Vec<LitRange> {
        let mut ranges: Vec<LitRange> = Vec::new();
        let Some(contacts) = contacts else {
            for cluster in clusters {
                extend(&mut ranges, Ambient::Vertices, &cluster.indices);
            }
            return ranges;
        };
        let body = &self.bodies[batch.body];
        let candidates = contacts.candidates_for_batch(body, centre, batch.radius);
        let mut near: Vec<LitRange> = Vec::new();
        for cluster in clusters {
            let plain = match cluster.mapped {
                true => Ambient::Map,
                false => Ambient::Vertices,
            };
            let candidates = contacts.candidates_for_cluster(&candidates, cluster);
            let mut start = cluster.indices.start;
            for piece in cluster.pieces.iter().filter(|_| !candidates.is_empty()) {
                if let Some(list) = contacts.list_for_piece(&candidates, piece) {
                    extend(&mut ranges, plain, &(start..piece.indices.start));
                    start = piece.indices.end;
                    let mapped = cluster.mapped;
                    let ambient = Ambient::Contacts { list, mapped };
                    extend(&mut near, ambient, &piece.indices);
                }
            }
            extend(&mut ranges, plain, &(start..cluster.indices.end));
        }
        ranges.append(&mut near);
        ranges
    }
}

/// Triangles and the source of their ambient light.
type LitRange = (Ambient, Range<u32>);

/// Appends triangles, and merges them with the last range if they are adjacent.
fn extend(ranges: &mut Vec<LitRange>, ambient: Ambient, indices: &Range<u32>) {
    match ranges.last_mut() {
        _ if indices.is_empty() => (),
        Some((last, range)) if *last == ambient && range.end == indices.start => {
            range.end = indices.end;
        }
        _ => ranges.push((ambient, indices.clone())),
    }
}

/// Shader data of the bodies. Rows of bodies at rest are kept, because the ambient
/// light of a body is sampled at many points.
#[derive(Default)]
pub(super) struct BodyRows {
    poses: Vec<Isometry3<f64>>,
    rows: Vec<BodyRow>,
}

impl BodyRows {
    /// Updates the rows; returns whether any changed.
    pub(super) fn update(
        &mut self,
        poses: &[Isometry3<f64>],
        bodies: &[Body],
        surroundings: &Surroundings,
    ) -> bool {
        let mut changed = self.rows.len() != poses.len();
        if changed {
            self.poses = poses.to_vec();
            self.rows = vec![[0.0; 16]; poses.len()];
        }
        let all = changed;
        let own = self.poses.iter_mut().zip(&mut self.rows);
        for ((pose, body), (old, row)) in poses.iter().zip(bodies).zip(own) {
            if all || pose != old {
                *row = body_row(pose, body, surroundings);
                *old = *pose;
                changed = true;
            }
        }
        changed
    }

    pub(super) fn all(&self) -> &[BodyRow] {
        &self.rows
    }
}

/// Shader data of a body at `pose`.
fn body_row(pose: &Isometry3<f64>, body: &Body, surroundings: &Surroundings) -> BodyRow {
    let m = pose.to_homogeneous();
    let mut row = [0.0; 16];
    for r in 0..3 {
        for c in 0..4 {
            row[4 * r + c] = m[(r, c)] as f32;
        }
    }
    row[12] = f32::from(body.instance);
    // Static bodies have it per vertex.
    row[13] = match body.binding {
        Binding::World => 1.0,
        _ => surroundings.of_body(&(pose * body.centre)) as f32,
    };
    row
}
