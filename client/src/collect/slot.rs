//! A worker's slot: the right to simulate, which its pipelines take in turn, and the
//! process that does it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use parking_lot::{Mutex, MutexGuard};
use wheelarm_rig::{Worker, WorkerOptions};

/// Room for one simulation; whoever wants to simulate waits for its permit.
#[derive(Default)]
pub struct Slot {
    permit: Mutex<()>,
    adapter: Option<String>,
    worker: Mutex<Option<Arc<Worker>>>,
}

/// Leave to simulate in a slot; it ends when dropped.
#[derive(Debug)]
pub struct Permit<'a> {
    _held: MutexGuard<'a, ()>,
}

impl Slot {
    /// One whose pictures are drawn by `adapter`; the strongest when absent.
    #[must_use]
    pub fn on(adapter: Option<String>) -> Self {
        Self {
            adapter,
            ..Self::default()
        }
    }

    /// Waits until nobody else simulates here.
    #[must_use]
    pub fn permit(&self) -> Permit<'_> {
        Permit {
            _held: self.permit.lock(),
        }
    }

    /// The adapter.
    #[must_use]
    pub fn adapter(&self) -> Option<&str> {
        self.adapter.as_deref()
    }

    /// The process of this slot that works for the dataset in `folder`; a new one
    /// where there is none, or it has died or done its share.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn worker(&self, assets: &Option<PathBuf>, folder: &Path) -> anyhow::Result<Arc<Worker>> {
        let mut worker = self.worker.lock();
        if let Some(worker) = &*worker
            && !worker.is_worn()
            && worker.death(Duration::ZERO)?.is_none()
        {
            return Ok(Arc::clone(worker));
        }
        let options = WorkerOptions {
            assets: assets.clone(),
            adapter: self.adapter.clone(),
            folder: Some(folder.to_owned()),
        };
        Ok(Arc::clone(worker.insert(Worker::start(&options)?)))
    }
}
