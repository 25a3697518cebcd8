//! One start of a task from a seed: the scene of its area, which knows nothing of
//! the task, then what the task is about where it has a choice, and the sentence.

use super::area::Variant;
use super::floor::Floor;
use super::random::{index, stream};
use super::scene_draw::{SceneDraw, draw_scene, variant};
use super::spec::TaskSpec;
use crate::scene::Scene;

/// Numbers as people say them.
const ORDINALS: [&str; 6] = ["first", "second", "third", "fourth", "fifth", "sixth"];

/// What was drawn for one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Draw {
    /// What stands there, the same for all tasks of the area.
    pub scene: SceneDraw,
    /// What the task is about.
    pub target: String,
    /// The sentence.
    pub instruction: String,
}

/// The variant of its area in which a task is done with this seed; `share` is
/// that of all variants but the first, else as the area says.
#[must_use]
pub fn variant_of(spec: &TaskSpec, seed: u64, share: Option<f64>) -> Option<&Variant> {
    let offering: Vec<_> = spec.variants().collect();
    variant(&spec.area, &offering, seed, share)
}

/// Draws a start of the task in a variant of its area. The same seed gives the
/// same draw on any machine. `scene` holds the optional furniture of the variant
/// and no other; with a `floor` the robot starts anywhere on it.
#[must_use]
pub fn draw(
    spec: &TaskSpec,
    variant: &Variant,
    scene: &Scene,
    seed: u64,
    floor: Option<&Floor>,
) -> Draw {
    let drawn = draw_scene(&spec.area, variant, scene, seed, floor);
    let mut random = stream(&spec.area.name, seed, &format!("task {}", spec.name));
    let mut one_of = |choices: &[String]| {
        let chosen = index(&mut random, choices.len());
        choices.get(chosen).cloned().unwrap_or_default()
    };
    let target = one_of(&spec.targets);
    let sentence = one_of(&spec.instructions);
    let instruction = in_words(&sentence, spec, variant, scene, &drawn, &target);
    Draw {
        scene: drawn,
        target,
        instruction,
    }
}

/// The sentence with the target's position among its like, counted by someone
/// who faces the surface: `{from_left}`, `{from_right}` and `{from_top}`.
fn in_words(
    sentence: &str,
    spec: &TaskSpec,
    variant: &Variant,
    scene: &Scene,
    drawn: &SceneDraw,
    target: &str,
) -> String {
    let surface = variant
        .place(target)
        .and_then(|place| scene.surface_named(&place.on, place.surface.as_deref()));
    let along = |name: &str| {
        let placement = drawn.placements[scene.object_named(name)?].as_ref()?;
        Some((surface?.edge.inverse() * placement.pose).translation.y)
    };
    let height = |name: &str| {
        let object = scene.object_named(name).and_then(|i| drawn.placements[i]);
        let placed = object.map(|placement| placement.pose.translation.z);
        let furniture = scene.furniture_named(name);
        placed.or_else(|| Some(scene.furniture[furniture?].pose.translation.z))
    };
    let above = |value: &dyn Fn(&str) -> Option<f64>, sign: f64| {
        let own = value(target)?;
        let others = spec.targets.iter().filter(|name| *name != target);
        let before = others.filter_map(|name| value(name));
        let before = before.filter(|other| sign * other > sign * own).count();
        Some(ORDINALS.get(before).copied().unwrap_or("next"))
    };
    // Looking inwards, the left is where `along` grows.
    [
        ("{from_left}", above(&along, 1.0)),
        ("{from_right}", above(&along, -1.0)),
        ("{from_top}", above(&height, 1.0)),
    ]
    .into_iter()
    .fold(sentence.to_owned(), |sentence, (key, word)| {
        word.map_or(sentence.clone(), |word| sentence.replace(key, word))
    })
}
