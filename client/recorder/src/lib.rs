//! The recorder: subscribes to every stream of an episode and writes one file per episode.
//!
//! [`Recorder`] decides and writes, without a network. `network` moves messages between it
//! and Zenoh through a queue bounded in bytes; a Zenoh callback only moves a sample into
//! that queue. A separate thread writes the file while the next episode is recorded. The
//! crate prints nothing: it reports events as [`Output`].
//!
//! A start or stop message is only a hint: the recorder confirms it with the query `episode`.
//! A file is complete only when it matches the manifest, including the digest of each stream.
//! The recorder requests lost images itself (`gaps`), because the transport gives up on
//! samples that are lost during recovery (docs/decisions/0006).

#![warn(missing_docs)]

mod cache_request;
mod compressed;
mod digests;
mod episode;
mod gaps;
mod latest;
mod many;
mod network;
mod opening;
mod queue;
mod raw;
mod recorder;

pub use self::episode::{Finishing, Made, Report};
pub use self::gaps::Missing;
pub use self::many::{ServerEvent, run_many};
pub use self::network::run;
pub use self::recorder::{Input, Output, Recorder};

use std::path::PathBuf;

use wheelarm_dataset::depth::Depth;

/// Options of a recorder.
#[derive(Clone, Debug)]
pub struct RecordOptions {
    /// Folder for the files; one per episode, named LABEL.h5.
    pub out: PathBuf,
    /// Folder for the log of an episode until its file is made; that of the file when
    /// absent. Use a fast disk or a RAM disk; a RAM disk loses its content at power loss.
    pub scratch: Option<PathBuf>,
    /// Name of this recorder; several at one server need different ones.
    pub name: String,
    /// How depth is stored.
    pub depth: Depth,
    /// Ends when standard input closes, i.e. with the program that started the recorder.
    pub end_with_stdin: bool,
    /// Ends after this many episodes; runs until it is shut down without it.
    pub episodes: Option<u64>,
}

/// Result of a recorder run.
#[derive(Clone, Debug, Default)]
pub struct ExitSummary {
    /// Episodes that were written to files.
    pub finished: Vec<Report>,
    /// Episodes that could not be recorded, with the reason and the fix.
    pub failed: Vec<String>,
}

impl ExitSummary {
    /// 0 when every file is complete, 3 when one is partial, 1 when an episode
    /// failed.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        if !self.failed.is_empty() {
            1
        } else if self.finished.iter().any(|r| !r.complete) {
            3
        } else {
            0
        }
    }
}
