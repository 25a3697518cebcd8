//! What the threads share, and what the transport's threads do with it: they
//! queue what comes, and do no work.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Instant;

use parking_lot::Mutex;
use wheelarm_proto::Query;
use wheelarm_proto::keys::Keys;
use wheelarm_proto::{schema, v1};
use zenoh::sample::Sample;

use super::denied::Denied;
use super::desk::{Desk, Lane, Request};
use super::inbox::{self, Inbox, Life};
use super::outbox::Outbox;
use super::recorders::Recorders;
use super::refusals::Refusals;
use super::replies::Replies;
use super::signal::Signal;
use crate::robot::control::GripperMap;

/// What the threads share.
pub(super) struct Shared {
    pub(super) outbox: Arc<Outbox>,
    pub(super) inbox: Mutex<Inbox>,
    pub(super) refusals: Mutex<Refusals>,
    /// What happened to the lease, in words, until the engine tells it.
    pub(super) tidings: Mutex<Vec<v1::Event>>,
    /// Queries that wait for the simulation thread.
    pub(super) desk: Desk<Request>,
    pub(super) replies: Replies,
    /// The tasks of the assets, once they were asked for.
    pub(super) tasks: Mutex<Option<Vec<v1::TaskInfo>>>,
    /// Newest episode and tick, for who answers beside the simulation thread.
    newest: [AtomicU64; 2],
    pub(super) recorders: Mutex<Recorders>,
    pub(super) signal: Arc<Signal>,
    /// Messages that name somebody else than their key, or that cannot be read.
    strange: AtomicU64,
    /// Zero of the wall clock of the gate.
    started: Instant,
    pub(super) stop: AtomicBool,
}

/// Largest request of a query, bytes. A reset may hold a snapshot, and the
/// start of an episode an instruction, and a question of reach a path.
fn most_bytes(query: Query) -> usize {
    match query {
        Query::Reset => 4 << 20,
        Query::Show => 1 << 20,
        Query::EpisodeStart => 128 << 10,
        Query::Reach => 32 << 10,
        _ => 4 << 10,
    }
}

impl Shared {
    pub(super) fn new(outbox: Outbox, gripper: GripperMap) -> Self {
        Self {
            outbox: Arc::new(outbox),
            inbox: Mutex::new(Inbox::new(gripper)),
            refusals: Mutex::default(),
            tidings: Mutex::default(),
            desk: Desk::default(),
            replies: Replies::default(),
            tasks: Mutex::default(),
            newest: Default::default(),
            recorders: Mutex::default(),
            signal: Arc::default(),
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
            (long, _) if long > inbox::MAX_BYTES => Err(self.inbox.lock().refuse_long(long)),
            (_, Err(other)) => Err(self.inbox.lock().refuse_version(from, &other)),
            (_, Ok(())) => self
                .inbox
                .lock()
                .accept_from(from, &payload.to_bytes(), now),
        };
        match result {
            // Lock-step waits for it, and real time takes its tick early. What is
            // refused wakes nobody: a flood must not keep the loop busy.
            Ok(()) => self.signal.raise(),
            Err(refused) => {
                if refused.code == v1::RefusalCode::Foreign || refused.commander.is_empty() {
                    self.note_strange();
                }
                self.refusals.lock().push(refused, now);
            }
        }
    }

    /// Counts what names somebody else than its key, or cannot be read.
    pub(super) fn note_strange(&self) {
        self.strange.fetch_add(1, Ordering::Relaxed);
    }

    /// How many were counted.
    pub(super) fn strange(&self) -> u64 {
        self.strange.load(Ordering::Relaxed)
    }

    /// Queues a query for whoever answers it. Nothing is copied here, and
    /// nothing waits.
    pub(super) fn take_query(
        &self,
        request: Request,
        asks: &mpsc::SyncSender<zenoh::query::Query>,
    ) {
        let Request { query, asked } = request;
        let (bytes, most) = (asked.payload().map_or(0, |p| p.len()), most_bytes(query));
        if bytes > most {
            let why = format!(
                "the request has {bytes} bytes, at most {most} are taken for `{}`",
                query.name()
            );
            let why = Denied::new(v1::FailureCode::TooLong, why);
            self.replies.turn_away(asked, self.stamp(), why);
            return;
        }
        let told = asked.encoding().map(ToString::to_string);
        if let Err(other) = schema::check(&told.unwrap_or_default()) {
            let why = Denied::new(v1::FailureCode::Version, other.to_string());
            self.replies.turn_away(asked, self.stamp(), why);
            return;
        }
        let full = match query {
            // Who does not read, or asks without end, takes no room from others.
            _ if !self.replies.has_room_for(&asked) => Some(asked),
            Query::Lease => asks.try_send(asked).err().map(|e| match e {
                mpsc::TrySendError::Full(asked) | mpsc::TrySendError::Disconnected(asked) => asked,
            }),
            _ => {
                let put = self
                    .desk
                    .put(Lane::of(query), bytes, Request { query, asked });
                put.err().map(|request| request.asked)
            }
        };
        match full {
            None => self.signal.raise(),
            Some(asked) => {
                let why = "too many queries wait to be answered; ask again in a moment";
                let why = Denied::new(v1::FailureCode::Busy, why);
                self.replies.turn_away(asked, self.stamp(), why);
            }
        }
    }

    /// Notes what became of control, for the event that tells it.
    pub(super) fn control(&self, change: v1::ControlChange, commander: &str, text: String) {
        self.tidings.lock().push(v1::Event {
            kind: v1::EventKind::Control.into(),
            text,
            commander: commander.to_owned(),
            control: change.into(),
            ..v1::Event::default()
        });
        self.signal.raise();
    }

    /// A commander's token vanished; control may end with it.
    pub(super) fn gone(&self, life: &Life) {
        if self.inbox.lock().vanished(life) {
            let words = format!("{:?} vanished: the chair brakes, the arm holds", life.name);
            self.control(v1::ControlChange::Lost, &life.name, words);
        }
    }

    /// Notes where the simulation is.
    pub(super) fn stamp_is(&self, episode: u64, tick: u64) {
        self.newest[0].store(episode, Ordering::Relaxed);
        self.newest[1].store(tick, Ordering::Relaxed);
    }

    /// A header for answers that are given beside the simulation thread.
    pub(super) fn stamp(&self) -> v1::Header {
        let [episode, tick] = [0, 1].map(|i| self.newest[i].load(Ordering::Relaxed));
        self.outbox.header(episode, tick)
    }

    /// Wall time since the start, s.
    pub(super) fn now(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }
}
