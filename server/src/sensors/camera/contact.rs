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
use super::buffers::Body;
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
    /// Width and height of the ambient map, metres.
    extent: [f32; 4],
    occluders: [GpuOccluder; MOST],
}

/// The capsules near the view of one camera, and the lists of them for the pieces.
pub(super) struct Contacts<'a> {
    charts: &'a PlacedCharts,
    /// Each with the share of its occlusion that the distance to the camera leaves.
    near: Vec<(&'a PlacedOccluder, f64)>,
    /// Index of a chart, and indices into `near`.
    lists: Vec<(usize, Vec<usize>)>,
}

impl<'a> Contacts<'a> {
    /// Selects the capsules that may darken surfaces in view.
    pub(super) fn in_view(
        view: &View,
        placed: &'a [PlacedOccluder],
        charts: &'a PlacedCharts,
    ) -> Self {
        let near = |p: &'a PlacedOccluder| {
            let radius = p.capsule.half_length + p.capsule.reach;
            let distance = view.distance(&p.centre, radius)?;
            let [from, to] = APPEARS;
            let share = (p.capsule.reach / distance.max(1e-3) - from) / (to - from);
            (share > 0.0).then_some((p, share.min(1.0)))
        };
        Self {
            charts,
            near: placed.iter().filter_map(near).collect(),
            lists: Vec::new(),
        }
    }

    /// Indices of the capsules that may darken a batch: those that reach its bounding
    /// sphere. Only static bodies are darkened; their frame is that of the world.
    pub(super) fn candidates_for_batch(
        &self,
        body: &Body,
        centre: &Point3<f64>,
        radius: f64,
    ) -> Vec<usize> {
        if body.binding != Binding::World {
            return Vec::new();
        }
        let reaches = |i: &usize| self.near[*i].0.reaches(centre, radius);
        (0..self.near.len()).filter(reaches).collect()
    }

    /// Those of `candidates` that reach the bounding sphere of a cluster.
    pub(super) fn candidates_for_cluster(
        &self,
        candidates: &[usize],
        cluster: &Cluster,
    ) -> Vec<usize> {
        let reaches = |i: &&usize| self.near[**i].0.reaches(&cluster.centre, cluster.radius);
        candidates.iter().filter(reaches).copied().collect()
    }

    /// Index of the list for a piece of a batch; `None` without a nearby capsule. Pieces of
    /// one chart share a list of few capsules, so that they are rendered together.
    pub(super) fn list_for_piece(&mut self, candidates: &[usize], piece: &Piece) -> Option<usize> {
        let chart = self.charts.placed.get(piece.chart)?.as_ref()?;
        let gap = |&i: &usize| Some((self.near[i].0.gap(piece, chart)?, i));
        let mut found: Vec<(f64, usize)> = candidates.iter().filter_map(gap).collect();
        if found.is_empty() {
            return None;
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(MOST);
        let own: Vec<usize> = found.into_iter().map(|(_, i)| i).collect();
        let fitting = self.lists.iter().rposition(|(chart, list)| {
            let added = own.iter().filter(|i| !list.contains(i)).count();
            let shared = list.len() + added;
            *chart == piece.chart && (added == 0 || shared <= MOST_SHARED)
        });
        if let Some(fitting) = fitting {
            let list = &mut self.lists[fitting].1;
            for i in own {
                if !list.contains(&i) {
                    list.push(i);
                }
            }
            return Some(fitting);
        }
        if self.lists.len() + 1 >= MOST_LISTS {
            return None;
        }
        self.lists.push((piece.chart, own));
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
                extent: [width, height, 0.0, 0.0],
                occluders: [GpuOccluder::NONE; MOST],
            };
            if let Some(Some(chart)) = self.charts.placed.get(*chart) {
                for (to, from) in own.occluders.iter_mut().zip(list) {
                    let (occluder, share) = &self.near[*from];
                    *to = occluder.on_chart(chart, *share);
                }
            }
            to[..LIST as usize].copy_from_slice(bytemuck::bytes_of(&own));
        }
        bytes
    }
}
