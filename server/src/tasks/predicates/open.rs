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
        let joint = context.joints.iter().position(|name| *name == self.joint);
        let state = joint.and_then(|joint| snapshot.furniture_joints.get(joint));
        let position = state.map_or(0.0, |state| state.position);
        Some(Measure {
            value: position,
            holds: position >= self.travel,
        })
    }
}
