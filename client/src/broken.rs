//! What broke an episode, where it was not the task that failed: the same codes
//! in the results of `evaluate` and in the journals of `collect`.

use serde::{Deserialize, Serialize};

/// What broke an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Broken {
    /// The state of the simulation broke; the server lives.
    Physics,
    /// The server died, or hung and was ended.
    Server,
    /// No server sets the scenario up.
    Scenario,
    /// The operator panicked or stalled; the server was well.
    Operator,
    /// The policy died, fell silent or answered what cannot be carried out.
    Policy,
}

impl Broken {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Physics => "physics broke",
            Self::Server => "server broke",
            Self::Scenario => "scenario refused",
            Self::Operator => "operator broke",
            Self::Policy => "policy broke",
        }
    }
}
