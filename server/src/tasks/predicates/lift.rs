//! Predicates about lifting in the gripper.

use serde::Deserialize;

use crate::snapshot::Snapshot;
use crate::tasks::condition::{Measure, Memory, Name, Predicate, Threshold};
use crate::tasks::context::Context;
use crate::tasks::failure::Failure;

/// The object's lowest point is `height` above where it started, and both pads
/// press it with at least `pad_force`, for `secs`. Value: the rise, metres.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct LiftedAndHeld {
    object: String,
    /// Metres.
    height: f64,
    /// N.
    pad_force: f64,
    /// s.
    secs: f64,
}

impl Predicate for LiftedAndHeld {
    fn word(&self) -> &'static str {
        "lifted_and_held"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Object(&self.object)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![
            Threshold::new("height", self.height, "m", 2.0),
            Threshold::new("pad_force", self.pad_force, "N", 1000.0),
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
        let (object, _) = context.object_in(&self.object, snapshot)?;
        let rise = context.rise(object, snapshot);
        let now = rise >= self.height && context.is_held(object, self.pad_force, snapshot);
        Some(Measure {
            value: rise,
            holds: memory.lasted(now, snapshot.tick, self.secs),
        })
    }
}

/// The object has once been lifted by `height` while both pads pressed it with at least
/// `pad_force`. Value: the largest rise while pressed, metres.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct LiftedBefore {
    object: String,
    /// Metres.
    height: f64,
    /// N.
    pad_force: f64,
}

impl Predicate for LiftedBefore {
    fn word(&self) -> &'static str {
        "lifted_before"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Object(&self.object)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![
            Threshold::new("height", self.height, "m", 2.0),
            Threshold::new("pad_force", self.pad_force, "N", 1000.0),
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
        let (object, _) = context.object_in(&self.object, snapshot)?;
        if context.is_held(object, self.pad_force, snapshot) {
            memory.worst = memory.worst.max(context.rise(object, snapshot));
        }
        Some(Measure {
            value: memory.worst,
            holds: memory.worst >= self.height,
        })
    }
}
