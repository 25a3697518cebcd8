//! Sends commands from a thread, so that a stalled connection never stalls the
//! keyboard, and measures the time until the server accepts each of them.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel::{Sender, bounded};
use parking_lot::Mutex;
use wheelarm_proto::{Message, TopicId, v1};
use wheelarm_sdk::{Client, Commander};

/// Commands that may wait for the connection; further ones are dropped.
const WAITING: usize = 32;
/// Commands whose echo is still expected.
const EXPECTED: usize = 256;
/// Longest wait for the last commands at the end.
const FAREWELL: Duration = Duration::from_secs(2);

type Flight = Arc<Mutex<VecDeque<(u64, Instant)>>>;

/// The sending side of one connection that holds control.
pub struct Commands {
    queue: Option<Sender<Box<(v1::Header, v1::Command)>>>,
    thread: Option<std::thread::JoinHandle<()>>,
    _echoes: Option<zenoh::pubsub::Subscriber<()>>,
}

impl Commands {
    /// Sends by `commander`; `echoed` receives the seconds from sending a
    /// command until the server published it as accepted.
    pub fn new(
        client: &Client,
        mut commander: Commander,
        name: String,
        echoed: impl Fn(f64) + Send + Sync + 'static,
    ) -> Self {
        let flight = Flight::default();
        let returning = Arc::clone(&flight);
        let echoes = client
            .subscribe(&client.keys().topic(TopicId::Command), move |sample| {
                let Ok(log) = v1::CommandLog::decode(&*sample.payload().to_bytes()) else {
                    return;
                };
                let command = log.command.unwrap_or_default();
                if command.commander != name {
                    return;
                }
                let sequence = command.header.map_or(0, |h| h.sequence);
                let mut flight = returning.lock();
                while flight.front().is_some_and(|(first, _)| *first < sequence) {
                    flight.pop_front();
                }
                if flight.front().is_some_and(|(first, _)| *first == sequence)
                    && let Some((_, sent)) = flight.pop_front()
                {
                    echoed(sent.elapsed().as_secs_f64());
                }
            })
            // Without echoes only the delay is unknown.
            .ok();
        let (queue, commands) = bounded::<Box<(v1::Header, v1::Command)>>(WAITING);
        let thread = std::thread::spawn(move || {
            for waiting in commands {
                let (header, command) = *waiting;
                let sequence = commander.sent();
                {
                    let mut flight = flight.lock();
                    if flight.len() == EXPECTED {
                        flight.pop_front();
                    }
                    flight.push_back((sequence, Instant::now()));
                }
                if let Err(error) = commander.answer(&header, command) {
                    // The connection monitor notices a dead connection.
                    tracing::warn!("cannot send a command: {error}");
                }
            }
        });
        Self {
            queue: Some(queue),
            thread: Some(thread),
            _echoes: echoes,
        }
    }

    /// Queues a command; false when the connection has stalled.
    pub fn send(&self, header: v1::Header, command: v1::Command) -> bool {
        let Some(queue) = &self.queue else {
            return true;
        };
        queue.try_send(Box::new((header, command))).is_ok()
    }

    /// Waits until all queued commands are sent, then releases control.
    pub fn finish(mut self) {
        self.queue = None;
        let Some(thread) = self.thread.take() else {
            return;
        };
        let since = Instant::now();
        while !thread.is_finished() && since.elapsed() < FAREWELL {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
