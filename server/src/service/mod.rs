//! The service: pacing, the gate for commands, publication, episode control
//! and the render thread, over one Zenoh session.
//!
//! This module and `main.rs` alone name zenoh; it names neither rapier nor
//! wgpu. `run(session, sim, options, shutdown)` is all that `main` calls.

#![expect(
    clippy::disallowed_methods,
    reason = "the service paces by the wall clock"
)]

mod assets;
mod cache;
mod compressed;
pub mod convert;
mod denied;
pub mod describe;
mod desk;
mod disturbance;
mod engine;
mod episode;
mod errand;
mod error;
mod heap;
pub mod inbox;
mod lag;
mod language;
mod leases;
mod outbox;
mod pace;
mod person;
mod pick;
mod preview;
mod priority;
mod publish;
mod recorders;
mod refusals;
mod render;
mod replies;
mod sensed;
pub mod session;
mod shared;
mod signal;
pub mod startup;
mod waiting;
mod wall;

pub use self::assets::tasks;
pub use self::engine::Options;
pub use self::error::ServiceError;
pub use self::render::OpenAhead;

use std::future::Future;
use std::sync::atomic::Ordering;
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use wheelarm_proto::Query;
use wheelarm_proto::keys::{self, Keys};
use wheelarm_proto::{Message, schema, v1};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

use self::desk::Request;
use self::engine::Engine;
use self::leases::Leases;
use self::outbox::Outbox;
use self::shared::Shared;
use crate::robot::control::GripperMap;
use crate::sim::Simulation;

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
    let outbox = Outbox::new(session.clone(), keys.clone(), keys::run_id());
    let shared = Arc::new(Shared::new(outbox, GripperMap::new(sim.model())));
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
                if sample.payload().len() > MAX_STATUS {
                    shared.note_strange();
                    return;
                }
                let from = Keys::sender_of(sample.key_expr().as_str());
                if let Err(other) = schema::check(&sample.encoding().to_string()) {
                    shared.recorders.lock().warn_once(from, &other);
                    return;
                }
                let status = v1::RecorderStatus::decode(&*sample.payload().to_bytes());
                // Nobody speaks for another recorder.
                match status.ok().filter(|status| status.recorder == from) {
                    Some(status) => {
                        shared.recorders.lock().update(status, Instant::now());
                        shared.signal.raise();
                    }
                    None => shared.note_strange(),
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
                    SampleKind::Put => shared.recorders.lock().came(&name),
                    SampleKind::Delete => shared.recorders.lock().left(&name, Instant::now()),
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

/// Whether another server holds the name.
fn taken(session: &Session, keys: &Keys) -> Result<bool, ServiceError> {
    let replies = session
        .liveliness()
        .get(keys.alive("*"))
        .timeout(Duration::from_millis(300))
        .wait()?;
    Ok(replies.iter().any(|reply| reply.result().is_ok()))
}
