//! A bound in bytes on what waits between the threads.

use parking_lot::{Condvar, Mutex};

/// Counts bytes in flight; taking waits until there is room.
pub(super) struct Budget {
    limit: usize,
    used: Mutex<usize>,
    freed: Condvar,
}

impl Budget {
    pub fn new(limit: usize) -> Self {
        Self {
            limit,
            used: Mutex::new(0),
            freed: Condvar::new(),
        }
    }

    /// Takes `bytes`, waiting for room. One item greater than the whole budget
    /// is accepted when nothing else waits.
    pub fn take(&self, bytes: usize) {
        let mut used = self.used.lock();
        self.freed
            .wait_while(&mut used, |used| *used > 0 && *used + bytes > self.limit);
        *used += bytes;
    }

    pub fn give(&self, bytes: usize) {
        let mut used = self.used.lock();
        *used = used.saturating_sub(bytes);
        self.freed.notify_all();
    }
}
