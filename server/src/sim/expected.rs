//! Expected duration of a task for the scripted operator, for time limits: driving
//! along the planned path, arm work, and style.

use wheelarm_proto::settings::{Starts, Style};

use super::scenario::Scenario;
use crate::robot::RobotModel;
use crate::scene::Scene;
use crate::tasks::{Floor, Goal, TaskSpec, Variant};

/// A time limit is the expected time multiplied by this.
const ROOM: f64 = 3.0;
/// Arm work of grasping an object, s (measured: `docs/drive-and-record/disturbances.md`).
const TAKE: f64 = 26.0;
/// Additional time to put the object elsewhere, s.
const PUT: f64 = 14.0;
/// Additional time when the arm does not start at home, s.
const STOW: f64 = 6.0;
/// Additional time with disturbances, for one or two retries, s.
const AGAIN: f64 = 10.0;
/// Without a path: seconds per metre of straight line, including detours.
const LINE: f64 = 6.0;
/// Factor of the human-like style.
const HUMAN: f64 = 12.0;

/// Whether the way to a place of a home may be longer than the limit of its task allows.
pub(super) fn may_be_long(scenario: &Scenario) -> bool {
    scenario.time_limit.is_none() && scenario.starts == Starts::Anywhere
}

/// Time limit by the expected time, seconds. That of a query is at least the limit of the
/// task, and `None` when that is enough and the scenario requests none.
pub(super) fn limit(
    about: (&TaskSpec, &Variant),
    is_query: bool,
    floor: &Floor,
    (model, scene): (&RobotModel, &Scene),
    scenario: &Scenario,
) -> Option<f64> {
    let limit = (ROOM * seconds(about, floor, model, scene, scenario)).ceil();
    let of_task = about.0.time_limit;
    match is_query {
        true if limit <= of_task => scenario.time_limit.map(|_| of_task),
        _ => Some(limit),
    }
}

/// Simulated seconds.
fn seconds(
    (task, variant): (&TaskSpec, &Variant),
    floor: &Floor,
    model: &RobotModel,
    scene: &Scene,
    scenario: &Scenario,
) -> f64 {
    let start = scenario.start.unwrap_or(scene.start);
    let way = floor.way_seconds(&start, &task.area, variant, scene);
    let way = way.unwrap_or_else(|| LINE * straight(scene, scenario));
    let put = match task.goal {
        Goal::Put { .. } | Goal::Give | Goal::Bring => PUT,
        Goal::Lift | Goal::Open(_) | Goal::Close(_) => 0.0,
    };
    let home = model.settings.home;
    let stow = if scenario.arm.is_none_or(|arm| arm == home) {
        0.0
    } else {
        STOW
    };
    let again = match scenario.disturbances {
        Some(_) => AGAIN,
        None => 0.0,
    };
    let slower = match scenario.style {
        Style::Quick => 1.0,
        Style::Human => HUMAN,
    };
    (way + TAKE + put + stow + again) * slower
}

/// Distance on the floor plan from the chair to the target, metres.
fn straight(scene: &Scene, scenario: &Scenario) -> f64 {
    let target = &scenario.target;
    let mut placed = scenario.objects.iter();
    let object = placed.find(|(name, _)| name == target);
    let furniture = scene
        .furniture_named(target)
        .map(|i| scene.furniture[i].pose);
    let at = object.map(|(_, p)| p.pose).or(furniture);
    let start = scenario.start.unwrap_or(scene.start);
    at.map_or(0.0, |at| {
        let between = at.translation.vector - start.translation.vector;
        between.xy().norm()
    })
}
