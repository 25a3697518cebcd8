//! Predicates about the robot.

use serde::Deserialize;

use crate::people::BodyPart;
use crate::snapshot::{BodyRef, Snapshot, Touch};
use crate::tasks::condition::{Measure, Memory, Name, Predicate, Threshold};
use crate::tasks::context::Context;
use crate::tasks::failure::Failure;

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

    fn loss(&self) -> Option<Failure> {
        None
    }

    fn measure(
        &self,
        _context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let root = snapshot.links.first()?;
        // Computed from poses: under a heavy person the engine reports 0.02 rad/s for a
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

/// The robot has never pressed furniture with more than `force`, except wheels on the
/// floor. Value: the largest force so far, N.
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

    fn loss(&self) -> Option<Failure> {
        Some(Failure::HardCollision)
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

/// No part of the person in the chair was ever pressed too hard. All parts and all
/// bodies that touch them count, except the chair's seat, which is fixed to the person.
/// Value: the largest force so far, N.
///
/// | part | touched by | limit |
/// |---|---|---|
/// | face, mouth | anything | `face` |
/// | lap, hands | an object that the robot does not touch | `force`, or `resting` times its weight |
/// | lap, hands | an object that the robot touches | `force`, or its weight |
/// | all others | robot, furniture, floor, object | `force` |
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct ClearOfPerson {
    /// N.
    force: f64,
    /// N.
    face: f64,
    /// Weights of the object.
    resting: f64,
}

impl ClearOfPerson {
    /// Largest allowed force of a contact, N.
    fn limit(&self, touch: &Touch, context: &Context, snapshot: &Snapshot) -> f64 {
        match (touch.part, touch.partner) {
            (BodyPart::Face | BodyPart::Mouth, _) => self.face,
            (BodyPart::Lap | BodyPart::Hands, BodyRef::Object(object)) => {
                let weights = match context.robot_force(object, snapshot) {
                    Some(_) => 1.0,
                    None => self.resting,
                };
                self.force.max(weights * touch.weight)
            }
            _ => self.force,
        }
    }
}

impl Predicate for ClearOfPerson {
    fn word(&self) -> &'static str {
        "clear_of_person"
    }

    fn names(&self) -> Vec<Name<'_>> {
        Vec::new()
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![
            Threshold::new("force", self.force, "N", 1_000.0),
            Threshold::new("face", self.face, "N", 1_000.0),
            Threshold::new("resting", self.resting, "weights of the object", 100.0),
        ]
    }

    fn loss(&self) -> Option<Failure> {
        Some(Failure::PersonForce)
    }

    fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        for touch in snapshot.person.iter().flat_map(|person| &person.touches) {
            memory.worst = memory.worst.max(touch.force);
            memory.exceeded |= touch.force > self.limit(touch, context, snapshot);
        }
        Some(Measure {
            value: memory.worst,
            holds: !memory.exceeded,
        })
    }
}
