//! Episodes of an evaluation by a worker in one process.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::bail;
use wheelarm_operate::operator::Outcome;
use wheelarm_proto::settings::Named;
use wheelarm_rollout::launcher::{Ongoing, Worker, WorkerOptions};
use wheelarm_rollout::protocol::{Order, Recording, Told, Tried};
use wheelarm_rollout::{free_label, limits};

use super::args::EvaluateArgs;
use super::entry::{Condition, Entry, Job, failed};
use super::pulse::Pulse;
use super::worker::broken_entry;
use crate::broken::Broken;
use crate::policy::Driver;

/// A worker for one episode after another.
pub struct OneProcess {
    worker: Arc<Worker>,
    args: EvaluateArgs,
    index: usize,
}

/// What an episode came to.
enum Came {
    Tried(Box<Tried>),
    Broke(Broken, String),
}

impl OneProcess {
    /// Starts it.
    ///
    /// # Errors
    /// When the program is not there or does not start.
    pub fn start(args: &EvaluateArgs, index: usize) -> anyhow::Result<Self> {
        let options = WorkerOptions {
            assets: args.assets.clone(),
            adapter: args.graphics.adapter.clone(),
            folder: Some(args.out.clone()),
        };
        Ok(Self {
            worker: Worker::start(&options)?,
            args: args.clone(),
            index,
        })
    }

    /// Does one episode, and whether the worker can do another.
    ///
    /// # Errors
    /// When something else than the simulation and the task fails.
    pub fn episode(&mut self, job: &Job) -> anyhow::Result<(Entry, bool)> {
        let (begun, pulse) = (Instant::now(), Pulse::default());
        let label = free_label(&self.args.out, &job.label());
        let mut ongoing = self.worker.begin(self.order(job, &label)?)?;
        let came = self.follow(&mut ongoing, &pulse)?;
        let lives = !self.worker.is_worn() && self.worker.death(Duration::ZERO)?.is_none();
        let (entry, lives) = match came {
            Came::Tried(tried) => (entry(job, *tried), lives),
            Came::Broke(broken, why) => {
                let entry = broken_entry(job, broken, why, &pulse, begun.elapsed());
                (entry, lives && broken == Broken::Scenario)
            }
        };
        let entry = Entry {
            label: Some(if self.args.record {
                label
            } else {
                String::new()
            }),
            ..entry
        };
        Ok((entry, lives))
    }

    fn order(&self, job: &Job, label: &str) -> anyhow::Result<Order> {
        let args = &self.args;
        let cameras = Driver::Operator.cameras(args.cameras(), !args.camera.is_empty())?;
        let forced = job.variation.forced(job.seed);
        Ok(Order {
            number: 0,
            scenario: args.server(Some(job), cameras).scenario,
            label: label.to_owned(),
            record: args.record.then(|| Recording {
                out: args.out.clone(),
                scratch: None,
                depth: args.depth.name().to_owned(),
                name: format!("evaluate-{}", self.index),
            }),
            log: None,
            profile_seed: None,
            forced: forced.map(|forced| forced.name().to_owned()),
            shown: None,
        })
    }

    /// Waits until nothing is left of an episode that went to its end, or says how it
    /// broke.
    fn follow(&self, ongoing: &mut Ongoing, pulse: &Pulse) -> anyhow::Result<Came> {
        let (mut tried, mut begun): (Option<Box<Tried>>, _) = (None, None);
        let mut newest = None;
        loop {
            match ongoing.next(limits::LOOK) {
                Some(Told::Tried(done)) => {
                    pulse.set_up(&done.scenario);
                    begun = Some(Instant::now());
                    tried = Some(done);
                }
                Some(Told::Over) => {
                    return match tried {
                        Some(tried) => Ok(Came::Tried(tried)),
                        None => bail!("the worker told nothing of it:\n{}", self.worker.tail()),
                    };
                }
                Some(Told::Status(status)) => {
                    let header = status.header.clone().unwrap_or_default();
                    // What was told first is newer than the first look.
                    if newest.is_none()
                        && let Some(scenario) = &status.scenario
                    {
                        pulse.set_up(scenario);
                    }
                    if newest != Some(header.tick) {
                        newest = Some(header.tick);
                        pulse.beat(header.stamp_nanos as f64 * 1e-9);
                    }
                }
                Some(Told::Scenario(words)) => return Ok(Came::Broke(Broken::Scenario, words)),
                Some(Told::Panicked(words)) => {
                    let why = format!("the operator panicked: {words}");
                    return Ok(Came::Broke(Broken::Operator, why));
                }
                Some(Told::Broke(words)) => return Ok(Came::Broke(Broken::Server, words)),
                Some(Told::Recorded { code, words }) if code != 0 => {
                    bail!("the recording failed: {words}\n{}", self.worker.tail())
                }
                Some(Told::Trouble(words)) => bail!("{words}\n{}", self.worker.tail()),
                Some(Told::Recorded { .. }) => {}
                None => {
                    if let Some(death) = self.worker.death(Duration::ZERO)? {
                        return Ok(Came::Broke(Broken::Server, death));
                    }
                    let (stalled, patience) = match begun {
                        None => (pulse.still(), self.args.patience),
                        Some(since) => (since.elapsed(), limits::FINISH),
                    };
                    if stalled > patience {
                        self.worker.kill();
                        let why = format!(
                            "the worker stalled for {:.0} s and was ended",
                            patience.as_secs_f64()
                        );
                        return Ok(Came::Broke(Broken::Server, why));
                    }
                }
            }
        }
    }
}

/// The result of an episode that went to its end.
fn entry(job: &Job, tried: Tried) -> Entry {
    let report = tried.report();
    let broken = matches!(report.outcome, Outcome::Broken(_)).then_some(Broken::Physics);
    let limit = tried.scenario.time_limit_seconds;
    let limit = limit.map(|limit| format!("0.00 s its time limit is {limit:.0} s"));
    let conditions = report.evaluation.conditions.iter();
    let seconds = report.seconds();
    Entry {
        task: job.task.clone(),
        seed: job.seed,
        settings: job.settings(),
        policy: job.policy.clone(),
        policy_files: job.policy_files.clone(),
        label: None,
        success: report.succeeded(),
        end: match (report.succeeded(), broken) {
            (true, _) => "success".to_owned(),
            (false, Some(broken)) => broken.words().to_owned(),
            (false, None) => failed(&report.evaluation),
        },
        // Nobody watches beside the operator.
        course: None,
        why: report.why().unwrap_or_default(),
        conditions: conditions.map(Condition::from).collect(),
        seconds,
        factor: seconds / tried.wall_seconds.max(1e-9),
        hash: tried
            .hash
            .map_or_else(String::new, |hash| format!("{hash:016x}")),
        rejected_starts: tried.scenario.rejected_starts,
        notes: limit.into_iter().chain(tried.notes).collect(),
        thinking: None,
        broken,
        scenario: broken.map(|_| wheelarm_dataset::scenario_text::scenario_json(&tried.scenario)),
    }
}
