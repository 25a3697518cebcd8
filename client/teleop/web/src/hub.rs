//! The thread of the gateway: receives events of the server and of the pages, and executes
//! the decisions of the model.
//!
//! Events wait in three lanes, each in order: stops first, then pages, then the server.
//! However much the server sends, a stop waits for one event at most. The server's lane is
//! bounded; behind it [`ServerConnection`] drops the oldest.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use crossbeam_channel::{Receiver, Select, Sender, bounded, unbounded};
use tokio::sync::{mpsc, oneshot, watch as latest};
use wheelarm_proto::TopicId;
use wheelarm_proto::v1;
use wheelarm_sdk::{Client, ClientError, Commander, Connect};

use crate::audit::Audit;
use crate::model::{Effect, Model, PendingPick, Socket};
use crate::pending_operation::{self, Done, Operation, OperationEvent};
use crate::protocol::{Action, Intent, Request};
use crate::report::{self, Sent};
use crate::send::Commands;
use crate::skills::{SkillEvent, Skills};
use crate::visitor::Visitor;
use crate::watch::{ConnectionEvent, ServerConnection};

/// Streams that the gateway subscribes.
const STREAMS: [TopicId; 12] = [
    TopicId::Pose,
    TopicId::JointState,
    TopicId::Odometry,
    TopicId::Evaluation,
    TopicId::Applied,
    TopicId::Contact,
    TopicId::Event,
    TopicId::Clock,
    TopicId::Phase,
    TopicId::Refusal,
    TopicId::Command,
    TopicId::EpisodeStop,
];
/// Time between two reports to the pages.
const REPORT: Duration = Duration::from_millis(100);
/// Reports between two readings of the size of the recording.
const SIZES: u64 = 10;
/// Time between two checks for due work: while motion is active, and otherwise.
const LOOK: [Duration; 2] = [Duration::from_millis(10), Duration::from_millis(50)];
/// Events of the server that may wait.
const SERVER: usize = 256;
/// Most events that are handled before time advances.
const AT_ONCE: usize = 500;
/// Time from the last command until the connection is closed.
const FAREWELL: Duration = Duration::from_millis(150);

/// Channels to one page.
#[derive(Debug)]
pub struct Outlet {
    /// Immediate messages; a page that does not read loses its socket.
    pub messages: mpsc::Sender<String>,
    /// The newest report.
    pub report: latest::Sender<String>,
}

/// Events of the hub.
#[derive(Debug)]
pub enum Event {
    /// A socket was opened; a state socket with its channels.
    Joined(String, Visitor, Socket, Option<Outlet>),
    /// A socket was closed.
    Left(String, Socket),
    /// The session of a page's socket ended, with the reason.
    SignedOut(String, String),
    /// An intent of a page.
    Intent(String, Intent),
    /// A stop that arrived before its socket was registered.
    Late(String, Intent),
    /// A request of a page.
    Request(String, Request),
    /// Codec and width of each camera that a page receives.
    Sent(String, Vec<Sent>),
    /// The newest report, as a page of this visitor would get it.
    Report(oneshot::Sender<String>),
    /// A user action outside the model, for the audit.
    Audit(serde_json::Value),
    /// From the server.
    Server(Server),
    /// The gateway shuts down.
    End,
}

/// Events from the server.
pub enum Server {
    /// From the connection.
    Connection(ConnectionEvent),
    /// From a pending operation.
    Operation(OperationEvent),
    /// Reply to a pick.
    PickReply(PendingPick, Result<v1::PickReply, String>),
    /// From a skill.
    Skill(SkillEvent),
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Server")
    }
}

/// Sending ends of the event queues.
#[derive(Clone)]
struct Lanes {
    stops: Sender<Event>,
    pages: Sender<Event>,
    server: Sender<Event>,
}

impl Lanes {
    /// Queues an event; dropped after shutdown.
    fn send(&self, event: Event) {
        let lane = match &event {
            Event::Intent(_, intent) if intent.action == Action::Stop => &self.stops,
            _ => &self.pages,
        };
        let _ = lane.send(event);
    }
}

/// Receiving ends of the event queues.
struct Queues {
    stops: Receiver<Event>,
    pages: Receiver<Event>,
    server: Receiver<Event>,
}

impl Queues {
    fn lanes() -> (Lanes, Self) {
        let (stops, stops_received) = unbounded();
        let (pages, pages_received) = unbounded();
        let (server, server_received) = bounded(SERVER);
        let lanes = Lanes {
            stops,
            pages,
            server,
        };
        let queues = Self {
            stops: stops_received,
            pages: pages_received,
            server: server_received,
        };
        (lanes, queues)
    }

