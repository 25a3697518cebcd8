//! One episode to run, and its result.

use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use wheelarm_proto::settings::Depth;
use wheelarm_proto::v1;

use crate::driver::Driver;
use crate::failure::Failure;
use crate::finished::Finished;
use crate::limits::Limits;
use crate::observer::Observer;
use crate::serde_text::named;

/// File for the phases and notes of the expert, in a rollout's folder.
const OPERATOR_LOG: &str = "operator.log";

/// One episode to run.
#[derive(Clone)]
pub struct Rollout {
    /// The scenario to simulate; without cameras nothing is rendered.
    pub scenario: v1::Scenario,
    /// Label of the episode, and name of its file.
    pub label: String,
    /// The program that drives the robot.
    pub driver: Driver,
    /// How the episode is recorded; not at all when absent.
    pub record: Option<Record>,
    /// Wall-time limits.
    pub limits: Limits,
    /// Folder for the messages of the programs and `operator.log`. With it a server listens
    /// on a private socket instead of a port.
    pub folder: Option<PathBuf>,
    /// Watches the episode.
    pub observer: Arc<dyn Observer>,
}

/// How an episode is recorded.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Record {
    /// Folder for the file.
    pub out: PathBuf,
    /// Folder for the recording before it is complete; `out` when absent.
    #[serde(default)]
    pub scratch: Option<PathBuf>,
    /// How depth is stored.
    #[serde(with = "named")]
    pub depth: Depth,
    /// Name of the recorder.
    pub name: String,
}

impl Rollout {
    /// File for the phases and notes of the expert; absent without a folder.
    #[must_use]
    pub fn operator_log(&self) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join(OPERATOR_LOG))
    }
}

/// The result of an episode.
#[derive(Clone, Debug)]
pub enum RolloutResult {
    /// The driver reached its end.
    Finished(Box<Finished>),
    /// The episode failed before that.
    Failed(Failure),
}

impl RolloutResult {
    /// The episode whose driver reached its end.
    ///
    /// # Errors
    /// The failure.
    pub fn finished(self) -> Result<Finished, Failure> {
        match self {
            Self::Finished(finished) => Ok(*finished),
            Self::Failed(failure) => Err(failure),
        }
    }
}
