//! One episode of an evaluation: set up, done by the operator, measured. What
//! breaks in it (the server dies or hangs, the physics breaks, the scenario is
//! refused, the operator panics) is a result like any other.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use wheelarm_link::{Link, LinkError};
use wheelarm_operate::operator::Outcome;
use wheelarm_operate::run::{self as operate, OperateError, OperateOptions};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_rig::{Recorder, RecorderOptions, Server, Work, free_label, limits};

use super::args::EvaluateArgs;
use super::entry::{Condition, Entry, Job};
use super::pulse::Pulse;
use crate::broken::Broken;

/// How long the operator may take to notice that its server is gone.
const NOTICE: Duration = Duration::from_secs(60);

/// A server, and a recorder if asked, for one episode after another.
pub struct Worker {
    server: Server,
    link: Link,
    recorder: Option<Recorder>,
    out: PathBuf,
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

impl Worker {
    /// Starts them; the first scenario comes with the first episode.
    ///
    /// # Errors
    /// When one of them does not start.
    pub fn start(args: &EvaluateArgs, index: usize) -> anyhow::Result<Self> {
        let server = Server::start(&args.server(None, args.cameras()))?;
        let link = server.link()?;
        let options = RecorderOptions::lasting(&format!("evaluate-{index}"), &args.out);
        let recorder = args
            .record
            .then(|| Recorder::start(server.connect(), &options))
            .transpose()?;
        Ok(Self {
            server,
            link,
            recorder,
            out: args.out.clone(),
            patience: args.patience,
        })
    }

    /// Does one episode, and whether the worker can do another. A server that
    /// dies or stalls for longer than the patience is an [`Entry`] too, and
    /// the worker is spent then.
    ///
    /// # Errors
    /// When something else than the server and the task fails: the recorder,
    /// the disk, a client.
    pub fn episode(&mut self, job: &Job) -> anyhow::Result<(Entry, bool)> {
        let pulse = Arc::new(Pulse::default());
        let begun = Instant::now();
        let work = self.begin(job, &pulse)?;
        let end = self.watch(&work, &pulse)?;
        let broken = |broken, why| broken_entry(job, broken, why, &pulse, begun.elapsed());
        // Only one whose server has ended can still be at it.
        if !work.is_over_within(NOTICE) {
            let why = format!(
                "the operator stalled for {:.0} s and was left behind",
                (self.patience + NOTICE).as_secs_f64()
            );
            return Ok((self.spent(broken(Broken::Operator, why)), false));
        }
        let (problem, end) = match work.outcome() {
            Ok(Ok(done)) => return Ok((self.entry(job, done, &pulse)?, end.is_none())),
            Ok(Err(Trouble::Refused(words))) => return Ok((broken(Broken::Scenario, words), true)),
            Err(panicked) => {
                let why = format!("the operator panicked: {}", panicked.0);
                return Ok((self.spent(broken(Broken::Operator, why)), false));
            }
            Ok(Err(Trouble::Work(problem))) => {
                let end = match end {
                    Some(end) => Some(end),
                    None => self.lost(&problem)?,
                };
                (problem, end)
            }
        };
        let Some(why) = end else {
            let tail = self.server.tail();
            return Err(problem.context(format!(
                "{} seed {}; the server said:\n{tail}",
                job.task, job.seed
            )));
        };
        Ok((self.spent(broken(Broken::Server, why)), false))
    }

    /// The operator begins the episode on a thread of its own.
    fn begin(&self, job: &Job, pulse: &Arc<Pulse>) -> anyhow::Result<Work<Result<Done, Trouble>>> {
        let (link, out, job) = (self.link.clone(), self.out.clone(), job.clone());
        let recorders = u32::from(self.recorder.is_some());
        let pulse = Arc::clone(pulse);
        Work::start("operator", move || {
            attempt(&link, &out, &job, recorders, &pulse)
        })
    }

    /// Waits until the work is over or its server has ended, and says how that
    /// did: it died, or it stalled for too long and is ended here, with which
    /// its connection and the work end.
    fn watch<T: Send + 'static>(
        &mut self,
        work: &Work<T>,
        pulse: &Pulse,
    ) -> anyhow::Result<Option<String>> {
        while !work.is_over_within(limits::LOOK) {
            if let Some(death) = self.server.death(Duration::ZERO)? {
                return Ok(Some(death));
            }
            if pulse.still() > self.patience {
                self.server.kill();
                return Ok(Some(format!(
                    "the server stalled for {:.0} s and was ended",
                    self.patience.as_secs_f64()
                )));
            }
        }
        Ok(None)
    }

