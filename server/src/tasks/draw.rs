//! One start of a task from a seed: placements, the chair's pose, the sentence.
//!
//! Whole draws are rejected until nothing overlaps and the way of the gripper to
//! the target is free; the best draw is taken should none do.

use nalgebra::{Isometry3, Point2, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::spec::{Range, TaskSpec};
use crate::scene::{Body, Bounds, Placement, Scene, Surface};

/// Draws before the best one is taken.
const ATTEMPTS: usize = 2000;
/// Least distance between two objects, metres.
const GAP: f64 = 0.02;
/// Half of the width that the open gripper needs on its way to the target, metres.
const LANE: f64 = 0.09;

/// What was drawn for one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Draw {
    /// One per entry of `Scene::objects`.
    pub placements: Vec<Placement>,
    /// Pose of `wheelchair_root` in `house`.
    pub start: Isometry3<f64>,
    /// The sentence.
    pub instruction: String,
}

/// Draws a start of the task. The same seed gives the same draw on any machine.
#[must_use]
pub fn draw(spec: &TaskSpec, scene: &Scene, seed: u64) -> Draw {
    draw_with_clearance(spec, scene, seed).0
}

/// How much room the draw leaves, metres; below zero something overlaps.
pub(super) fn clearance_of(spec: &TaskSpec, scene: &Scene, seed: u64) -> f64 {
    draw_with_clearance(spec, scene, seed).1
}

fn draw_with_clearance(spec: &TaskSpec, scene: &Scene, seed: u64) -> (Draw, f64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let start = Isometry3::new(
        Vector3::new(
            number(&mut random, spec.start.x),
            number(&mut random, spec.start.y),
            0.0,
        ),
        Vector3::z() * number(&mut random, spec.start.yaw),
    );
    let whole = Range {
        min: 0.0,
        max: spec.instructions.len() as f64,
    };
    let chosen = number(&mut random, whole) as usize;
    let instruction = spec.instructions.get(chosen).cloned().unwrap_or_default();
    let room = Room::new(spec, scene);
    let mut best: Option<(Vec<Placement>, f64)> = None;
    for _ in 0..ATTEMPTS {
        let placements = placements(&mut random, spec, scene);
        let clearance = room.clearance(&placements);
        if best.as_ref().is_none_or(|(_, most)| clearance > *most) {
            best = Some((placements, clearance));
        }
        if clearance >= 0.0 {
            break;
        }
    }
    let (placements, clearance) = best.unwrap_or_default();
    let draw = Draw {
        placements,
        start,
        instruction,
    };
    (draw, clearance)
}

/// Uniform in the range, from 53 bits: independent of any library's sampling.
fn number(random: &mut ChaCha8Rng, range: Range) -> f64 {
    let fraction = (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    range.min + (range.max - range.min) * fraction
}

fn placements(random: &mut ChaCha8Rng, spec: &TaskSpec, scene: &Scene) -> Vec<Placement> {
    let mut placements: Vec<_> = scene
        .objects
        .iter()
        .map(|body| Placement {
            pose: body.pose,
            mass: body.mass.map_or(0.0, |mass| mass.mass),
            friction: body.friction,
        })
        .collect();
    for place in &spec.places {
        let (inwards, along, yaw) = (
            number(random, place.inwards),
            number(random, place.along),
            number(random, place.yaw),
        );
        let mass = place.mass.map(|range| number(random, range));
        let friction = place.friction.map(|range| number(random, range));
        // Both names were checked when the task was read.
        let surface = scene.surface_named(&place.on, place.surface.as_deref());
        let object = scene.object_named(&place.object);
        if let (Some(surface), Some(object)) = (surface, object) {
            let placement = &mut placements[object];
            let lift = scene.objects[object].standing_height();
            placement.pose =
                surface.standing(inwards, along, yaw) * Isometry3::translation(0.0, 0.0, lift);
            placement.mass = mass.unwrap_or(placement.mass);
            placement.friction = friction.unwrap_or(placement.friction);
        }
    }
    placements
}

/// What objects must keep clear of.
struct Room<'a> {
    scene: &'a Scene,
    /// Radius of each object's footprint.
    radii: Vec<f64>,
    furniture: Vec<Bounds>,
    /// Surface of each placed object.
    surfaces: Vec<Option<&'a Surface>>,
    target: Option<usize>,
}

impl<'a> Room<'a> {
    fn new(spec: &TaskSpec, scene: &'a Scene) -> Self {
        let mut surfaces = vec![None; scene.objects.len()];
        for place in &spec.places {
            if let Some(object) = scene.object_named(&place.object) {
                surfaces[object] = scene.surface_named(&place.on, place.surface.as_deref());
            }
        }
        Self {
            scene,
            radii: scene.objects.iter().map(Body::footprint_radius).collect(),
            furniture: scene
                .furniture
                .iter()
                .filter_map(|body| body.collision_bounds(&body.pose))
                .collect(),
            surfaces,
            target: scene.object_named(&spec.target),
        }
    }

    /// The least distance that is left anywhere, metres.
    fn clearance(&self, placements: &[Placement]) -> f64 {
        let mut least = f64::INFINITY;
        let centre = |i: usize| Point2::from(placements[i].pose.translation.vector.xy());
        for (i, surface) in self.surfaces.iter().enumerate() {
            let Some(surface) = surface else { continue };
            let on = surface.edge.inverse() * placements[i].pose;
            let (inwards, along) = (on.translation.x, on.translation.y);
            let room = inwards
                .min(surface.depth - inwards)
                .min(surface.width / 2.0 - along.abs());
            least = least.min(room - self.radii[i]);
            let Some(own) = self.scene.objects[i].collision_bounds(&placements[i].pose) else {
                continue;
            };
            for other in &self.furniture {
                let level = own.max.z.min(other.max.z) - own.min.z.max(other.min.z);
                if level > 0.001 {
                    let outside = |k: usize| {
                        (other.min[k] - centre(i)[k])
                            .max(centre(i)[k] - other.max[k])
                            .max(0.0)
                    };
                    let distance = outside(0).hypot(outside(1));
                    least = least.min(distance - self.radii[i] - GAP);
                }
            }
            for j in (0..placements.len()).filter(|&j| j != i) {
                let distance = (centre(i) - centre(j)).norm();
                least = least.min(distance - self.radii[i] - self.radii[j] - GAP);
            }
        }
        if let Some(target) = self.target
            && let Some(way) = self.approach(target, placements)
        {
            for j in (0..placements.len()).filter(|&j| j != target) {
                let to = centre(j) - centre(target);
                let along = to.dot(&way).clamp(0.0, 1.0);
                least = least.min((to - way * along).norm() - self.radii[j] - LANE);
            }
        }
        least
    }

    /// Direction from the target out over the approach edge, along the grasp
    /// that fits that side best; one metre long.
    fn approach(&self, target: usize, placements: &[Placement]) -> Option<Vector2<f64>> {
        let surface = self.surfaces[target]?;
        let inwards = (surface.edge.rotation * Vector3::x()).xy();
        self.scene.objects[target]
            .grasps
            .iter()
            .map(|grasp| {
                let z = placements[target].pose.rotation * grasp.pose.rotation * Vector3::z();
                if grasp.symmetric { inwards } else { z.xy() }
            })
            .max_by(|a, b| a.dot(&inwards).total_cmp(&b.dot(&inwards)))
            .map(|approach| -approach.normalize())
    }
}
