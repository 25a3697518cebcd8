//! One attempt at an episode: its rollout, and the check of its file.
//!
//! | failure | next attempt |
//! |---|---|
//! | task failed, simulation diverged, expert panicked or hung | new seed |
//! | server or worker died or hung, perhaps because of the host | same seed, once |
//! | server or worker killed by another program (out of memory) | same seed, fewer workers, no journal entry |
//! | any other failure of the host | same seed |

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use wheelarm_dataset::read::Episode as Recording;
use wheelarm_dataset::scenario_text::scenario_json;
use wheelarm_proto::v1;
use wheelarm_rollout::{
    Driver, Expert, Failure, FailureCause, Finished, InProcess, Limits, Processes, Record, Rollout,
    WorkerOptions,
};

use super::acceptance::{Verdict, check_file};
use super::activity::Activity;
use super::episode::Episode;
use super::failure_analysis::{Loss, find_loss};
use super::folder::{Folder, sha256};
use super::journal::{Done, Failed};
use super::plan::Plan;
use super::slot::{Permit, Slot};
use super::stop::Stop;
use crate::episode_seed::EpisodeSeed;
use crate::worker_mode::WorkerMode;

/// Least time for which simulated time may not advance while the server replies.
const STALL: Duration = Duration::from_secs(60);

/// Settings that all attempts of a campaign share.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The plan.
    pub plan: Plan,
    /// The dataset's folder.
    pub folder: Folder,
    /// Assets folder; found by the server when absent.
    pub assets: Option<PathBuf>,
    /// Folders of world packs.
    pub packs: Vec<PathBuf>,
    /// Processes of a worker.
    pub mode: WorkerMode,
    /// Longest wait for a reply before a server is ended.
    pub patience: Duration,
}

impl Setup {
    /// A slot whose images are rendered by `adapter`; by the strongest when absent.
    #[must_use]
    pub fn slot(&self, adapter: Option<String>) -> Slot {
        let assets = self.assets.clone();
        Slot::new(match self.mode {
            WorkerMode::Socket => Box::new(Processes::new(assets, adapter).with_packs(&self.packs)),
            WorkerMode::Process => Box::new(InProcess::new(WorkerOptions {
                assets,
                packs: self.packs.clone(),
                adapter,
                folder: Some(self.folder.root().to_owned()),
            })),
        })
    }
}

/// The outcome of an attempt.
#[derive(Debug)]
pub enum Outcome {
    /// The staged file is accepted.
    Done(Box<Done>),
    /// The task failed, or the failure is not the fault of a server or the host.
    Failed(Failed),
    /// The server died or hung.
    Broke(Failed),
    /// Another program killed the server or the worker; the exit status as text.
    Killed(String),
    /// Discarded because the campaign ends.
    Stopped,
}

/// Makes one attempt and leaves the file in the staging folder. `permit` is held during the
/// simulation and dropped before the file is finished.
///
/// # Errors
/// When a failure may be the fault of the host, with the last messages.
pub fn attempt(
    setup: &Setup,
    (episode, number): (&Episode, u32),
    (slot, permit): (&Slot, Permit<'_>),
    stop: &Stop,
    activity: &Activity,
) -> anyhow::Result<Outcome> {
    let attempt = Attempt {
        setup,
        episode,
        number,
        seed: episode.seed_of(number),
        staging: setup.folder.stage(&episode.id)?,
        activity,
        begun: Instant::now(),
    };
    activity.set_step("starting");
    let rollout = attempt.rollout(stop);
    let (mut permit, mut wall_seconds) = (Some(permit), 0.0);
    let result = slot.backend().run_and_then(&rollout, &mut || {
        permit = None;
        wall_seconds = attempt.begun.elapsed().as_secs_f64();
        activity.set_step("finishing the file");
    });
    match result? {
        Ok(finished) => attempt.check(&finished, wall_seconds),
        Err(failure) => attempt.failed(failure),
    }
}

/// A running attempt.
struct Attempt<'a> {
    setup: &'a Setup,
    episode: &'a Episode,
    number: u32,
    seed: u64,
    staging: PathBuf,
    activity: &'a Activity,
    begun: Instant,
}

