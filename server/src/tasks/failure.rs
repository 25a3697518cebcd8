//! Causes of failure.

use serde::{Deserialize, Serialize};

/// Cause of failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Failure {
    /// The target fell, from the gripper or from its support.
    Dropped,
    /// The target tipped over.
    Tipped,
    /// The time limit has passed.
    Timeout,
    /// The target is at rest out of the arm's reach.
    Unreachable,
    /// The robot hit furniture much too hard.
    HardCollision,
    /// The simulation lost the target or its state is not finite.
    Lost,
    /// The state of the simulation broke: the result is void.
    Physics,
    /// A force on the person exceeded the task's limit.
    PersonForce,
    /// An object other than the target was lifted.
    WrongObject,
    /// Another object fell or leaned further than the task allows.
    KnockedOver,
    /// The target leaned further than the task allows.
    Tilted,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Dropped => "dropped",
            Self::Tipped => "tipped",
            Self::Timeout => "timeout",
            Self::Unreachable => "unreachable",
            Self::HardCollision => "hard collision",
            Self::Lost => "lost",
            Self::Physics => "physics",
            Self::PersonForce => "pressed the person",
            Self::WrongObject => "wrong object",
            Self::KnockedOver => "knocked over",
            Self::Tilted => "tilted",
        })
    }
}
