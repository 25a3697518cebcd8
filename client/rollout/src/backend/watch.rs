//! Watches the program that simulates an episode.

use crate::failure::{Failure, FailureCause};
use crate::finished::Finished;
use crate::heartbeat::Heartbeat;
use crate::launcher::Process;
use crate::rollout::Rollout;

/// The clocks of an episode and their limits.
pub(super) struct Watch<'a> {
    pub rollout: &'a Rollout,
    pub heartbeat: Heartbeat,
    /// Verb of the error about a silent program: `answered` or `sent`.
    pub verb: &'static str,
}

impl Watch<'_> {
    /// Ends the episode with an error when the caller cancels it, or when the program died
    /// or is silent for too long.
    pub fn check(&self, simulator: &mut Process) -> anyhow::Result<()> {
        self.heartbeat.update();
        let limits = &self.rollout.limits;
        if (limits.cancelled)() {
            simulator.kill();
            return Err(self.failed(FailureCause::Cancelled, "cancelled".to_owned()));
        }
        if let Some(death) = simulator.death()? {
            let cause = match simulator.was_killed() {
                true => FailureCause::Killed,
                false => FailureCause::Server,
            };
            return Err(self.failed(cause, death));
        }
        if self.heartbeat.silent_for() < limits.silence {
            return Ok(());
        }
        simulator.kill();
        let seconds = limits.silence.as_secs_f64();
        let words = format!(
            "the {} stalled and {} nothing for {seconds:.0} s",
            simulator.name(),
            self.verb
        );
        Err(self.failed(FailureCause::Server, words))
    }

    /// Message when simulated time does not advance for too long while the program replies.
    pub fn stall(&self) -> Option<String> {
        let patience = self.rollout.limits.stall;
        (self.heartbeat.stalled_for() >= patience).then(|| {
            format!(
                "simulation time stalled for {:.0} s{}",
                patience.as_secs_f64(),
                self.heartbeat.waiting_for()
            )
        })
    }

    /// The failure after a stall: the driver's where it did not return from the end of its
    /// simulation.
    pub fn stalled(&self, words: String, driver_returned: bool) -> anyhow::Error {
        match driver_returned {
            true => self.failed(FailureCause::Stall, words),
            false => {
                let words = format!("the operator stalled: {words}");
                self.failed(FailureCause::Operator, words)
            }
        }
    }

    /// A failure at this point of the episode.
    pub fn failed(&self, cause: FailureCause, reason: String) -> anyhow::Error {
        self.heartbeat.failure(cause, reason).into()
    }
}

/// Whether the programs of an episode can run another one: it finished, or only its
/// scenario was rejected.
pub(super) fn is_reusable(result: &anyhow::Result<Finished>) -> bool {
    let is_of_scenario = |problem: &anyhow::Error| {
        let failure = problem.downcast_ref::<Failure>();
        failure.is_some_and(|failure| failure.cause == FailureCause::Scenario)
    };
    result.as_ref().err().is_none_or(is_of_scenario)
}
