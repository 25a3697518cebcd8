//! Predicates about furniture on a joint.

use serde::{Deserialize, Deserializer};

use crate::snapshot::Snapshot;
use crate::tasks::condition::{Measure, Memory, Name, Predicate, Threshold};
use crate::tasks::context::Context;
use crate::tasks::failure::Failure;
use crate::tasks::goal::JointBounds;

/// The joint of furniture is open by at least, or at most, a bound. Value: its
/// position, metres or radians.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::tasks) struct Opening {
    side: Side,
    joint: String,
    bounds: JointBounds,
    /// The angle as written, degrees.
    angle_deg: f64,
}

/// Side of the bound.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    /// `opened_by`.
    AtLeast,
    /// `closed_to`.
    AtMost,
}

/// Angles of a template that gives none, degrees: recordings carry such templates.
const OPEN_DEG: f64 = 45.0;
const CLOSED_DEG: f64 = 3.0;

/// Reads `opened_by = { joint, travel, angle_deg }`.
pub(super) fn opened_by<'de, D: Deserializer<'de>>(from: D) -> Result<Opening, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Written {
        joint: String,
        travel: f64,
        angle_deg: Option<f64>,
    }
    let written = Written::deserialize(from)?;
    let angle_deg = written.angle_deg.unwrap_or(OPEN_DEG);
    Ok(Opening::new(
        Side::AtLeast,
        written.joint,
        written.travel,
        angle_deg,
    ))
}

/// Reads `closed_to = { joint, position, angle_deg }`.
pub(super) fn closed_to<'de, D: Deserializer<'de>>(from: D) -> Result<Opening, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Written {
        joint: String,
        position: f64,
        angle_deg: Option<f64>,
    }
    let written = Written::deserialize(from)?;
    let angle_deg = written.angle_deg.unwrap_or(CLOSED_DEG);
    Ok(Opening::new(
        Side::AtMost,
        written.joint,
        written.position,
        angle_deg,
    ))
}

impl Opening {
    fn new(side: Side, joint: String, distance: f64, angle_deg: f64) -> Self {
        let angle = angle_deg.to_radians();
        Self {
            side,
            joint,
            bounds: JointBounds { distance, angle },
            angle_deg,
        }
    }

    /// Where the joint must be.
    pub(in crate::tasks) fn bounds(&self) -> JointBounds {
        self.bounds
    }
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
        vec![
            Threshold::new(key, self.bounds.distance, "m", 2.0),
            Threshold::new("angle_deg", self.angle_deg, "degrees", 175.0),
        ]
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
        let (motion, position) = context.joint_position(&self.joint, snapshot);
        let bound = self.bounds.of(motion);
        Some(Measure {
            value: position,
            holds: match self.side {
                Side::AtLeast => position >= bound,
                Side::AtMost => position <= bound,
            },
        })
    }
}
