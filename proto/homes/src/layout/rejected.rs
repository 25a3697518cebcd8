//! Why a layout is not kept.

/// A rejected layout. Another `layout_seed` may give one that is kept.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Rejected {
    /// The rooms do not fit beside each other.
    #[error("no place for the room {room}")]
    Rooms {
        /// Name of the room.
        room: String,
    },
    /// Furniture has no place.
    #[error("no place for {piece} in {room}")]
    Furniture {
        /// Name of the room.
        room: String,
        /// Kind of the piece.
        piece: String,
    },
    /// The chair starts nowhere.
    #[error("no free floor where the chair starts")]
    Start,
    /// The chair does not get into all rooms.
    #[error("the chair does not enter {rooms}")]
    NotEntered {
        /// Names of the rooms.
        rooms: String,
    },
    /// The arm reaches too few surfaces.
    #[error("{reached} of {surfaces} surfaces reached; not: {missed}")]
    NotReached {
        /// Reached surfaces.
        reached: usize,
        /// All surfaces.
        surfaces: usize,
        /// Names of the others.
        missed: String,
    },
}

impl Rejected {
    /// The reason in one word, for tables.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Rooms { .. } => "rooms",
            Self::Furniture { .. } => "furniture",
            Self::Start => "start",
            Self::NotEntered { .. } => "not_entered",
            Self::NotReached { .. } => "not_reached",
        }
    }
}
