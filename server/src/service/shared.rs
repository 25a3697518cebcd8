//! State shared between threads, and the callbacks of the transport's threads: they
//! only queue messages.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Instant;

use parking_lot::Mutex;
use wheelarm_pack::PackName;
use wheelarm_proto::Query;
use wheelarm_proto::keys::Keys;
use wheelarm_proto::{schema, v1};
use zenoh::sample::Sample;

use super::command_gate::{self, CommandGate, Life};
use super::denied::Denied;
use super::outbox::Outbox;
use super::recorders::Recorders;
use super::refusals::Refusals;
use super::replies::Replies;
use super::request_queue::{Lane, Request, RequestQueue};
use super::wakeup::Wakeup;
use crate::robot::control::GripperMap;

/// State shared between threads.
pub(super) struct Shared {
    pub(super) outbox: Arc<Outbox>,
    pub(super) command_gate: Mutex<CommandGate>,
    pub(super) refusals: Mutex<Refusals>,
    /// Control events, until the engine publishes them.
    pub(super) event_queue: Mutex<Vec<v1::Event>>,
    /// Queries that wait for the simulation thread.
    pub(super) request_queue: RequestQueue<Request>,
    pub(super) replies: Replies,
    /// The tasks of the assets and of a pack, after the first request.
    pub(super) tasks: Mutex<Option<(Vec<PackName>, Vec<v1::TaskInfo>)>>,
    /// Newest episode and tick, for replies from other threads.
    newest: [AtomicU64; 2],
    pub(super) recorders: Mutex<Recorders>,
    pub(super) wakeup: Arc<Wakeup>,
    /// Messages that name another sender than their key, or cannot be decoded.
    strange: AtomicU64,
    /// Zero of the gate's wall clock.
    started: Instant,
    pub(super) stop: AtomicBool,
}

/// Largest request of a query, bytes. A reset may contain a snapshot, an episode start
/// an instruction, a reach query a path.
fn most_bytes(kind: Query) -> usize {
    match kind {
        Query::Reset => 4 << 20,
        Query::Playback => 1 << 20,
        Query::PackPut => super::uploads::MOST_PIECE + (4 << 10),
        Query::EpisodeStart => 128 << 10,
        Query::Reach => 32 << 10,
        Query::Status
        | Query::Scene
        | Query::Tasks
        | Query::Lease
        | Query::Map
        | Query::Pick
        | Query::Pause
        | Query::Resume
        | Query::EpisodeStop
        | Query::Episode
        | Query::Snapshot
        | Query::Sensors
        | Query::Packs
        | Query::Shutdown => 4 << 10,
    }
}

impl Shared {
    pub(super) fn new(outbox: Outbox, gripper: GripperMap) -> Self {
        Self {
            outbox: Arc::new(outbox),
            command_gate: Mutex::new(CommandGate::new(gripper)),
            refusals: Mutex::default(),
            event_queue: Mutex::default(),
            request_queue: RequestQueue::default(),
            replies: Replies::default(),
            tasks: Mutex::default(),
            newest: Default::default(),
            recorders: Mutex::default(),
            wakeup: Arc::default(),
            strange: AtomicU64::new(0),
            started: Instant::now(),
            stop: AtomicBool::new(false),
        }
    }

    pub(super) fn take_command(&self, sample: &Sample) {
        let (now, payload) = (self.now(), sample.payload());
        let from = Keys::sender_of(sample.key_expr().as_str());
        let version = schema::check(&sample.encoding().to_string());
        let result = match (payload.len(), version) {
            (long, _) if long > command_gate::MAX_BYTES => {
                Err(self.command_gate.lock().refuse_long(long))
            }
            (_, Err(other)) => Err(self.command_gate.lock().refuse_version(from, &other)),
            (_, Ok(())) => self
                .command_gate
                .lock()
                .accept_from(from, &payload.to_bytes(), now),
        };
        match result {
            // Wake the loop: lock-step waits for the command, and real time may run its
            // tick early. A rejected command wakes nothing, so that a flood cannot keep
            // the loop busy.
            Ok(()) => self.wakeup.raise(),
            Err(refused) => {
                if refused.code == v1::RefusalCode::Foreign || refused.commander.is_empty() {
                    self.note_strange();
                }
                self.refusals.lock().push(refused, now);
            }
        }
    }

    /// Counts a message that names another sender than its key, or cannot be decoded.
    pub(super) fn note_strange(&self) {
        self.strange.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of such messages.
    pub(super) fn strange(&self) -> u64 {
        self.strange.load(Ordering::Relaxed)
    }

    /// Queues a query for the thread that answers it, without copying or blocking.
    pub(super) fn take_query(
        &self,
        request: Request,
        leases: &mpsc::SyncSender<zenoh::query::Query>,
    ) {
        let Request { kind, query } = request;
        let (bytes, most) = (query.payload().map_or(0, |p| p.len()), most_bytes(kind));
        if bytes > most {
            let why = format!(
                "the request has {bytes} bytes, at most {most} are accepted for `{}`",
                kind.name()
            );
            let why = Denied::new(v1::FailureCode::TooLong, why);
            self.replies.turn_away(query, self.stamp(), why);
            return;
        }
        let encoding = query.encoding().map(ToString::to_string);
        if let Err(other) = schema::check(&encoding.unwrap_or_default()) {
            let why = Denied::new(v1::FailureCode::Version, other.to_string());
            self.replies.turn_away(query, self.stamp(), why);
            return;
        }
        let full = match kind {
            // A client that does not read, or floods, takes no room from others.
            _ if !self.replies.has_room_for(&query) => Some(query),
            Query::Lease => leases.try_send(query).err().map(|e| match e {
                mpsc::TrySendError::Full(query) | mpsc::TrySendError::Disconnected(query) => query,
            }),
            _ => {
                let put =
                    self.request_queue
                        .put(Lane::for_query(kind), bytes, Request { kind, query });
                put.err().map(|request| request.query)
            }
        };
        match full {
            None => self.wakeup.raise(),
            Some(query) => {
                let why = "too many queries are waiting; try again in a moment";
                let why = Denied::new(v1::FailureCode::Busy, why);
                self.replies.turn_away(query, self.stamp(), why);
            }
        }
    }

    /// Queues an event about a change of control.
    pub(super) fn control(&self, change: v1::ControlChange, commander: &str, text: String) {
        self.event_queue.lock().push(v1::Event {
            kind: v1::EventKind::Control.into(),
            text,
            commander: commander.to_owned(),
            control: change.into(),
            ..v1::Event::default()
        });
        self.wakeup.raise();
    }

    /// Handles the loss of a commander's token; its control may end.
    pub(super) fn commander_lost(&self, life: &Life) {
        if self.command_gate.lock().token_lost(life) {
            let words = format!(
                "{:?} disappeared: the chair brakes, the arm holds",
                life.name
            );
            self.control(v1::ControlChange::Lost, &life.name, words);
        }
    }

    /// Sets the simulation's episode and tick.
    pub(super) fn set_stamp(&self, episode: u64, tick: u64) {
        self.newest[0].store(episode, Ordering::Relaxed);
        self.newest[1].store(tick, Ordering::Relaxed);
    }

    /// A header for replies from other threads.
    pub(super) fn stamp(&self) -> v1::Header {
        let [episode, tick] = [0, 1].map(|i| self.newest[i].load(Ordering::Relaxed));
        self.outbox.header(episode, tick)
    }

    /// Wall time since the start, s.
    pub(super) fn now(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }
}
