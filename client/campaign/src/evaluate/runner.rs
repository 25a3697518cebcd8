//! One episode of an evaluation after another. An episode that fails is a result too.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use wheelarm_dataset::scenario_text::scenario_json;
use wheelarm_rollout::{
    Backend, Failure, Finished, InProcess, Limits, Processes, Record, Rollout, WorkerOptions,
    free_label,
};

use super::args::EvaluateArgs;
use super::entry::{Condition, Entry, Job};
use super::episode_monitor::EpisodeMonitor;
use crate::policy_options::DriverChoice;
use crate::worker_mode::WorkerMode;

/// Runs one episode at a time.
pub struct Runner<'a> {
    args: &'a EvaluateArgs,
    driver: &'a DriverChoice,
    backend: Box<dyn Backend>,
    record: Option<Record>,
}

impl<'a> Runner<'a> {
    /// Runner number `index`, whose programs start with the first episode.
    ///
    /// # Errors
    /// When the recordings need other cameras than the policy.
    pub fn new(
        args: &'a EvaluateArgs,
        driver: &'a DriverChoice,
        index: usize,
    ) -> anyhow::Result<Self> {
        let record = args.records().then(|| Record {
            depth: args.depth,
            ..Record::new(&format!("evaluate-{index}"), &args.out)
        });
        let (assets, adapter) = (args.assets.clone(), args.graphics.first());
        // A policy is queried from this process, which also removes the recordings of successes.
        let is_in_process = args.worker == WorkerMode::Process
            && driver.is_expert()
            && args.redraw_failures.is_none();
        let backend: Box<dyn Backend> = match is_in_process {
            true => Box::new(InProcess::new(WorkerOptions {
                assets,
                packs: args.packs.packs.clone(),
                adapter,
                folder: Some(args.out.clone()),
            })),
            false => {
                let cameras = driver.cameras(args.cameras(), !args.camera.is_empty())?;
                let scenario = args.scenario(None, cameras);
                let processes = Processes::new(assets, adapter).with_packs(&args.packs.packs);
                Box::new(processes.keeping(scenario, record.clone()))
            }
        };
        Ok(Self {
            args,
            driver,
            backend,
            record,
        })
    }

    /// Runs one episode.
    ///
    /// # Errors
    /// When something fails that is not part of the episode: the recorder, the disk, a
    /// missing program.
    pub fn episode(&self, job: &Job) -> anyhow::Result<Entry> {
        let begun = Instant::now();
        let label = free_label(&self.args.out, &job.label());
        let monitor = Arc::new(EpisodeMonitor::default());
        let cameras = self
            .driver
            .cameras(self.args.cameras(), !self.args.camera.is_empty())?;
        let rollout = Rollout {
            scenario: self.args.scenario(Some(job), cameras),
            label: label.clone(),
            driver: self
                .driver
                .for_episode(job.seed, job.variation.forced(job.seed)),
            record: self.record.clone(),
            limits: Limits::patience(self.args.patience),
            folder: None,
            observer: monitor.clone(),
        };
        let result = self.backend.run(&rollout);
        let label = match self.record {
            Some(_) => label,
            None => String::new(),
        };
        match result.with_context(|| format!("{} seed {}", job.task, job.seed))? {
            Ok(finished) => self.finished(job, finished, label, &monitor),
            Err(failure) => Ok(failed(job, failure, label, begun.elapsed())),
        }
    }

    fn finished(
        &self,
        job: &Job,
        finished: Finished,
        label: String,
        monitor: &EpisodeMonitor,
    ) -> anyhow::Result<Entry> {
        let success = finished.succeeded();
        // Recordings of successes are made for --redraw-failures alone.
        let is_forgotten = self.record.is_some() && !self.args.record && success;
        if is_forgotten {
            let file = self.args.out.join(format!("{label}.h5"));
            std::fs::remove_file(&file).with_context(|| format!("removing {}", file.display()))?;
        }
        let seconds = finished.seconds().max(monitor.seconds());
        let limit = finished.scenario.time_limit_seconds;
        let limit = limit.map(|limit| format!("0.00 s its time limit is {limit:.0} s"));
        let broken = finished.failure();
        let conditions = finished.evaluation.conditions.iter();
        Ok(Entry {
            label: Some(if is_forgotten { String::new() } else { label }),
            success,
            end: finished.end(),
            course: monitor.course(success, finished.seconds()),
            why: finished.why().unwrap_or_default(),
            conditions: conditions.map(Condition::from).collect(),
            seconds,
            factor: seconds / finished.wall_seconds.max(1e-9),
            hash: finished
                .hash
                .map_or_else(String::new, |hash| format!("{hash:016x}")),
            rejected_starts: finished.scenario.rejected_starts,
            instruction: finished.scenario.instruction().to_owned(),
            target: finished.scenario.target().to_owned(),
            thinking: answer_times(finished.answer_seconds),
            broken,
            scenario: broken.map(|_| scenario_json(&finished.scenario)),
            notes: limit.into_iter().chain(finished.notes).collect(),
            ..Entry::for_job(job)
        })
    }
}

/// The result of an episode that failed before its driver finished.
fn failed(job: &Job, failure: Failure, label: String, wall: Duration) -> Entry {
    let seconds = failure.seconds;
    let when = match seconds > 0.0 {
        true => format!(", after {seconds:.1} simulated s"),
        false => String::new(),
    };
    let requested = || serde_json::json!({ "task": job.task, "seed": job.seed });
    let cause = failure.cause.stored();
    let scenario = failure.scenario.as_deref();
    Entry {
        label: Some(label),
        end: cause.words().to_owned(),
        why: failure.reason + &when,
        seconds,
        factor: seconds / wall.as_secs_f64().max(1e-9),
        rejected_starts: scenario.map_or(0, |scenario| scenario.rejected_starts),
        broken: Some(cause),
        scenario: Some(scenario.map_or_else(requested, scenario_json)),
        ..Entry::for_job(job)
    }
}

/// Number of a policy's answers, their mean wall time, s, and what 99 of 100 stayed below.
fn answer_times(mut seconds: Vec<f64>) -> Option<(usize, f64, f64)> {
    seconds.sort_by(f64::total_cmp);
    let count = seconds.len();
    let slow = seconds.get((count * 99 / 100).min(count.saturating_sub(1)))?;
    let mean = seconds.iter().sum::<f64>() / count.max(1) as f64;
    Some((count, mean, *slow))
}
