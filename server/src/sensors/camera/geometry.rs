//! The scene on the GPU, and the part of it that a camera sees.

use std::ops::Range;

use nalgebra::{Isometry3, Point3};
use wgpu::util::DeviceExt;

use super::batch::{Batch, Body, Finish, Shine, Vertex};
use super::buffers::Buffers;
use super::contact::Contacts;
use super::culling_clusters::Cluster;
use super::pipelines::Ambient;
use super::scene::Binding;
use super::surroundings::Surroundings;
use super::view::{Placed, View};

/// Triangles of all bodies.
pub(super) struct Geometry {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    pub(super) bodies: Vec<Body>,
    pub(super) batches: Vec<Batch>,
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
        let mut ranges: Vec<LitRange> = Vec::new();
        let mut near: Vec<LitRange> = Vec::new();
        // Rank, finish and ranges of each batch.
        let mut visible: Vec<(f64, Finish, Range<usize>)> = Vec::new();
        // Consecutive batches have the same body or are static.
        let fixed = view.placed(&Isometry3::identity());
        let mut moving: Option<(usize, Placed)> = None;
        for batch in &self.batches {
            let centre: Point3<f64> = poses[batch.body] * batch.centre;
            let Some(distance) = view.distance(&centre, batch.radius) else {
                continue;
            };
            let rank = if batch.radius > 1.5 {
                LARGE + batch.radius
            } else {
                distance
            };
            let clusters = match distance > view.focal * COARSE_BELOW {
                true => &batch.coarse,
                false => &batch.full,
            };
            let is_static = self.bodies[batch.body].binding == Binding::World;
            if !is_static && moving.as_ref().is_none_or(|(body, _)| *body != batch.body) {
                moving = Some((batch.body, view.placed(&poses[batch.body])));
            }
            let placed = match &moving {
                Some((_, placed)) if !is_static => placed,
                _ => &fixed,
            };
            let shown = clusters
                .iter()
                .filter(|cluster| view.shows(placed, cluster));
            let first = ranges.len();
            let glass = batch.finish.shine == Shine::Glass;
            let contacts = contacts.as_deref_mut().filter(|_| !glass);
            add_lit_ranges(&mut ranges, &mut near, shown, contacts);
            if ranges.len() > first {
                visible.push((rank, batch.finish, first..ranges.len()));
            }
        }
        let key = |rank: f64, finish: Finish| match order {
            Order::Finish => (rank >= LARGE, finish.index()),
            Order::Depth => (false, 0),
        };
        visible.sort_by(|a, b| {
            let order = key(a.0, a.1).cmp(&key(b.0, b.1));
            order.then(a.0.total_cmp(&b.0))
        });
        // Glass is last, from back to front.
        let (glass, mut visible): (Vec<_>, Vec<_>) = visible
            .into_iter()
            .partition(|(_, finish, _)| finish.shine == Shine::Glass);
        visible.extend(glass.into_iter().rev());
        let pieces = |(_, finish, own): (f64, Finish, Range<usize>)| {
            let piece = move |(ambient, indices): &LitRange| VisibleRange {
                finish,
                ambient: *ambient,
                indices: indices.clone(),
            };
            ranges[own].iter().map(piece)
        };
        visible.into_iter().flat_map(pieces).collect()
    }
}

/// Appends the triangles of the clusters of a batch, grouped by the source of their ambient
/// light. Those with contacts come last. `near` is empty before and after.
fn add_lit_ranges<'a>(
    ranges: &mut Vec<LitRange>,
    near: &mut Vec<LitRange>,
    clusters: impl Iterator<Item = &'a Cluster>,
    contacts: Option<&mut Contacts<'_>>,
) {
    let first = ranges.len();
    let Some(contacts) = contacts else {
        for cluster in clusters {
            extend(ranges, first, Ambient::Vertices, &cluster.indices);
        }
        return;
    };
    for cluster in clusters {
        let mapped = cluster.mapped;
        let plain = match mapped {
            true => Ambient::Map,
            false => Ambient::Vertices,
        };
        let mut start = cluster.indices.start;
        contacts.for_each_piece(cluster, |piece, list| {
            extend(ranges, first, plain, &(start..piece.indices.start));
            start = piece.indices.end;
            let ambient = Ambient::Contacts { list, mapped };
            extend(near, 0, ambient, &piece.indices);
        });
        extend(ranges, first, plain, &(start..cluster.indices.end));
    }
    ranges.append(near);
}

/// Triangles and the source of their ambient light.
type LitRange = (Ambient, Range<u32>);

/// Appends triangles, and merges them with the last range if they are adjacent; ranges
/// before the index `first` are of other batches.
fn extend(ranges: &mut Vec<LitRange>, first: usize, ambient: Ambient, indices: &Range<u32>) {
    if indices.is_empty() {
        return;
    }
    match ranges[first..].last_mut() {
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
