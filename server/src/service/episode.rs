//! A running episode: what it was announced as, and how far it is.

use std::collections::BTreeMap;
use std::time::Instant;

use bytes::Bytes;
use wheelarm_proto::v1;

/// Where an episode stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Announced; time is paused until the recorders are ready.
    Waiting,
    /// Time goes on.
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
    /// Its commands are those of a recording: as they were applied.
    pub replayed: bool,
    /// Recorders that must be ready.
    pub required: usize,
    /// Recorders that were ready when time went on.
    pub participants: Vec<String>,
    /// Participants that were lost since then.
    pub lost: Vec<String>,
    /// Wall time of the announcement.
    pub since: Instant,
    /// Wall time when simulation time went on.
    pub running_since: Instant,
    /// Pictures that fell due in the episode, by camera.
    pub pictures: BTreeMap<String, u64>,
}

/// An answer to `episode_stop` that waits for the recorders: a server that is killed right
/// behind its answer must not leave files without a manifest.
pub(super) struct Unacknowledged {
    pub(super) asked: zenoh::query::Query,
    pub(super) stopped: v1::EpisodeStopped,
    pub(super) participants: Vec<String>,
    pub(super) since: Instant,
}
