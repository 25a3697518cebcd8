//! One episode from its order to its file: a simulation is set up and served, a
//! recorder and the operator are its clients, and everything of it is gone before the
//! order is over. A panic in any part costs this episode alone.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context;
use tokio::sync::Notify;
use wheelarm_link::Link;
use wheelarm_operate::demonstration::Demonstrations;
use wheelarm_operate::forced::ForcedError;
use wheelarm_operate::log::Log;
use wheelarm_operate::run::{self as operate, OperateError, OperateOptions};
use wheelarm_proto::settings::{Depth, Named};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_record::{ExitSummary, RecordOptions};
use wheelarm_rollout::launcher::Panicked;
use wheelarm_rollout::limits;
use wheelarm_rollout::protocol::{Came, Order, Recording, ShownFile, Told, Tried};
use wheelarm_server::sensors::camera::Graphics;
use wheelarm_server::service::startup;
use wheelarm_server::sim::Simulation;
use zenoh::Session;

use super::serving::Serving;
use super::voice::OrderVoice;

/// How often the state is told.
const STATUS: Duration = Duration::from_secs(1);
/// Longest wait for the state.
const ANSWER: Duration = Duration::from_secs(20);
/// How long a service that fell may take to be seen by this process.
const NOTICE: Duration = Duration::from_millis(200);

/// What the episodes of this process share.
pub struct Room {
    /// It reaches nobody outside.
    pub session: Session,
    /// Assets folder.
    pub assets: PathBuf,
    /// What draws.
    pub graphics: Graphics,
    /// For services and recorders.
    pub runtime: tokio::runtime::Handle,
}

/// That an episode is to end before its time.
#[derive(Clone, Default)]
pub struct Stop {
    asked: Arc<AtomicBool>,
    told: Arc<Notify>,
}

impl Stop {
    /// Asks for the end.
    pub fn ask(&self) {
        self.asked.store(true, Ordering::Release);
        self.told.notify_waiters();
        self.told.notify_one();
    }

    /// Whether it was asked for.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Acquire)
    }

    async fn come(self) {
        if !self.is_asked() {
            self.told.notified().await;
        }
    }
}

/// Makes an episode and tells how it goes; [`Told::Over`] comes last, and not at all
/// where something of it is left.
pub fn make(room: &Room, order: &Order, stop: &Stop, voice: &OrderVoice) {
    let made = catch_unwind(AssertUnwindSafe(|| attempt(room, order, stop, voice)));
    let problem = match made {
        Ok(Ok(())) => None,
        Ok(Err(Left::Nothing(problem))) => Some(format!("{problem:#}")),
        Ok(Err(Left::Operator)) => return,
        Err(cause) => Some(Panicked::because_of(&*cause).to_string()),
    };
    if let Some(words) = problem {
        voice.tell(Told::Trouble(words));
    }
    voice.tell(Told::Over);
}

/// What is left where an episode could not be made.
enum Left {
    Nothing(anyhow::Error),
    /// An operator that stalls.
    Operator,
}

impl<E: Into<anyhow::Error>> From<E> for Left {
    fn from(problem: E) -> Self {
        Self::Nothing(problem.into())
    }
}

fn attempt(room: &Room, order: &Order, stop: &Stop, voice: &OrderVoice) -> Result<(), Left> {
    let mut scenario = startup::scenario(&order.scenario)?;
    if order.scenario.cameras.is_empty() {
        // Absent, they would be those of the default scenario.
        scenario.cameras.clear();
    }
    let draws = !scenario.cameras.is_empty();
    let depth = order.record.as_ref().map(depth_of).transpose()?;
    let sim = match Simulation::new(&room.assets, scenario) {
        Ok(sim) => sim,
        Err(problem) if problem.is_of_one_draw() => {
            voice.tell(Told::Scenario(problem.to_string()));
            return Ok(());
        }
        Err(problem) => return Err(problem.into()),
    };
    let name = format!("worker-{}-{}", std::process::id(), order.number);
    let mut serving = Serving::start(room, sim, &name, draws, depth.unwrap_or_default(), stop)?;
    let recorder = order.record.as_ref();
    let start = |how| Recorder::start(room, serving.link(), how, stop);
    let recorder = recorder.map(start);
    let recorder = recorder.transpose()?;
    let status = tell_status(serving.link(), voice)?;
    let operator = begin(serving.link(), order)?;
    let mut broke = None;
    let outcome = loop {
        match operator.recv_timeout(limits::LOOK) {
            Ok(outcome) => break Some(outcome),
            Err(_) if stop.is_asked() => break None,
            Err(_) => broke = serving.ended(),
        }
        if broke.is_some() {
            break None;
        }
    };
    drop(status);
    match outcome {
        Some(Ok(Ok(tried))) => voice.tell(Told::Tried(Box::new(tried))),
        Some(Ok(Err(problem))) => match serving.ended_within(NOTICE) {
            Some(words) => voice.tell(Told::Broke(words)),
            None => {
                stop.ask();
                let problem = anyhow::Error::from(problem).context("the operator broke");
                voice.tell(Told::Trouble(format!("{problem:#}")));
            }
        },
        Some(Err(panicked)) => {
            stop.ask();
            voice.tell(Told::Panicked(panicked.0));
        }
        None => {
            // With its service the operator's work ends.
            stop.ask();
            drop(serving);
            if let Some(words) = broke {
                voice.tell(Told::Broke(words));
            }
            if operator.recv_timeout(limits::END).is_err() {
                return Err(Left::Operator);
            }
            end(recorder, voice);
            return Ok(());
        }
    }
    end(recorder, voice);
    Ok(())
}

