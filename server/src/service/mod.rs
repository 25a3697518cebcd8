//! The service: pacing, the gate for commands, publication, episode control
//! and the render thread, over one Zenoh session.
//!
//! This module and `main.rs` alone name zenoh; it names neither rapier nor
//! wgpu. `run(session, sim, options, shutdown)` is all that `main` calls.

mod anomalies;
mod answer;
pub mod convert;
mod denied;
mod desk;
mod engine;
mod episode;
mod errand;
pub mod inbox;
mod leases;
mod outbox;
mod pace;
mod preview;
mod publish;
mod recorders;
mod refusals;
mod render;
mod replies;
pub mod session;
mod signal;
mod tell;
mod waiting;

use std::future::Future;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::{Duration, Instant};

use wheelarm_proto::Query;
use wheelarm_proto::keys::{self, Keys};
use wheelarm_proto::{Message, schema, v1};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

use self::denied::Denied;
use self::desk::{Desk, Lane};
use self::engine::{Engine, Request};
use self::inbox::{Inbox, Life};
use self::leases::Leases;
use self::outbox::Outbox;
use self::recorders::Recorders;
use self::refusals::Refusals;
use self::replies::Replies;
use self::signal::Signal;
use crate::robot::control::GripperMap;
use crate::sensors::camera::RenderError;
use crate::sim::{SimError, Simulation};

/// What a service needs to know beside the simulation.
#[derive(Clone, Debug)]
pub struct Options {
    /// Keys of this server.
    pub keys: Keys,
    /// Graphics adapter by a part of its name; `None` takes the best.
    pub adapter: Option<String>,
    /// Physics only: no pictures, no driver needed.
    pub no_cameras: bool,
}

/// Why a service ended early.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// The transport.
    #[error("Zenoh: {0}")]
    Zenoh(String),
    /// The cameras.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A scenario.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// An asset file that is to be stored with recordings.
    #[error("cannot read {0}")]
    Assets(String),
    /// Another server has this name.
    #[error("a server named {0:?} is already on this network; choose another with --sim NAME")]
    NameTaken(String),
    /// The simulation thread.
    #[error("the simulation thread {0}")]
    Thread(String),
}

impl From<zenoh::Error> for ServiceError {
    fn from(e: zenoh::Error) -> Self {
        Self::Zenoh(e.to_string())
    }
}

