//! Samples one start of a task from a seed: the scene of its area, independent of the
//! task, then the target and the sentence.

use nalgebra::Translation3;
use wheelarm_planning::posture_routes::STOP_GOALS;

use super::area::Variant;
use super::floor::Floor;
use super::leaf_reach::choose_angle;
use super::random::{index, stream};
use super::scene_sampling::{SceneSample, sample_scene, variant};
use super::spec::TaskSpec;
use crate::scene::Scene;

/// Places and objects of a query that are sampled until the robot reaches one.
const CHOICES: usize = 24;
/// Stops at the target from which a way to the place of a task is looked for.
const TAKES: usize = 2;
/// Ordinals in sentences.
const ORDINALS: [&str; 6] = ["first", "second", "third", "fourth", "fifth", "sixth"];

/// Sampled values of one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskSample {
    /// The scene, the same for all tasks of the area.
    pub scene: SceneSample,
    /// Target of the task.
    pub target: String,
    /// The sentence.
    pub instruction: String,
}

/// The variant of its area in which a task is done with this seed; `share` is the
/// probability of all variants but the first, default is the area's.
#[must_use]
pub fn variant_of(spec: &TaskSpec, seed: u64, share: Option<f64>) -> Option<&Variant> {
    let offering: Vec<_> = spec.variants().collect();
    variant(&spec.area, &offering, seed, share)
}

/// Samples a start of the task in a variant of its area. The same seed gives the same
/// sample on any machine. `scene` contains the optional furniture of the variant and no
/// other; with a `floor` the robot starts anywhere on it.
#[must_use]
pub fn sample(
    spec: &TaskSpec,
    variant: &Variant,
    scene: &Scene,
    seed: u64,
    floor: Option<&Floor>,
) -> TaskSample {
    let mut drawn = sample_scene(&spec.area, variant, scene, seed, floor);
    let mut random = stream(&spec.area.name, seed, &format!("task {}", spec.name));
    let mut one_of = |choices: &[String]| {
        let chosen = index(&mut random, choices.len());
        choices.get(chosen).cloned().unwrap_or_default()
    };
    let target = one_of(&spec.targets);
    let sentence = one_of(&spec.instructions);
    drawn.has_reach &= floor.is_none_or(|floor| {
        let mut possible = spec.rivals.iter().chain([&target]);
        possible.all(|one| is_goal_reached((spec, variant), scene, (one, &drawn), floor))
    });
    drawn.has_reach &= floor.is_none_or(|floor| {
        !drawn.is_complete() || choose_angle(spec, (scene, &target), &mut drawn, seed, floor)
    });
    let instruction = in_words(&sentence, spec, variant, scene, &drawn, &target);
    TaskSample {
        scene: drawn,
        target,
        instruction,
    }
}

/// Samples a settled task. A query whose object the robot does not reach from its start is
/// settled again, with any variant and target that are open by `is_open`; when none is
/// reached, the first sample says why.
#[must_use]
pub fn sample_reached(
    task: &TaskSpec,
    settled: (TaskSpec, Variant),
    is_open: &dyn Fn(&str, &str) -> bool,
    scene: &Scene,
    seed: u64,
    floor: Option<&Floor>,
) -> ((TaskSpec, Variant), TaskSample) {
    let sampled = |about: (TaskSpec, Variant)| {
        let sample = sample(&about.0, &about.1, scene, seed, floor);
        (about, sample)
    };
    let first = sampled(settled);
    if first.1.scene.is_complete() || floor.is_none() {
        return first;
    }
    let choices = task.choices(seed, scene).into_iter();
    let choices = choices.filter(|(variant, target)| is_open(&variant.name, target));
    // Every choice fits its place.
    let others = choices
        .take(CHOICES)
        .filter_map(|(variant, target)| task.settled(variant, scene, seed, target).ok());
    let complete = others
        .map(sampled)
        .find(|(_, sample)| sample.scene.is_complete());
    complete.unwrap_or(first)
}

/// Whether the robot puts an object down in the middle of the task's region, if the task has
/// one and the floor has maps, and carries it there with the arm at home.
fn is_goal_reached(
    (spec, variant): (&TaskSpec, &Variant),
    scene: &Scene,
    (target, sample): (&str, &SceneSample),
    floor: &Floor,
) -> bool {
    let check = || {
        let region = spec.region(scene)?;
        let object = scene.object_named(target)?;
        let body = &scene.objects[object];
        let drivable = floor.drivable(&spec.area)?;
        let reach = floor.grasp_reach(&drivable)?;
        let raised = Translation3::new(0.0, 0.0, body.standing_height());
        let at = (region.centre().translation * raised).into();
        if !reach.can_put(body, &at, region) {
            return Some(false);
        }
        let place = variant.place(target)?;
        let surface = scene.surface_named(&place.on, place.surface.as_deref())?;
        let pose = sample.placements[object]?.pose;
        let takes = reach.stops((body, &pose, surface), false, TAKES);
        let puts = reach.stops((body, &at, region), true, STOP_GOALS);
        let mut takes = takes.iter();
        Some(body.grasps.is_empty() || takes.any(|take| drivable.has_path_at_home(take, &puts)))
    };
    check().unwrap_or(true)
}

/// The sentence with the target's position among similar objects, counted by a person
/// who faces the surface: `{from_left}`, `{from_right}` and `{by_height}`.
fn in_words(
    sentence: &str,
    spec: &TaskSpec,
    variant: &Variant,
    scene: &Scene,
    drawn: &SceneSample,
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
    let before = |value: &dyn Fn(&str) -> Option<f64>, sign: f64| {
        let own = value(target)?;
        let others = spec.targets.iter().filter(|name| *name != target);
        let others = others.filter_map(|name| value(name));
        Some(others.filter(|other| sign * other > sign * own).count())
    };
    let ordinal = |place: usize| ORDINALS.get(place).copied().unwrap_or("next");
    let numbered = |place: Option<usize>| place.map(|place| ordinal(place).to_owned());
    let category = || {
        let object = scene.object_named(target);
        let object = object.map(|i| &scene.objects[i].category);
        let furniture = scene.furniture_named(target);
        object.or(furniture.map(|i| &scene.furniture[i].category))
    };
    let by_height = before(&height, 1.0).zip(category()).map(|(place, noun)| {
        // The first and the last have words of their own.
        match place {
            0 => format!("top {noun}"),
            last if last + 1 == spec.targets.len() => format!("bottom {noun}"),
            place => format!("{} {noun} from the top", ordinal(place)),
        }
    });
    // Looking inwards, `along` grows to the left.
    [
        ("{from_left}", numbered(before(&along, 1.0))),
        ("{from_right}", numbered(before(&along, -1.0))),
        ("{by_height}", by_height),
    ]
    .into_iter()
    .fold(sentence.to_owned(), |sentence, (key, words)| match words {
        Some(words) => sentence.replace(key, &words),
        None => sentence,
    })
}
