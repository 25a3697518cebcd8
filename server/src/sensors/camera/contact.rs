//! Contact darkening: objects occlude the ambient light of nearby static planes that have a
//! chart. A pixel there combines the occlusion by at most [`MOST`] capsules, in closed form.
//! Triangles without a nearby object use a shader without this step.
//!
//! The sphere of a capsule that is nearest to the pixel counts. Close to the capsule this
//! approximates a cylinder, further away a sphere. Capsules are in coordinates of the chart,
//! so that a pixel needs only its coordinates in the ambient map. Oriented boxes instead of
//! capsules take a CPU adapter twice the time. Robot and person are not occluders: the floor
//! around the chair would cost a tenth of the rate. Objects and other curved surfaces are
//! not darkened.

use nalgebra::{Isometry3, Point3, Vector3};

use super::ambient_map::{PlacedChart, PlacedCharts};
use super::buffers::Body;
use super::culling_clusters::{Cluster, Outline, Piece};
use super::scene::Binding;
use super::view::View;

/// Maximum number of capsules that darken one piece of a surface.
pub(super) const MOST: usize = 4;
/// Number of capsules of each shader variant. A variant evaluates all of its capsules,
/// because a CPU adapter executes both sides of a branch.
pub(super) const VARIANTS: [usize; 2] = [2, MOST];
/// Maximum number of distinct lists in an image. Further pieces have no contacts.
pub(super) const MOST_LISTS: usize = 64;
/// Bytes between the starts of two lists, a multiple of the uniform buffer alignment.
pub(super) const STRIDE: u64 = 256;
/// Bytes of a list.
pub(super) const LIST: u64 = size_of::<List>() as u64;
/// Largest invisible occlusion.
const LEAST: f64 = 0.05;
/// Largest distance at which an object darkens a surface, metres.
const MOST_REACH: f64 = 0.16;
/// Smallest side of an occluder, metres.
const LEAST_SIDE: f64 = 0.02;
/// Least radius, metres.
const LEAST_RADIUS: f64 = 0.003;

/// A capsule in the frame of its body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Occluder {
    pub(super) body: usize,
    centre: Point3<f64>,
    axis: Vector3<f64>,
    /// Half the distance between the centres of the caps.
    half_length: f64,
    radius: f64,
    /// Mean half side.
    width: f64,
    /// Largest distance from the axis with visible occlusion, metres.
    reach: f64,
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
        let reach = (radius * width / LEAST).sqrt().min(MOST_REACH);
        Some(Self {
            body,
            centre: nalgebra::center(low, high),
            axis: Vector3::ith(longest, 1.0),
            half_length: (half[longest] - radius).max(0.0),
            radius,
            width: width.max(radius),
            reach: reach.max(radius * 1.5),
        })
    }

    pub(super) fn placed(&self, pose: &Isometry3<f64>) -> PlacedOccluder {
        PlacedOccluder {
            capsule: *self,
            centre: pose * self.centre,
            axis: pose.rotation * self.axis,
        }
    }
}

/// Decrease of the occlusion with the distance: see `unoccluded_share` in the shaders.
const FALLOFF: f64 = 0.25;

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
        (gap < 1.0).then_some(gap.max(0.0))
    }

    /// The capsule in coordinates of a chart.
    fn on_chart(&self, chart: &PlacedChart) -> GpuOccluder {
        let Occluder {
            half_length,
            radius,
            width,
            reach,
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
            more: row([
                radius * radius,
                FALLOFF / (width * width),
                1.0 / (reach * reach),
                radius,
            ]),
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
    /// Square of the radius, falloff, 1 / reach², radius.
    more: [f32; 4],
}

impl GpuOccluder {
    /// Occludes no light.
    const NONE: Self = Self {
        place: [0.0; 4],
        heights: [0.0; 4],
        more: [1.0, 0.0, 0.0, 0.0],
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
    near: Vec<&'a PlacedOccluder>,
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
        let is_near = |p: &&PlacedOccluder| {
            let radius = p.capsule.half_length + p.capsule.reach;
            view.distance(&p.centre, radius).is_some()
        };
        Self {
            charts,
            near: placed.iter().filter(is_near).collect(),
            lists: Vec::new(),
        }
    }

    /// Indices of the capsules that may darken a static batch: those that reach its
    /// bounding sphere.
    pub(super) fn candidates_for_batch(
        &self,
        body: &Body,
        centre: &Point3<f64>,
        radius: f64,
    ) -> Vec<usize> {
        if body.binding != Binding::World {
            return Vec::new();
        }
        let reaches = |i: &usize| self.near[*i].reaches(centre, radius);
        (0..self.near.len()).filter(reaches).collect()
    }

    /// Those of `candidates` that reach the bounding sphere of a cluster.
    pub(super) fn candidates_for_cluster(
        &self,
        candidates: &[usize],
        cluster: &Cluster,
    ) -> Vec<usize> {
        let reaches = |i: &&usize| self.near[**i].reaches(&cluster.centre, cluster.radius);
        candidates.iter().filter(reaches).copied().collect()
    }

    /// Index of the list for a piece of a batch; `None` without a nearby capsule. Pieces of
    /// one chart share a list where it has room, so that they are rendered together.
    pub(super) fn list_for_piece(&mut self, candidates: &[usize], piece: &Piece) -> Option<usize> {
        let chart = self.charts.placed.get(piece.chart)?.as_ref()?;
        let gap = |&i: &usize| Some((self.near[i].gap(piece, chart)?, i));
        let mut found: Vec<(f64, usize)> = candidates.iter().filter_map(gap).collect();
        if found.is_empty() {
            return None;
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(MOST);
        let own = found.into_iter().map(|(_, i)| i);
        let own: Vec<usize> = own.collect();
        let fitting = self.lists.iter().rposition(|(chart, list)| {
            let added = own.iter().filter(|i| !list.contains(i)).count();
            *chart == piece.chart && list.len() + added <= MOST
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
                    *to = self.near[*from].on_chart(chart);
                }
            }
            to[..LIST as usize].copy_from_slice(bytemuck::bytes_of(&own));
        }
        bytes
    }
}
