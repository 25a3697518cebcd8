//! The program `wheelarm-worker`: its process, the requests to it and its events.

use std::collections::{BTreeMap, VecDeque};
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{ChildStdin, ChildStdout};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use parking_lot::{Condvar, Mutex};

use crate::launcher::{Input, Launch, Process, Program};
use crate::limits;
use crate::protocol::{EpisodeRequest, Event, Reply, Request};

/// Episodes of one worker. It grows by 9 MB with each (measured, with cameras), and
/// another one starts in about a second.
const MOST_EPISODES: u64 = 64;

/// Options of a worker.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WorkerOptions {
    /// Assets folder; the worker finds it when absent.
    pub assets: Option<PathBuf>,
    /// Folders of world packs; those of the environment or the user when empty.
    pub packs: Vec<PathBuf>,
    /// Graphics adapter, as the server names it; the server's choice when absent.
    pub adapter: Option<String>,
    /// The folder of results, in its command line: for users who list
    /// processes.
    pub folder: Option<PathBuf>,
}

/// A worker; killed when its last owner drops it.
pub(super) struct Worker {
    pub process: Mutex<Process>,
    input: Mutex<ChildStdin>,
    inbox: Arc<Inbox>,
    next: AtomicU64,
}

/// Unread events of a worker.
#[derive(Default)]
struct Inbox {
    events: Mutex<Events>,
    changed: Condvar,
}

#[derive(Default)]
struct Events {
    /// The worker's output has ended.
    is_closed: bool,
    by_episode: BTreeMap<u64, VecDeque<Event>>,
}

impl Worker {
    /// Starts `wheelarm-worker`; it accepts requests at once.
    ///
    /// # Errors
    /// When the program is missing or does not start.
    pub fn start(options: &WorkerOptions) -> anyhow::Result<Arc<Self>> {
        let launch = Launch {
            name: "worker",
            program: Program::Own("wheelarm-worker"),
            arguments: arguments(options),
            environment: Vec::new(),
            input: Input::Orders,
            folder: None,
        };
        let inbox = Arc::new(Inbox::default());
        let (started, result) = mpsc::sync_channel(1);
        let reader = Arc::clone(&inbox);
        // The kernel kills the worker when the thread that started it ends: this thread
        // lives until the worker's output ends.
        let thread = std::thread::Builder::new().name("worker".to_owned());
        thread
            .spawn(move || {
                let begun = Process::start(launch).and_then(|mut process| {
                    let pipes = process.take_pipes().context("a worker without pipes")?;
                    Ok((process, pipes))
                });
                match begun {
                    Err(problem) => {
                        let _ = started.send(Err(problem));
                    }
                    Ok((process, (input, output))) => {
                        let _ = started.send(Ok((process, input)));
                        reader.read(output);
                    }
                }
            })
            .context("starting the thread that reads from a worker")?;
        let (process, input) = result
            .recv()
            .map_err(|_| anyhow!("the thread that starts a worker ended"))??;
        Ok(Arc::new(Self {
            process: Mutex::new(process),
            input: Mutex::new(input),
            inbox,
            next: AtomicU64::new(1),
        }))
    }

    /// Begins an episode, whose number the worker chooses.
    ///
    /// # Errors
    /// When the worker has ended.
    pub fn begin(self: &Arc<Self>, request: EpisodeRequest) -> anyhow::Result<RunningEpisode> {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        let mut events = self.inbox.events.lock();
        events.by_episode.insert(number, VecDeque::default());
        drop(events);
        let running = RunningEpisode {
            worker: Arc::clone(self),
            number,
            is_over: false,
        };
        let request = EpisodeRequest { number, ..request };
        self.send(&Request::Run(Box::new(request)))?;
        Ok(running)
    }

    fn send(&self, request: &Request) -> anyhow::Result<()> {
        let mut line = serde_json::to_vec(request).context("writing a request")?;
        line.push(b'\n');
        let written = self.input.lock().write_all(&line);
        written.context("the worker accepts no requests")
    }

