//! A condition that several threads raise and one waits for.

use std::time::Duration;

use parking_lot::{Condvar, Mutex};

/// Remembers that something happened until the waiting thread has seen it.
#[derive(Debug, Default)]
pub struct Signal {
    raised: Mutex<bool>,
    changed: Condvar,
}

impl Signal {
    /// Wakes the waiting thread.
    pub fn raise(&self) {
        *self.raised.lock() = true;
        self.changed.notify_all();
    }

    /// Waits until raised or until `timeout` has passed; lowers it.
    pub fn wait(&self, timeout: Duration) {
        let mut raised = self.raised.lock();
        self.changed
            .wait_while_for(&mut raised, |raised| !*raised, timeout);
        *raised = false;
    }
}
