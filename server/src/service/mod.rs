//! The service: pacing, command gate, publication, episode control and the render
//! thread, over one Zenoh session.
//!
//! Only this module and `main.rs` use zenoh; it uses neither rapier nor wgpu. `main`
//! calls only `run(session, sim, options, shutdown)`.

#![expect(
    clippy::disallowed_methods,
    reason = "the service paces by the wall clock"
)]

mod assets;
mod cache;
mod command_delay;
pub mod command_gate;
mod compressed;
pub mod convert;
mod denied;
pub mod describe;
mod disturbance;
mod engine;
mod episode;
mod error;
mod language;
mod leases;
mod malloc_trim;
mod outbox;
mod pace;
pub mod packs;
mod pending_operation;
mod person;
mod pick;
mod preview;
mod priority;
mod publish;
mod recorders;
mod refusals;
mod render;
mod replies;
mod request_queue;
mod sensor_images;
pub mod session;
mod shared;
pub mod startup;
mod uploads;
mod waiting;
mod wakeup;
mod wall_clock;

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

use self::engine::Engine;
use self::leases::Leases;
use self::outbox::Outbox;
use self::request_queue::Request;
use self::shared::Shared;
use crate::robot::control::GripperMap;
use crate::sim::Simulation;

/// Serves a simulation until `shutdown` resolves or a client requests the end. `ready`
/// is called once, when the server answers.
///
/// # Errors
/// [`ServiceError`] with the fix.
pub async fn run(
    session: Session,
    sim: Simulation,
    options: Options,
    ready: impl FnOnce(),
    shutdown: impl Future<Output = ()>,
) -> Result<(), ServiceError> {
    let keys = options.keys.clone();
    if name_is_taken(&session, &keys)? {
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
                // A status must come under the key of its own recorder.
                match status.ok().filter(|status| status.recorder == from) {
                    Some(status) => {
                        shared.recorders.lock().update(status, Instant::now());
                        shared.wakeup.raise();
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
                    SampleKind::Put => shared.recorders.lock().token_appeared(&name),
                    SampleKind::Delete => {
                        shared.recorders.lock().disconnected(&name, Instant::now())
                    }
                }
                shared.wakeup.raise();
            })
            .wait()?
    };
    let (lease_queries, waiting) = mpsc::sync_channel(LEASES);
    Leases::start(session.clone(), keys.clone(), Arc::clone(&shared), waiting)
        .map_err(|e| ServiceError::Thread(format!("for leases cannot start: {e}")))?;
    let mut _queries = Vec::new();
    for kind in Query::ALL {
        let (shared, leases) = (Arc::clone(&shared), lease_queries.clone());
        _queries.push(
            session
                .declare_queryable(keys.query(kind))
                .callback(move |query| shared.take_query(Request { kind, query }, &leases))
                .wait()?,
        );
    }
    drop(lease_queries);
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
    shared.wakeup.raise();
    let joined = thread.join();
    shared.replies.finish(LAST_ANSWERS);
    joined.map_err(|_| ServiceError::Thread("panicked; please report it".to_owned()))
}

/// Largest status of a recorder, bytes: it contains a path and a sentence.
const MAX_STATUS: usize = 16 << 10;

/// Lease queries that may wait.
const LEASES: usize = 64;

/// Longest wait for the last replies at shutdown.
const LAST_ANSWERS: Duration = Duration::from_secs(2);

/// Whether another server uses the name.
fn name_is_taken(session: &Session, keys: &Keys) -> Result<bool, ServiceError> {
    let replies = session
        .liveliness()
        .get(keys.alive("*"))
        .timeout(Duration::from_millis(300))
        .wait()?;
    Ok(replies.iter().any(|reply| reply.result().is_ok()))
}
