//! What the robot itself does.

use serde::Deserialize;

use crate::people::BodyPart;
use crate::snapshot::{PersonState, Snapshot};
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
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let root = snapshot.links.first()?;
        // By its way: under a heavy person the engine tells a speed of 0.02 rad/s of a
        // chair that does not move.
        let [moving, turning] = memory
            .rates(snapshot.tick, &root.pose)
            .unwrap_or([root.linear.norm(), root.angular.norm()]);
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

/// Nothing has ever pressed the person in the chair with more than `force`: the robot
/// anywhere, whatever it is on head, torso and arms. Things may lie in lap and hands.
/// Value: the greatest force so far, N.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct ClearOfPerson {
    /// N.
    force: f64,
}

/// Parts on which nothing is to lie.
const BARE: [BodyPart; 4] = [
    BodyPart::Head,
    BodyPart::Face,
    BodyPart::Torso,
    BodyPart::Arms,
];

impl Predicate for ClearOfPerson {
    fn word(&self) -> &'static str {
        "clear_of_person"
    }

    fn names(&self) -> Vec<Name<'_>> {
        Vec::new()
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("force", self.force, "N", 1_000.0)]
    }

    fn measure(
        &self,
        _context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let force = |person: &PersonState| {
            let bare = BARE.map(|part| person.forces[part.index()]);
            bare.into_iter().fold(person.robot_force, f64::max)
        };
        let now = snapshot.person.as_ref().map_or(0.0, force);
        memory.worst = memory.worst.max(now);
        Some(Measure {
            value: memory.worst,
            holds: memory.worst <= self.force,
        })
    }
}
