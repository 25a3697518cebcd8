//! One start of a task from a seed: placements, the chair's pose, the target
//! where there is a choice, the sentence, how hard drawers slide.
//!
//! Things are placed one after another, each again and again until it keeps
//! clear of what stands there already and of the gripper's way to the target.
//! Should one find no room, all begin anew; the best draw is taken if none fits.

use nalgebra::{Isometry3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::placement_clearance::PlacementClearance;
use super::spec::{PlaceSpec, Range, TaskSpec};
use crate::scene::{Placement, Resistance, Scene};

/// Whole draws before the best one is taken.
const ATTEMPTS: usize = 60;
/// Places that are tried for one object.
const TRIES: usize = 60;
/// Numbers as people say them.
const ORDINALS: [&str; 6] = ["first", "second", "third", "fourth", "fifth", "sixth"];

/// What was drawn for one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Draw {
    /// One per entry of `Scene::objects`; `None` for what is not there.
    pub placements: Vec<Option<Placement>>,
    /// One per entry of `Scene::joints`.
    pub slides: Vec<Resistance>,
    /// Pose of `wheelchair_root` in `house`.
    pub start: Isometry3<f64>,
    /// What the task is about.
    pub target: String,
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
    let instruction = one_of(&mut random, &spec.instructions);
    let target = one_of(&mut random, &spec.targets);
    let clearance = PlacementClearance::new(spec, scene);
    let mut best: Option<(Vec<Option<Placement>>, f64)> = None;
    for _ in 0..ATTEMPTS {
        let (placements, clearance) = placements(&mut random, spec, scene, &clearance, &target);
        if best.as_ref().is_none_or(|(_, most)| clearance > *most) {
            best = Some((placements, clearance));
        }
        if clearance >= 0.0 {
            break;
        }
    }
    let (placements, clearance) = best.unwrap_or_default();
    let instruction = in_words(&instruction, spec, scene, &placements, &target);
    let mut slides: Vec<_> = scene.joints.iter().map(|joint| joint.resistance).collect();
    for slide in &spec.slides {
        let drawn = Resistance {
            friction: number(&mut random, slide.friction),
            damping: number(&mut random, slide.damping),
        };
        if let Some(joint) = scene.joint_named(&slide.joint) {
            slides[joint] = drawn;
        }
    }
    let draw = Draw {
        placements,
        slides,
        start,
        target,
        instruction,
    };
    (draw, clearance)
}

/// Uniform in the range, from 53 bits: independent of any library's sampling.
fn number(random: &mut ChaCha8Rng, range: Range) -> f64 {
    let fraction = (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    range.min + (range.max - range.min) * fraction
}

fn one_of(random: &mut ChaCha8Rng, choices: &[String]) -> String {
    let whole = Range {
        min: 0.0,
        max: choices.len() as f64,
    };
    let chosen = number(random, whole) as usize;
    choices.get(chosen).cloned().unwrap_or_default()
}

/// One whole draw, and the least room in it.
fn placements(
    random: &mut ChaCha8Rng,
    spec: &TaskSpec,
    scene: &Scene,
    clearance: &PlacementClearance<'_>,
    target: &str,
) -> (Vec<Option<Placement>>, f64) {
    let mut placements: Vec<Option<Placement>> = scene
        .objects
        .iter()
        .map(|body| {
            let drawn = spec.places.iter().any(|place| place.object == body.name);
            (!drawn && !body.optional).then(|| Placement::of(body))
        })
        .collect();
    let target_place = spec.places.iter().find(|place| place.object == target);
    let carrier = target_place.and_then(|p| scene.surface_named(&p.on, p.surface.as_deref()));
    let target = scene.object_named(target).zip(carrier);
    let mut least = f64::INFINITY;
    for place in &spec.places {
        // Both names were checked when the task was read.
        let surface = scene.surface_named(&place.on, place.surface.as_deref());
        let Some((surface, object)) = surface.zip(scene.object_named(&place.object)) else {
            continue;
        };
        let certain = Range { min: 0.0, max: 1.0 };
        if number(random, certain) >= place.chance {
            continue;
        }
        let mut best: Option<(Placement, f64)> = None;
        for _ in 0..TRIES {
            let placement = standing(random, place, scene, object, surface);
            placements[object] = Some(placement);
            let clearance = clearance.clearance(object, surface, &placements, target);
            if best.as_ref().is_none_or(|(_, most)| clearance > *most) {
                best = Some((placement, clearance));
            }
            if clearance >= 0.0 {
                break;
            }
        }
        if let Some((placement, clearance)) = best {
            placements[object] = Some(placement);
            least = least.min(clearance);
        }
        if least < 0.0 {
            break;
        }
    }
    (placements, least)
}

fn standing(
    random: &mut ChaCha8Rng,
    place: &PlaceSpec,
    scene: &Scene,
    object: usize,
    surface: &crate::scene::Surface,
) -> Placement {
    let body = &scene.objects[object];
    let (inwards, along, yaw) = (
        number(random, place.inwards),
        number(random, place.along),
        number(random, place.yaw),
    );
    let usual = Placement::of(body);
    let lift = Isometry3::translation(0.0, 0.0, body.standing_height());
    Placement {
        pose: surface.standing(inwards, along, yaw) * lift,
        mass: place.mass.map_or(usual.mass, |range| number(random, range)),
        friction: place
            .friction
            .map_or(usual.friction, |range| number(random, range)),
    }
}

/// The sentence with the target's position among its like, counted by someone
/// who faces the surface: `{from_left}` and `{from_right}`.
fn in_words(
    sentence: &str,
    spec: &TaskSpec,
    scene: &Scene,
    placements: &[Option<Placement>],
    target: &str,
) -> String {
    let surface = spec
        .places
        .iter()
        .find(|place| place.object == target)
        .and_then(|place| scene.surface_named(&place.on, place.surface.as_deref()));
    let along = |name: &str| {
        let placement = placements[scene.object_named(name)?].as_ref()?;
        Some((surface?.edge.inverse() * placement.pose).translation.y)
    };
    let Some(own) = along(target) else {
        return sentence.to_owned();
    };
    let others = || {
        let others = spec.targets.iter().filter(|name| *name != target);
        others.filter_map(|name| along(name))
    };
    let word = |index: usize| ORDINALS.get(index).copied().unwrap_or("next");
    // Looking inwards, the left is where `along` grows.
    sentence
        .replace("{from_left}", word(others().filter(|y| *y > own).count()))
        .replace("{from_right}", word(others().filter(|y| *y < own).count()))
}
