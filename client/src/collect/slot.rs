//! A worker's slot: the right to simulate, which its pipelines take in turn, and the
//! process that does it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use parking_lot::{Mutex, MutexGuard};
use wheelarm_rollout::launcher::{Worker, WorkerOptions};

/// Room for one simulation; whoever wants to simulate waits for its permit.
#[derive(Default)]
pub struct Slot {
    permit: Mutex<()>,
    adapter: Option<String>,
    worker: Mutex<Option<Arc<Worker>>>,
    pipelines: AtomicUsize,
    retired: AtomicBool,
}

/// A pipeline's part in a slot. With the last of them the slot's process ends, while
/// others still work: a driver takes a tenth of a second for it.
pub struct Part<'a>(&'a Slot);

impl<'a> Part<'a> {
    /// The slot.
    #[must_use]
    pub fn slot(&self) -> &'a Slot {
        self.0
    }
}

impl Drop for Part<'_> {
    fn drop(&mut self) {
        if self.0.pipelines.fetch_sub(1, Ordering::AcqRel) == 1 {
            *self.0.worker.lock() = None;
        }
    }
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

    /// A part for another pipeline.
    #[must_use]
    pub fn part(&self) -> Part<'_> {
        self.pipelines.fetch_add(1, Ordering::AcqRel);
        Part(self)
    }

    /// Waits until nobody else simulates here.
    #[must_use]
    pub fn permit(&self) -> Permit<'_> {
        Permit {
            _held: self.permit.lock(),
        }
    }

    /// Takes no more episodes. Whether it took some before.
    pub fn retire(&self) -> bool {
        !self.retired.swap(true, Ordering::AcqRel)
    }

    /// Whether it takes no more episodes.
    #[must_use]
    pub fn is_retired(&self) -> bool {
        self.retired.load(Ordering::Acquire)
    }

    /// Lets go of the process, which ends when nothing uses it.
    pub fn rest(&self) {
        *self.worker.lock() = None;
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
