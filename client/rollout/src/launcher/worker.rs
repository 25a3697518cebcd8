//! A worker of a command's own: server, recorder and operator in one process,
//! which makes one episode after the other and passes pictures on where they lie.

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

use super::process::{Input, Launch, Process, Program};
use crate::limits;
use crate::protocol::{Asked, Order, Said, Told};

/// Orders of one worker: it grows by some megabytes with each (9 MB measured, with
/// cameras), and starting another takes about a second.
const MOST_ORDERS: u64 = 64;

/// What a worker is started with.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WorkerOptions {
    /// Assets folder; the worker looks for it when absent.
    pub assets: Option<PathBuf>,
    /// Graphics adapter, as the server takes it; its choice when absent.
    pub adapter: Option<String>,
    /// For what it works; for people, and to find it among others.
    pub folder: Option<PathBuf>,
}

/// A worker; killed when the last who holds it lets go.
pub struct Worker {
    process: Mutex<Process>,
    input: Mutex<ChildStdin>,
    board: Arc<Board>,
    next: AtomicU64,
}

/// What a worker has said and nobody has read.
#[derive(Default)]
struct Board {
    said: Mutex<Heard>,
    changed: Condvar,
}

#[derive(Default)]
struct Heard {
    ready: bool,
    /// It says nothing more.
    closed: bool,
    told: BTreeMap<u64, VecDeque<Told>>,
}

impl Worker {
    /// Starts `wheelarm-worker`; orders may be given at once.
    ///
    /// # Errors
    /// When it is not there or does not start.
    pub fn start(options: &WorkerOptions) -> anyhow::Result<Arc<Self>> {
        let launch = Launch {
            name: "worker",
            program: Program::Own("wheelarm-worker"),
            arguments: arguments(options),
            environment: Vec::new(),
            input: Input::Orders,
            folder: None,
        };
        let board = Arc::new(Board::default());
        let (started, result) = mpsc::sync_channel(1);
        let heard = Arc::clone(&board);
        // The kernel kills the worker when the thread that started it is gone: this
        // one is there until the worker says nothing more.
        let keeper = std::thread::Builder::new().name("worker".to_owned());
        keeper
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
                        heard.listen(output);
                    }
                }
            })
            .context("starting the thread that listens to a worker")?;
        let (process, input) = result
            .recv()
            .map_err(|_| anyhow!("the thread that starts a worker ended"))??;
        Ok(Arc::new(Self {
            process: Mutex::new(process),
            input: Mutex::new(input),
            board,
            next: AtomicU64::new(1),
        }))
    }

    /// Gives an order; its number is the worker's.
    ///
    /// # Errors
    /// When the worker is gone.
    pub fn begin(self: &Arc<Self>, order: Order) -> anyhow::Result<Ongoing> {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        self.board
            .said
            .lock()
            .told
            .insert(number, VecDeque::default());
        let ongoing = Ongoing {
            worker: Arc::clone(self),
            number,
            over: false,
        };
        self.ask(&Asked::Do(Box::new(Order { number, ..order })))?;
        Ok(ongoing)
    }

    fn ask(&self, asked: &Asked) -> anyhow::Result<()> {
        let mut line = serde_json::to_vec(asked).context("writing an order")?;
        line.push(b'\n');
        let written = self.input.lock().write_all(&line);
        written.context("the worker takes no orders")
    }

    /// Whether it has had so many orders that a new one is to follow: what drivers and
    /// allocators keep for good goes with it.
    #[must_use]
    pub fn is_worn(&self) -> bool {
        self.next.load(Ordering::Relaxed) > MOST_ORDERS
    }

    /// Whether it has said that it takes orders.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.board.said.lock().ready
    }

    /// That it died, and why by its own words, if it has or does so within
    /// `patience`.
    ///
    /// # Errors
    /// When the operating system does not tell.
    pub fn death(&self, patience: Duration) -> anyhow::Result<Option<String>> {
        let mut process = self.process.lock();
        let Some(status) = process.ended_within(patience)? else {
            return Ok(None);
        };
        Ok(Some(match process.last_words().as_str() {
            "" => format!("the worker died ({status})"),
            words => format!("the worker died ({status}): {words}"),
        }))
    }

    /// Whether something else killed it, see [`Process::was_killed`].
    #[must_use]
    pub fn was_killed(&self) -> bool {
        self.process.lock().was_killed()
    }

    /// Kills it, also when it is stopped.
    pub fn kill(&self) {
        self.process.lock().kill();
    }

    /// Its last messages.
    #[must_use]
    pub fn tail(&self) -> String {
        self.process.lock().tail()
    }
}

