//! The service: pacing, the gate for commands, publication, episode control
//! and the render thread, over one Zenoh session.
//!
//! This module and `main.rs` alone name zenoh; it names neither rapier nor
//! wgpu. `run(session, sim, options, shutdown)` is all that `main` calls.

mod answer;
pub mod convert;
mod engine;
mod episode;
pub mod inbox;
mod outbox;
mod pace;
mod preview;
mod publish;
mod recorders;
mod refusals;
mod render;
pub mod session;
mod signal;
mod tell;
mod waiting;

use std::future::Future;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::Instant;

use wheelarm_proto::keys::{self, Keys, Query};
use wheelarm_proto::{Message, v1};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

use self::engine::{Engine, Request};
use self::inbox::{Inbox, Life};
use self::outbox::Outbox;
use self::recorders::Recorders;
use self::refusals::Refusals;
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
    vanished: Mutex<Vec<String>>,
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
        vanished: Mutex::default(),
        recorders: Mutex::default(),
        signal: Arc::default(),
        run_id,
        started: Instant::now(),
        stop: AtomicBool::new(false),
    });
    let (requests, queue) = mpsc::sync_channel(256);
    let engine = Engine::new(sim, Arc::clone(&shared), queue, options)?;
    let _commands = {
        let shared = Arc::clone(&shared);
        session
            .declare_subscriber(keys.command())
            .callback(move |sample| shared.take_command(&sample.payload().to_bytes()))
            .wait()?
    };
    let _commanders = {
        let shared = Arc::clone(&shared);
        session
            .liveliness()
            .declare_subscriber(keys.commander_alive("*", "*"))
            .history(true)
            .callback(move |sample| {
                if let Some((name, run_id)) = Keys::commander_of(sample.key_expr().as_str()) {
                    shared.commander(Life { name, run_id }, sample.kind());
                }
            })
            .wait()?
    };
    let _statuses = {
        let shared = Arc::clone(&shared);
        session
            .declare_subscriber(keys.recorder("*"))
            .callback(move |sample| {
                if let Ok(status) = v1::RecorderStatus::decode(&*sample.payload().to_bytes()) {
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
    let mut _queries = Vec::new();
    for query in Query::ALL {
        let (requests, signal) = (requests.clone(), Arc::clone(&shared.signal));
        _queries.push(
            session
                .declare_queryable(keys.query(query))
                .callback(move |asked| {
                    // A full queue drops the query: the client's time-out tells it.
                    if requests.try_send(Request { query, asked }).is_ok() {
                        signal.raise();
                    }
                })
                .wait()?,
        );
    }
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
    thread
        .join()
        .map_err(|_| ServiceError::Thread("panicked; please report it".to_owned()))
}

impl Shared {
    fn take_command(&self, bytes: &[u8]) {
        let now = self.now();
        let result = lock(&self.inbox).accept(bytes, now);
        match result {
            // Lock-step waits for it, and real time takes its tick early. What is
            // refused wakes nobody: a flood must not keep the loop busy.
            Ok(()) => self.signal.raise(),
            Err(refused) => lock(&self.refusals).push(refused, now),
        }
    }

    /// A commander's token appeared or vanished.
    fn commander(&self, life: Life, kind: SampleKind) {
        match kind {
            SampleKind::Put => lock(&self.inbox).appeared(life),
            SampleKind::Delete => {
                if lock(&self.inbox).vanished(&life) {
                    let words =
                        format!("{:?} vanished: the chair brakes, the arm holds", life.name);
                    lock(&self.vanished).push(words);
                    self.signal.raise();
                }
            }
        }
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
