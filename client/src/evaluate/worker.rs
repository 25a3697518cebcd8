//! One episode of an evaluation: set up, done by the operator, measured. What
//! breaks in it (the server dies or hangs, the physics breaks, the scenario is
//! refused, the operator panics) is a result like any other.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use wheelarm_link::{Link, LinkError};
use wheelarm_operate::operator::Outcome;
use wheelarm_operate::run::{self as operate, OperateError, OperateOptions};
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::{Recorder, RecorderOptions, Server, Work};
use wheelarm_rollout::policy::run::{self as fly, Flight, FlyError, FlyOptions};
use wheelarm_rollout::policy::{Policy, PolicyError};
use wheelarm_rollout::{free_label, limits};

use super::args::EvaluateArgs;
use super::entry::{Condition, Entry, Job, failed};
use super::progress::Course;
use super::pulse::{Pulse, Thinker};
use super::witness::Witness;
use crate::broken::Broken;
use crate::policy::Driver;

/// How long the operator may take to notice that its server is gone.
const NOTICE: Duration = Duration::from_secs(60);

/// A server, and a recorder if asked, for one episode after another.
pub struct Worker {
    server: Server,
    link: Link,
    recorder: Option<Recorder>,
    driver: Driver,
    out: PathBuf,
    patience: Duration,
    /// Recordings of successes are not kept.
    forgets: bool,
}

