//! One episode of an evaluation: set up, done by the operator, measured. What
//! breaks in it (the server dies or hangs, the physics breaks, the scenario is
//! refused) is a result like any other.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;
use serde::{Deserialize, Serialize};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};

use super::pulse::Pulse;
use super::{EvaluateArgs, Job};
use wheelarm_link::{Link, LinkError};
use wheelarm_operate::operator::Outcome;
use wheelarm_operate::run::{self as operate, OperateError, OperateOptions};
use wheelarm_rig::local::{self, LocalServer, Program};

/// Cameras of a recording when none are named.
const CAMERAS: &str = "*=640x360@10";

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
    /// What broke: `physics`, `server` or `scenario`; empty for nothing.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub broken: String,
    /// Where something broke, the scenario that reproduces it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<serde_json::Value>,
}

/// The state of the simulation broke; the server lives.
pub const PHYSICS: &str = "physics";
/// The server died, or stood still and was ended.
pub const SERVER: &str = "server";
/// The server refused the scenario.
pub const SCENARIO: &str = "scenario";
/// How long the recorder of a server that died may take for its partial file.
const PARTING: Duration = Duration::from_secs(20);

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
    patience: Duration,
}

/// What the operator came to.
struct Done {
    report: operate::Report,
    notes: Vec<String>,
    hash: String,
    /// Wall seconds.
    wall: f64,
}

/// Why the operator came to nothing.
enum Trouble {
    /// The server refused the scenario, in its words.
    Refused(String),
    Work(anyhow::Error),
}

impl From<LinkError> for Trouble {
    fn from(problem: LinkError) -> Self {
        Self::Work(problem.into())
    }
}

impl From<OperateError> for Trouble {
    fn from(problem: OperateError) -> Self {
        Self::Work(problem.into())
    }
}

/// Sets the scenario up and lets the operator do it.
fn attempt(
    link: &Link,
    out: &Path,
    job: &Job,
    recorders: usize,
    pulse: &Pulse,
) -> Result<Done, Trouble> {
    let wanted = v1::Scenario {
        task: Some(job.task.clone()),
        seed: Some(job.seed),
        ..v1::Scenario::default()
    };
    let scenario = match link.reset(wanted, false) {
        Ok(scenario) => scenario,
        Err(LinkError::Refused { message, .. }) => return Err(Trouble::Refused(message)),
        Err(problem) => return Err(problem.into()),
    };
    pulse.set_up(&scenario);
    let hashes = link.streams(&[TopicId::StateHash])?;
    let label = format!("{}-seed{}", job.task, job.seed);
    let work = OperateOptions {
        label: Some(local::free_label(out, &label)),
        require_recorders: recorders as u32,
        ..OperateOptions::default()
    };
    let mut notes = Vec::new();
    let begun = Instant::now();
    let report = operate::run(link, &work, &mut |progress| {
        pulse.beat(progress.time);
        let told = progress.notes.iter();
        notes.extend(told.map(|note| format!("{:.2} s {note}", progress.time)));
    })?;
    let wall = begun.elapsed().as_secs_f64();
    let mut hash = String::new();
    while let Some(sample) = hashes.next(Duration::from_millis(1))? {
        if let Sample::StateHash(sample) = sample {
            hash = format!("{:016x}", sample.hash);
        }
    }
    Ok(Done {
        report,
        notes,
        hash,
        wall,
    })
}

/// Whether a problem is that the server does not answer.
fn is_of_server(problem: &anyhow::Error) -> bool {
    let of_link = |e: &LinkError| {
        matches!(
            e,
            LinkError::Gone { .. }
                | LinkError::Silent { .. }
                | LinkError::Unanswered { .. }
                | LinkError::Transport { .. }
        )
    };
    match problem.downcast_ref::<OperateError>() {
        Some(OperateError::Link(e)) => of_link(e),
        Some(OperateError::Silent(..)) => true,
        Some(_) => false,
        None => problem.downcast_ref::<LinkError>().is_some_and(of_link),
    }
}

