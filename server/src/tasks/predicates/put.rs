//! Predicates about the position, pose and release of an object.

use serde::Deserialize;

use crate::snapshot::Snapshot;
use crate::tasks::condition::{Measure, Memory, Name, Predicate, Threshold};
use crate::tasks::context::Context;
use crate::tasks::failure::Failure;

/// The object's centre of mass is above the first surface of furniture `on`,
/// and its lowest point within `above` of it. Value: the distance of the centre
/// of mass from the middle of the surface on the floor plan, metres.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct Inside {
    object: String,
    on: String,
    /// Metres.
    above: f64,
}

impl Predicate for Inside {
    fn word(&self) -> &'static str {
        "inside"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Object(&self.object), Name::Surface(&self.on)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("above", self.above, "m", 1.0)]
    }

    fn loss(&self) -> Option<Failure> {
        None
    }

    fn measure(
        &self,
        context: &Context,
        _memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let (object, state) = context.object_in(&self.object, snapshot)?;
        let (value, holds) = context.inside(object, state, &self.on, self.above)?;
        Some(Measure { value, holds })
    }
}

/// The object's centre of mass is above the lap of the person in the chair, and its
/// lowest point within `above` of it. Value: the distance of the centre of mass from
/// the middle of the lap on the floor plan, metres.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct InLap {
    object: String,
    /// Metres.
    above: f64,
}

impl Predicate for InLap {
    fn word(&self) -> &'static str {
        "in_lap"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Object(&self.object)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("above", self.above, "m", 1.0)]
    }

    fn loss(&self) -> Option<Failure> {
        None
    }

    fn measure(
        &self,
        context: &Context,
        _memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let (object, state) = context.object_in(&self.object, snapshot)?;
        let (value, holds) = context.in_lap(object, state, self.above, snapshot)?;
        Some(Measure { value, holds })
    }
}

/// The object leans by at most `tilt_deg` from its start. Value: the lean, rad.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct Upright {
    object: String,
    /// Degrees.
    tilt_deg: f64,
}

impl Predicate for Upright {
    fn word(&self) -> &'static str {
        "upright"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Object(&self.object)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("tilt_deg", self.tilt_deg, "degrees", 180.0)]
    }

    fn loss(&self) -> Option<Failure> {
        None
    }

    fn measure(
        &self,
        context: &Context,
        _memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let (object, state) = context.object_in(&self.object, snapshot)?;
        let lean = context.lean(object, state);
        Some(Measure {
            value: lean,
            holds: lean <= self.tilt_deg.to_radians(),
        })
    }
}

/// The object moves slower than `speed` and turns slower than `turn_rate_deg_s`,
/// for `secs`. Value: its speed, m/s.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct AtRest {
    object: String,
    /// m/s.
    speed: f64,
    /// Degrees/s.
    turn_rate_deg_s: f64,
    /// s.
    secs: f64,
}

impl Predicate for AtRest {
    fn word(&self) -> &'static str {
        "at_rest"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Object(&self.object)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        let turn_rate = self.turn_rate_deg_s;
        vec![
            Threshold::new("speed", self.speed, "m/s", 1.0),
            Threshold::new("turn_rate_deg_s", turn_rate, "degrees/s", 500.0),
            Threshold::new("secs", self.secs, "s", 60.0),
        ]
    }

    fn loss(&self) -> Option<Failure> {
        None
    }

    fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let (_, state) = context.object_in(&self.object, snapshot)?;
        let moving = state.linear.norm();
        let turning = state.angular.norm();
        let now = moving <= self.speed && turning <= self.turn_rate_deg_s.to_radians();
        Some(Measure {
            value: moving,
            holds: memory.lasted(now, snapshot.tick, self.secs),
        })
    }
}

/// No part of the robot touches the object, for `secs`. Value: the force of the
/// robot on it, N.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct Released {
    object: String,
    /// s.
    secs: f64,
}

impl Predicate for Released {
    fn word(&self) -> &'static str {
        "released"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Object(&self.object)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("secs", self.secs, "s", 60.0)]
    }

    fn loss(&self) -> Option<Failure> {
        None
    }

    fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let (object, _) = context.object_in(&self.object, snapshot)?;
        let force = context.robot_force(object, snapshot);
        Some(Measure {
            value: force.unwrap_or(0.0),
            holds: memory.lasted(force.is_none(), snapshot.tick, self.secs),
        })
    }
}