    /// How the server ended where `problem` says that it does not answer: a link
    /// that breaks is known before the process is gone.
    fn lost(&mut self, problem: &anyhow::Error) -> anyhow::Result<Option<String>> {
        if !is_of_server(problem) {
            return Ok(None);
        }
        let death = self.server.death(limits::END)?;
        Ok(Some(death.unwrap_or_else(|| {
            self.server.kill();
            format!("the server did not answer and was ended: {problem:#}")
        })))
    }

    /// Lets the recorder of a worker that is spent make its partial file.
    fn spent(&mut self, entry: Entry) -> Entry {
        self.server.kill();
        if let Some(recorder) = self.recorder.take() {
            recorder.end();
        }
        entry
    }

    /// The result of an episode that went to its end.
    fn entry(&mut self, job: &Job, done: Done, pulse: &Pulse) -> anyhow::Result<Entry> {
        let report = &done.report;
        if let Some(recorder) = &mut self.recorder {
            recorder.finished(&self.link, report.episode())?;
        }
        let seconds = report.seconds().max(pulse.seconds());
        let physics = matches!(report.outcome, Outcome::Broken(_));
        Ok(Entry {
            task: job.task.clone(),
            seed: job.seed,
            settings: job.settings(),
            success: report.succeeded(),
            why: report.why().unwrap_or_default(),
            conditions: report
                .evaluation
                .conditions
                .iter()
                .map(Condition::from)
                .collect(),
            seconds,
            factor: seconds / done.wall.max(1e-9),
            hash: done.hash,
            notes: done.notes,
            broken: physics.then_some(Broken::Physics),
            scenario: pulse.scenario().filter(|_| physics),
        })
    }

    /// Ends the server.
    ///
    /// # Errors
    /// When it cannot be asked.
    pub fn stop(self) -> anyhow::Result<()> {
        drop(self.recorder);
        self.server.stop(self.link)
    }
}

/// The result of an episode in which something broke.
fn broken_entry(job: &Job, broken: Broken, why: String, pulse: &Pulse, wall: Duration) -> Entry {
    let seconds = pulse.seconds();
    let when = match seconds > 0.0 {
        true => format!(", after {seconds:.1} simulated s"),
        false => String::new(),
    };
    let asked = || serde_json::json!({ "task": job.task, "seed": job.seed });
    Entry {
        task: job.task.clone(),
        seed: job.seed,
        settings: job.settings(),
        success: false,
        why: why + &when,
        conditions: Vec::new(),
        seconds,
        factor: seconds / wall.as_secs_f64().max(1e-9),
        hash: String::new(),
        notes: Vec::new(),
        broken: Some(broken),
        scenario: Some(pulse.scenario().unwrap_or_else(asked)),
    }
}

/// Sets the scenario up and lets the operator do it.
fn attempt(
    link: &Link,
    out: &Path,
    job: &Job,
    recorders: u32,
    pulse: &Pulse,
) -> Result<Done, Trouble> {
    let mut wanted = v1::Scenario {
        task: Some(job.task.clone()),
        seed: Some(job.seed),
        ..v1::Scenario::default()
    };
    job.variation.apply(job.seed, &mut wanted);
    let scenario = match link.reset(wanted, false) {
        Ok(scenario) => scenario,
        Err(LinkError::Refused { message, .. }) => return Err(Trouble::Refused(message)),
        Err(problem) => return Err(problem.into()),
    };
    pulse.set_up(&scenario);
    let hashes = link.streams(&[TopicId::StateHash])?;
    let work = OperateOptions {
        label: Some(free_label(out, &job.label())),
        require_recorders: recorders,
        forced: job.variation.forced(job.seed),
        ..OperateOptions::default()
    };
    let limit = scenario.time_limit_seconds;
    let limit = limit.map(|limit| format!("0.00 s its time limit is {limit:.0} s"));
    let mut notes: Vec<String> = limit.into_iter().collect();
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
