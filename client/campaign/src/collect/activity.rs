//! Progress of an attempt: reported by the attempt, shown by the progress display.

use std::sync::Arc;

use parking_lot::Mutex;
use wheelarm_proto::v1;
use wheelarm_rollout::{Observer, episode_seconds};

/// Simulated seconds and the current step, shared between attempt and display.
#[derive(Clone, Debug, Default)]
pub struct Activity(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    seconds: f64,
    doing: String,
}

impl Activity {
    /// Resets the progress for another attempt.
    pub fn reset(&self) {
        *self.0.lock() = State::default();
    }

    /// Names the current step, in a word or two.
    pub fn set_step(&self, doing: &str) {
        doing.clone_into(&mut self.0.lock().doing);
    }

    /// Both as text.
    #[must_use]
    pub fn line(&self) -> String {
        let state = self.0.lock();
        format!("{:6.1} s simulated, {}", state.seconds, state.doing)
    }

    /// Simulated seconds so far.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.0.lock().seconds
    }
}

impl Observer for Activity {
    fn status(&self, status: &v1::Status) {
        if let Some(seconds) = episode_seconds(status) {
            let doing = format!("{:.2}x real time", status.real_time_factor);
            *self.0.lock() = State { seconds, doing };
        }
    }
}
