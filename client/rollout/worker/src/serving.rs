//! The service of one episode, on a separate thread, over the session of this
//! process.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context;
use tokio::sync::oneshot;
use wheelarm_proto::keys::Keys;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::Panicked;
use wheelarm_rollout::limits;
use wheelarm_sdk::Client;
use wheelarm_server::service::{self, Options};
use wheelarm_server::sim::Simulation;

use super::room::{Room, Stop};

/// A running service; it ends when dropped.
pub struct Serving {
    client: Client,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<Result<(), String>>>,
}

impl Serving {
    /// Starts to serve and waits until it does, unless it is stopped before.
    ///
    /// # Errors
    /// Those of the service, for example a missing graphics driver.
    pub fn start(
        room: &Room,
        sim: Simulation,
        name: &str,
        has_cameras: bool,
        depth: Depth,
        stop: &Stop,
    ) -> anyhow::Result<Self> {
        let options = Options {
            keys: Keys::new(name)?,
            graphics: room.graphics.clone(),
            no_cameras: !has_cameras,
            depth,
            access: v1::Access::Local,
            packs: room.packs.clone(),
        };
        let (end, ended) = oneshot::channel::<()>();
        let (ready, serves) = mpsc::sync_channel(1);
        let (session, runtime) = (room.session.clone(), room.runtime.clone());
        let thread = std::thread::Builder::new().name("service".to_owned());
        let thread = thread
            .spawn(move || {
                let ready = move || {
                    let _ = ready.send(());
                };
                let ended = async {
                    let _ = ended.await;
                };
                let serve = service::run(session, sim, options, ready, ended);
                runtime
                    .block_on(serve)
                    .map_err(|problem| problem.to_string())
            })
            .context("starting the thread of the service")?;
        let deadline = Instant::now() + limits::READY;
        loop {
            match serves.recv_timeout(limits::LOOK) {
                Ok(()) => break,
                Err(RecvTimeoutError::Timeout)
                    if !stop.is_requested() && Instant::now() < deadline => {}
                Err(RecvTimeoutError::Timeout) => {
                    anyhow::bail!("the service did not start in time")
                }
                Err(RecvTimeoutError::Disconnected) => {
                    let why = thread
                        .join()
                        .unwrap_or_else(|_| Err("it panicked".to_owned()));
                    anyhow::bail!(
                        "the service did not start: {}",
                        why.err().unwrap_or_default()
                    );
                }
            }
        }
        Ok(Self {
            client: Client::within(room.session.clone(), name)?,
            end: Some(end),
            thread: Some(thread),
        })
    }

    /// A client of the service.
    #[must_use]
    pub fn client(&self) -> &Client {
        &self.client
    }

    /// Reason of an unrequested end, if it has ended.
    pub fn ended(&mut self) -> Option<String> {
        if !self.thread.as_ref()?.is_finished() {
            return None;
        }
        Some(match self.thread.take()?.join() {
            Ok(Err(why)) => format!("the simulation ended: {why}"),
            Ok(Ok(())) => "the simulation received a request to end".to_owned(),
            Err(cause) => format!("the simulation ended: {}", Panicked::because_of(&*cause)),
        })
    }

    /// As [`Serving::ended`] for one that may be about to.
    pub fn ended_within(&mut self, patience: Duration) -> Option<String> {
        let deadline = Instant::now() + patience;
        loop {
            let ended = self.ended();
            if ended.is_some() || Instant::now() >= deadline {
                return ended;
            }
            std::thread::sleep(limits::LOOK);
        }
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        // A service that has ended does not receive this.
        let _ = self.end.take().map(|end| end.send(()));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
