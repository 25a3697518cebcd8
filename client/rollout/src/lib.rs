//! Runs one episode.
//!
//! A [`Rollout`] names the scenario, the [`Driver`], the [`Record`] and the [`Limits`] of an
//! episode. A [`Backend`] runs it and returns a [`RolloutResult`]. Every command that makes
//! episodes (`demo`, `evaluate`, `collect`, `multiply`, `replay`) makes them this way.
//!
//! | module | content |
//! |---|---|
//! | `rollout` | [`Rollout`], [`RolloutResult`] |
//! | `backend` | [`InProcess`]: a worker; [`Processes`]: server and recorder as programs |
//! | `driver` | [`Driver`]: expert, demonstrations, policy, replay, playback |
//! | `replay`, `playback`, `comparison` | the commands or the states of a recording |
//! | `policy` | policies as processes, and an episode driven by one |
//! | `finished`, `failure` | results: [`Finished`], [`Failure`] with its [`FailureCause`] |
//! | `heartbeat`, `limits` | how long a server was silent or did not advance, and may be |
//! | `session`, `observer` | an episode as its driver and its caller see it |
//! | `episode_log` | [`EpisodeLog`]: results on disk, from which a command resumes |
//! | `protocol`, `serde_text` | lines between this crate and `wheelarm-worker` |
//! | `launcher`, `label` | child processes, [`Record`], and free file names |
//!
//! Files name only files above them in this list of layers: `failure`, `heartbeat`,
//! `launcher`; `policy`; `finished`; `session`; `replay`, `playback`; `driver`; `rollout`;
//! `protocol`; `backend`.
//! Nothing here reads an episode file: readers hand recordings over as values.

#![warn(missing_docs)]

mod backend;
mod comparison;
mod driver;
mod episode_log;
mod failure;
mod finished;
mod heartbeat;
mod label;
pub mod launcher;
pub mod limits;
mod observer;
mod playback;
pub mod policy;
pub mod protocol;
mod replay;
mod rollout;
mod serde_text;
mod session;

pub use backend::{Backend, InProcess, Processes, WorkerOptions};
pub use comparison::Comparison;
pub use driver::{DemonstrationFile, Driver, Expert, PolicyDriver, Takeover};
pub use episode_log::{EpisodeLog, LogEntry, damaged_line, read_log};
pub use failure::{Failure, FailureCause};
pub use finished::Finished;
pub use heartbeat::{Heartbeat, episode_seconds};
pub use label::free_label;
pub use launcher::Record;
pub use limits::Limits;
pub use observer::Observer;
pub use playback::Playback;
pub use replay::{REPLAY, Replay};
pub use rollout::{Rollout, RolloutResult};
pub use session::Session;