impl Board {
    /// Takes what the worker says until it says nothing more.
    fn listen(&self, output: ChildStdout) {
        for line in BufReader::new(output).lines() {
            let Ok(line) = line else { break };
            let Ok(said) = serde_json::from_str(&line) else {
                tracing::warn!("a worker said what cannot be read: {line:?}");
                continue;
            };
            let mut heard = self.said.lock();
            match said {
                Said::Ready => heard.ready = true,
                Said::Of { order, told } => {
                    // Of one that nobody waits for any more nothing is kept.
                    if let Some(queue) = heard.told.get_mut(&order) {
                        queue.push_back(told);
                    }
                }
            }
            self.changed.notify_all();
        }
        self.said.lock().closed = true;
        self.changed.notify_all();
    }
}

/// An order under way. When it is dropped before its end the worker ends it, and
/// is killed where it does not.
pub struct Ongoing {
    worker: Arc<Worker>,
    number: u64,
    over: bool,
}

impl Ongoing {
    /// What the worker tells of it next, if it does within `patience`.
    pub fn next(&mut self, patience: Duration) -> Option<Told> {
        let deadline = Instant::now() + patience;
        let mut heard = self.worker.board.said.lock();
        loop {
            let queue = heard.told.get_mut(&self.number)?;
            if let Some(told) = queue.pop_front() {
                self.over |= told == Told::Over;
                return Some(told);
            }
            let timed_out = self
                .worker
                .board
                .changed
                .wait_until(&mut heard, deadline)
                .timed_out();
            if timed_out
                || heard.closed && heard.told.get(&self.number).is_none_or(|q| q.is_empty())
            {
                return heard.told.get_mut(&self.number)?.pop_front();
            }
        }
    }

    /// Has it ended before its time; what the worker tells then is still heard.
    pub fn cancel(&self) {
        // One that takes no orders has ended.
        let _ = self.worker.ask(&Asked::Cancel { order: self.number });
    }

    /// The worker.
    #[must_use]
    pub fn worker(&self) -> &Arc<Worker> {
        &self.worker
    }

    /// Whether nothing is left of it within `patience`, or of its worker.
    pub fn is_over_within(&mut self, patience: Duration) -> bool {
        let deadline = Instant::now() + patience;
        while !self.over {
            let left = deadline.saturating_duration_since(Instant::now());
            if self.next(left.min(limits::LOOK)).is_none()
                && (left.is_zero() || self.worker.board.said.lock().closed)
            {
                break;
            }
        }
        self.over || self.worker.board.said.lock().closed
    }
}

impl Drop for Ongoing {
    fn drop(&mut self) {
        if !self.over {
            self.cancel();
            // What is left behind would write into the folder of the next attempt.
            if !self.is_over_within(limits::END) {
                self.worker.kill();
            }
        }
        self.worker.board.said.lock().told.remove(&self.number);
    }
}

fn arguments(options: &WorkerOptions) -> Vec<OsString> {
    let mut arguments = Vec::new();
    if let Some(assets) = &options.assets {
        arguments.extend(["--assets".into(), assets.into()]);
    }
    if let Some(adapter) = &options.adapter {
        arguments.extend(["--adapter".into(), adapter.into()]);
    }
    if let Some(folder) = &options.folder {
        arguments.extend(["--for".into(), folder.into()]);
    }
    arguments
}
