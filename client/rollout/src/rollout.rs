//! One episode to run, and its result.

use std::path::PathBuf;
use std::sync::Arc;

use wheelarm_proto::v1;

use crate::driver::Driver;
use crate::failure::Failure;
use crate::finished::Finished;
use crate::launcher::Record;
use crate::limits::Limits;
use crate::observer::Observer;

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
    /// Recording of the episode; none when absent.
    pub record: Option<Record>,
    /// Wall-time limits.
    pub limits: Limits,
    /// Folder for the messages of the programs and `operator.log`. With it a server listens
    /// on a private socket instead of a port.
    pub folder: Option<PathBuf>,
    /// Watches the episode.
    pub observer: Arc<dyn Observer>,
}

impl Rollout {
    /// File for the phases and notes of the expert; absent without a folder.
    #[must_use]
    pub fn operator_log(&self) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join(OPERATOR_LOG))
    }
}

/// The result of an episode: an error when the episode failed before its driver finished.
pub type RolloutResult = Result<Finished, Failure>;
