//! What a task asks for in one word, for who has to do it.

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
    /// Put it into the lap of who sits in the chair and leave it there.
    Give,
    /// Bring its tip to the mouth of who sits in the chair and hold it there.
    Bring,
    /// Draw furniture out.
    Open {
        /// Wanted joint position, metres.
        travel: f64,
    },
    /// Push furniture in.
    Close {
        /// Wanted joint position, metres.
        position: f64,
    },
}
