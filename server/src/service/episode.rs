//! A running episode: its announcement and its progress.

use std::collections::BTreeMap;
use std::time::Instant;

use bytes::Bytes;
use wheelarm_proto::v1;

/// Stage of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Announced; time is paused until the recorders are ready.
    Waiting,
    /// Time passes.
    Running,
}

/// A running episode.
#[derive(Debug)]
pub struct Episode {
    /// Number, counting from 1 in one run.
    pub number: u64,
    /// Announcement.
    pub started: v1::EpisodeStarted,
    /// State at the first tick.
    pub snapshot: Bytes,
    /// Stage.
    pub stage: Stage,
    /// Its commands are replayed from a recording, as they were applied.
    pub replayed: bool,
    /// Recorders that must be ready.
    pub required: usize,
    /// Recorders that were ready when time resumed.
    pub participants: Vec<String>,
    /// Participants lost since then.
    pub lost: Vec<String>,
    /// Wall time of the announcement.
    pub since: Instant,
    /// Wall time when simulation time resumed.
    pub running_since: Instant,
    /// Images due in the episode, by camera.
    pub images: BTreeMap<String, u64>,
}

/// A reply to `episode_stop` that waits for the recorders: a server killed right after
/// its reply must not leave files without a manifest.
pub(super) struct PendingStopReply {
    pub(super) query: zenoh::query::Query,
    pub(super) stopped: v1::EpisodeStopped,
    pub(super) participants: Vec<String>,
    pub(super) since: Instant,
}
