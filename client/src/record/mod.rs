//! The recorder: subscribes to everything an episode publishes and writes one
//! file per episode.
//!
//! [`RecorderCore`] decides and writes, without a network; `network` moves
//! messages between it and Zenoh through a queue bounded in bytes. No zenoh
//! callback works: it moves the sample into that queue. The file of an episode
//! is made on a thread of its own, while the next episode is recorded.

mod core;
mod digests;
mod episode;
mod gaps;
mod many;
mod network;
mod queue;

pub use self::core::{Input, Output, RecorderCore};
pub use self::episode::{Finishing, Report};
pub use self::gaps::Missing;
pub use self::many::{EVERY_SERVER, run_many};
pub use self::network::{run, run_with};

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use wheelarm_dataset::depth::DepthFormat;

/// How depth is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Depth {
    /// float32 metres, bit by bit as rendered.
    #[default]
    F32,
    /// 16-bit millimetres at half the size; 0 where nothing was hit or the
    /// surface is farther than 65.535 m.
    U16,
}

impl From<Depth> for DepthFormat {
    fn from(depth: Depth) -> Self {
        match depth {
            Depth::F32 => Self::Metres,
            Depth::U16 => Self::Millimetres,
        }
    }
}

/// Options of a recorder.
#[derive(Args, Clone, Debug)]
pub struct RecordArgs {
    /// Folder for the files; one per episode, named LABEL.h5, with
    /// `--sim '*'` below a folder per server.
    #[arg(long, default_value = "data", value_name = "DIR")]
    pub out: PathBuf,
    /// Name of this recorder; several at one server need different ones.
    #[arg(long, default_value = "recorder")]
    pub name: String,
    /// How depth is stored.
    #[arg(long, value_enum, default_value_t = Depth::F32)]
    pub depth: Depth,
    /// Ends when standard input is closed: with the program that started it.
    #[arg(long, hide = true)]
    pub end_with_stdin: bool,
    /// Ends after this many episodes, of all servers with `--sim '*'`; runs
    /// until Ctrl-C without it.
    #[arg(long, value_name = "N")]
    pub episodes: Option<u64>,
}

/// What a recorder did until its end.
#[derive(Clone, Debug, Default)]
pub struct ExitSummary {
    /// Episodes that are in files.
    pub finished: Vec<Report>,
    /// Episodes that could not be recorded, with the reason and the cure.
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
