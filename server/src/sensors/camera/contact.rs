//! Contact darkening: objects occlude the ambient light of nearby surfaces. Each pixel of
//! such a surface combines the occlusion by at most [`MOST`] capsules, in closed form.
//! Surfaces without a nearby object use a shader without this step.
//!
//! The sphere of a capsule that is nearest to the pixel counts. Close to the capsule this
//! approximates a cylinder, further away a sphere. Oriented boxes instead of capsules take
//! a CPU adapter twice the time. Robot and person are not occluders: the floor around the
//! chair would cost a tenth of the rate.

use nalgebra::{Isometry3, Point3, Vector3};

use super::buffers::Body;
use super::culling_clusters::Piece;
use super::scene::Binding;
use super::view::View;

/// Maximum number of capsules that darken one piece of a surface.
pub(super) const MOST: usize = 8;
/// Number of capsules of each shader variant. A variant evaluates all of its capsules,
/// because a CPU adapter executes both sides of a branch.
pub(super) const VARIANTS: [usize; 4] = [1, 2, 4, MOST];
/// Maximum number of distinct lists in an image. Further pieces have no contacts.
pub(super) const MOST_LISTS: usize = 96;
/// Bytes between the starts of two lists, a multiple of the uniform buffer alignment.
pub(super) const STRIDE: u64 = 512;
/// Bytes of a list.
pub(super) const LIST: u64 = size_of::<List>() as u64;
/// Largest invisible occlusion.
const LEAST: f64 = 0.05;
/// Largest distance at which an object darkens a surface, metres.
const MOST_REACH: f64 = 0.25;
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
        let (centre, axis) = (pose * self.centre, pose.rotation * self.axis);
        let row = |v: &Vector3<f64>, last: f64| [v.x, v.y, v.z, last].map(|x| x as f32);
        PlacedOccluder {
            body: self.body,
            centre,
            axis,
            half_length: self.half_length,
            reach: self.reach,
            gpu: GpuOccluder {
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

/// Decrease of the occlusion with the distance: see `unoccluded_share` in the shaders.
const FALLOFF: f64 = 0.25;

/// A capsule in the world.
pub(super) struct PlacedOccluder {
    body: usize,
    centre: Point3<f64>,
    axis: Vector3<f64>,
    half_length: f64,
    reach: f64,
    gpu: GpuOccluder,
}

/// `Occluder` in the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct GpuOccluder {
    /// Centre and radius.
    centre: [f32; 4],
    /// Axis and half the length.
    axis: [f32; 4],
    /// Square of the radius, falloff, 1 / reach².
    more: [f32; 4],
}

impl GpuOccluder {
    /// Occludes no light.
    const NONE: Self = Self {
        centre: [0.0, 0.0, 1e3, 0.0],
        axis: [0.0; 4],
        more: [0.0; 4],
    };
}

/// `Contacts` in the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct List([GpuOccluder; MOST]);

/// The capsules near the view of one camera, and the lists of them for the pieces.
pub(super) struct Contacts<'a> {
    near: Vec<&'a PlacedOccluder>,
    /// Indices into `near`, ascending.
    lists: Vec<Vec<usize>>,
}

impl<'a> Contacts<'a> {
    /// Selects the capsules that may darken surfaces in view.
    pub(super) fn in_view(view: &View, placed: &'a [PlacedOccluder]) -> Self {
        let is_near =
            |p: &&PlacedOccluder| view.distance(&p.centre, p.half_length + p.reach).is_some();
        Self {
            near: placed.iter().filter(is_near).collect(),
            lists: Vec::new(),
        }
    }

    /// Indices of the capsules that may darken a batch: those of other bodies that reach its
    /// bounding sphere.
    pub(super) fn candidates_for_batch(
        &self,
        body: usize,
        bodies: &[Body],
        centre: &Point3<f64>,
        radius: f64,
    ) -> Vec<usize> {
        // Links cover many pixels, and a grasped object hides its contact.
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

    /// Index of the list for a piece of a batch, and of its variant; `None` without a
    /// nearby capsule.
    pub(super) fn list_for_piece(
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
            // Distance to the nearest of five points along the capsule.
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

    /// The lists as the shaders read them, [`STRIDE`] bytes each.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.lists.len() * STRIDE as usize];
        for (list, to) in self.lists.iter().zip(bytes.chunks_mut(STRIDE as usize)) {
            let mut own = List([GpuOccluder::NONE; MOST]);
            for (to, from) in own.0.iter_mut().zip(list) {
                *to = self.near[*from].gpu;
            }
            to[..LIST as usize].copy_from_slice(bytemuck::bytes_of(&own));
        }
        bytes
    }
}
