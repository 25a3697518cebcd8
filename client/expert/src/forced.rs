//! Errors that the operator makes on purpose, so that their correction is recorded.

use serde::{Deserialize, Serialize};
use wheelarm_proto::settings::Named;
use wheelarm_proto::v1::Incident;

/// An error that is made once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ForcedError {
    /// The first grasp closes beside the object.
    WrongGrasp,
    /// Another object is grasped first, and released.
    WrongObject,
    /// The object is dropped as soon as it is off the ground, and grasped again.
    Drop,
}

impl Named for ForcedError {
    const WHAT: &'static str = "forced error";
    const ALL: &'static [Self] = &[Self::WrongGrasp, Self::WrongObject, Self::Drop];

    fn name(self) -> &'static str {
        match self {
            Self::WrongGrasp => "wrong-grasp",
            Self::WrongObject => "wrong-object",
            Self::Drop => "drop",
        }
    }
}

impl ForcedError {
    /// Its code in recordings.
    #[must_use]
    pub fn incident(self) -> Incident {
        match self {
            Self::WrongGrasp => Incident::ForcedWrongGrasp,
            Self::WrongObject => Incident::ForcedWrongObject,
            Self::Drop => Incident::ForcedDrop,
        }
    }
}
