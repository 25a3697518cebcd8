//! What a task asks for in one word, for who has to do it.

use super::predicate::Predicate;
use super::spec::TaskSpec;

/// What is to be done with the target.
#[derive(Clone, Debug, PartialEq)]
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

impl TaskSpec {
    /// What the required conditions amount to.
    #[must_use]
    pub fn goal(&self) -> Goal {
        let mut required = self.conditions.iter().filter(|c| c.required);
        required
            .find_map(|condition| match &condition.predicate {
                Predicate::Inside { on, .. } => Some(Goal::Put { on: on.clone() }),
                Predicate::OpenedBy { joint, travel } => Some(Goal::Open {
                    joint: joint.clone(),
                    travel: *travel,
                }),
                _ => None,
            })
            .unwrap_or(Goal::Lift)
    }
}
