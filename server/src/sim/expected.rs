//! Expected duration of a task for the scripted operator, for time limits: driving
//! along the planned path, arm work, and style.

use wheelarm_proto::settings::Style;

use super::scenario::Scenario;
use crate::robot::RobotModel;
use crate::scene::Scene;
use crate::tasks::{Floor, Goal, TaskSpec, Variant};

/// A time limit is the expected time multiplied by this.
pub(super) const ROOM: f64 = 3.0;
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

/// Simulated seconds.
pub(super) fn seconds(
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