/// Waits for a recorder's end.
fn end(recorder: Option<Recorder>, voice: &OrderVoice) {
    if let Some(recorder) = recorder {
        let (code, words) = recorder.end();
        voice.tell(Told::Recorded { code, words });
    }
}

/// Tells the simulation's state until what is returned is dropped.
fn tell_status(link: &Link, voice: &OrderVoice) -> std::io::Result<SyncSender<()>> {
    let (end, ended) = mpsc::sync_channel::<()>(1);
    let (link, voice) = (link.clone(), voice.clone());
    let thread = std::thread::Builder::new().name("status".to_owned());
    thread.spawn(move || {
        while ended.recv_timeout(STATUS) == Err(RecvTimeoutError::Timeout) {
            if let Ok(status) = link.ask_within(&v1::StatusRequest {}, ANSWER) {
                voice.tell(Told::Status(Box::new(status)));
            }
        }
    })?;
    Ok(end)
}

/// Reads the demonstrations of an order.
fn shown(told: &ShownFile) -> anyhow::Result<Demonstrations> {
    let path = told.file.display();
    let text = std::fs::read_to_string(&told.file).with_context(|| format!("reading {path}"))?;
    let list = serde_json::from_str(&text).with_context(|| format!("reading {path}"))?;
    Ok(Demonstrations {
        list,
        seed: told.seed,
        noise: told.noise,
    })
}

/// What comes of an operator.
type Outcome = Result<Result<Tried, OperateError>, Panicked>;

/// The operator begins on a thread of its own.
fn begin(link: &Link, order: &Order) -> anyhow::Result<Receiver<Outcome>> {
    let forced = order
        .forced
        .as_deref()
        .map(|name| ForcedError::from_name(name).map_err(|unknown| anyhow::anyhow!("{unknown}")));
    let options = OperateOptions {
        label: Some(order.label.clone()),
        require_recorders: u32::from(order.record.is_some()),
        forced: forced.transpose()?,
        profile_seed: order.profile_seed,
        shown: order
            .shown
            .as_ref()
            .map_or(Ok(Demonstrations::default()), shown)?,
        ..OperateOptions::default()
    };
    let log = order
        .log
        .as_deref()
        .map(|path| Log::create(path).with_context(|| format!("making {}", path.display())));
    let (mut log, link) = (log.transpose()?, link.clone());
    let (done, outcome) = mpsc::sync_channel(1);
    let thread = std::thread::Builder::new().name("operator".to_owned());
    thread.spawn(move || {
        let work = AssertUnwindSafe(|| work_at(&link, &options, log.as_mut()));
        let came = catch_unwind(work).map_err(|cause| Panicked::because_of(&*cause));
        // Whoever waited for it has given it up.
        let _ = done.send(came);
    })?;
    Ok(outcome)
}

fn work_at(
    link: &Link,
    options: &OperateOptions,
    mut log: Option<&mut Log>,
) -> Result<Tried, OperateError> {
    let hashes = link.streams(&[TopicId::StateHash])?;
    let begun = Instant::now();
    let mut notes = Vec::new();
    let report = operate::run(link, options, &mut |progress| {
        let told = progress.notes.iter();
        notes.extend(told.map(|note| format!("{:.2} s {note}", progress.time)));
        if let Some(log) = &mut log {
            log.follow(progress);
        }
    });
    if let Some(log) = log {
        log.end(&report);
    }
    let report = report?;
    let wall_seconds = begun.elapsed().as_secs_f64();
    let mut hash = None;
    while let Some(sample) = hashes.next(Duration::ZERO)? {
        if let Sample::StateHash(sample) = sample {
            hash = Some(sample.hash);
        }
    }
    Ok(Tried {
        came: Came::from(&report.outcome),
        scenario: report.started.scenario.clone().unwrap_or_default(),
        started: report.started,
        stopped: report.stopped.unwrap_or_default(),
        evaluation: report.evaluation,
        ticks: report.ticks,
        source: report.source,
        notes,
        hash,
        wall_seconds,
    })
}

/// How a recording stores depth.
fn depth_of(how: &Recording) -> anyhow::Result<Depth> {
    Depth::from_name(&how.depth).map_err(|unknown| anyhow::anyhow!("{unknown}"))
}

/// The recorder of an episode, on a thread of its own.
struct Recorder {
    thread: JoinHandle<anyhow::Result<ExitSummary>>,
}

impl Recorder {
    fn start(room: &Room, link: &Link, how: &Recording, stop: &Stop) -> anyhow::Result<Self> {
        let options = RecordOptions {
            out: how.out.clone(),
            scratch: how.scratch.clone(),
            name: how.name.clone(),
            depth: depth_of(how)?,
            end_with_stdin: false,
            episodes: Some(1),
        };
        let (link, stop, runtime) = (link.clone(), stop.clone(), room.runtime.clone());
        let thread = std::thread::Builder::new().name("recorder".to_owned());
        let thread = thread
            .spawn(move || {
                let recording = wheelarm_record::run(&link, options, stop.come(), |_| {});
                runtime.block_on(recording)
            })
            .context("starting the thread of the recorder")?;
        Ok(Self { thread })
    }

    /// Waits for its end: its exit code and what failed.
    fn end(self) -> (u8, String) {
        match self.thread.join() {
            Ok(Ok(summary)) => (summary.exit_code(), summary.failed.join("; ")),
            Ok(Err(problem)) => (1, format!("{problem:#}")),
            Err(cause) => (1, Panicked::because_of(&*cause).to_string()),
        }
    }
}
