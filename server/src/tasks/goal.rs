//! What a task asks for in one word, for who has to do it.

use serde::Deserialize;

/// What is to be done with the target, as the task file says it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Goal {
    /// Lift it and hold it.
    Lift,
    /// Put it on a surface and leave it there.
    Put {
        /// Furniture with the surface.
        on: String,
    },
    /// Move a joint of furniture.
    Open {
        /// The joint.
        joint: String,
        /// Wanted position, metres.
        travel: f64,
    },
}