    /// The most urgent event.
    fn next(&self) -> Option<Event> {
        let mut lanes = [&self.stops, &self.pages, &self.server].into_iter();
        lanes.find_map(|lane| lane.try_recv().ok())
    }

    /// Like [`Queues::next`], but waits.
    fn wait(&self, patience: Duration) -> Option<Event> {
        let mut select = Select::new();
        for lane in [&self.stops, &self.pages, &self.server] {
            select.recv(lane);
        }
        // The woken lane is irrelevant: `next` checks all.
        let _ = select.ready_timeout(patience);
        self.next()
    }
}

/// Handle to the hub.
#[derive(Clone)]
pub struct Hub {
    lanes: Lanes,
    /// The connection to the server, while there is one.
    pub client: latest::Receiver<Option<Client>>,
    /// Names of the cameras, by their index.
    pub cameras: latest::Receiver<Vec<String>>,
    /// The page in control.
    pub driving: latest::Receiver<Option<String>>,
}

impl Hub {
    /// Starts the thread.
    #[must_use]
    pub fn start(
        connect: &Connect,
        audit: Audit,
        recordings: Option<PathBuf>,
    ) -> (Self, std::thread::JoinHandle<()>) {
        let (lanes, queues) = Queues::lanes();
        let (client, client_of) = latest::channel(None);
        let (cameras, cameras_of) = latest::channel(Vec::new());
        let (driving, driving_of) = latest::channel(None);
        let work = Work {
            model: Model::default(),
            lanes: lanes.clone(),
            client: None,
            client_sender: client,
            cameras,
            driving,
            commands: None,
            skills: None,
            outlets: BTreeMap::new(),
            sent: BTreeMap::new(),
            audit,
            began: Instant::now(),
            reports: 0,
            recordings,
        };
        let server = lanes.server.clone();
        let connection =
            ServerConnection::open(connect.clone(), STREAMS.to_vec(), server, |event| {
                Event::Server(Server::Connection(event))
            });
        let thread = std::thread::spawn(move || {
            work.run(&queues);
            // The connection may wait for room in the queue: without a reader it ends.
            drop(queues);
            drop(connection);
        });
        let hub = Self {
            lanes,
            client: client_of,
            cameras: cameras_of,
            driving: driving_of,
        };
        (hub, thread)
    }

    /// Queues an event; dropped after shutdown.
    pub fn send(&self, event: Event) {
        self.lanes.send(event);
    }
}

struct Work {
    model: Model,
    lanes: Lanes,
    client: Option<Client>,
    client_sender: latest::Sender<Option<Client>>,
    cameras: latest::Sender<Vec<String>>,
    driving: latest::Sender<Option<String>>,
    commands: Option<Commands>,
    skills: Option<Skills>,
    outlets: BTreeMap<String, Outlet>,
    sent: BTreeMap<String, Vec<Sent>>,
    audit: Audit,
    began: Instant,
    reports: u64,
    recordings: Option<PathBuf>,
}

