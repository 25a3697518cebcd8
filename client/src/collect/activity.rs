//! How an attempt goes, for people: told by whoever works on it, shown by the
//! progress display.

use std::sync::Arc;

use parking_lot::Mutex;

/// Simulated seconds and what is being done, shared by those who tell and those
/// who show.
#[derive(Clone, Debug, Default)]
pub struct Activity(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    seconds: f64,
    doing: String,
}

impl Activity {
    /// Something else begins: nothing is simulated yet.
    pub fn reset(&self) {
        *self.0.lock() = State::default();
    }

    /// What is being done, in a word or two.
    pub fn tell(&self, doing: &str) {
        doing.clone_into(&mut self.0.lock().doing);
    }

    /// So many simulated seconds are over.
    pub fn simulated(&self, seconds: f64, doing: String) {
        *self.0.lock() = State { seconds, doing };
    }

    /// Simulated seconds so far.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.0.lock().seconds
    }

    /// Both in words.
    #[must_use]
    pub fn line(&self) -> String {
        let state = self.0.lock();
        format!("{:6.1} s simulated, {}", state.seconds, state.doing)
    }
}
