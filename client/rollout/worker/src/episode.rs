//! One episode from its request to its file. A simulation is set up and served; a recorder
//! and the expert are its clients. Everything of the episode has ended before its last
//! event. A panic in any part costs this episode alone.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::Context;
use wheelarm_proto::v1;
use wheelarm_recorder::{ExitSummary, RecordOptions};
use wheelarm_rollout::launcher::Panicked;
use wheelarm_rollout::protocol::{EpisodeRequest, Event};
use wheelarm_rollout::{FailureCause, Finished, Heartbeat, Record, Session, limits};
use wheelarm_sdk::Client;
use wheelarm_server::service::{packs, startup};
use wheelarm_server::sim::Simulation;

use super::room::{Room, Stop};
use super::serving::Serving;
use super::stdout_protocol::EpisodeOutput;

/// Time between two status events.
const STATUS: Duration = Duration::from_secs(1);
/// Longest wait for the status.
const ANSWER: Duration = Duration::from_secs(20);
/// Longest time in which this process notices that a service ended.
const NOTICE: Duration = Duration::from_millis(200);

/// Makes an episode. [`Event::Over`] is the last event; it is missing when a part of the
/// episode could not be ended.
pub fn make(room: &Room, request: &EpisodeRequest, stop: &Stop, output: &EpisodeOutput) {
    let made = catch_unwind(AssertUnwindSafe(|| attempt(room, request, stop, output)));
    let problem = match made {
        Ok(Ok(())) => None,
        Ok(Err(Left::Nothing(problem))) => Some(format!("{problem:#}")),
        Ok(Err(Left::Expert)) => return,
        Err(cause) => Some(Panicked::because_of(&*cause).to_string()),
    };
    if let Some(words) = problem {
        output.write(Event::HostFailed(words));
    }
    output.write(Event::Over);
}

/// The part that is left of an episode that failed.
enum Left {
    Nothing(anyhow::Error),
    /// An expert that hangs.
    Expert,
}

impl<E: Into<anyhow::Error>> From<E> for Left {
    fn from(problem: E) -> Self {
        Self::Nothing(problem.into())
    }
}

fn attempt(
    room: &Room,
    request: &EpisodeRequest,
    stop: &Stop,
    output: &EpisodeOutput,
) -> Result<(), Left> {
    let failed = |cause, reason| output.write(Event::Failed { cause, reason });
    let mut scenario = startup::scenario(&request.scenario)?;
    if request.scenario.cameras.is_empty() {
        // Absent, they would be those of the default scenario.
        scenario.cameras.clear();
    }
    if let Err(words) = packs::attach(&room.assets, &room.packs, &mut scenario) {
        failed(FailureCause::Scenario, words);
        return Ok(());
    }
    let has_cameras = !scenario.cameras.is_empty();
    let sim = match Simulation::new(&room.assets, scenario) {
        Ok(sim) => sim,
        Err(problem) if problem.is_of_one_draw() => {
            failed(FailureCause::Scenario, problem.to_string());
            return Ok(());
        }
        Err(problem) => return Err(problem.into()),
    };
    let name = format!("worker-{}-{}", std::process::id(), request.number);
    let record = request.record.as_ref();
    let depth = record.map(|record| record.depth).unwrap_or_default();
    let mut serving = Serving::start(room, sim, &name, has_cameras, depth, stop)?;
    let recorder = record.map(|record| Recorder::start(room, serving.client(), record, stop));
    let recorder = recorder.transpose()?;
    let status = report_status(serving.client(), output)?;
    let expert = begin(serving.client(), request)?;
    let mut broken = None;
    let outcome = loop {
        match expert.recv_timeout(limits::LOOK) {
            Ok(outcome) => break Some(outcome),
            Err(_) if stop.is_requested() => break None,
            Err(_) => broken = serving.ended(),
        }
        if broken.is_some() {
            break None;
        }
    };
    match outcome {
        Some(Ok(Ok(finished))) => output.write(Event::Finished(Box::new(finished))),
        Some(Ok(Err(problem))) => match serving.ended_within(NOTICE) {
            Some(words) => failed(FailureCause::Server, words),
            None => {
                stop.request();
                let problem = problem.context("the operator broke");
                output.write(Event::HostFailed(format!("{problem:#}")));
            }
        },
        Some(Err(panicked)) => {
            stop.request();
            let words = format!("the operator panicked: {}", panicked.0);
            failed(FailureCause::Operator, words);
        }
        None => {
            // The expert ends with its service.
            stop.request();
            drop(serving);
            if let Some(words) = broken {
                failed(FailureCause::Server, words);
            }
            if expert.recv_timeout(limits::END).is_err() {
                return Err(Left::Expert);
            }
        }
    }
    if let Some(recorder) = recorder {
        let (code, words) = recorder.end();
        output.write(Event::Recorded { code, words });
    }
    drop(status);
    Ok(())
}

/// Reports the simulation's status until the returned sender is dropped.
fn report_status(client: &Client, output: &EpisodeOutput) -> std::io::Result<SyncSender<()>> {
    let (end, ended) = mpsc::sync_channel::<()>(1);
    let (client, output) = (client.clone(), output.clone());
    let thread = std::thread::Builder::new().name("status".to_owned());
    thread.spawn(move || {
        while ended.recv_timeout(STATUS) == Err(RecvTimeoutError::Timeout) {
            if let Ok(status) = client.request_within(&v1::StatusRequest {}, ANSWER) {
                output.write(Event::Status(Box::new(status)));
            }
        }
    })?;
    Ok(end)
}

/// The outcome of the expert's thread.
type Outcome = Result<anyhow::Result<Finished>, Panicked>;

/// Starts the expert on a separate thread.
fn begin(client: &Client, request: &EpisodeRequest) -> anyhow::Result<Receiver<Outcome>> {
    let (client, request) = (client.clone(), request.clone());
    let (done, outcome) = mpsc::sync_channel(1);
    let thread = std::thread::Builder::new().name("operator".to_owned());
    thread.spawn(move || {
        let work = AssertUnwindSafe(|| {
            request.driver().run(&Session {
                client: &client,
                label: &request.label,
                recorders: u32::from(request.record.is_some()),
                log: request.log.as_deref(),
                heartbeat: &Heartbeat::new(limits::FINISH),
                observer: &(),
            })
        });
        let outcome = catch_unwind(work).map_err(|cause| Panicked::because_of(&*cause));
        // The receiver may have given up.
        let _ = done.send(outcome);
    })?;
    Ok(outcome)
}

/// The recorder of an episode, on a separate thread.
struct Recorder {
    thread: JoinHandle<anyhow::Result<ExitSummary>>,
}

impl Recorder {
    fn start(room: &Room, client: &Client, record: &Record, stop: &Stop) -> anyhow::Result<Self> {
        let options = RecordOptions {
            out: record.out.clone(),
            scratch: record.scratch.clone(),
            name: record.name.clone(),
            depth: record.depth,
            end_with_stdin: false,
            episodes: Some(1),
        };
        let (client, stop, runtime) = (client.clone(), stop.clone(), room.runtime.clone());
        let thread = std::thread::Builder::new().name("recorder".to_owned());
        let thread = thread
            .spawn(move || {
                let recording = wheelarm_recorder::run(&client, options, stop.requested(), |_| {});
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
