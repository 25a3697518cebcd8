//! One episode of an evaluation: set up, done by the operator, measured.

use std::time::{Duration, Instant};

use anyhow::Context;
use serde::{Deserialize, Serialize};
use wheelarm_proto::v1;

use super::{EvaluateArgs, Job};
use crate::control::{self, ResetArgs};
use crate::link::{Link, Received, Stream};
use crate::local::{self, LocalServer, Program};
use crate::operate::operator::Outcome;
use crate::operate::run::{self as operate, OperateArgs};

/// Cameras of a recording when none are named.
const CAMERAS: [&str; 2] = ["gen3=640x360@10", "wheelchair=640x360@10"];

/// One condition of the task at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// Predicate.
    pub name: String,
    /// Whether it held.
    pub holds: bool,
    /// Whether it had to.
    pub required: bool,
    /// The measured quantity, in the unit of its threshold (SI).
    pub value: f64,
}

/// What came of one episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Task.
    pub task: String,
    /// Seed of the scenario and of the operator's habits.
    pub seed: u64,
    /// Operator and task agree that it is done.
    pub success: bool,
    /// Empty, or why not in words.
    pub why: String,
    /// The task's conditions at the end.
    pub conditions: Vec<Condition>,
    /// Simulated seconds.
    pub seconds: f64,
    /// Simulated seconds per wall second.
    pub factor: f64,
    /// Hash of the newest state that was published, once per simulated second;
    /// equal in every run of the same episode.
    pub hash: String,
    /// What the operator noted.
    pub notes: Vec<String>,
}

impl Entry {
    /// The entry in one line.
    #[must_use]
    pub fn line(&self) -> String {
        format!(
            "{:<20} seed {:<4} {} {:5.1} s, {:4.1}x{}",
            self.task,
            self.seed,
            if self.success { "yes" } else { "NO " },
            self.seconds,
            self.factor,
            if self.success {
                String::new()
            } else {
                format!("  {}", self.why)
            }
        )
    }

    /// Required conditions that did not hold.
    pub fn failed(&self) -> impl Iterator<Item = &str> {
        self.conditions
            .iter()
            .filter(|condition| condition.required && !condition.holds)
            .map(|condition| condition.name.as_str())
    }
}

/// A server, and a recorder if asked, for one episode after another.
pub struct Worker {
    server: LocalServer,
    link: Link,
    recorder: Option<(String, Program)>,
    out: std::path::PathBuf,
}

impl Worker {
    /// Starts them for their first job.
    ///
    /// # Errors
    /// When one of them does not start.
    pub fn start(args: &EvaluateArgs, job: &Job, index: usize) -> anyhow::Result<Self> {
        let cameras = match (args.record, args.camera.is_empty()) {
            (false, _) => Vec::new(),
            (true, true) => CAMERAS.map(str::to_owned).to_vec(),
            (true, false) => args.camera.clone(),
        };
        let server = LocalServer::start(&args.server(&job.task, job.seed, cameras))?;
        let link = server.link()?;
        let recorder = args
            .record
            .then(|| {
                let name = format!("evaluate-{index}");
                let program = local::start_recorder(server.connect(), &args.out, &name)?;
                anyhow::Ok((name, program))
            })
            .transpose()?;
        Ok(Self {
            server,
            link,
            recorder,
            out: args.out.clone(),
        })
    }

    /// Does one episode.
    ///
    /// # Errors
    /// When a program stops answering; a task that failed is an [`Entry`].
    pub fn episode(&mut self, job: &Job) -> anyhow::Result<Entry> {
        let context = || {
            format!(
                "{} seed {}; the server said:\n{}",
                job.task,
                job.seed,
                self.server.messages()
            )
        };
        let reset = ResetArgs {
            task: Some(job.task.clone()),
            seed: Some(job.seed),
            ..ResetArgs::default()
        };
        control::reset(&self.link, &reset).with_context(context)?;
        let hashes = self.link.streams(&[Stream::StateHash])?;
        let label = format!("{}-seed{}", job.task, job.seed);
        let work = OperateArgs {
            label: Some(local::free_label(&self.out, &label)),
            require_recorders: self.recorder.iter().count() as u32,
            ..OperateArgs::default()
        };
        let mut notes = Vec::new();
        let begun = Instant::now();
        let report = operate::run(&self.link, &work, &mut |progress| {
            let told = progress.notes.iter();
            notes.extend(told.map(|note| format!("{:.2} s {note}", progress.time)));
        })
        .with_context(context)?;
        let wall = begun.elapsed().as_secs_f64();
        let mut hash = String::new();
        while let Some(sample) = hashes.next(Duration::from_millis(1))? {
            if let Received::StateHash(sample) = sample {
                hash = format!("{:016x}", sample.hash);
            }
        }
        if let Some((name, program)) = &mut self.recorder {
            let episode = report.started.header.as_ref().map_or(0, |h| h.episode);
            local::finished(&self.link, name, episode, program)?;
        }
        let seconds = seconds(&report);
        let why = match &report.outcome {
            Outcome::Failure(why) => why.clone(),
            Outcome::Success if !report.evaluation.success => {
                "the task's conditions no longer held at the end".to_owned()
            }
            Outcome::Success => String::new(),
        };
        Ok(Entry {
            task: job.task.clone(),
            seed: job.seed,
            success: report.succeeded(),
            why,
            conditions: report.evaluation.conditions.iter().map(condition).collect(),
            seconds,
            factor: seconds / wall.max(1e-9),
            hash,
            notes,
        })
    }

    /// Ends the server.
    ///
    /// # Errors
    /// When it does not end.
    pub fn stop(self) -> anyhow::Result<()> {
        drop(self.recorder);
        self.server.stop(self.link)
    }
}

fn condition(condition: &v1::Condition) -> Condition {
    Condition {
        name: condition.name.clone(),
        holds: condition.holds,
        required: condition.required,
        value: condition.value,
    }
}

/// Simulated seconds of an episode.
fn seconds(report: &operate::Report) -> f64 {
    let stamp = |header: Option<&v1::Header>| header.map_or(0, |h| h.stamp_nanos);
    let begun = stamp(report.started.header.as_ref());
    let ended = stamp(report.stopped.as_ref().and_then(|s| s.header.as_ref()));
    ended.saturating_sub(begun) as f64 * 1e-9
}
