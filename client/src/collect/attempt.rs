//! One attempt at an episode: what it is made of and what its file is worth.
//! `by_process` and `by_socket` simulate it.
//!
//! A failure of the task is the operator's and gets a fresh seed, and so does a
//! simulation that breaks and an operator that panics or stalls; where a server or a
//! worker dies or hangs, which may be the host's fault, the same seed is tried once
//! more; anything else that goes wrong is the host's, and the same seed is tried
//! again. A server or worker that something else killed ran out of memory: the same
//! seed is tried again by fewer workers, and the journal has no entry.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use wheelarm_dataset::read::Episode as Recording;
use wheelarm_dataset::scenario_text::scenario_json;
use wheelarm_operate::run::Report;
use wheelarm_proto::v1;

use super::activity::Activity;
use super::episode::Episode;
use super::folder::{Folder, sha256};
use super::journal::{Done, Failed};
use super::judge::{Judged, judge};
use super::loss::{self, Loss};
use super::plan::Plan;
use super::slot::Slot;
use super::stop::Stop;
use crate::broken::Broken;
use crate::episode_seed::EpisodeSeed;
use crate::way::Way;

/// Simulation time may stall for as long as the server may be silent, and
/// for this long in any case, while the server answers.
pub const STALL: Duration = Duration::from_secs(60);

/// File for what the operator does, in a staging folder.
pub const OPERATOR_LOG: &str = "operator.log";

/// What every attempt of a campaign needs.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The plan.
    pub plan: Plan,
    /// The dataset's folder.
    pub folder: Folder,
    /// Assets folder; the server looks for it when absent.
    pub assets: Option<PathBuf>,
    /// How a worker runs.
    pub way: Way,
    /// Longest time in which a server does not answer before it is ended.
    pub patience: Duration,
}

/// What came of an attempt.
#[derive(Debug)]
pub enum Outcome {
    /// The staged file is good.
    Done(Box<Done>),
    /// The task was not done, or it was no fault of a server or the host.
    Failed(Failed),
    /// The server died or hung.
    Broke(Failed),
    /// Something else killed the server or the worker; how it ended.
    Killed(String),
    /// Thrown away because the campaign is to end.
    Stopped,
}

/// An attempt under way.
pub struct Attempt<'a> {
    pub setup: &'a Setup,
    pub slot: &'a Slot,
    pub episode: &'a Episode,
    pub number: u32,
    pub seed: u64,
    pub staging: PathBuf,
    pub stop: &'a Stop,
    pub activity: &'a Activity,
    pub begun: Instant,
}

/// Why an attempt ends before its file is there.
pub enum Halt {
    Over(Box<Outcome>),
    Trouble(anyhow::Error),
}

impl From<anyhow::Error> for Halt {
    fn from(problem: anyhow::Error) -> Self {
        Self::Trouble(problem)
    }
}

/// An attempt that is over.
pub fn over(outcome: Outcome) -> Halt {
    Halt::Over(Box::new(outcome))
}

impl Attempt<'_> {
    /// What the file of an attempt is worth that took `wall_seconds`; `said` are the
    /// words of whoever made it.
    pub fn judged(
        &self,
        report: &Report,
        wall_seconds: f64,
        said: &str,
    ) -> anyhow::Result<Outcome> {
        self.activity.tell("checking the file");
        let file = self.staging.join(format!("{}.h5", self.episode.id));
        let judged = judge(
            self.episode,
            self.number,
            &file,
            &self.scenario(),
            report,
            wall_seconds,
        );
        let judged = judged.with_context(|| format!("the recorder said:\n{said}"))?;
        Ok(match judged {
            Judged::Done(done) => Outcome::Done(done),
            Judged::Failed(mut failed) => {
                if self.setup.plan.keep_failed && failed.broken.is_none() {
                    failed.loss = Some(Box::new(self.keep(&file)?));
                }
                Outcome::Failed(failed)
            }
        })
    }

    /// Keeps the recording of an attempt that failed at its task.
    fn keep(&self, file: &Path) -> anyhow::Result<Loss> {
        let (cause, tick) = loss::of(&Recording::open(file)?);
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

    /// From what the episode is drawn.
    pub fn drawn(&self) -> EpisodeSeed {
        EpisodeSeed {
            scene: self.seed,
            sentence: self.episode.sentence,
        }
    }

    /// The scenario that is asked for.
    pub fn scenario(&self) -> v1::Scenario {
        let plan = &self.setup.plan;
        let mut scenario = v1::Scenario {
            scene: plan.scene.clone(),
            robot: plan.robot.clone(),
            task: Some(self.episode.task.clone()),
            seed: Some(self.seed),
            cameras: plan.cameras.iter().map(|camera| camera.setting()).collect(),
            state_rate_hz: Some(plan.state_rate),
            imu_rate_hz: Some(plan.imu_rate),
            imu_noise: Some(plan.randomise.imu_noise),
            pacing: v1::Pacing::LockStep.into(),
            quality: plan.quality.code().into(),
            ..v1::Scenario::default()
        };
        plan.variation.apply(self.drawn(), &mut scenario);
        scenario
    }

    /// Seed of the operator's profile; the scenario's when absent.
    pub fn profile_seed(&self) -> Option<u64> {
        match self.setup.plan.randomise.operator {
            // The scenario's seed, for the first sentence of a scene.
            true => (self.episode.sentence > 0).then(|| self.drawn().own()),
            false => Some(0),
        }
    }

    /// The journal's entry where something broke; `told` is the scenario that
    /// the server told.
    pub fn failed(&self, broken: Broken, reason: String, told: Option<v1::Scenario>) -> Failed {
        let asked = || serde_json::json!({ "task": self.episode.task, "seed": self.seed });
        Failed {
            episode: self.episode.id.clone(),
            task: self.episode.task.clone(),
            attempt: self.number,
            seed: self.seed,
            settings: self.episode.settings.clone(),
            reason,
            seconds: self.activity.seconds(),
            wall_seconds: self.begun.elapsed().as_secs_f64(),
            broken: Some(broken),
            death: 0,
            loss: None,
            scenario: Some(told.as_ref().map_or_else(asked, scenario_json)),
        }
    }
}
