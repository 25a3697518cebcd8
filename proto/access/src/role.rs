//! Roles of users.

use serde::{Deserialize, Serialize};

/// Rights of a user, from least to most. A recorder may not command and an operator may
/// not record; an admin may do both.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Watches: state streams, previews, status.
    Viewer,
    /// Commands the robot, starts and ends episodes; watches.
    Operator,
    /// Records everything that is published; watches.
    Recorder,
    /// Everything except acting as the server itself.
    Admin,
}

impl Role {
    /// All roles.
    pub const ALL: [Self; 4] = [Self::Viewer, Self::Operator, Self::Recorder, Self::Admin];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Recorder => "recorder",
            Self::Admin => "admin",
        }
    }

    /// The role with a name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.name() == name)
    }

    /// Whether it may command a robot.
    #[must_use]
    pub fn commands(self) -> bool {
        matches!(self, Self::Operator | Self::Admin)
    }
}

impl std::fmt::Display for Role {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
