//! A connection that keeps itself open: it connects, reports samples, detects the loss
//! of the server and reconnects, until its owner drops it.
//!
//! All reports arrive in one queue, in order.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossbeam_channel::Sender;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};

use wheelarm_sdk::{Bound, Client, ClientError, Connect};

/// Time between two status requests.
const PULSE: Duration = Duration::from_millis(400);
/// Longest wait for a status reply.
const PULSE_PATIENCE: Duration = Duration::from_millis(1500);
/// The connection is reopened after this long without a reply.
const GIVE_UP: Duration = Duration::from_secs(8);
/// Wait between two attempts to connect.
const RETRY: Duration = Duration::from_millis(500);
/// Longest wait for one attempt, s.
const ATTEMPT_SECS: f64 = 2.0;

/// Samples that may wait: several seconds of all streams. On overflow the oldest are
/// dropped.
const WAITING: Bound = Bound {
    samples: 4096,
    bytes: 32 << 20,
};

/// Reports of a connection.
pub enum ConnectionEvent {
    /// Connected; the client may be used until [`ConnectionEvent::Lost`].
    Connected(Box<Client>),
    /// A sample.
    Sample(Box<Sample>),
    /// The simulated robot: reported after connecting, and again when
    /// it changes.
    Robot(Box<v1::RobotDescription>),
    /// The server's status, and the round trip it took, s.
    Status(Box<v1::Status>, f64),
    /// No reply within the timeout; the connection may recover.
    Silent,
    /// The connection is lost; it reconnects by itself.
    Lost(String),
}

/// A connection that keeps itself open; it ends when dropped.
pub struct ServerConnection {
    ended: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl ServerConnection {
    /// Starts connecting; `to_event` converts a report into the owner's event.
    #[must_use]
    pub fn open<E: Send + 'static>(
        connect: Connect,
        streams: Vec<TopicId>,
        events: Sender<E>,
        to_event: fn(ConnectionEvent) -> E,
    ) -> Self {
        let ended = Arc::new(AtomicBool::new(false));
        let ours = Arc::clone(&ended);
        let thread = std::thread::spawn(move || {
            let send = |event| {
                if events.send(to_event(event)).is_err() {
                    ours.store(true, Ordering::Release);
                }
            };
            keep_open(&connect, &streams, &ours, &send);
        });
        Self {
            ended,
            thread: Some(thread),
        }
    }
}

impl Drop for ServerConnection {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been printed already.
            let _ = thread.join();
        }
    }
}

fn keep_open(
    connect: &Connect,
    streams: &[TopicId],
    ended: &AtomicBool,
    send: &(dyn Fn(ConnectionEvent) + Sync),
) {
    let attempt = Connect {
        timeout_secs: connect.timeout_secs.clamp(0.2, ATTEMPT_SECS),
        ..connect.clone()
    };
    while !ended.load(Ordering::Acquire) {
        let reason = match Client::open(&attempt) {
            Ok(client) => match stay(&client, streams, ended, send) {
                Ok(Some(reason)) => {
                    close(client);
                    reason
                }
                Ok(None) => {
                    close(client);
                    return;
                }
                Err(error) => error.to_string(),
            },
            Err(error) => error.to_string(),
        };
        send(ConnectionEvent::Lost(reason));
        std::thread::sleep(RETRY);
    }
}

/// Closing waits for the peer, which may be gone: it runs on its own thread.
fn close(client: Client) {
    std::thread::spawn(move || client.close());
}

/// Serves one connection; returns why it was lost, or `None` when the owner ended it.
fn stay(
    client: &Client,
    streams: &[TopicId],
    ended: &AtomicBool,
    send: &(dyn Fn(ConnectionEvent) + Sync),
) -> Result<Option<String>, ClientError> {
    let samples = client.newest_streams(streams, WAITING)?;
    send(ConnectionEvent::Connected(Box::new(client.clone())));
    let closed = &AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(move || {
            while !closed.load(Ordering::Acquire) {
                // `wheelarm watch` reports samples that cannot be read.
                if let Ok(Some(sample)) = samples.next(Duration::from_millis(50)) {
                    send(ConnectionEvent::Sample(Box::new(sample)));
                }
            }
        });
        let mut answered = Instant::now();
        let mut robot = None;
        let lost = loop {
            if ended.load(Ordering::Acquire) {
                break None;
            }
            if client.is_gone() {
                break Some("the server has disconnected".to_owned());
            }
            let requested = Instant::now();
            match pulse(client) {
                Some(status) => {
                    answered = Instant::now();
                    let round_trip = requested.elapsed().as_secs_f64();
                    let named = status.scenario.as_ref().map(|s| s.robot.clone());
                    send(ConnectionEvent::Status(Box::new(status), round_trip));
                    if robot != named
                        && let Some(description) = describe(client)
                    {
                        robot = named;
                        send(ConnectionEvent::Robot(Box::new(description)));
                    }
                    std::thread::sleep(PULSE.saturating_sub(requested.elapsed()));
                }
                None if answered.elapsed() > GIVE_UP => {
                    break Some(format!(
                        "no reply for {:.0} s",
                        answered.elapsed().as_secs_f64()
                    ));
                }
                None => {
                    send(ConnectionEvent::Silent);
                    std::thread::sleep(PULSE.saturating_sub(requested.elapsed()));
                }
            }
        };
        closed.store(true, Ordering::Release);
        Ok(lost)
    })
}

/// Requests the robot's description.
fn describe(client: &Client) -> Option<v1::RobotDescription> {
    let scene = client.request_within(&v1::SceneRequest {}, PULSE_PATIENCE);
    scene.ok()?.robot
}

/// Requests the status, with a shorter timeout than that of a command's query.
fn pulse(client: &Client) -> Option<v1::Status> {
    client
        .request_within(&v1::StatusRequest {}, PULSE_PATIENCE)
        .ok()
}
