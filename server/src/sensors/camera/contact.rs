//! Contact darkening: objects occlude the ambient light of nearby static planes that have a
//! chart. A pixel there combines the occlusion by at most [`MOST`] capsules, in closed form.
//! Triangles without a nearby object use a shader without this step.
//!
//! The sphere of a capsule that is nearest to the pixel counts. Its occlusion is the height
//! of its centre above the plane times a smooth function of the distance. Capsules are in coordinates of the chart,
//! so that a pixel needs only its coordinates in the ambient map. Oriented boxes instead of
//! capsules take a CPU adapter twice the time. Robot and person are not occluders: the floor
//! around the chair would cost a tenth of the rate. Objects and other curved surfaces are
//! not darkened.

use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::ambient_map::{PlacedChart, PlacedCharts};
use super::batch::{Batch, Body, Shine};
use super::culling_clusters::{Cluster, Outline, Piece};
use super::scene::Binding;
use super::view::View;

/// Maximum number of capsules that darken one piece of a surface.
pub(super) const MOST: usize = 8;
/// Number of capsules of each shader variant. A variant evaluates all of its capsules,
/// because a CPU adapter executes both sides of a branch.
pub(super) const VARIANTS: [usize; 4] = [1, 2, 4, MOST];
/// Maximum number of distinct lists in an image. Further pieces have no contacts.
pub(super) const MOST_LISTS: usize = 64;
/// Bytes between the starts of two lists, a multiple of the uniform buffer alignment.
pub(super) const STRIDE: u64 = 512;
/// Bytes of a list.
pub(super) const LIST: u64 = size_of::<List>() as u64;
/// Largest number of capsules of a list that different pieces share: pieces with lists of
/// their own cost a draw call each, further capsules cost time per pixel.
const MOST_SHARED: usize = 2;
/// Share of the reach beyond which the occlusion is invisible: at most 2 %.
const VISIBLE: f64 = 0.8;
/// Reach of an object, as a share of its distance to the camera, at which its occlusion
/// appears and at which it is complete.
const APPEARS: [f64; 2] = [0.04, 0.06];
/// Occlusion that counts as invisible.
const LEAST: f64 = 0.05;
/// Distance beyond the diameter of an object at which its occlusion ends, metres.
const REACH: f64 = 0.05;
/// Decrease of the occlusion with the distance, relative to a sphere without end.
const FALLOFF: f64 = 0.25;
/// Smallest side of an occluder, metres.
const LEAST_SIDE: f64 = 0.02;
/// Least radius, metres.
const LEAST_RADIUS: f64 = 0.003;

/// A capsule in the frame of its body.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Occluder {
    pub(super) body: usize,
    centre: Point3<f64>,
    axis: Vector3<f64>,
    /// Half the distance between the centres of the caps.
    half_length: f64,
    /// Largest distance from the axis with occlusion, metres.
    reach: f64,
    /// Occlusion by a unit of height without fading, 1/m.
    strength: f64,
}

impl Occluder {
    /// The capsule that approximates the box between two corners; `None` if it is too small.
    pub(super) fn new(body: usize, low: &Point3<f64>, high: &Point3<f64>) -> Option<Self> {
        let half = (high - low) / 2.0;
        if !half.max().is_finite() || half.max() * 2.0 < LEAST_SIDE {
            return None;
        }
        let longest = half.imax();
        let across = half[(longest + 1) % 3] * half[(longest + 2) % 3];
        let radius = across.sqrt().max(LEAST_RADIUS);
        let width = half.sum() / 3.0;
        let reach = (radius * width.max(radius) / LEAST).sqrt();
        let reach = reach.min(2.0 * radius + REACH);
        // Beside a sphere on the plane the occlusion equals the exact one.
        let square = 2.0 * radius * radius;
        let fade = 1.0 - square / (reach * reach);
        let falloff = 1.0 + FALLOFF * square / width.max(radius).powi(2);
        Some(Self {
            body,
            centre: nalgebra::center(low, high),
            axis: Vector3::ith(longest, 1.0),
            half_length: (half[longest] - radius).max(0.0),
            reach,
            strength: radius / (square * falloff * fade.powi(3)),
        })
    }

    /// The same capsule on another body.
    pub(super) fn on_body(self, body: usize) -> Self {
        Self { body, ..self }
    }

