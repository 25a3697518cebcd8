//! Goal of a task, for clients that execute it.

use wheelarm_proto::furniture::JointMotion;

/// What to do with the target.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// Lift it and hold it.
    Lift,
    /// Put it on a surface and release it there.
    Put {
        /// Furniture with the surface.
        on: String,
    },
    /// Put it into the lap of the person in the chair and release it there.
    Give,
    /// Bring its tip to the mouth of the person in the chair and hold it there.
    Bring,
    /// Pull furniture open.
    Open(JointBounds),
    /// Push furniture closed.
    Close(JointBounds),
}

/// Wanted position of the joint of furniture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointBounds {
    /// Of what slides, metres.
    pub distance: f64,
    /// Of what turns, radians.
    pub angle: f64,
}

impl JointBounds {
    /// The bound of a joint of this motion, metres or radians.
    #[must_use]
    pub fn of(&self, motion: JointMotion) -> f64 {
        match motion {
            JointMotion::Slides => self.distance,
            JointMotion::Turns => self.angle,
        }
    }
}
