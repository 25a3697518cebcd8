//! Predicates about objects other than the target.

use serde::Deserialize;

use crate::snapshot::Snapshot;
use crate::tasks::condition::{Measure, Memory, Name, Predicate, Threshold};
use crate::tasks::context::Context;
use crate::tasks::failure::Failure;

/// No possible target except the sampled one was ever lifted by `height`. Value: the
/// largest rise of another, metres.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct CorrectInstance {
    /// Metres.
    height: f64,
}

impl Predicate for CorrectInstance {
    fn word(&self) -> &'static str {
        "correct_instance"
    }

    fn names(&self) -> Vec<Name<'_>> {
        Vec::new()
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("height", self.height, "m", 2.0)]
    }

    fn loss(&self) -> Option<Failure> {
        Some(Failure::WrongObject)
    }

    fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        for &other in &context.decoys {
            memory.worst = memory.worst.max(context.rise(other, snapshot));
        }
        Some(Measure {
            value: memory.worst,
            holds: memory.worst < self.height,
        })
    }
}

/// No object but the target has ever leant by more than `tilt_deg` from its start, or
/// fallen by more than `drop`. Value: the largest lean so far, rad (pi for a fall).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct NothingKnockedOver {
    /// Degrees.
    tilt_deg: f64,
    /// Metres.
    drop: f64,
}

impl Predicate for NothingKnockedOver {
    fn word(&self) -> &'static str {
        "nothing_knocked_over"
    }

    fn names(&self) -> Vec<Name<'_>> {
        Vec::new()
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![
            Threshold::new("tilt_deg", self.tilt_deg, "degrees", 180.0),
            Threshold::new("drop", self.drop, "m", 2.0),
        ]
    }

    fn loss(&self) -> Option<Failure> {
        Some(Failure::KnockedOver)
    }

    fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        for (object, state) in snapshot.objects.iter().enumerate() {
            if Some(object) == context.target {
                continue;
            }
            let fell = context.rise(object, snapshot) < -self.drop;
            let lean = if fell {
                std::f64::consts::PI
            } else {
                context.lean(object, state)
            };
            memory.worst = memory.worst.max(lean);
        }
        Some(Measure {
            value: memory.worst,
            holds: memory.worst <= self.tilt_deg.to_radians(),
        })
    }
}
