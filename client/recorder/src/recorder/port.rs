//! Inputs and outputs of a recorder.

use std::time::Duration;

use bytes::Bytes;
use wheelarm_proto::v1;

use super::super::episode::{Finishing, Made, Report};
use super::super::gaps::Missing;

/// Inputs of a recorder.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "one such message per episode; samples are the small ones"
)]
pub enum Input {
    /// An episode may have begun or ended, or the server has returned.
    Hint,
    /// The reply to [`Output::RequestState`].
    State(Result<v1::EpisodeState, String>),
    /// The reply to [`Output::RequestSnapshot`].
    Snapshot(Result<v1::SnapshotReply, String>),
    /// A sample of a stream (`camera/NAME` for a camera, `compressed/NAME` for its
    /// compressed images).
    Sample {
        /// Stream name.
        stream: String,
        /// The encoded message.
        payload: Bytes,
    },
    /// All samples for an [`Output::RequestSamples`] arrived, or the request timed out.
    Answered(Missing),
    /// The server's liveliness token or the link to it is lost.
    ServerLost,
    /// Result of [`Output::Finish`].
    Done(Made),
    /// Ends the recorder.
    Shutdown,
}

/// Actions that a recorder requests.
#[derive(Debug)]
pub enum Output {
    /// Request the snapshot of the running episode.
    RequestSnapshot,
    /// Request the running and the ended episodes.
    RequestState,
    /// Request missing samples from the server's cache; [`Input::Answered`] follows when
    /// all of them arrived.
    RequestSamples {
        /// The samples.
        missing: Missing,
        /// Longest wait for the answer.
        patience: Duration,
    },
    /// Subscribe to the cameras' images in this form instead of the other.
    SubscribeCameras {
        /// Compressed by the server, or exact.
        compressed: bool,
    },
    /// Publish this status now and periodically; its header names the episode.
    Status(v1::RecorderStatus),
    /// Write the file of an ended episode on another thread; [`Input::Done`] returns the
    /// result.
    Finish(Box<Finishing>),
    /// An episode was written to its file.
    Finished(Report),
    /// An episode could not be recorded.
    Failed(String),
    /// An episode was discarded by its operator.
    Discarded(String),
}
