//! Goal of a task, for clients that execute it.

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
    Open {
        /// Wanted joint position, metres.
        travel: f64,
    },
    /// Push furniture closed.
    Close {
        /// Wanted joint position, metres.
        position: f64,
    },
}
