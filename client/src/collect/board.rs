//! What lanes share: the floor on which one of them simulates, and the board on
//! which each tells how it goes.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How an attempt goes, for people.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// Simulated seconds.
    pub seconds: f64,
    /// What it does, in a word or two.
    pub doing: String,
}

/// Where an attempt tells how it goes.
pub type Board = Arc<Mutex<Progress>>;

/// Whoever holds a worker's floor may simulate.
pub type Floor = Mutex<()>;
/// The turn to simulate; it ends when dropped.
pub type Turn<'a> = MutexGuard<'a, ()>;
/// Locks; what a thread that panicked left is taken as it is.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