impl Worker {
    /// Starts them; the first scenario comes with the first episode.
    ///
    /// # Errors
    /// When one of them does not start.
    pub fn start(args: &EvaluateArgs, index: usize) -> anyhow::Result<Self> {
        let cameras = match (args.record, args.camera.is_empty()) {
            (false, _) => Vec::new(),
            (true, true) => vec![CAMERAS.to_owned()],
            (true, false) => args.camera.clone(),
        };
        let server = LocalServer::start(&args.server("", 0, cameras))?;
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
            patience: Duration::from_secs_f64(args.patience.clamp(1.0, 86_400.0)),
        })
    }

    /// Does one episode. A server that dies or stands still for longer than the
    /// patience is an [`Entry`] too, and the worker is spent then.
    ///
    /// # Errors
    /// When something else than the server and the task fails: the recorder,
    /// the disk, a client.
    pub fn episode(&mut self, job: &Job) -> anyhow::Result<(Entry, bool)> {
        let pulse = Pulse::default();
        let begun = Instant::now();
        let mut end: Option<String> = None;
        let (link, out, recorders) = (&self.link, &self.out, self.recorder.iter().count());
        let server = &mut self.server;
        let patience = self.patience;
        let tried = std::thread::scope(|scope| {
            let work = scope.spawn(|| attempt(link, out, job, recorders, &pulse));
            while !work.is_finished() {
                std::thread::sleep(Duration::from_millis(20));
                if end.is_some() {
                    continue;
                }
                if let Some(status) = server.ended()? {
                    end = Some(format!("the server died ({status})"));
                } else if pulse.still() > patience {
                    // Its connection ends with it, and so does the work.
                    server.kill();
                    end = Some(format!(
                        "the server stood still for {:.0} s and was ended",
                        patience.as_secs_f64()
                    ));
                }
            }
            let tried = work.join();
            anyhow::Ok(tried.map_err(|_| anyhow::anyhow!("the operator panicked")))
        })??;
        let seconds = pulse.seconds();
        let scenario = pulse.scenario();
        let broken = |broken: &str, why: String| Entry {
            task: job.task.clone(),
            seed: job.seed,
            success: false,
            why,
            conditions: Vec::new(),
            seconds,
            factor: seconds / begun.elapsed().as_secs_f64().max(1e-9),
            hash: String::new(),
            notes: Vec::new(),
            broken: broken.to_owned(),
            scenario: Some(
                scenario
                    .clone()
                    .unwrap_or_else(|| serde_json::json!({ "task": job.task, "seed": job.seed })),
            ),
        };
        let tried = match tried {
            Ok(done) => Ok(done),
            Err(Trouble::Refused(words)) => return Ok((broken(SCENARIO, words), true)),
            Err(Trouble::Work(problem)) => {
                // A link that breaks is known before the process is gone.
                if end.is_none() && is_of_server(&problem) {
                    end = Some(match server.ended_within(PARTING)? {
                        Some(status) => format!("the server died ({status})"),
                        None => {
                            server.kill();
                            format!("the server did not answer and was ended: {problem:#}")
                        }
                    });
                }
                Err(problem)
            }
        };
        if let Some(mut why) = end
            && tried.is_err()
        {
            let words = server.last_words();
            why = format!("{why} after {seconds:.1} simulated s");
            if !words.is_empty() {
                why = format!("{why}: {words}");
            }
            if let Some((_, recorder)) = &mut self.recorder {
                recorder.let_end(PARTING);
            }
            return Ok((broken(SERVER, why), false));
        }
        let done = tried.with_context(|| {
            format!(
                "{} seed {}; the server said:\n{}",
                job.task,
                job.seed,
                self.server.messages()
            )
        })?;
        let report = &done.report;
        if let Some((name, program)) = &mut self.recorder {
            let episode = report.started.header.as_ref().map_or(0, |h| h.episode);
            local::finished(&self.link, name, episode, program)?;
        }
        let seconds = self::seconds(report).max(seconds);
        let why = match &report.outcome {
            Outcome::Failure(why) | Outcome::Broken(why) => why.clone(),
            Outcome::Success if !report.evaluation.success => {
                "the task's conditions no longer held at the end".to_owned()
            }
            Outcome::Success => String::new(),
        };
        let physics = matches!(report.outcome, Outcome::Broken(_));
        Ok((
            Entry {
                task: job.task.clone(),
                seed: job.seed,
                success: report.succeeded(),
                why,
                conditions: report.evaluation.conditions.iter().map(condition).collect(),
                seconds,
                factor: seconds / done.wall.max(1e-9),
                hash: done.hash,
                notes: done.notes,
                broken: String::from(if physics { PHYSICS } else { "" }),
                scenario: scenario.filter(|_| physics),
            },
            true,
        ))
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