    pub(super) fn placed(&self, pose: &Isometry3<f64>) -> PlacedOccluder {
        PlacedOccluder {
            capsule: *self,
            centre: pose * self.centre,
            axis: pose.rotation * self.axis,
        }
    }
}

/// A capsule in the world.
pub(super) struct PlacedOccluder {
    capsule: Occluder,
    centre: Point3<f64>,
    axis: Vector3<f64>,
}

impl PlacedOccluder {
    /// Whether the capsule may darken surfaces in a sphere.
    fn reaches(&self, centre: &Point3<f64>, radius: f64) -> bool {
        let reach = radius + self.capsule.half_length + self.capsule.reach;
        (self.centre - centre).norm_squared() < reach * reach
    }

    /// Distance of the surface from the capsule's axis, as a share of the reach; `None` if
    /// the capsule does not darken the piece.
    fn gap(&self, piece: &Piece, chart: &PlacedChart) -> Option<f64> {
        let Occluder {
            half_length, reach, ..
        } = self.capsule;
        let height = chart.normal.dot(&self.centre.coords) - chart.height;
        let rise = (chart.normal.dot(&self.axis) * half_length).abs();
        if height + rise <= 0.0 || height - rise >= reach {
            return None;
        }
        let most = VISIBLE * reach + 1.25 * half_length;
        if piece.outline.distance_of_box(&self.centre) > most {
            return None;
        }
        // Distance to the nearest of five points along the axis.
        let outside = |along: f64| {
            let at = self.centre + self.axis * (along * half_length);
            match &piece.outline {
                Outline::Triangle(corners) => distance_to_triangle(&at, corners),
                Outline::Bounds(centre, half) => {
                    ((at - centre).abs() - half).map(|x| x.max(0.0)).norm()
                }
            }
        };
        let nearest = [-1.0, -0.5, 0.0, 0.5, 1.0].map(outside);
        let nearest = nearest.into_iter().fold(f64::INFINITY, f64::min);
        let gap = (nearest - 0.25 * half_length) / reach;
        (gap < VISIBLE).then_some(gap.max(0.0))
    }

    /// The capsule in coordinates of a chart, with a share of its occlusion.
    fn on_chart(&self, chart: &PlacedChart, share: f64) -> GpuOccluder {
        let Occluder {
            half_length,
            reach,
            strength,
            ..
        } = self.capsule;
        let [right, ahead] = chart.axes;
        let height = chart.normal.dot(&self.centre.coords) - chart.height;
        let rise = chart.normal.dot(&self.axis);
        let row = |values: [f64; 4]| values.map(|x| x as f32);
        GpuOccluder {
            place: row([
                right.dot(&self.centre.coords) + chart.origin[0],
                ahead.dot(&self.centre.coords) + chart.origin[1],
                right.dot(&self.axis),
                ahead.dot(&self.axis),
            ]),
            heights: row([height, rise, height * rise, half_length]),
            fading: row([1.0 / (reach * reach), strength * share, 0.0, 0.0]),
        }
    }
}

/// Distance of a point to a triangle.
fn distance_to_triangle(p: &Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> f64 {
    let edges = [(a, b - a), (b, c - b), (c, a - c)];
    let normal = edges[0].1.cross(&edges[1].1);
    let is_inside = edges
        .iter()
        .all(|(from, edge)| edge.cross(&(p - *from)).dot(&normal) >= 0.0);
    match normal.try_normalize(1e-12) {
        Some(normal) if is_inside => (p - a).dot(&normal).abs(),
        _ => edges
            .iter()
            .map(|(from, edge)| {
                let offset = p - *from;
                let share = edge.dot(&offset) / edge.norm_squared().max(1e-12);
                (offset - edge * share.clamp(0.0, 1.0)).norm()
            })
            .fold(f64::INFINITY, f64::min),
    }
}

/// `Occluder` in the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct GpuOccluder {
    /// Centre and axis, projected on the plane.
    place: [f32; 4],
    /// Height of the centre above the plane, rise of the axis, their product, half the
    /// length.
    heights: [f32; 4],
    /// 1 / reach² and strength.
    fading: [f32; 4],
}

impl GpuOccluder {
    /// Occludes no light.
    const NONE: Self = Self {
        place: [0.0; 4],
        heights: [0.0; 4],
        fading: [0.0; 4],
    };
}

