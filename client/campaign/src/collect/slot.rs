//! A worker's slot: the permit to simulate, which its pipelines hold in turn, and the
//! backend that simulates.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use parking_lot::{Mutex, MutexGuard};
use wheelarm_rollout::Backend;

/// Slot for one simulation; a pipeline that wants to simulate waits for its permit.
pub struct Slot {
    permit: Mutex<()>,
    backend: Box<dyn Backend>,
    pipelines: AtomicUsize,
    retired: AtomicBool,
}

/// A pipeline's part in a slot. Dropping the last part ends the slot's process while other
/// slots still work, because a graphics driver needs 0.1 s to exit.
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
            self.0.backend.rest();
        }
    }
}

/// Permit to simulate in a slot; released when dropped.
#[derive(Debug)]
pub struct Permit<'a> {
    _held: MutexGuard<'a, ()>,
}

impl Slot {
    /// A slot that simulates with `backend`.
    #[must_use]
    pub fn new(backend: Box<dyn Backend>) -> Self {
        Self {
            permit: Mutex::new(()),
            backend,
            pipelines: AtomicUsize::new(0),
            retired: AtomicBool::new(false),
        }
    }

    /// The backend.
    #[must_use]
    pub fn backend(&self) -> &dyn Backend {
        self.backend.as_ref()
    }

    /// A part for another pipeline.
    #[must_use]
    pub fn part(&self) -> Part<'_> {
        self.pipelines.fetch_add(1, Ordering::AcqRel);
        Part(self)
    }

    /// Waits until no other pipeline simulates here.
    #[must_use]
    pub fn permit(&self) -> Permit<'_> {
        Permit {
            _held: self.permit.lock(),
        }
    }

    /// Retires the slot. Returns whether it was active before.
    pub fn retire(&self) -> bool {
        !self.retired.swap(true, Ordering::AcqRel)
    }

    /// Whether the slot accepts no more episodes.
    #[must_use]
    pub fn is_retired(&self) -> bool {
        self.retired.load(Ordering::Acquire)
    }

    /// Releases the process, which ends when it is unused.
    pub fn rest(&self) {
        self.backend.rest();
    }
}
