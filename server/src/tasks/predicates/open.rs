//! Furniture that slides.

use serde::Deserialize;

use crate::snapshot::Snapshot;
use crate::tasks::condition::{Measure, Memory, Name, Predicate, Threshold};
use crate::tasks::context::Context;

/// The joint of furniture is open by at least `travel`. Value: its position,
/// metres.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct OpenedBy {
    joint: String,
    /// Metres.
    travel: f64,
}

impl Predicate for OpenedBy {
    fn word(&self) -> &'static str {
        "opened_by"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Joint(&self.joint)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("travel", self.travel, "m", 2.0)]
    }

    fn measure(
        &self,
        context: &Context,
        _memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let position = context.joint_position(&self.joint, snapshot);
        Some(Measure {
            value: position,
            holds: position >= self.travel,
        })
    }
}

/// The joint of furniture is open by at most `position`. Value: its position,
/// metres.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct ClosedTo {
    joint: String,
    /// Metres.
    position: f64,
}

impl Predicate for ClosedTo {
    fn word(&self) -> &'static str {
        "closed_to"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Joint(&self.joint)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("position", self.position, "m", 2.0)]
    }

    fn measure(
        &self,
        context: &Context,
        _memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let position = context.joint_position(&self.joint, snapshot);
        Some(Measure {
            value: position,
            holds: position <= self.position,
        })
    }
}
