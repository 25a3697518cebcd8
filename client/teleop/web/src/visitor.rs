//! Who looks at the page, and what they may do.

/// What somebody may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Looks.
    Viewer,
    /// Looks, drives, and keeps episodes.
    Operator,
    /// An operator that may also end the server.
    Admin,
}

impl Role {
    /// As pages and users know it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Admin => "admin",
        }
    }

    /// Whether it may drive.
    #[must_use]
    pub fn may_drive(self) -> bool {
        self >= Self::Operator
    }
}

/// Somebody who has signed in.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Visitor {
    /// Name; an operator's commands carry it.
    pub name: String,
    /// What they may do.
    pub role: Role,
}