/// What the threads share.
struct Shared {
    outbox: Arc<Outbox>,
    inbox: Mutex<Inbox>,
    refusals: Mutex<Refusals>,
    /// What happened to the lease, in words, until the engine tells it.
    tidings: Mutex<Vec<String>>,
    /// Queries that wait for the simulation thread.
    desk: Desk<Request>,
    replies: Replies,
    /// The tasks of the assets, once they were asked for.
    tasks: Mutex<Option<Vec<v1::TaskInfo>>>,
    /// Newest episode and tick, for who answers beside the simulation thread.
    newest: [AtomicU64; 2],
    recorders: Mutex<Recorders>,
    signal: Arc<Signal>,
    run_id: String,
    /// Zero of the wall clock of the gate.
    started: Instant,
    stop: AtomicBool,
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves a simulation until `shutdown` resolves or a client asks to end.
/// `ready` is called once, when the server answers.
///
/// # Errors
/// [`ServiceError`] with the cure.
pub async fn run(
    session: Session,
    sim: Simulation,
    options: Options,
    ready: impl FnOnce(),
    shutdown: impl Future<Output = ()>,
) -> Result<(), ServiceError> {
    let keys = options.keys.clone();
    if taken(&session, &keys)? {
        return Err(ServiceError::NameTaken(keys.sim().to_owned()));
    }
    let run_id = keys::run_id();
    let shared = Arc::new(Shared {
        outbox: Arc::new(Outbox::new(session.clone(), keys.clone(), run_id.clone())),
        inbox: Mutex::new(Inbox::new(GripperMap::new(sim.model()))),
        refusals: Mutex::default(),
        tidings: Mutex::default(),
        desk: Desk::default(),
        replies: Replies::default(),
        tasks: Mutex::default(),
        newest: Default::default(),
        recorders: Mutex::default(),
        signal: Arc::default(),
        run_id,
        started: Instant::now(),
        stop: AtomicBool::new(false),
    });
    let engine = Engine::new(sim, Arc::clone(&shared), options)?;
    let _commands = {
        let shared = Arc::clone(&shared);
        session
            .declare_subscriber(keys.command("*"))
            .callback(move |sample| shared.take_command(&sample))
            .wait()?
    };
    let _statuses = {
        let shared = Arc::clone(&shared);
        session
            .declare_subscriber(keys.recorder("*"))
            .callback(move |sample| {
                let version = schema::check(&sample.encoding().to_string());
                if sample.payload().len() > MAX_STATUS || version.is_err() {
                    return;
                }
                let status = v1::RecorderStatus::decode(&*sample.payload().to_bytes());
                let from = Keys::sender_of(sample.key_expr().as_str());
                // Nobody speaks for another recorder.
                if let Some(status) = status.ok().filter(|status| status.recorder == from) {
                    lock(&shared.recorders).update(status);
                    shared.signal.raise();
                }
            })
            .wait()?
    };
    let _presence = {
        let shared = Arc::clone(&shared);
        session
            .liveliness()
            .declare_subscriber(keys.recorder_alive("*"))
            .history(true)
            .callback(move |sample| {
                let name = sample
                    .key_expr()
                    .as_str()
                    .rsplit('/')
                    .nth(1)
                    .map(str::to_owned);
                let Some(name) = name else { return };
                match sample.kind() {
                    SampleKind::Put => lock(&shared.recorders).came(&name),
                    SampleKind::Delete => lock(&shared.recorders).left(&name, Instant::now()),
                }
                shared.signal.raise();
            })
            .wait()?
    };
    let (asks, asked) = mpsc::sync_channel(LEASES);
    Leases::start(session.clone(), keys.clone(), Arc::clone(&shared), asked)
        .map_err(|e| ServiceError::Thread(format!("for leases cannot start: {e}")))?;
    let mut _queries = Vec::new();
    for query in Query::ALL {
        let (shared, asks) = (Arc::clone(&shared), asks.clone());
        _queries.push(
            session
                .declare_queryable(keys.query(query))
                .callback(move |asked| shared.take_query(Request { query, asked }, &asks))
                .wait()?,
        );
    }
    drop(asks);
    let _alive = session
        .liveliness()
        .declare_token(keys.alive(&session.zid().to_string()))
        .wait()?;
    let (ended, end) = tokio::sync::oneshot::channel();
    let thread = std::thread::Builder::new()
        .name("simulation".to_owned())
        .spawn(move || {
            engine.run();
            let _ = ended.send(());
        })
        .map_err(|e| ServiceError::Thread(format!("cannot start: {e}")))?;
    ready();
    tokio::select! {
        () = shutdown => {}
        _ = end => {}
    }
    shared.stop.store(true, Ordering::Release);
    shared.signal.raise();
    let joined = thread.join();
    shared.replies.finish(LAST_ANSWERS);
    joined.map_err(|_| ServiceError::Thread("panicked; please report it".to_owned()))
}

/// Largest status of a recorder, bytes: it holds a path and a sentence.
const MAX_STATUS: usize = 16 << 10;

/// Asks for control that may wait.
const LEASES: usize = 64;

/// How long the last answers may take when the server ends.
const LAST_ANSWERS: Duration = Duration::from_secs(2);

/// Largest request of a query, bytes. A reset may hold a snapshot, and the
/// start of an episode an instruction.
fn most_bytes(query: Query) -> usize {
    match query {
        Query::Reset => 4 << 20,
        Query::EpisodeStart => 128 << 10,
        _ => 4 << 10,
    }
}

impl Shared {
    fn take_command(&self, sample: &Sample) {
        let (now, payload) = (self.now(), sample.payload());
        let from = Keys::sender_of(sample.key_expr().as_str());
        let version = schema::check(&sample.encoding().to_string());
        let result = match (payload.len(), version) {
            (long, _) if long > inbox::MAX_BYTES => Err(lock(&self.inbox).refuse_long(long)),
            (_, Err(other)) => Err(lock(&self.inbox).refuse_version(from, &other)),
            (_, Ok(())) => lock(&self.inbox).accept_from(from, &payload.to_bytes(), now),
        };
        match result {
            // Lock-step waits for it, and real time takes its tick early. What is
            // refused wakes nobody: a flood must not keep the loop busy.
            Ok(()) => self.signal.raise(),
            Err(refused) => lock(&self.refusals).push(refused, now),
        }
    }

    /// Queues a query for whoever answers it. Nothing is copied here, and
    /// nothing waits.
    fn take_query(&self, request: Request, asks: &mpsc::SyncSender<zenoh::query::Query>) {
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

    /// A commander's token vanished; control may end with it.
    fn gone(&self, life: &Life) {
        if lock(&self.inbox).vanished(life) {
            let words = format!("{:?} vanished: the chair brakes, the arm holds", life.name);
            lock(&self.tidings).push(words);
            self.signal.raise();
        }
    }

    /// Notes where the simulation is.
    fn stamp_is(&self, episode: u64, tick: u64) {
        self.newest[0].store(episode, Ordering::Relaxed);
        self.newest[1].store(tick, Ordering::Relaxed);
    }

    /// A header for answers that are given beside the simulation thread.
    fn stamp(&self) -> v1::Header {
        let [episode, tick] = [0, 1].map(|i| self.newest[i].load(Ordering::Relaxed));
        self.outbox.header(episode, tick)
    }

    /// Wall time since the start, s.
    fn now(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }
}

/// Whether another server holds the name.
fn taken(session: &Session, keys: &Keys) -> Result<bool, ServiceError> {
    let replies = session
        .liveliness()
        .get(keys.alive("*"))
        .timeout(std::time::Duration::from_millis(300))
        .wait()?;
    Ok(replies.iter().any(|reply| reply.result().is_ok()))
}
