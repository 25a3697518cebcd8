//! Causes for which a task fails.

use serde::{Deserialize, Serialize};

/// Why it failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Failure {
    /// The target fell, from the gripper or from where it stood.
    Dropped,
    /// The target lies where it stood.
    Tipped,
    /// The time is over.
    Timeout,
    /// The target rests where no arm gets it.
    Unreachable,
    /// The robot hit furniture much too hard.
    HardCollision,
    /// The simulation lost the target or its state is not finite.
    Lost,
    /// The state of the simulation broke: nothing of the end can be believed.
    Physics,
    /// The person in the chair was pressed harder than the task allows.
    PersonForce,
    /// An object that was not asked for was lifted.
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
