//! A flag that several threads raise and one waits for.

use std::time::Duration;

use parking_lot::{Condvar, Mutex};

/// Stays raised until the waiting thread wakes.
#[derive(Debug, Default)]
pub struct Wakeup {
    raised: Mutex<bool>,
    changed: Condvar,
}

impl Wakeup {
    /// Wakes the waiting thread.
    pub fn raise(&self) {
        *self.raised.lock() = true;
        self.changed.notify_all();
    }

    /// Waits until raised or until `timeout` has passed; lowers the flag.
    pub fn wait(&self, timeout: Duration) {
        let mut raised = self.raised.lock();
        self.changed
            .wait_while_for(&mut raised, |raised| !*raised, timeout);
        *raised = false;
    }
}
