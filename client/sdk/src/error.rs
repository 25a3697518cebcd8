//! What can go wrong between a client and a server, in words that name the cure.

use wheelarm_proto::bundle::NoIdentity;
use wheelarm_proto::endpoint::BadEndpoint;
use wheelarm_proto::keys::BadName;
use wheelarm_proto::program::without_source_places;
use wheelarm_proto::schema::OtherVersion;
use wheelarm_proto::v1::FailureCode;

use super::frame::BadFrame;

/// What can go wrong between a client and a server.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The endpoint is none.
    #[error(transparent)]
    Endpoint(#[from] BadEndpoint),
    /// The keys are not where they were looked for.
    #[error(transparent)]
    Identity(#[from] NoIdentity),
    /// A name cannot stand in a key.
    #[error(transparent)]
    Name(#[from] BadName),
    /// Nobody listens.
    #[error(
        "no server answers at {endpoint} (waited {seconds:.1} s): start one with `wheelarm-server`, or name its address with --connect ({cause})"
    )]
    NoServer {
        /// Where it was looked for.
        endpoint: String,
        /// How long.
        seconds: f64,
        /// The transport's own words.
        cause: String,
    },
    /// The endpoint takes keys, and none were given.
    #[error(
        "{0} takes keys: name the folder that you were given with --keys DIR, or on the server's host its folder of keys with --keys DIR --user NAME"
    )]
    NoKeys(String),
    /// A server took the keys and shows nothing to their user.
    #[error(
        "a server answers at {endpoint}, and shows no server {sim:?} to the user of these keys: the user was removed, or the server started before it was added, or has another name; ask who runs it (`wheelarm users list`, then start the server anew)"
    )]
    NoRights {
        /// Where it answers.
        endpoint: String,
        /// The wanted name.
        sim: String,
    },
    /// Somebody listens, but under another name.
    #[error(
        "a server answers at {endpoint}, but none is named {sim:?} (found: {found}): choose one with --sim"
    )]
    OtherName {
        /// Where it was looked for.
        endpoint: String,
        /// The wanted name.
        sim: String,
        /// Names that are there.
        found: String,
    },
    /// More than one session says that it is the server.
    #[error(
        "{count} sessions behind {endpoint} say that they are the server {sim:?} ({ids}): one of them is a stranger or a second server of the same name; connect to the server itself, or end the other"
    )]
    Several {
        /// Where it was looked for.
        endpoint: String,
        /// The wanted name.
        sim: String,
        /// How many there are.
        count: usize,
        /// Ids of the sessions.
        ids: String,
    },
    /// The server did not answer a query in time.
    #[error("the server {sim:?} did not answer `{query}` within {seconds} s")]
    Silent {
        /// Server name.
        sim: String,
        /// Query name.
        query: &'static str,
        /// How long.
        seconds: f64,
    },
    /// Nobody is there any more who could answer.
    #[error(
        "the server {sim:?} has gone: nobody answers `{query}` any more (told after {seconds:.1} s); its own last words say why"
    )]
    Gone {
        /// Server name.
        sim: String,
        /// Query name.
        query: &'static str,
        /// After how long that was known.
        seconds: f64,
    },
    /// The query ended early and without an answer, though the server is there.
    #[error(
        "the server {sim:?} is there, but `{query}` ended after {seconds:.1} s without an answer: it is asked more than it can answer, or it just came back; ask again. With keys: their user may not ask this (`wheelarm doctor` tells)"
    )]
    Unanswered {
        /// Server name.
        sim: String,
        /// Query name.
        query: &'static str,
        /// After how long it ended.
        seconds: f64,
    },
    /// The server answered that it will not.
    #[error("the server refused `{query}`: {message}")]
    Refused {
        /// Query name.
        query: &'static str,
        /// Why, for programs.
        code: FailureCode,
        /// The server's words.
        message: String,
    },
    /// An episode was announced and did not begin.
    #[error("episode {label:?} did not begin: {why}")]
    NotBegun {
        /// Its label.
        label: String,
        /// Why, with the cure.
        why: String,
        /// Where a recorder has a file of that label: the next label that is free there.
        free_label: Option<String>,
    },
    /// No pictures come from a camera of that name.
    #[error(
        "the camera {camera:?} is not in use (in use: {found}): choose one of them, or ask for it when the server starts (--camera) or with a reset"
    )]
    NoCamera {
        /// The wanted name.
        camera: String,
        /// Names of those in use.
        found: String,
    },
    /// A message could not be read.
    #[error("{what} cannot be read ({cause}): client and server differ in version?")]
    Garbled {
        /// Which message.
        what: String,
        /// The decoder's words.
        cause: wheelarm_proto::DecodeError,
    },
    /// A picture is not as its message says.
    #[error(transparent)]
    Frame(#[from] BadFrame),
    /// The server speaks another version of the contract.
    #[error(transparent)]
    Version(#[from] OtherVersion),
    /// The transport failed.
    #[error("{operation} failed: {cause}")]
    Transport {
        /// What was tried.
        operation: &'static str,
        /// The transport's words.
        cause: String,
    },
}

pub(super) fn transport(operation: &'static str) -> impl Fn(zenoh::Error) -> ClientError {
    move |cause| ClientError::Transport {
        operation,
        cause: words(&cause),
    }
}

/// Nothing can come any more.
pub(super) fn closed(operation: &'static str) -> ClientError {
    ClientError::Transport {
        operation,
        cause: "the connection is closed".to_owned(),
    }
}

/// The transport's words without the place in its source.
#[must_use]
pub fn words(error: &zenoh::Error) -> String {
    without_source_places(&error.to_string())
}
