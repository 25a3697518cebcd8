//! Why an episode of a policy ends early.

use wheelarm_link::LinkError;
use wheelarm_proto::check::Invalid;

/// Why an episode could not be flown to its end.
#[derive(Debug, thiserror::Error)]
pub enum FlyError {
    /// The connection to the server.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A message is not as the contract says.
    #[error("a message of the server is wrong: {0}")]
    Message(#[from] Invalid),
    /// The policy cannot be shown what it was made for.
    #[error("{0}")]
    Sees(String),
    /// The episode ended under the policy's hands.
    #[error("the episode was ended by somebody else")]
    Ended,
    /// Nothing came for a long time.
    #[error("the server sent nothing for {0:.0} s; it waits for: {1}")]
    Silent(f64, String),
}
