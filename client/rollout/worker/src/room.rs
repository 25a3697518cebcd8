//! Resources that the episodes of a worker share, and the request to end one of them.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tokio::sync::Notify;
use wheelarm_pack::Store as PackStore;
use wheelarm_server::sensors::camera::Graphics;
use zenoh::Session;

/// Resources that the episodes of this process share.
pub struct Room {
    /// A session that reaches no other process.
    pub session: Session,
    /// Assets folder.
    pub assets: PathBuf,
    /// Folders of world packs.
    pub packs: PackStore,
    /// The renderer.
    pub graphics: Graphics,
    /// The runtime of services and recorders.
    pub runtime: tokio::runtime::Handle,
}

/// A request to end an episode early.
#[derive(Clone, Default)]
pub struct Stop {
    is_requested: Arc<AtomicBool>,
    changed: Arc<Notify>,
}

impl Stop {
    /// Requests the end.
    pub fn request(&self) {
        self.is_requested.store(true, Ordering::Release);
        self.changed.notify_waiters();
        self.changed.notify_one();
    }

    /// Whether the end was requested.
    #[must_use]
    pub fn is_requested(&self) -> bool {
        self.is_requested.load(Ordering::Acquire)
    }

    /// Waits for the request.
    pub async fn requested(self) {
        if !self.is_requested() {
            self.changed.notified().await;
        }
    }
}