/// `Contacts` in the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct List {
    /// Width and height of the ambient map, metres; number of capsules.
    extent: [f32; 4],
    occluders: [GpuOccluder; MOST],
}

/// The capsules in the world and the pieces that they may darken. Only capsules that moved
/// are compared with the pieces again.
pub(super) struct Nearby {
    occluders: Vec<Occluder>,
    /// Each with the pose of its body; `None` before the first image.
    placed: Vec<Option<(Isometry3<f64>, PlacedOccluder)>>,
    /// Whether `of_cluster` contains each capsule at its present place.
    compared: Vec<bool>,
    /// Numbers of the clusters near each capsule.
    clusters: Vec<Vec<usize>>,
    /// By the number of a cluster, ordered by piece, gap and capsule.
    of_cluster: Vec<Vec<Near>>,
}

/// A capsule near a piece.
#[derive(Clone, Copy)]
struct Near {
    /// Index of the piece in its cluster.
    piece: usize,
    gap: f64,
    capsule: usize,
}

impl Nearby {
    /// Numbers the clusters that have pieces. Only static bodies are darkened; their frame
    /// is that of the world.
    pub(super) fn new(occluders: Vec<Occluder>, bodies: &[Body], batches: &mut [Batch]) -> Self {
        let mut numbers = 0..;
        for batch in batches {
            let is_static = bodies[batch.body].binding == Binding::World;
            if !is_static || batch.finish.shine == Shine::Glass {
                continue;
            }
            for cluster in batch.full.iter_mut().chain(&mut batch.coarse) {
                if !cluster.pieces.is_empty() {
                    cluster.number = numbers.next();
                }
            }
        }
        let count = occluders.len();
        Self {
            occluders,
            placed: (0..count).map(|_| None).collect(),
            compared: vec![false; count],
            clusters: vec![Vec::new(); count],
            of_cluster: vec![Vec::new(); numbers.start],
        }
    }

    /// Moves the capsules to the poses of their bodies.
    pub(super) fn place(&mut self, poses: &[Isometry3<f64>]) {
        let all = self.occluders.iter().zip(&mut self.placed);
        for ((occluder, placed), compared) in all.zip(&mut self.compared) {
            let pose = &poses[occluder.body];
            if placed.as_ref().is_none_or(|(old, _)| old != pose) {
                *placed = Some((*pose, occluder.placed(pose)));
                *compared = false;
            }
        }
    }

    /// Selects the capsules that may darken surfaces in view.
    pub(super) fn in_view<'a>(
        &'a mut self,
        view: &View,
        batches: &[Batch],
        charts: &'a PlacedCharts,
    ) -> Contacts<'a> {
        let share = |p: &PlacedOccluder| {
            let radius = p.capsule.half_length + p.capsule.reach;
            let distance = view.distance(&p.centre, radius)?;
            let [from, to] = APPEARS;
            let share = (p.capsule.reach / distance.max(1e-3) - from) / (to - from);
            (share > 0.0).then_some(share.min(1.0))
        };
        let placed = self.placed.iter();
        let shares: Vec<Option<f64>> = placed
            .map(|placed| placed.as_ref().and_then(|(_, p)| share(p)))
            .collect();
        for (capsule, share) in shares.iter().enumerate() {
            if share.is_some() && !self.compared[capsule] {
                self.compare(capsule, batches, charts);
            }
        }
        Contacts {
            charts,
            nearby: self,
            shares,
            lists: Vec::new(),
        }
    }

    /// Finds the pieces near a capsule.
    fn compare(&mut self, capsule: usize, batches: &[Batch], charts: &PlacedCharts) {
        let Some((_, placed)) = &self.placed[capsule] else {
            return;
        };
        self.compared[capsule] = true;
        for cluster in self.clusters[capsule].drain(..) {
            self.of_cluster[cluster].retain(|near| near.capsule != capsule);
        }
        for batch in batches {
            if !placed.reaches(&batch.centre, batch.radius) {
                continue;
            }
            for cluster in batch.full.iter().chain(&batch.coarse) {
                let Some(number) = cluster.number else {
                    continue;
                };
                if !placed.reaches(&cluster.centre, cluster.radius) {
                    continue;
                }
                let all = &mut self.of_cluster[number];
                let before = all.len();
                for (index, piece) in cluster.pieces.iter().enumerate() {
                    let chart = charts.placed.get(piece.chart).and_then(Option::as_ref);
                    let gap = chart.and_then(|chart| placed.gap(piece, chart));
                    all.extend(gap.map(|gap| Near {
                        piece: index,
                        gap,
                        capsule,
                    }));
                }
                if all.len() > before {
                    self.clusters[capsule].push(number);
                    all.sort_by(|a, b| {
                        let order = a.piece.cmp(&b.piece).then(a.gap.total_cmp(&b.gap));
                        order.then(a.capsule.cmp(&b.capsule))
                    });
                }
            }
        }
    }
}

