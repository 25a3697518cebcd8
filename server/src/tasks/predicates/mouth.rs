//! Predicates about bringing an object to the mouth: position of its tip, spilling, and
//! force on the face.

use serde::Deserialize;

use crate::people::BodyPart;
use crate::snapshot::{PersonState, Snapshot};
use crate::tasks::condition::{Measure, Memory, Name, Predicate, Threshold};
use crate::tasks::context::Context;
use crate::tasks::failure::Failure;

/// For `secs` the object's tip is within `distance` of the middle of the lips, and it
/// leans by at most `tilt_deg` from its start. No contact presses the face with more
/// than `force`. Value: the distance, metres.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct AtMouth {
    object: String,
    /// Metres.
    distance: f64,
    /// Degrees.
    tilt_deg: f64,
    /// N.
    force: f64,
    /// s.
    secs: f64,
}

impl Predicate for AtMouth {
    fn word(&self) -> &'static str {
        "at_mouth"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Object(&self.object)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![
            Threshold::new("distance", self.distance, "m", 0.5),
            Threshold::new("tilt_deg", self.tilt_deg, "degrees", 180.0),
            Threshold::new("force", self.force, "N", 1_000.0),
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
        let (object, state) = context.object_in(&self.object, snapshot)?;
        let distance = context.tip_to_mouth(object, state, snapshot)?;
        let lean = context.lean(object, state);
        let now = distance <= self.distance
            && lean <= self.tilt_deg.to_radians()
            && face_force(snapshot) <= self.force;
        Some(Measure {
            value: distance,
            holds: memory.lasted(now, snapshot.tick, self.secs),
        })
    }
}

/// No contact has ever pressed head, face and mouth with more than `force`. Value: the
/// largest force so far, N.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct GentleOnFace {
    /// N.
    force: f64,
}

impl Predicate for GentleOnFace {
    fn word(&self) -> &'static str {
        "gentle_on_face"
    }

    fn names(&self) -> Vec<Name<'_>> {
        Vec::new()
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("force", self.force, "N", 1_000.0)]
    }

    fn loss(&self) -> Option<Failure> {
        Some(Failure::PersonForce)
    }

    fn measure(
        &self,
        _context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        memory.worst = memory.worst.max(face_force(snapshot));
        Some(Measure {
            value: memory.worst,
            holds: memory.worst <= self.force,
        })
    }
}

/// The object has never leant by more than `tilt_deg` from its start, so nothing is
/// spilt. Value: the largest lean so far, rad.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::tasks) struct KeptLevel {
    object: String,
    /// Degrees.
    tilt_deg: f64,
}

impl Predicate for KeptLevel {
    fn word(&self) -> &'static str {
        "kept_level"
    }

    fn names(&self) -> Vec<Name<'_>> {
        vec![Name::Object(&self.object)]
    }

    fn thresholds(&self) -> Vec<Threshold> {
        vec![Threshold::new("tilt_deg", self.tilt_deg, "degrees", 180.0)]
    }

    fn loss(&self) -> Option<Failure> {
        Some(Failure::Tilted)
    }

    fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let (object, state) = context.object_in(&self.object, snapshot)?;
        memory.worst = memory.worst.max(context.lean(object, state));
        Some(Measure {
            value: memory.worst,
            holds: memory.worst <= self.tilt_deg.to_radians(),
        })
    }
}

/// Force on the face and the rest of the head, N; the mouth is part of the face.
fn face_force(snapshot: &Snapshot) -> f64 {
    let force = |person: &PersonState| {
        let of = |part: BodyPart| person.forces[part.index()];
        of(BodyPart::Head).max(of(BodyPart::Face))
    };
    snapshot.person.as_ref().map_or(0.0, force)
}