impl Attempt<'_> {
    fn rollout(&self, stop: &Stop) -> Rollout {
        let plan = &self.setup.plan;
        let stop = stop.clone();
        Rollout {
            scenario: self.scenario(),
            label: self.episode.id.clone(),
            driver: Driver::Expert(Expert {
                profile_seed: self.profile_seed(),
                forced: plan.variation.forced(self.episode_seed()),
                ..Expert::default()
            }),
            record: Some(Record {
                out: self.staging.clone(),
                scratch: self.setup.folder.scratch(&self.episode.id),
                depth: plan.depth,
                name: "collect".to_owned(),
            }),
            limits: Limits {
                silence: self.setup.patience,
                stall: self.setup.patience.max(STALL),
                cancelled: Arc::new(move || stop.at_once()),
            },
            folder: Some(self.staging.clone()),
            observer: Arc::new(self.activity.clone()),
        }
    }

    /// The outcome of an attempt that failed before the expert finished.
    fn failed(&self, failure: Failure) -> anyhow::Result<Outcome> {
        let cause = failure.cause;
        let entry = |failure: Failure| {
            let requested = || serde_json::json!({ "task": self.episode.task, "seed": self.seed });
            Failed {
                episode: self.episode.id.clone(),
                task: self.episode.task.clone(),
                attempt: self.number,
                seed: self.seed,
                settings: self.episode.settings.clone(),
                reason: failure.reason,
                seconds: failure.seconds,
                wall_seconds: self.begun.elapsed().as_secs_f64(),
                broken: Some(cause.stored()),
                death: 0,
                loss: None,
                scenario: Some(
                    failure
                        .scenario
                        .as_deref()
                        .map_or_else(requested, scenario_json),
                ),
            }
        };
        match cause {
            FailureCause::Cancelled => Ok(Outcome::Stopped),
            FailureCause::Killed => Ok(Outcome::Killed(failure.reason)),
            FailureCause::Server => Ok(Outcome::Broke(entry(failure))),
            FailureCause::Stall => Err(anyhow!(failure.reason)),
            FailureCause::Scenario
            | FailureCause::Physics
            | FailureCause::Operator
            | FailureCause::Policy => Ok(Outcome::Failed(entry(failure))),
        }
    }

    /// The outcome of an attempt from its file; its simulation took `wall_seconds`, s.
    fn check(&self, finished: &Finished, wall_seconds: f64) -> anyhow::Result<Outcome> {
        self.activity.set_step("checking the file");
        let file = self.staging.join(format!("{}.h5", self.episode.id));
        let verdict = check_file(
            self.episode,
            self.number,
            &file,
            &self.scenario(),
            finished,
            wall_seconds,
        );
        let verdict =
            verdict.with_context(|| format!("output of the recorder:\n{}", finished.messages))?;
        Ok(match verdict {
            Verdict::Done(done) => Outcome::Done(done),
            Verdict::Failed(mut failed) => {
                if self.setup.plan.keep_failed && failed.broken.is_none() {
                    failed.loss = Some(Box::new(self.keep(&file)?));
                }
                Outcome::Failed(failed)
            }
        })
    }

    /// Keeps the recording of an attempt that failed at its task.
    fn keep(&self, file: &Path) -> anyhow::Result<Loss> {
        let (cause, tick) = find_loss(&Recording::open(file)?);
        let sha256 = sha256(file)?;
        let name = format!("{}-attempt-{}", self.episode.id, self.number);
        let file = self.setup.folder.keep_recording(file, &name)?;
        Ok(Loss {
            cause,
            tick,
            file,
            sha256,
        })
    }

    /// Seed from which the episode is sampled.
    fn episode_seed(&self) -> EpisodeSeed {
        EpisodeSeed {
            scene: self.seed,
            sentence: self.episode.sentence,
        }
    }

    /// The requested scenario.
    fn scenario(&self) -> v1::Scenario {
        let plan = &self.setup.plan;
        v1::Scenario {
            task: Some(self.episode.task.clone()),
            seed: Some(self.seed),
            pacing: v1::Pacing::LockStep.into(),
            ..plan.variation.for_episode(self.episode_seed())
        }
    }

    /// Seed of the operator's profile; the scenario's when absent.
    fn profile_seed(&self) -> Option<u64> {
        match self.setup.plan.varied_operator {
            // The first sentence of a scene uses the scenario's seed.
            true => (self.episode.sentence > 0).then(|| self.episode_seed().own()),
            false => Some(0),
        }
    }
}