/// The capsules near the view of one camera, and the lists of them for the pieces.
pub(super) struct Contacts<'a> {
    charts: &'a PlacedCharts,
    nearby: &'a Nearby,
    /// The share of the occlusion of each capsule that the distance to the camera leaves.
    shares: Vec<Option<f64>>,
    /// Index of a chart, and indices of capsules.
    lists: Vec<(usize, Vec<usize>)>,
}

impl Contacts<'_> {
    /// Calls `darkened` for the pieces of a cluster with a nearby capsule, in order, with
    /// the index of the list of each. Pieces of one chart share a list of few capsules, so
    /// that they are rendered together.
    pub(super) fn for_each_piece(
        &mut self,
        cluster: &Cluster,
        mut darkened: impl FnMut(&Piece, usize),
    ) {
        let nearby = self.nearby;
        let all = cluster
            .number
            .map_or(&[][..], |i| &nearby.of_cluster[i][..]);
        for near in all.chunk_by(|a, b| a.piece == b.piece) {
            let mut own = [0; MOST];
            let mut count = 0;
            let in_view = near
                .iter()
                .filter(|near| self.shares[near.capsule].is_some());
            for (to, near) in own.iter_mut().zip(in_view) {
                *to = near.capsule;
                count += 1;
            }
            let piece = &cluster.pieces[near[0].piece];
            if let Some(list) = self.list(piece.chart, &own[..count]) {
                darkened(piece, list);
            }
        }
    }

    /// Index of the list for a piece with nearby capsules, the nearest first.
    fn list(&mut self, chart: usize, own: &[usize]) -> Option<usize> {
        if own.is_empty() {
            return None;
        }
        let fitting = self.lists.iter().rposition(|(of, list)| {
            let added = || own.iter().filter(|i| !list.contains(i)).count();
            *of == chart
                && match added() {
                    0 => true,
                    added => list.len() + added <= MOST_SHARED,
                }
        });
        if let Some(fitting) = fitting {
            let list = &mut self.lists[fitting].1;
            for i in own {
                if !list.contains(i) {
                    list.push(*i);
                }
            }
            return Some(fitting);
        }
        if self.lists.len() + 1 >= MOST_LISTS {
            return None;
        }
        self.lists.push((chart, own.to_vec()));
        Some(self.lists.len() - 1)
    }

    /// Index of the shader variant of each list.
    pub(super) fn variants(&self) -> Vec<usize> {
        let variant = |(_, list): &(usize, Vec<usize>)| {
            let fits = VARIANTS.iter().position(|most| list.len() <= *most);
            fits.unwrap_or(VARIANTS.len() - 1)
        };
        self.lists.iter().map(variant).collect()
    }

    /// The lists as the shaders read them, [`STRIDE`] bytes each.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let [width, height] = self.charts.extent.map(|side| side as f32);
        let mut bytes = vec![0; self.lists.len() * STRIDE as usize];
        for ((chart, list), to) in self.lists.iter().zip(bytes.chunks_mut(STRIDE as usize)) {
            let mut own = List {
                extent: [width, height, list.len() as f32, 0.0],
                occluders: [GpuOccluder::NONE; MOST],
            };
            if let Some(Some(chart)) = self.charts.placed.get(*chart) {
                for (to, from) in own.occluders.iter_mut().zip(list) {
                    let placed = &self.nearby.placed[*from];
                    if let (Some((_, placed)), Some(share)) = (placed, self.shares[*from]) {
                        *to = placed.on_chart(chart, share);
                    }
                }
            }
            to[..LIST as usize].copy_from_slice(bytemuck::bytes_of(&own));
        }
        bytes
    }
}
