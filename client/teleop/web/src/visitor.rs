//! Visitors of the page, and their rights.

/// Role of a visitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// May watch.
    Viewer,
    /// May watch, drive, and keep episodes.
    Operator,
    /// An operator that may also end the server.
    Admin,
}

impl Role {
    /// Name in the page protocol and in the file of users.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Admin => "admin",
        }
    }

    /// Whether this role may drive.
    #[must_use]
    pub fn may_drive(self) -> bool {
        self >= Self::Operator
    }
}

/// A signed-in visitor.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Visitor {
    /// Name; an operator's commands carry it.
    pub name: String,
    /// Role.
    pub role: Role,
}
