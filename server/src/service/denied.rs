//! Why a request is rejected: a code for programs and a text for people.

use wheelarm_proto::check::Invalid;
use wheelarm_proto::v1::FailureCode;

/// Why a request is rejected.
#[derive(Clone, Debug, PartialEq)]
pub struct Denied {
    /// Machine-readable code.
    pub code: FailureCode,
    /// What is wrong and how to fix it.
    pub words: String,
}

impl Denied {
    /// With a code.
    pub fn new(code: FailureCode, words: impl Into<String>) -> Self {
        let words = words.into();
        Self { code, words }
    }

    /// An internal error of the server.
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        Self::new(FailureCode::Internal, cause.to_string())
    }

    /// A scenario that cannot be simulated.
    pub fn scenario(cause: impl std::fmt::Display) -> Self {
        Self::new(FailureCode::Scenario, cause.to_string())
    }
}

impl From<Invalid> for Denied {
    fn from(invalid: Invalid) -> Self {
        Self::new(FailureCode::Invalid, invalid.to_string())
    }
}
