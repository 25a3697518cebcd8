//! Predicates about sliding furniture.

use serde::{Deserialize, Deserializer};

use crate::snapshot::Snapshot;
use crate::tasks::condition::{Measure, Memory, Name, Predicate, Threshold};
use crate::tasks::context::Context;
use crate::tasks::failure::Failure;

/// The joint of furniture is open by at least, or at most, `bound`. Value: its
/// position, metres.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::tasks) struct Opening {
    side: Side,
    joint: String,
    /// Metres.
    bound: f64,
}

/// Side of the bound.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    /// `opened_by`.
    AtLeast,
    /// `closed_to`.
    AtMost,
}

/// Reads `opened_by = { joint, travel }`.
pub(super) fn opened_by<'de, D: Deserializer<'de>>(from: D) -> Result<Opening, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Written {
        joint: String,
        travel: f64,
    }
    Written::deserialize(from).map(|written| Opening {
        side: Side::AtLeast,
        joint: written.joint,
        bound: written.travel,
    })
}

/// Reads `closed_to = { joint, position }`.
pub(super) fn closed_to<'de, D: Deserializer<'de>>(from: D) -> Result<Opening, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Written {
        joint: String,
        position: f64,
    }
    Written::deserialize(from).map(|written| Opening {
        side: Side::AtMost,
        joint: written.joint,
        bound: written.position,
    })
}

impl Predicate for Opening {
    fn word(&self) -> &'static str {
        match self.side {
            Side::AtLeast => "opened_by",
            Side::AtMost => "closed_to",
        }
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Joint(&self.joint)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        let key = match self.side {
            Side::AtLeast => "travel",
            Side::AtMost => "position",
        };
        vec![Threshold::new(key, self.bound, "m", 2.0)]
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
        let position = context.joint_position(&self.joint, snapshot);
        Some(Measure {
            value: position,
            holds: match self.side {
                Side::AtLeast => position >= self.bound,
                Side::AtMost => position <= self.bound,
            },
        })
    }
}
