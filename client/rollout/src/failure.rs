//! Failures of an episode other than of its task.

use serde::{Deserialize, Serialize};
use wheelarm_proto::v1;

/// The part of an episode that failed. Result files store the first five.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FailureCause {
    /// The state of the simulation diverged; the server still answers.
    Physics,
    /// The server or the worker died, or hung and was killed.
    Server,
    /// The server rejects the scenario.
    Scenario,
    /// The expert panicked, or did not return after its server was killed.
    Operator,
    /// The policy died, timed out, or answered rows that cannot be executed.
    Policy,
    /// Simulated time stopped although the server answered, or a request timed out.
    Stall,
    /// Another program sent SIGKILL to the server or the worker, usually because memory
    /// ran out.
    Killed,
    /// The caller cancelled the episode.
    Cancelled,
}

impl FailureCause {
    /// The cause as result files store it: a server that was killed or did not advance
    /// counts as a server failure.
    #[must_use]
    pub fn stored(self) -> Self {
        match self {
            Self::Stall | Self::Killed | Self::Cancelled => Self::Server,
            cause => cause,
        }
    }

    /// The cause in two words, for tables and lists.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self.stored() {
            Self::Physics => "physics broke",
            Self::Scenario => "scenario refused",
            Self::Operator => "operator broke",
            Self::Policy => "policy broke",
            _ => "server broke",
        }
    }
}

/// An episode that failed before its driver finished.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{reason}")]
pub struct Failure {
    /// The part that failed.
    pub cause: FailureCause,
    /// Reason, as text.
    pub reason: String,
    /// Simulated seconds before the failure.
    pub seconds: f64,
    /// The scenario with its sampled values; absent when the server did not report it.
    pub scenario: Option<Box<v1::Scenario>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn result_files_keep_their_five_words() {
        use FailureCause::{Cancelled, Killed, Operator, Physics, Policy, Scenario, Server, Stall};
        for (cause, word) in [
            (Physics, "physics"),
            (Server, "server"),
            (Scenario, "scenario"),
            (Operator, "operator"),
            (Policy, "policy"),
            (Stall, "server"),
            (Killed, "server"),
            (Cancelled, "server"),
        ] {
            let text = serde_json::to_string(&cause.stored()).unwrap();
            assert_eq!(text, format!("{word:?}"));
            assert_eq!(
                serde_json::from_str::<FailureCause>(&text).ok(),
                Some(cause.stored())
            );
        }
    }
}
