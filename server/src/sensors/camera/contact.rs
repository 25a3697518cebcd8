//! Contact darkening: objects keep ambient light from what they stand on or come near to. Every pixel of such a surface sums up the occlusion by at most
//! [`MOST`] capsules, in closed form; surfaces that nothing is near to are rendered without.
//!
//! Of a capsule the ball nearest to the pixel counts: near to it this is the occlusion by a
//! cylinder, further away that by a ball. Boxes in the place of capsules, with their
//! rotations, take a CPU adapter twice the time. Robot and person darken nothing: the floor
//! around the chair would take a tenth of the rate.

use nalgebra::{Isometry3, Point3, Vector3};

use super::buffers::Body;
use super::cells::Piece;
use super::scene::Binding;
use super::view::View;

/// Capsules that darken one piece of a surface.
pub(super) const MOST: usize = 8;
/// Capsules of the shader variants. Each sums up all of its capsules: a CPU adapter does
/// not skip a branch, and gathers what it reads by an index that is not constant.
pub(super) const VARIANTS: [usize; 4] = [1, 2, 4, MOST];
/// Different lists of capsules in an image; pieces beyond are rendered without.
pub(super) const MOST_LISTS: usize = 96;
/// Bytes from one list to the next, a multiple of the alignment of uniform buffers.
pub(super) const STRIDE: u64 = 512;
/// Bytes of a list.
pub(super) const LIST: u64 = size_of::<List>() as u64;
/// Occlusion that is not seen any more.
const LEAST: f64 = 0.05;
/// Nothing darkens from further away, metres.
const MOST_REACH: f64 = 0.25;
/// Smaller bodies darken nothing worth seeing, metres.
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
    /// From the axis, metres.
    reach: f64,
}

impl Occluder {
    /// The capsule in the place of the box between two corners; `None` when it is too small.
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

    pub(super) fn placed(&self, pose: &Isometry3<f64>) -> Placed {
        let (centre, axis) = (pose * self.centre, pose.rotation * self.axis);
        let row = |v: &Vector3<f64>, last: f64| [v.x, v.y, v.z, last].map(|x| x as f32);
        Placed {
            body: self.body,
            centre,
            axis,
            half_length: self.half_length,
            reach: self.reach,
            on_adapter: OnAdapter {
                centre: row(&centre.coords, self.radius),
                axis: row(&axis, self.half_length),
                more: [
                    self.radius * self.radius,
                    FALLOFF / (self.width * self.width),
                    1.0 / (self.reach * self.reach),
                    0.0,
                ]
                .map(|x| x as f32),
            },
        }
    }
}

/// How fast a body of a width gets smaller with the distance: see `left_by` in the shaders.
const FALLOFF: f64 = 0.25;

/// A capsule in the world.
pub(super) struct Placed {
    body: usize,
    centre: Point3<f64>,
    axis: Vector3<f64>,
    half_length: f64,
    reach: f64,
    on_adapter: OnAdapter,
}

/// `Occluder` in the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct OnAdapter {
    /// And radius.
    centre: [f32; 4],
    /// And half the length.
    axis: [f32; 4],
    /// Square of the radius, falloff, 1 / reach².
    more: [f32; 4],
}

impl OnAdapter {
    /// Darkens nothing.
    const NONE: Self = Self {
        centre: [0.0, 0.0, 1e3, 0.0],
        axis: [0.0; 4],
        more: [0.0; 4],
    };
}

/// `Contacts` in the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct List([OnAdapter; MOST]);

/// The capsules near to what one camera sees, and the lists of them that pieces need.
pub(super) struct Contacts<'a> {
    near: Vec<&'a Placed>,
    /// Numbers in `near`, in rising order.
    lists: Vec<Vec<usize>>,
}

impl<'a> Contacts<'a> {
    /// Chooses the capsules that may darken what is in view.
    pub(super) fn in_view(view: &View, placed: &'a [Placed]) -> Self {
        let seen = |p: &&Placed| view.distance(&p.centre, p.half_length + p.reach).is_some();
        Self {
            near: placed.iter().filter(seen).collect(),
            lists: Vec::new(),
        }
    }

    /// Numbers of the capsules that may darken a batch: those of other bodies that reach the
    /// ball around it.
    pub(super) fn of_batch(
        &self,
        body: usize,
        bodies: &[Body],
        centre: &Point3<f64>,
        radius: f64,
    ) -> Vec<usize> {
        // Their pixels are many, and what they grasp hides where they touch it.
        if matches!(bodies[body].binding, Binding::Link(_)) {
            return Vec::new();
        }
        let reaches = |i: &usize| {
            let p = self.near[*i];
            let reach = radius + p.half_length + p.reach;
            p.body != body && (p.centre - centre).norm_squared() < reach * reach
        };
        (0..self.near.len()).filter(reaches).collect()
    }

    /// Number of the list of a piece of the batch and that of its variant; `None` when
    /// nothing is near to it.
    pub(super) fn of_piece(
        &mut self,
        candidates: &[usize],
        piece: &Piece,
        pose: &Isometry3<f64>,
    ) -> Option<(usize, usize)> {
        if candidates.is_empty() {
            return None;
        }
        let mut found: Vec<(f64, usize)> = Vec::new();
        for &i in candidates {
            let p = self.near[i];
            let centre = pose.inverse_transform_point(&p.centre) - piece.centre;
            let axis = pose.rotation.inverse() * p.axis * p.half_length;
            // The nearest of five places along the capsule, a quarter apart.
            let outside = |along: f64| {
                let away = (centre + axis * along).abs() - piece.half;
                away.map(|x| x.max(0.0)).norm()
            };
            let nearest = [-1.0, -0.5, 0.0, 0.5, 1.0].map(outside);
            let nearest = nearest.into_iter().fold(f64::INFINITY, f64::min);
            let gap = nearest - 0.25 * p.half_length;
            if gap < p.reach {
                found.push((gap.max(0.0) / p.reach, i));
            }
        }
        if found.is_empty() {
            return None;
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(MOST);
        let mut list: Vec<usize> = found.into_iter().map(|(_, i)| i).collect();
        list.sort_unstable();
        let variant = VARIANTS.iter().position(|most| list.len() <= *most)?;
        if let Some(known) = self.lists.iter().position(|l| *l == list) {
            return Some((known, variant));
        }
        if self.lists.len() + 1 >= MOST_LISTS {
            return None;
        }
        self.lists.push(list);
        Some((self.lists.len() - 1, variant))
    }

    /// The lists, [`STRIDE`] bytes each, as the adapter reads them.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.lists.len() * STRIDE as usize];
        for (list, to) in self.lists.iter().zip(bytes.chunks_mut(STRIDE as usize)) {
            let mut own = List([OnAdapter::NONE; MOST]);
            for (to, from) in own.0.iter_mut().zip(list) {
                *to = self.near[*from].on_adapter;
            }
            to[..LIST as usize].copy_from_slice(bytemuck::bytes_of(&own));
        }
        bytes
    }
}
