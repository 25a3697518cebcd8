//! A worker's slot: the right to simulate, which its pipelines take in turn.

use parking_lot::{Mutex, MutexGuard};

/// Room for one simulation; whoever wants to simulate waits for its permit.
#[derive(Debug, Default)]
pub struct Slot(Mutex<()>);

/// Leave to simulate in a slot; it ends when dropped.
#[derive(Debug)]
pub struct Permit<'a> {
    _held: MutexGuard<'a, ()>,
}

impl Slot {
    /// Waits until nobody else simulates here.
    #[must_use]
    pub fn permit(&self) -> Permit<'_> {
        Permit {
            _held: self.0.lock(),
        }
    }
}
