//! Server operations that take time: control, episodes, scenarios. Each runs on its own
//! thread and hands its result to the caller's event queue.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use wheelarm_proto::{check, v1};

use super::send::Commands;
use wheelarm_sdk::{Client, ClientError, Commander};

/// An operation that takes time; its result arrives as [`Done`].
#[derive(Clone, Debug, PartialEq)]
pub enum Operation {
    /// Request control; `take` takes it from the current holder.
    Lease {
        /// Take it over.
        take: bool,
    },
    /// Start an episode.
    Start(Start),
    /// End the running episode.
    Stop {
        /// Throw it away.
        discard: bool,
    },
    /// Throw the running episode away, set the scene up again, start again.
    Redo(Start),
    /// Set up a scenario.
    Reset {
        /// Task.
        task: String,
        /// Seed.
        seed: u64,
    },
    /// Stop time, or let it go on.
    Pause(bool),
    /// List the tasks.
    Tasks,
    /// Read the scene, for the target hint.
    Scene,
}

/// How long a person who starts an episode waits for recorders that are not connected.
const RECORDERS_COME: Duration = Duration::from_secs(2);
/// Time between two checks for them.
const LOOK: Duration = Duration::from_millis(100);

/// How an episode is started.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Start {
    /// File label.
    pub label: String,
    /// The label is generated: a recorder that already has such a file adds a number.
    pub numbered: bool,
    /// Instruction sentence.
    pub instruction: String,
    /// Recorders that must be ready; 0 is practice, of which nothing is recorded.
    pub recorders: u32,
}

/// Result of an operation; the error is text for the person.
#[derive(Clone, Debug, PartialEq)]
pub enum Done {
    /// Control is ours, or the reason why not.
    Lease(Result<(), String>),
    /// An episode began.
    Started(Result<Box<v1::EpisodeStarted>, String>),
    /// An episode ended.
    Stopped(Result<Box<v1::EpisodeStopped>, String>),
    /// A scenario is set up.
    Reset(Result<Box<v1::Scenario>, String>),
    /// Time is paused or resumed.
    Paused(Result<bool, String>),
    /// The tasks.
    Tasks(Result<Vec<v1::TaskInfo>, String>),
    /// The scene.
    Scene(Result<Box<v1::SceneReply>, String>),
}

/// A message of a running operation.
pub enum OperationEvent {
    /// The operation ended.
    Done(Done),
    /// Control was granted, with the channel for commands.
    Control(Box<Commander>),
}

/// Runs an operation on a thread and passes its messages on. `former` is a command
/// channel that is released first.
pub fn run(
    client: Client,
    name: String,
    operation: Operation,
    former: Option<Commands>,
    send: impl Fn(OperationEvent) + Send + 'static,
) {
    std::thread::spawn(move || {
        if let Some(former) = former {
            former.finish();
        }
        let done = match operation {
            Operation::Lease { take } => match client.commander(&name, take) {
                Ok(commander) => {
                    send(OperationEvent::Control(Box::new(commander)));
                    Done::Lease(Ok(()))
                }
                Err(error) => Done::Lease(Err(words(&error))),
            },
            Operation::Start(args) => Done::Started(start(&client, &name, &args)),
            Operation::Stop { discard } => Done::Stopped(stop(&client, discard)),
            Operation::Redo(args) => {
                let again = stop(&client, true)
                    .and_then(|_| reset(&client, v1::Scenario::default()))
                    .and_then(|_| start(&client, &name, &args));
                Done::Started(again)
            }
            Operation::Reset { task, seed } => {
                let scenario = v1::Scenario {
                    task: Some(task),
                    seed: Some(seed),
                    ..v1::Scenario::default()
                };
                Done::Reset(reset(&client, scenario))
            }
            Operation::Pause(pause) => {
                let result = pause_time(&client, pause);
                Done::Paused(result.map(|()| pause).map_err(|e| words(&e)))
            }
            Operation::Tasks => {
                let list = client.request(&v1::TasksRequest {});
                Done::Tasks(list.map(|l| l.tasks).map_err(|e| words(&e)))
            }
            Operation::Scene => {
                let scene = client.request(&v1::SceneRequest {});
                Done::Scene(scene.map(Box::new).map_err(|e| words(&e)))
            }
        };
        send(OperationEvent::Done(done));
    });
}

/// The server's own words where it rejected the request; otherwise the whole error.
fn words(error: &ClientError) -> String {
    match error {
        ClientError::Refused { message, .. } => message.clone(),
        error => error.to_string(),
    }
}

/// Starts an episode for a person: it has no time limit and begins only when its
/// recorders have opened their files.
fn start(client: &Client, name: &str, args: &Start) -> Result<Box<v1::EpisodeStarted>, String> {
    wait_for_recorders(client, args.recorders)?;
    let request = v1::EpisodeStartRequest {
        label: args.label.clone(),
        instruction: (!args.instruction.is_empty()).then(|| args.instruction.clone()),
        require_recorders: args.recorders,
        commander: name.to_owned(),
        practice: args.recorders == 0,
        time_limit_seconds: Some(check::MAX_TIME_LIMIT),
        ..Default::default()
    };
    let started = match args.numbered {
        true => client.start_episode_numbered(request),
        false => client.start_episode(&request),
    };
    started.map(Box::new).map_err(|e| words(&e))
}

/// Waits here, because the server waits half a minute for recorders that are not
/// connected, which a person would take for a fault.
fn wait_for_recorders(client: &Client, wanted: u32) -> Result<(), String> {
    if wanted == 0 {
        return Ok(());
    }
    let since = Instant::now();
    loop {
        let status = client
            .request(&v1::StatusRequest {})
            .map_err(|e| words(&e))?;
        let all = status.recorders.iter();
        let answering = all.filter(|recorder| recorder.silent_seconds.is_none());
        let names: BTreeSet<_> = answering.map(|recorder| &recorder.recorder).collect();
        if names.len() >= wanted as usize {
            return Ok(());
        }
        if since.elapsed() > RECORDERS_COME {
            return Err(format!(
                "nothing can be recorded: {} of {wanted} recorders answer. Start one with \
                 `wheelarm record`, or practise without recording",
                names.len()
            ));
        }
        std::thread::sleep(LOOK);
    }
}

fn stop(client: &Client, discard: bool) -> Result<Box<v1::EpisodeStopped>, String> {
    client
        .stop_episode(discard)
        .map(Box::new)
        .map_err(|e| words(&e))
}

/// Resets the same scenario; its instruction is kept.
fn reset(client: &Client, scenario: v1::Scenario) -> Result<Box<v1::Scenario>, String> {
    client
        .reset(scenario, false)
        .map(Box::new)
        .map_err(|e| words(&e))
}

fn pause_time(client: &Client, pause: bool) -> Result<(), ClientError> {
    let done = match pause {
        true => client.request(&v1::PauseRequest {}),
        false => client.request(&v1::ResumeRequest {}),
    };
    done.map(|_| ())
}
