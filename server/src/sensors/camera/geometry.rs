//! The scene on the adapter: what is where, and which of it a camera sees.

use std::ops::Range;

use nalgebra::{Isometry3, Point3};
use wgpu::util::DeviceExt;

use super::ambient_occlusion::Surroundings;
use super::buffers::{Batch, Body, Buffers, Finish, Shine, Vertex};
use super::cells::Cell;
use super::contact::Contacts;
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

/// Coarse triangles serve where 5 mm are less than a pixel.
const COARSE_BELOW: f64 = 0.005;

/// Rank of large batches: further than any other is.
const LARGE: f64 = 100.0;

/// In which order batches are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// Strictly front to back, for a CPU adapter: what is hidden costs more there than
    /// a change of pipeline.
    Depth,
    /// By pipeline, each front to back, for a graphics card: strictly front to back the
    /// robot's two cameras change the pipeline a hundred times in the home. Where two
    /// surfaces lie in one plane to the last bit, the one that is drawn later is seen.
    Finish,
}

/// Triangles in view that are drawn together.
pub(super) struct Seen {
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

    /// Replaces the vertices from `first` on.
    pub(super) fn write_vertices(&self, queue: &wgpu::Queue, first: usize, vertices: &[Vertex]) {
        let offset = (first * std::mem::size_of::<Vertex>()) as u64;
        queue.write_buffer(&self.vertices, offset, bytemuck::cast_slice(vertices));
    }

    pub(super) fn set(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
    }

    /// What is in view, batch by batch in `order`; large ones (rugs, walls, the floor)
    /// last: they are mostly hidden. With `contacts` ambient light is known per pixel.
    pub(super) fn seen(
        &self,
        view: &View,
        poses: &[Isometry3<f64>],
        order: Order,
        mut contacts: Option<&mut Contacts<'_>>,
    ) -> Vec<Seen> {
        let mut seen: Vec<(f64, Finish, Vec<Lit>)> = self
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
                let cells = match distance > view.focal * COARSE_BELOW {
                    true => &batch.coarse,
                    false => &batch.full,
                };
                let placed = view.placed(&poses[batch.body]);
                let shown = cells.iter().filter(|cell| view.shows(&placed, cell));
                let glass = batch.finish.shine == Shine::Glass;
                let contacts = contacts.as_deref_mut().filter(|_| !glass);
                let ranges = self.lit(batch, shown, (&poses[batch.body], &centre), contacts);
                (!ranges.is_empty()).then_some((rank, batch.finish, ranges))
            })
            .collect();
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        if order == Order::Finish {
            let finish = |of: Finish| Finish::ALL.iter().position(|f| *f == of);
            seen.sort_by_key(|(rank, of, _)| (*rank >= LARGE, finish(*of)));
        }
        // Glass comes last, what is behind first.
        let (glass, mut seen): (Vec<_>, Vec<_>) = seen
            .into_iter()
            .partition(|(_, finish, _)| finish.shine == Shine::Glass);
        seen.extend(glass.into_iter().rev());
        let pieces = |(_, finish, ranges): (f64, Finish, Vec<Lit>)| {
            let piece = move |(ambient, indices)| Seen {
                finish,
                ambient,
                indices,
            };
            ranges.into_iter().map(piece)
        };
        seen.into_iter().flat_map(pieces).collect()
    }

    /// Triangles of the cells of a batch, by where their ambient light is known from:
    /// those that nothing is near to come first.
    fn lit<'a>(
        &self,
        batch: &Batch,
        cells: impl Iterator<Item = &'a Cell>,
        (pose, centre): (&Isometry3<f64>, &Point3<f64>),
        contacts: Option<&mut Contacts<'_>>,
    ) -> Vec<Lit> {
        let mut ranges: Vec<Lit> = Vec::new();
        let Some(contacts) = contacts else {
            for cell in cells {
                extend(&mut ranges, Ambient::Vertices, &cell.indices);
            }
            return ranges;
        };
        let plain = match self.bodies[batch.body].binding {
            Binding::World => Ambient::Map,
            _ => Ambient::Vertices,
        };
        let candidates = contacts.of_batch(batch.body, &self.bodies, centre, batch.radius);
        let mut near: Vec<Lit> = Vec::new();
        for cell in cells {
            if candidates.is_empty() {
                extend(&mut ranges, plain, &cell.indices);
                continue;
            }
            for piece in &cell.pieces {
                match contacts.of_piece(&candidates, piece, pose) {
                    None => extend(&mut ranges, plain, &piece.indices),
                    Some((list, variant)) => {
                        let ambient = Ambient::Contacts(list, variant);
                        extend(&mut near, ambient, &piece.indices);
                    }
                }
            }
        }
        ranges.append(&mut near);
        ranges
    }
}

/// Triangles, and where their ambient light is known from.
type Lit = (Ambient, Range<u32>);

/// Appends triangles, to the last ones where they go on.
fn extend(ranges: &mut Vec<Lit>, ambient: Ambient, indices: &Range<u32>) {
    match ranges.last_mut() {
        Some((last, range)) if *last == ambient && range.end == indices.start => {
            range.end = indices.end;
        }
        _ => ranges.push((ambient, indices.clone())),
    }
}

/// What the shader knows of the bodies. Rows of bodies that stand still are kept: what
/// lights a body is looked up in many places around it.
#[derive(Default)]
pub(super) struct BodyRows {
    poses: Vec<Isometry3<f64>>,
    rows: Vec<BodyRow>,
}

impl BodyRows {
    /// Brings the rows up to date; whether any changed.
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

/// What the shader knows of a body at `pose`.
fn body_row(pose: &Isometry3<f64>, body: &Body, surroundings: &Surroundings) -> BodyRow {
    let m = pose.to_homogeneous();
    let mut row = [0.0; 16];
    for r in 0..3 {
        for c in 0..4 {
            row[4 * r + c] = m[(r, c)] as f32;
        }
    }
    row[12] = f32::from(body.instance);
    // Bodies that never move know it for every vertex.
    row[13] = match body.binding {
        Binding::World => 1.0,
        _ => surroundings.of_body(&(pose * body.centre)) as f32,
    };
    row
}