/// What an episode came to, whoever did it.
struct Done {
    started: v1::EpisodeStarted,
    success: bool,
    /// Empty, or why not in words.
    why: String,
    /// What broke.
    broken: Option<Broken>,
    /// What the policy did wrong, in a word.
    fault: Option<&'static str>,
    course: Option<Course>,
    evaluation: v1::Evaluation,
    /// Simulated seconds.
    seconds: f64,
    notes: Vec<String>,
    thinking: Option<(usize, f64, f64)>,
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

impl From<FlyError> for Trouble {
    fn from(problem: FlyError) -> Self {
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
    pub fn start(args: &EvaluateArgs, driver: &Driver, index: usize) -> anyhow::Result<Self> {
        let cameras = driver.cameras(args.cameras(), !args.camera.is_empty())?;
        let server = Server::start(&args.server(None, cameras))?;
        let link = server.link()?;
        let options = RecorderOptions {
            depth: args.depth,
            ..RecorderOptions::lasting(&format!("evaluate-{index}"), &args.out)
        };
        let recorder = args
            .records()
            .then(|| Recorder::start(server.connect(), &options))
            .transpose()?;
        Ok(Self {
            server,
            link,
            recorder,
            driver: driver.clone(),
            out: args.out.clone(),
            forgets: !args.record,
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
        let label = free_label(&self.out, &job.label());
        let recording = match &self.recorder {
            Some(_) => label.clone(),
            None => String::new(),
        };
        let work = self.begin(job, label, &pulse)?;
        let end = self.watch(&work, &pulse)?;
        let broken = |broken, why| Entry {
            label: Some(recording.clone()),
            ..broken_entry(job, broken, why, &pulse, begun.elapsed())
        };
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
    fn begin(
        &self,
        job: &Job,
        label: String,
        pulse: &Arc<Pulse>,
    ) -> anyhow::Result<Work<Result<Done, Trouble>>> {
        let (link, job) = (self.link.clone(), job.clone());
        let recorders = u32::from(self.recorder.is_some());
        let (pulse, driver) = (Arc::clone(pulse), self.driver.clone());
        Work::start("operator", move || {
            attempt(&link, (&job, label), &driver, recorders, &pulse)
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
        if let Some(recorder) = &mut self.recorder {
            let episode = done.started.header.as_ref().map_or(0, |h| h.episode);
            recorder.finished(&self.link, episode)?;
            if self.forgets && done.success {
                let file = self.out.join(format!("{}.h5", done.started.label));
                std::fs::remove_file(&file)
                    .with_context(|| format!("removing {}", file.display()))?;
            }
        }
        let is_kept = self.recorder.is_some() && !(self.forgets && done.success);
        let label = match is_kept {
            true => done.started.label.clone(),
            false => String::new(),
        };
        let seconds = done.seconds.max(pulse.seconds());
        let conditions = done.evaluation.conditions.iter();
        Ok(Entry {
            task: job.task.clone(),
            seed: job.seed,
            settings: job.settings(),
            policy: job.policy.clone(),
            policy_files: job.policy_files.clone(),
            label: Some(label),
            success: done.success,
            end: end(&done),
            course: done.course,
            why: done.why,
            conditions: conditions.map(Condition::from).collect(),
            seconds,
            factor: seconds / done.wall.max(1e-9),
            hash: done.hash,
            rejected_starts: rejected_starts(pulse),
            notes: done.notes,
            thinking: done.thinking,
            broken: done.broken,
            scenario: pulse.scenario().filter(|_| done.broken.is_some()),
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

/// How an episode ended, in a word or two.
fn end(done: &Done) -> String {
    match (done.success, done.broken, done.fault) {
        (true, ..) => "success".to_owned(),
        (_, _, Some(fault)) => format!("policy {fault}"),
        (_, Some(broken), _) => broken.words().to_owned(),
        _ => failed(&done.evaluation),
    }
}

/// As the scenario in force says.
fn rejected_starts(pulse: &Pulse) -> u32 {
    let scenario = pulse.scenario().unwrap_or_default();
    let count = scenario["rejected_starts"].as_u64();
    count
        .and_then(|count| u32::try_from(count).ok())
        .unwrap_or_default()
}

/// The result of an episode in which something broke.
pub fn broken_entry(
    job: &Job,
    broken: Broken,
    why: String,
    pulse: &Pulse,
    wall: Duration,
) -> Entry {
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
        policy: job.policy.clone(),
        policy_files: job.policy_files.clone(),
        label: None,
        thinking: None,
        success: false,
        end: broken.words().to_owned(),
        course: None,
        why: why + &when,
        conditions: Vec::new(),
        seconds,
        factor: seconds / wall.as_secs_f64().max(1e-9),
        hash: String::new(),
        rejected_starts: rejected_starts(pulse),
        notes: Vec::new(),
        broken: Some(broken),
        scenario: Some(pulse.scenario().unwrap_or_else(asked)),
    }
}

/// Sets the scenario up and lets the driver do it.
fn attempt(
    link: &Link,
    (job, label): (&Job, String),
    driver: &Driver,
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
    let witness = Witness::start(link).map_err(Trouble::Work)?;
    let limit = scenario.time_limit_seconds;
    let limit = limit.map(|limit| format!("0.00 s its time limit is {limit:.0} s"));
    let mut notes: Vec<String> = limit.into_iter().collect();
    let begun = Instant::now();
    let mut done = match driver {
        Driver::Operator => operated(link, label, recorders, job, false, pulse, &mut notes)?,
        Driver::Policy(policy, options) => {
            let options = FlyOptions {
                label,
                require_recorders: recorders,
                ..options.clone()
            };
            flown(fly(link, policy.as_ref(), &options, pulse)?)
        }
        Driver::Both(policy, options, most) => {
            let options = FlyOptions {
                label: label.clone(),
                require_recorders: recorders,
                until_seconds: Some(most * share(job.seed)),
                ..options.clone()
            };
            let flight = fly(link, policy.as_ref(), &options, pulse)?;
            match flight.stopped.is_some() {
                // The task was over, or the policy broke, before.
                true => flown(flight),
                false => {
                    notes.push(format!("{:.2} s the operator takes over", pulse.seconds()));
                    operated(link, label, recorders, job, true, pulse, &mut notes)?
                }
            }
        }
    };
    done.wall = begun.elapsed().as_secs_f64();
    done.notes = notes;
    if let Some(seen) = witness.saw() {
        done.course = Some(seen.follower.course(done.success, done.seconds));
        done.hash = seen.hash;
    }
    Ok(done)
}

/// A policy does it; the time that it takes itself is not the server's.
fn fly(
    link: &Link,
    policy: &dyn Policy,
    options: &FlyOptions,
    pulse: &Pulse,
) -> Result<Flight, FlyError> {
    let thinker = Thinker { policy, pulse };
    fly::run(link, &thinker, options, &mut |time| pulse.beat(time))
}

/// Which share of the longest time the policy drives: of the seed, 0 to 1.
fn share(seed: u64) -> f64 {
    (crate::episode_seed::mixed(seed ^ 0x7a6b_0c57_11d3_95e1) >> 11) as f64 / (1_u64 << 53) as f64
}

/// The scripted operator does it, from the start or `on_the_spot`.
fn operated(
    link: &Link,
    label: String,
    recorders: u32,
    job: &Job,
    on_the_spot: bool,
    pulse: &Pulse,
    notes: &mut Vec<String>,
) -> Result<Done, Trouble> {
    let work = OperateOptions {
        label: Some(label),
        require_recorders: recorders,
        forced: job.variation.forced(job.seed),
        on_the_spot,
        ..OperateOptions::default()
    };
    let mut report = operate::run(link, &work, &mut |progress| {
        pulse.beat(progress.time);
        let told = progress.notes.iter();
        notes.extend(told.map(|note| format!("{:.2} s {note}", progress.time)));
    })?;
    // One that a policy began goes on until it is ended.
    if report.stopped.is_none() {
        report.stopped = Some(link.stop_episode_of(&report.started, false)?);
    }
    let broken = matches!(report.outcome, Outcome::Broken(_));
    Ok(Done {
        success: report.succeeded(),
        why: report.why().unwrap_or_default(),
        broken: broken.then_some(Broken::Physics),
        seconds: report.seconds(),
        started: report.started,
        evaluation: report.evaluation,
        fault: None,
        course: None,
        notes: Vec::new(),
        thinking: None,
        hash: String::new(),
        wall: 0.0,
    })
}

/// What came of a policy's episode.
fn flown(flight: Flight) -> Done {
    let evaluation = flight.evaluation.clone();
    let (broken, why) = match (&flight.broken, &flight.error) {
        (Some(words), _) => (Some(Broken::Physics), format!("the physics broke: {words}")),
        (None, Some(problem)) => (Some(Broken::Policy), problem.to_string()),
        (None, None) if evaluation.success => (None, String::new()),
        (None, None) => (None, format!("the task failed: {}", evaluation.failure)),
    };
    let mut thinking = flight.thinking.clone();
    thinking.sort_by(f64::total_cmp);
    let count = thinking.len();
    let mean = thinking.iter().sum::<f64>() / count.max(1) as f64;
    let slow = thinking.get((count * 99 / 100).min(count.saturating_sub(1)));
    Done {
        success: evaluation.success && broken.is_none(),
        why,
        broken,
        fault: flight.error.as_ref().map(PolicyError::kind),
        course: None,
        seconds: flight.seconds(),
        thinking: slow.map(|slow| (count, mean, *slow)),
        started: flight.started,
        evaluation,
        notes: Vec::new(),
        hash: String::new(),
        wall: 0.0,
    }
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
        None => match problem.downcast_ref::<FlyError>() {
            Some(FlyError::Link(e)) => of_link(e),
            Some(FlyError::Silent(..)) => true,
            Some(_) => false,
            None => problem.downcast_ref::<LinkError>().is_some_and(of_link),
        },
    }
}
