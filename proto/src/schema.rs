//! The schema that stands in the encoding of every sample, request and reply:
//! which message it is, and of which version of the contract.

use crate::CONTRACT_VERSION;

/// What stands before the schema.
pub const MEDIA_TYPE: &str = "application/protobuf";

/// Schema of a message, for example `wheelarm.v1.Clock@2`.
#[must_use]
pub fn of(message: &str) -> String {
    format!("{message}@{CONTRACT_VERSION}")
}

/// The whole encoding of a message.
#[must_use]
pub fn encoding(message: &str) -> String {
    format!("{MEDIA_TYPE};{}", of(message))
}

/// The contract version that an encoding tells; the first version told none.
#[must_use]
pub fn version_of(encoding: &str) -> u32 {
    let told = encoding.strip_prefix(MEDIA_TYPE);
    let told = told.and_then(|schema| schema.rsplit_once('@'));
    told.and_then(|(_, version)| version.parse().ok())
        .unwrap_or(1)
}

/// The other side speaks another version of the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the other side speaks version {theirs} of the contract, this program version \
     {CONTRACT_VERSION}: use server and clients of one build (`wheelarm --version` and \
     `wheelarm-server --version` tell it; messages carry the encoding \
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
    fn a_version_is_read_as_it_is_told_and_none_is_the_first() {
        let own = encoding("wheelarm.v1.Clock");
        assert_eq!(own, "application/protobuf;wheelarm.v1.Clock@2");
        assert_eq!(check(&own), Ok(()));
        for (other, theirs) in [
            ("zenoh/bytes", 1),
            ("application/protobuf", 1),
            ("application/protobuf;wheelarm.v1.Clock", 1),
            ("application/protobuf;wheelarm.v1.Clock@7", 7),
        ] {
            assert_eq!(check(other), Err(OtherVersion { theirs }), "{other}");
        }
        let told = OtherVersion { theirs: 1 }.to_string();
        assert!(told.contains("one build"), "{told}");
    }
}