impl Work {
    fn now(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    fn run(mut self, queues: &Queues) {
        let mut next_report = Instant::now();
        loop {
            let look = LOOK[usize::from(!self.model.is_busy())];
            let due = next_report.saturating_duration_since(Instant::now());
            let mut event = queues.wait(look.min(due));
            // Events that arrived meanwhile are handled before time advances.
            let mut taken = 0;
            while let Some(one) = event {
                if matches!(one, Event::End) {
                    return self.farewell();
                }
                self.take(one);
                taken += 1;
                event = (taken < AT_ONCE).then(|| queues.next()).flatten();
            }
            let effects = self.model.tick(self.now());
            self.perform(effects);
            if Instant::now() >= next_report {
                next_report = Instant::now() + REPORT;
                self.report();
                self.audit.tick();
            }
        }
    }

    fn take(&mut self, event: Event) {
        let now = self.now();
        let effects = match event {
            Event::Joined(page, visitor, socket, outlet) => {
                self.model.joined(&page, &visitor, socket, now);
                if let Some(outlet) = outlet {
                    self.outlets.insert(page, outlet);
                }
                Vec::new()
            }
            Event::Left(page, socket) => {
                let effects = self.model.left(&page, socket, now);
                let closed = |outlet: &Outlet| outlet.messages.is_closed();
                if self.outlets.get(&page).is_some_and(closed) {
                    self.outlets.remove(&page);
                }
                if socket == Socket::Video {
                    self.sent.remove(&page);
                }
                effects
            }
            Event::SignedOut(page, why) => self.model.signed_out(&page, &why, now),
            Event::Intent(page, intent) => {
                // A stop overtook the opening of its socket: it is queued behind it, once.
                if intent.action == Action::Stop && !self.model.knows(&page) {
                    let _ = self.lanes.pages.send(Event::Late(page, intent));
                    return;
                }
                self.model.intent(&page, &intent, now)
            }
            Event::Late(page, intent) => self.model.intent(&page, &intent, now),
            Event::Request(page, request) => self.model.handle_request(&page, &request, now),
            Event::Sent(page, sent) => {
                self.sent.insert(page, sent);
                Vec::new()
            }
            Event::Report(answer) => {
                let common = report::common(&self.model, self.reports, now);
                let _ = answer.send(serde_json::Value::Object(common).to_string());
                Vec::new()
            }
            Event::Audit(line) => {
                self.audit.write(&line);
                Vec::new()
            }
            Event::Server(server) => self.handle_server(server, now),
            Event::End => Vec::new(),
        };
        self.perform(effects);
    }

    fn handle_server(&mut self, server: Server, now: f64) -> Vec<Effect> {
        match server {
            Server::Connection(ConnectionEvent::Connected(client)) => {
                self.client_sender.send_replace(Some((*client).clone()));
                self.client = Some(*client);
                self.model.connected(now)
            }
            Server::Connection(ConnectionEvent::Sample(sample)) => self.model.sample(*sample, now),
            Server::Connection(ConnectionEvent::Robot(robot)) => {
                self.model.robot(&robot);
                Vec::new()
            }
            Server::Connection(ConnectionEvent::Status(status, round_trip)) => {
                self.publish_cameras(&status);
                self.model.status(*status, round_trip, now)
            }
            Server::Connection(ConnectionEvent::Silent) => self.model.silent(now),
            Server::Connection(ConnectionEvent::Lost(reason)) => {
                self.client_sender.send_replace(None);
                self.client = None;
                self.release();
                self.model.lost(&reason, now)
            }
            Server::Operation(OperationEvent::Control(commander)) => {
                self.take_control(*commander);
                Vec::new()
            }
            Server::Operation(OperationEvent::Done(done)) => self.model.done(done, now),
            Server::PickReply(picked, reply) => {
                self.model.picked(&picked.page, picked.id, reply, now)
            }
            Server::Skill(SkillEvent::Acts {
                number,
                header,
                command,
                notes,
            }) => self.model.goal_acts(number, *header, *command, &notes),
            Server::Skill(SkillEvent::Over { number, result }) => {
                self.model.goal_over(number, result, now)
            }
        }
    }

    fn publish_cameras(&mut self, status: &v1::Status) {
        let scenario = status.scenario.as_ref();
        let names: Vec<String> = scenario
            .map(|s| s.cameras.iter().map(|c| c.name.clone()).collect())
            .unwrap_or_default();
        self.cameras.send_if_modified(|known| {
            let changed = *known != names;
            if changed {
                *known = names;
            }
            changed
        });
    }

    fn take_control(&mut self, commander: Commander) {
        let Some(client) = &self.client else { return };
        let name = commander.name().to_owned();
        self.commands = Some(Commands::new(client, commander, name, |_| {}));
    }

    /// Releases control on a thread: the connection may hang.
    fn release(&mut self) {
        if let Some(commands) = self.commands.take() {
            std::thread::spawn(move || commands.finish());
        }
    }

    fn perform(&mut self, effects: Vec<Effect>) {
        let driving = self.model.control.page();
        self.driving.send_if_modified(|known| {
            let changed = known.as_deref() != driving;
            if changed {
                *known = driving.map(str::to_owned);
            }
            changed
        });
        for effect in effects {
            match effect {
                Effect::Send(header, command) => {
                    let stalled = match &self.commands {
                        Some(commands) => !commands.send(*header, *command),
                        None => false,
                    };
                    if stalled {
                        let effects = self.model.not_sent(self.now());
                        self.perform(effects);
                    }
                }
                Effect::Say(page, message) => self.say(&page, message.to_string()),
                Effect::Operation(operation, name) => self.start_operation(operation, name),
                Effect::Release => self.release(),
                Effect::Pick(picked) => self.pick(picked),
                Effect::Goal(request) => {
                    let lanes = self.lanes.clone();
                    let send = move |event| {
                        lanes.send(Event::Server(Server::Skill(event)));
                    };
                    self.skills = self
                        .client
                        .clone()
                        .map(|client| Skills::start(client, request, send));
                }
                Effect::EndGoal(_) => self.skills = None,
                Effect::Audit(line) => self.audit.write(&line),
            }
        }
    }

    fn say(&mut self, page: &str, text: String) {
        let Some(outlet) = self.outlets.get(page) else {
            return;
        };
        // A page that does not read is closed by its own socket.
        if outlet.messages.try_send(text).is_err() {
            self.outlets.remove(page);
        }
    }

    fn start_operation(&mut self, operation: Operation, name: String) {
        let lanes = self.lanes.clone();
        let send = move |event| {
            lanes.send(Event::Server(Server::Operation(event)));
        };
        let Some(client) = &self.client else {
            let lease = matches!(operation, Operation::Lease { .. });
            let words = "no connection to the simulation: wait until it is back".to_owned();
            if lease {
                send(OperationEvent::Done(Done::Lease(Err(words))));
            } else {
                send(OperationEvent::Done(Done::Tasks(Err(words))));
            }
            return;
        };
        // Two command channels of one client would block each other.
        let leases = matches!(operation, Operation::Lease { .. });
        let former = if leases { self.commands.take() } else { None };
        pending_operation::run(client.clone(), name, operation, former, send);
    }

    fn pick(&self, picked: PendingPick) {
        let lanes = self.lanes.clone();
        let client = self.client.clone();
        std::thread::spawn(move || {
            let reply = match client {
                Some(client) => client.request(&picked.request).map_err(|e| match e {
                    ClientError::Refused { message, .. } => message,
                    e => e.to_string(),
                }),
                None => Err("no connection to the simulation: wait until it is back".to_owned()),
            };
            lanes.send(Event::Server(Server::PickReply(picked, reply)));
        });
    }

    fn report(&mut self) {
        let now = self.now();
        self.reports += 1;
        if self.reports.is_multiple_of(SIZES) {
            self.model.recorded_bytes = self.recordings.as_deref().and_then(newest_log);
        }
        let common = report::common(&self.model, self.reports, now);
        for (page, outlet) in &self.outlets {
            let sent = self.sent.get(page).map_or(&[][..], Vec::as_slice);
            let message = report::of_page(&self.model, page, &common, sent, now);
            outlet.report.send_replace(message.to_string());
        }
    }

    /// Brakes the chair, holds the arm and releases control.
    fn farewell(&mut self) {
        let effects = self.model.farewell(self.now());
        self.perform(effects);
        if let Some(commands) = self.commands.take() {
            // The stop must leave before control is released.
            std::thread::sleep(FAREWELL);
            commands.finish();
        }
    }
}

/// Size of the log in this folder that was written last, bytes: that of the running
/// episode.
fn newest_log(folder: &Path) -> Option<u64> {
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let logs = entries.filter(|entry| entry.path().extension().is_some_and(|end| end == "wal"));
    let metadata = logs.filter_map(|entry| entry.metadata().ok());
    let written = |file: &std::fs::Metadata| file.modified().unwrap_or(SystemTime::UNIX_EPOCH);
    metadata.max_by_key(written).map(|file| file.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intent(kind: &str) -> Intent {
        let text = format!(r#"{{"t":"{kind}","seq":1,"epoch":1}}"#);
        Intent::read(&text).unwrap().unwrap()
    }

    #[test]
    fn a_stop_overtakes_all_waiting_events() {
        let (lanes, queues) = Queues::lanes();
        let mut refused = 0;
        while refused < 100_000 {
            let event = Event::Server(Server::Connection(ConnectionEvent::Silent));
            if lanes.server.try_send(event).is_err() {
                break;
            }
            refused += 1;
        }
        assert_eq!(refused, SERVER, "the lane of the server is bounded");
        for _ in 0..1000 {
            lanes.send(Event::Intent("a".to_owned(), intent("alive")));
        }
        lanes.send(Event::Intent("a".to_owned(), intent("stop")));
        let first = queues.next();
        assert!(
            matches!(&first, Some(Event::Intent(_, one)) if one.action == Action::Stop),
            "{first:?}"
        );
        for _ in 0..1000 {
            assert!(
                matches!(queues.next(), Some(Event::Intent(..))),
                "pages first"
            );
        }
        assert!(matches!(queues.next(), Some(Event::Server(_))));
    }
}
