//! What the robot itself does.

use serde::Deserialize;

use crate::snapshot::Snapshot;
use crate::tasks::condition::{Measure, Memory, Name, Predicate, Threshold};
use crate::tasks::context::Context;

/// The chair moves slower than `speed` and turns slower than `turn_rate_deg_s`.
/// Value: its speed, m/s.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct ChairStopped {
    /// m/s.
    speed: f64,
    /// Degrees/s.
    turn_rate_deg_s: f64,
}

impl Predicate for ChairStopped {
    fn word(&self) -> &'static str {
        "chair_stopped"
    }

    fn names(&self) -> Vec<Name<'_>> {
        Vec::new()
    }

    fn thresholds(&self) -> Vec<Threshold> {
        let turn_rate = self.turn_rate_deg_s;
        vec![
            Threshold::new("speed", self.speed, "m/s", 1.0),
            Threshold::new("turn_rate_deg_s", turn_rate, "degrees/s", 60.0),
        ]
    }

    fn measure(
        &self,
        _context: &Context,
        _memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let root = snapshot.links.first();
        let moving = root.map_or(0.0, |link| link.linear.norm());
        let turning = root.map_or(0.0, |link| link.angular.norm());
        Some(Measure {
            value: moving,
            holds: moving <= self.speed && turning <= self.turn_rate_deg_s.to_radians(),
        })
    }
}

/// The robot has never pressed furniture with more than `force`, wheels on the
/// floor excepted. Value: the greatest force so far, N.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct NoHardCollision {
    /// N.
    force: f64,
}

impl Predicate for NoHardCollision {
    fn word(&self) -> &'static str {
        "no_hard_collision"
    }

    fn names(&self) -> Vec<Name<'_>> {
        Vec::new()
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("force", self.force, "N", 10_000.0)]
    }

    fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        memory.worst = memory.worst.max(context.collision_force(snapshot));
        Some(Measure {
            value: memory.worst,
            holds: memory.worst <= self.force,
        })
    }
}
