//! Signs of life of an episode, for who watches from another thread.

use std::time::{Duration, Instant};

use parking_lot::Mutex;
use wheelarm_dataset::scenario_text::scenario_json;
use wheelarm_proto::v1;

/// When something happened last, and what is known so far.
pub struct Pulse(Mutex<Seen>);

struct Seen {
    last: Instant,
    seconds: f64,
    scenario: Option<serde_json::Value>,
}

impl Default for Pulse {
    fn default() -> Self {
        Self(Mutex::new(Seen {
            last: Instant::now(),
            seconds: 0.0,
            scenario: None,
        }))
    }
}

impl Pulse {
    /// The scenario stands, with its drawn values.
    pub fn set_up(&self, scenario: &v1::Scenario) {
        let mut seen = self.0.lock();
        seen.last = Instant::now();
        seen.scenario = Some(scenario_json(scenario));
    }

    /// A tick came, `seconds` simulated seconds after the first.
    pub fn beat(&self, seconds: f64) {
        let mut seen = self.0.lock();
        seen.last = Instant::now();
        seen.seconds = seconds;
    }

    /// For how long nothing has come.
    pub fn still(&self) -> Duration {
        self.0.lock().last.elapsed()
    }

    /// Simulated seconds so far.
    pub fn seconds(&self) -> f64 {
        self.0.lock().seconds
    }

    /// The scenario, once it stands.
    pub fn scenario(&self) -> Option<serde_json::Value> {
        self.0.lock().scenario.clone()
    }
}
