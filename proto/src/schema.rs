//! The schema in the encoding of every sample, request and reply: message type and
//! contract version.

use crate::CONTRACT_VERSION;

/// Media type before the schema.
pub const MEDIA_TYPE: &str = "application/protobuf";

/// Schema of a message, for example `wheelarm.v1.Clock@2`.
#[must_use]
pub fn schema_name(message: &str) -> String {
    format!("{message}@{CONTRACT_VERSION}")
}

/// The whole encoding of a message.
#[must_use]
pub fn encoding(message: &str) -> String {
    format!("{MEDIA_TYPE};{}", schema_name(message))
}

/// The contract version in an encoding; the first version sent none.
#[must_use]
pub fn version_of(encoding: &str) -> u32 {
    let version = encoding.strip_prefix(MEDIA_TYPE);
    let version = version.and_then(|schema| schema.rsplit_once('@'));
    version
        .and_then(|(_, version)| version.parse().ok())
        .unwrap_or(1)
}

/// The peer uses another version of the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the peer uses version {theirs} of the contract, this program version \
     {CONTRACT_VERSION}: use server and clients of one build (`wheelarm --version` and \
     `wheelarm-server --version` print it; messages have the encoding \
     `application/protobuf;MESSAGE@{CONTRACT_VERSION}`)"
)]
pub struct OtherVersion {
    /// Its version.
    pub theirs: u32,
}

/// Checks the version of an encoding.
///
/// # Errors
/// [`OtherVersion`].
pub fn check(encoding: &str) -> Result<(), OtherVersion> {
    match version_of(encoding) {
        CONTRACT_VERSION => Ok(()),
        theirs => Err(OtherVersion { theirs }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_parsed_and_default_to_the_first() {
        let own = encoding("wheelarm.v1.Clock");
        assert_eq!(
            own,
            format!("application/protobuf;wheelarm.v1.Clock@{CONTRACT_VERSION}")
        );
        assert_eq!(check(&own), Ok(()));
        for (other, theirs) in [
            ("zenoh/bytes", 1),
            ("application/protobuf", 1),
            ("application/protobuf;wheelarm.v1.Clock", 1),
            ("application/protobuf;wheelarm.v1.Clock@7", 7),
        ] {
            assert_eq!(check(other), Err(OtherVersion { theirs }), "{other}");
        }
        let message = OtherVersion { theirs: 1 }.to_string();
        assert!(message.contains("one build"), "{message}");
    }
}