    /// Whether another worker should follow: memory that drivers and allocators keep is
    /// freed with this one.
    #[must_use]
    pub fn is_worn(&self) -> bool {
        self.next.load(Ordering::Relaxed) > MOST_EPISODES
    }
}

impl Inbox {
    /// Reads events until the worker's output ends.
    fn read(&self, output: ChildStdout) {
        for line in BufReader::new(output).lines() {
            let Ok(line) = line else { break };
            let Ok(reply) = serde_json::from_str(&line) else {
                tracing::warn!("a line of a worker cannot be read: {line:?}");
                continue;
            };
            let mut events = self.events.lock();
            match reply {
                Reply::Ready => {}
                Reply::Episode { number, event } => {
                    // Events of an episode that was dropped are dropped too.
                    if let Some(queue) = events.by_episode.get_mut(&number) {
                        queue.push_back(event);
                    }
                }
            }
            self.changed.notify_all();
        }
        self.events.lock().is_closed = true;
        self.changed.notify_all();
    }
}

/// A running episode. Dropped before its end, it is cancelled, and its worker is killed
/// when that takes too long.
pub(super) struct RunningEpisode {
    worker: Arc<Worker>,
    number: u64,
    is_over: bool,
}

impl RunningEpisode {
    /// The next event, if one arrives within `patience`.
    pub fn next(&mut self, patience: Duration) -> Option<Event> {
        let deadline = Instant::now() + patience;
        let inbox = &self.worker.inbox;
        let mut events = inbox.events.lock();
        loop {
            let queue = events.by_episode.get_mut(&self.number)?;
            if let Some(event) = queue.pop_front() {
                self.is_over |= event == Event::Over;
                return Some(event);
            }
            if events.is_closed || inbox.changed.wait_until(&mut events, deadline).timed_out() {
                let event = events.by_episode.get_mut(&self.number)?.pop_front();
                self.is_over |= event == Some(Event::Over);
                return event;
            }
        }
    }

    /// Ends the episode early; its further events still arrive.
    pub fn cancel(&self) {
        // A worker that accepts no requests has ended.
        let number = self.number;
        let _ = self.worker.send(&Request::Cancel { number });
    }

    /// The worker.
    #[must_use]
    pub fn worker(&self) -> &Arc<Worker> {
        &self.worker
    }

    /// Whether the episode or its worker ends within `patience`.
    pub fn is_over_within(&mut self, patience: Duration) -> bool {
        let deadline = Instant::now() + patience;
        while !self.is_over {
            let left = deadline.saturating_duration_since(Instant::now());
            if self.next(left.min(limits::LOOK)).is_none() && (left.is_zero() || self.is_closed()) {
                break;
            }
        }
        self.is_over || self.is_closed()
    }

    fn is_closed(&self) -> bool {
        self.worker.inbox.events.lock().is_closed
    }
}

impl Drop for RunningEpisode {
    fn drop(&mut self) {
        if !self.is_over {
            self.cancel();
            // What is left would write into the folder of the next attempt.
            if !self.is_over_within(limits::END) {
                self.worker.process.lock().kill();
            }
        }
        let mut events = self.worker.inbox.events.lock();
        events.by_episode.remove(&self.number);
    }
}

fn arguments(options: &WorkerOptions) -> Vec<OsString> {
    let mut arguments = Vec::new();
    if let Some(assets) = &options.assets {
        arguments.extend(["--assets".into(), assets.into()]);
    }
    for folder in &options.packs {
        arguments.extend(["--packs".into(), folder.into()]);
    }
    if let Some(adapter) = &options.adapter {
        arguments.extend(["--adapter".into(), adapter.into()]);
    }
    if let Some(folder) = &options.folder {
        arguments.extend(["--for".into(), folder.into()]);
    }
    arguments
}
