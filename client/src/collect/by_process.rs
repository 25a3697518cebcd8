//! An attempt by the worker of a slot: server, recorder and operator in one process,
//! which stays from one episode to the next.

use std::time::{Duration, Instant};

use anyhow::anyhow;
use wheelarm_operate::run::Report;
use wheelarm_proto::settings::Named;
use wheelarm_rollout::launcher::Ongoing;
use wheelarm_rollout::limits;
use wheelarm_rollout::protocol::{Order, Recording, Told};

use super::attempt::{Attempt, Halt, OPERATOR_LOG, Outcome, STALL, over};
use super::slot::Permit;
use super::watch::Watch;
use crate::broken::Broken;

/// Makes the attempt; `permit` is over before the file is finished.
///
/// # Errors
/// [`Halt`].
pub fn run(attempt: &Attempt<'_>, permit: Permit<'_>) -> Result<Outcome, Halt> {
    attempt.activity.tell("starting");
    let worker = attempt
        .slot
        .worker(&attempt.setup.assets, attempt.setup.folder.root())?;
    let mut making = Making {
        attempt,
        ongoing: worker.begin(attempt.order())?,
        watch: Watch::told(attempt.activity, attempt.setup.patience),
        recorded: None,
    };
    let made = making.simulate();
    let outcome = made.and_then(|report| {
        drop(permit);
        let wall_seconds = attempt.begun.elapsed().as_secs_f64();
        attempt.activity.tell("finishing the file");
        making.finish()?;
        let said = making.words();
        Ok(attempt.judged(&report, wall_seconds, &said)?)
    });
    if !matches!(outcome, Ok(Outcome::Done(_))) {
        making.keep_words();
    }
    outcome
}

/// An order of an attempt.
struct Making<'a> {
    attempt: &'a Attempt<'a>,
    ongoing: Ongoing,
    watch: Watch,
    /// What the recorder came to.
    recorded: Option<(u8, String)>,
}

impl Attempt<'_> {
    fn order(&self) -> Order {
        let plan = &self.setup.plan;
        let forced = plan.variation.forced(self.drawn());
        Order {
            number: 0,
            scenario: self.scenario(),
            label: self.episode.id.clone(),
            record: Some(Recording {
                out: self.staging.clone(),
                scratch: self.setup.folder.scratch(&self.episode.id),
                depth: plan.depth.name().to_owned(),
                name: "collect".to_owned(),
            }),
            log: Some(self.staging.join(OPERATOR_LOG)),
            profile_seed: self.profile_seed(),
            forced: forced.map(|forced| forced.name().to_owned()),
            shown: None,
        }
    }
}

impl Making<'_> {
    /// Waits for the operator.
    fn simulate(&mut self) -> Result<Report, Halt> {
        loop {
            match self.next()? {
                Some(Told::Tried(tried)) => return Ok(tried.report()),
                Some(Told::Recorded { code, words }) if code != 0 => {
                    return Err(self.trouble(&format!("the recorder ended: {words}")));
                }
                Some(Told::Over) => return Err(self.trouble("the operator came to no end")),
                _ => {}
            }
            self.check_stall()?;
        }
    }

    /// Waits for the finished file and until nothing else of the order is left.
    fn finish(&mut self) -> Result<(), Halt> {
        let begun = Instant::now();
        loop {
            if let Some(Told::Over) = self.next()? {
                return Ok(());
            }
            if begun.elapsed() > limits::FINISH {
                return Err(self.trouble(&format!(
                    "the recorder did not finish within {:.0} s",
                    limits::FINISH.as_secs_f64()
                )));
            }
        }
    }

    /// What the worker tells next. An attempt that the campaign throws away ends
    /// here, and one whose worker is lost or tells that it is over.
    fn next(&mut self) -> Result<Option<Told>, Halt> {
        let told = self.ongoing.next(limits::LOOK);
        if self.attempt.stop.at_once() {
            // With the worker all its episodes end, and they are all thrown away.
            self.ongoing.worker().kill();
            return Err(over(Outcome::Stopped));
        }
        match told {
            Some(Told::Status(status)) => {
                self.watch.take(&status);
                Ok(None)
            }
            Some(Told::Scenario(words)) => {
                Err(over(Outcome::Failed(self.failed(Broken::Scenario, words))))
            }
            Some(Told::Panicked(words)) => {
                let reason = format!("the operator panicked: {words}");
                Err(over(Outcome::Failed(self.failed(Broken::Operator, reason))))
            }
            Some(Told::Broke(words)) => Err(self.broke(words)),
            Some(Told::Trouble(words)) => Err(self.trouble(&words)),
            Some(Told::Recorded { code, words }) => {
                self.recorded = Some((code, words.clone()));
                Ok(Some(Told::Recorded { code, words }))
            }
            Some(told @ (Told::Tried(_) | Told::Over)) => Ok(Some(told)),
            None => {
                self.watch.look();
                let worker = self.ongoing.worker();
                if let Some(death) = worker.death(Duration::ZERO)? {
                    return Err(match worker.was_killed() {
                        true => over(Outcome::Killed(death)),
                        false => self.broke(death),
                    });
                }
                let patience = self.attempt.setup.patience;
                if self.watch.silent_for() >= patience {
                    worker.kill();
                    return Err(self.broke(format!(
                        "the worker stalled and told nothing for {:.0} s",
                        patience.as_secs_f64()
                    )));
                }
                Ok(None)
            }
        }
    }

    /// Ends the attempt when simulation time stalls for too long while the worker
    /// tells of it: an operator that does not come back from the end of its
    /// simulation is what stalled.
    fn check_stall(&mut self) -> Result<(), Halt> {
        let patience = self.attempt.setup.patience.max(STALL);
        if self.watch.stalled() < patience {
            return Ok(());
        }
        let words = format!(
            "simulation time stalled for {:.0} s{}",
            patience.as_secs_f64(),
            self.watch.waiting_for()
        );
        self.ongoing.cancel();
        if !self.ongoing.is_over_within(2 * limits::END) {
            let reason = format!("the operator stalled: {words}");
            return Err(over(Outcome::Failed(self.failed(Broken::Operator, reason))));
        }
        Err(self.trouble(&words))
    }

    fn broke(&self, reason: String) -> Halt {
        over(Outcome::Broke(self.failed(Broken::Server, reason)))
    }

    fn trouble(&self, words: &str) -> Halt {
        Halt::Trouble(anyhow!("{words}\n{}", self.words()))
    }

    fn failed(&self, broken: Broken, reason: String) -> super::journal::Failed {
        self.attempt.failed(broken, reason, self.watch.scenario())
    }

    /// The last words of the worker, and of the recorder.
    fn words(&self) -> String {
        let recorder = self.recorded.as_ref();
        let recorder = recorder.map(|(code, words)| format!("  the recorder: {code} {words}\n"));
        self.ongoing.worker().tail() + &recorder.unwrap_or_default()
    }

    /// Keeps the worker's last words beside what the attempt left.
    fn keep_words(&self) {
        // A disk that takes no log takes no recording either, which is told.
        let _ = std::fs::write(self.attempt.staging.join("worker.log"), self.words());
    }
}
