//! How long the scripted operator is expected to take, for time limits.
//!
//! A straight line over the operator's means (`client/guide/recover.md`): a part for
//! the work of the arm and a part for the way of the chair.

use wheelarm_proto::settings::Style;

use super::Scenario;
use crate::scene::Scene;
use crate::tasks::{Goal, TaskSpec};

/// A time limit is the expected time times this.
pub(super) const ROOM: f64 = 3.0;
/// Arm work of taking something, s.
const TAKE: f64 = 16.0;
/// More of it where the thing is put somewhere else, s.
const PUT: f64 = 12.0;
/// Seconds per metre of straight line from the chair to the thing.
const WAY: f64 = 3.5;
/// The human-like style takes longer by this.
const HUMAN: f64 = 8.0;

/// Simulated seconds.
pub(super) fn seconds(task: &TaskSpec, scene: &Scene, scenario: &Scenario) -> f64 {
    let target = &scenario.target;
    let mut placed = scenario.objects.iter();
    let object = placed.find(|(name, _)| name == target);
    let furniture = scene.furniture_named(target).map(|i| scene.furniture[i].pose);
    let at = object.map(|(_, p)| p.pose).or(furniture);
    let start = scenario.start.unwrap_or(scene.start);
    let way = at.map_or(0.0, |at| {
        let between = at.translation.vector - start.translation.vector;
        between.xy().norm()
    });
    let arm = match task.goal {
        Goal::Put { .. } => TAKE + PUT,
        Goal::Lift | Goal::Open { .. } | Goal::Close { .. } => TAKE,
    };
    let slower = match scenario.style {
        Style::Quick => 1.0,
        Style::Human => HUMAN,
    };
    (arm + WAY * way) * slower
}
