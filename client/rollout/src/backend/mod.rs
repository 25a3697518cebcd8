//! Backends, which run the simulation of an episode.

mod in_process;
mod processes;
mod watch;
mod worker;

use crate::finished::Finished;
use crate::rollout::{Rollout, RolloutResult};

pub use in_process::InProcess;
pub use processes::Processes;
pub use worker::WorkerOptions;

/// Runs the simulation of an episode.
pub trait Backend: Send + Sync {
    /// Runs an episode; calls `simulated` when only its file is unfinished.
    ///
    /// # Errors
    /// A [`Failure`](crate::Failure) for an episode that failed before its driver finished;
    /// any other error for what is not part of the episode.
    fn attempt(&self, rollout: &Rollout, simulated: &mut dyn FnMut()) -> anyhow::Result<Finished>;

    /// Releases the programs that wait for the next episode.
    fn rest(&self);

    /// Runs an episode. `simulated` is called when the simulation is over and only the file
    /// is unfinished: another episode may then use the processor.
    ///
    /// # Errors
    /// When something fails that is not part of the episode: a missing program, the
    /// recorder, the disk. A failure of the episode is a [`RolloutResult`].
    fn run_and_then(
        &self,
        rollout: &Rollout,
        simulated: &mut dyn FnMut(),
    ) -> anyhow::Result<RolloutResult> {
        match self.attempt(rollout, simulated) {
            Ok(finished) => Ok(Ok(finished)),
            Err(problem) => problem.downcast().map(Err),
        }
    }

    /// Runs an episode.
    ///
    /// # Errors
    /// As [`Backend::run_and_then`].
    fn run(&self, rollout: &Rollout) -> anyhow::Result<RolloutResult> {
        self.run_and_then(rollout, &mut || {})
    }
}
