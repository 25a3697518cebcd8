//! What goes into a recorder and what comes out.

use std::time::Duration;

use bytes::Bytes;
use wheelarm_proto::v1;

use super::super::episode::{Finishing, Made, Report};
use super::super::gaps::Missing;

/// What reaches a recorder.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "one such message per episode; samples are the small ones"
)]
pub enum Input {
    /// An episode may have begun or ended, or the server is there again.
    Hint,
    /// The answer to [`Output::AskState`].
    State(Result<v1::EpisodeState, String>),
    /// The answer to [`Output::AskSnapshot`].
    Snapshot(Result<v1::SnapshotReply, String>),
    /// A sample of a stream (`camera/NAME` for a camera, `compressed/NAME` where its
    /// pictures come compressed).
    Sample {
        /// Stream name.
        stream: String,
        /// The encoded message.
        payload: Bytes,
    },
    /// All that the server sends for an [`Output::AskSamples`] has come, or nothing came
    /// in time.
    Answered(Missing),
    /// The server's liveliness token is gone, or the way to it.
    ServerLost,
    /// What came of [`Output::Finish`].
    Done(Made),
    /// The recorder is to end.
    Shutdown,
}

/// What a recorder wants done.
#[derive(Debug)]
pub enum Output {
    /// Ask the server for the snapshot of the running episode.
    AskSnapshot,
    /// Ask the server what it runs and what has ended.
    AskState,
    /// Ask the server's cache for samples that did not come; [`Input::Answered`] tells
    /// when all that it sends is here.
    AskSamples {
        /// Which.
        missing: Missing,
        /// Longest wait for the answer.
        patience: Duration,
    },
    /// Listen to the cameras' pictures in this form from now on, and not in the other.
    Hear {
        /// Compressed by the server, or as they are.
        compressed: bool,
    },
    /// Publish this status now, and again from time to time; each speaks of the
    /// episode in its header.
    Status(v1::RecorderStatus),
    /// Make the file of an episode that is over, aside; [`Input::Done`] brings
    /// the result.
    Finish(Box<Finishing>),
    /// An episode is in its file.
    Finished(Report),
    /// An episode could not be recorded.
    Failed(String),
    /// An episode was thrown away, as its operator wished.
    Discarded(String),
}
