//! Why a request is not carried out: a code for programs, words for people.

use wheelarm_proto::check::Invalid;
use wheelarm_proto::v1::FailureCode;

/// Why a request is not carried out.
#[derive(Clone, Debug, PartialEq)]
pub struct Denied {
    /// For programs.
    pub code: FailureCode,
    /// What is wrong and the cure.
    pub words: String,
}

impl Denied {
    /// With a code.
    pub fn new(code: FailureCode, words: impl Into<String>) -> Self {
        let words = words.into();
        Self { code, words }
    }

    /// The server's own fault.
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        Self::new(FailureCode::Internal, cause.to_string())
    }

    /// Of a scenario that cannot be simulated.
    pub fn scenario(cause: impl std::fmt::Display) -> Self {
        Self::new(FailureCode::Scenario, cause.to_string())
    }
}

impl From<Invalid> for Denied {
    fn from(invalid: Invalid) -> Self {
        Self::new(FailureCode::Invalid, invalid.to_string())
    }
}
