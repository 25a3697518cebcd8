//! Errors between a client and a server, each with its fix.

use wheelarm_proto::bundle::NoIdentity;
use wheelarm_proto::endpoint::BadEndpoint;
use wheelarm_proto::keys::BadName;
use wheelarm_proto::program::without_source_places;
use wheelarm_proto::schema::OtherVersion;
use wheelarm_proto::v1::FailureCode;

use super::frame::FrameError;

/// Failure of a connection, a query or a message.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The endpoint is invalid.
    #[error(transparent)]
    Endpoint(#[from] BadEndpoint),
    /// The folder of keys cannot be read.
    #[error(transparent)]
    Identity(#[from] NoIdentity),
    /// A name is not valid in a key.
    #[error(transparent)]
    Name(#[from] BadName),
    /// Nothing listens at the endpoint.
    #[error(
        "no server answers at {endpoint} (waited {seconds:.1} s): start one with `wheelarm-server`, or name its address with --connect ({cause})"
    )]
    NoServer {
        /// The endpoint.
        endpoint: String,
        /// The wait, s.
        seconds: f64,
        /// Message of the transport.
        cause: String,
    },
    /// The endpoint requires keys, and none were given.
    #[error(
        "{0} takes keys: name the folder that you were given with --keys DIR, or on the server's host its folder of keys with --keys DIR --user NAME"
    )]
    NoKeys(String),
    /// The endpoint accepts the keys, but their user cannot see the server.
    #[error(
        "the user of these keys cannot see a server {sim:?} at {endpoint}: the user was removed, or was added after the server started, or the server has another name; the administrator checks `wheelarm users list` and restarts the server"
    )]
    NoRights {
        /// The endpoint.
        endpoint: String,
        /// The wanted name.
        sim: String,
    },
    /// A server listens, but under another name.
    #[error(
        "a server answers at {endpoint}, but none is named {sim:?} (found: {found}): choose one with --sim"
    )]
    OtherName {
        /// The endpoint.
        endpoint: String,
        /// The wanted name.
        sim: String,
        /// Names of the servers found.
        found: String,
    },
    /// Several sessions declare the token of the server.
    #[error(
        "{count} sessions behind {endpoint} claim to be the server {sim:?} ({ids}): one of them is a second server of that name or an impostor; connect to the server directly, or end the other"
    )]
    Several {
        /// The endpoint.
        endpoint: String,
        /// The wanted name.
        sim: String,
        /// Number of sessions.
        count: usize,
        /// IDs of the sessions.
        ids: String,
    },
    /// The server did not reply to a query in time.
    #[error("the server {sim:?} did not answer `{query}` within {seconds} s")]
    Silent {
        /// Server name.
        sim: String,
        /// Query name.
        query: &'static str,
        /// The wait, s.
        seconds: f64,
    },
    /// The server disconnected before it replied.
    #[error(
        "the server {sim:?} has gone: `{query}` ended after {seconds:.1} s without a reply; the log of the server has the cause"
    )]
    Gone {
        /// Server name.
        sim: String,
        /// Query name.
        query: &'static str,
        /// Time until the query ended, s.
        seconds: f64,
    },
    /// The query ended early without a reply, though the server is connected.
    #[error(
        "the server {sim:?} is connected, but `{query}` ended after {seconds:.1} s without a reply: the server is overloaded or has just reconnected; try again. With keys, their user may lack the right (see `wheelarm doctor`)"
    )]
    Unanswered {
        /// Server name.
        sim: String,
        /// Query name.
        query: &'static str,
        /// Time until the query ended, s.
        seconds: f64,
    },
    /// The server refused the query.
    #[error("the server refused `{query}`: {message}")]
    Refused {
        /// Query name.
        query: &'static str,
        /// Code of the reason, for programs.
        code: FailureCode,
        /// Message of the server.
        message: String,
    },
    /// An episode was announced and did not begin.
    #[error("episode {label:?} did not begin: {why}")]
    NotBegun {
        /// Its label.
        label: String,
        /// Reason and fix.
        why: String,
        /// Next free label, when a recorder has a file of this one.
        free_label: Option<String>,
    },
    /// The camera is not in use.
    #[error(
        "the camera {camera:?} is not in use (in use: {found}): choose one of these, or add it at the start of the server (--camera) or with a reset"
    )]
    NoCamera {
        /// The wanted name.
        camera: String,
        /// Names of the cameras in use.
        found: String,
    },
    /// A message could not be decoded.
    #[error("{what} cannot be read ({cause}): client and server differ in version?")]
    Garbled {
        /// Name of the message.
        what: String,
        /// Error of the decoder.
        cause: wheelarm_proto::DecodeError,
    },
    /// An image does not match its message.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The server uses another contract version.
    #[error(transparent)]
    Version(#[from] OtherVersion),
    /// The transport failed.
    #[error("{operation} failed: {cause}")]
    Transport {
        /// The operation.
        operation: &'static str,
        /// Message of the transport.
        cause: String,
    },
}

pub(super) fn transport(operation: &'static str) -> impl Fn(zenoh::Error) -> ClientError {
    move |cause| ClientError::Transport {
        operation,
        cause: words(&cause),
    }
}

/// The error of a closed session.
pub(super) fn closed(operation: &'static str) -> ClientError {
    ClientError::Transport {
        operation,
        cause: "the connection is closed".to_owned(),
    }
}

/// Message of a Zenoh error without positions in its source.
#[must_use]
pub fn words(error: &zenoh::Error) -> String {
    without_source_places(&error.to_string())
}
