//! Signs of life of an episode, for who watches from another thread.

use std::time::{Duration, Instant};

use parking_lot::Mutex;
use wheelarm_dataset::scenario_text::scenario_json;
use wheelarm_proto::v1;
use wheelarm_rollout::policy::{Policy, PolicyError};

/// When something happened last, and what is known so far.
pub struct Pulse(Mutex<Seen>);

struct Seen {
    last: Instant,
    /// It is a policy's turn, not the server's.
    thinks: bool,
    seconds: f64,
    scenario: Option<serde_json::Value>,
}

impl Default for Pulse {
    fn default() -> Self {
        Self(Mutex::new(Seen {
            last: Instant::now(),
            thinks: false,
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

    /// For how long nothing has come from the server. While a policy thinks, or is
    /// started again, that is nothing: its own time is bounded by its own patience.
    pub fn still(&self) -> Duration {
        let seen = self.0.lock();
        match seen.thinks {
            true => Duration::ZERO,
            false => seen.last.elapsed(),
        }
    }

    fn thinks(&self, thinks: bool) {
        let mut seen = self.0.lock();
        seen.last = Instant::now();
        seen.thinks = thinks;
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

/// A policy whose time to think is not the server's.
pub struct Thinker<'a> {
    /// Who is asked.
    pub policy: &'a dyn Policy,
    /// What is told of it.
    pub pulse: &'a Pulse,
}

impl Thinker<'_> {
    fn meanwhile<T>(&self, asks: impl FnOnce(&dyn Policy) -> T) -> T {
        self.pulse.thinks(true);
        let answer = asks(self.policy);
        self.pulse.thinks(false);
        answer
    }
}

impl Policy for Thinker<'_> {
    fn spec(&self) -> &v1::PolicySpec {
        self.policy.spec()
    }

    fn reset(&self, request: v1::PolicyResetRequest) -> Result<(), PolicyError> {
        self.meanwhile(|policy| policy.reset(request))
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        self.meanwhile(|policy| policy.infer(observation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sees of the server what stands in the pulse while it thinks.
    struct Looks<'a>(v1::PolicySpec, &'a Pulse);

    impl Policy for Looks<'_> {
        fn spec(&self) -> &v1::PolicySpec {
            &self.0
        }

        fn reset(&self, _: v1::PolicyResetRequest) -> Result<(), PolicyError> {
            assert_eq!(self.1.still(), Duration::ZERO);
            Err(PolicyError::Said("no".to_owned()))
        }

        fn infer(&self, _: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
            assert_eq!(self.1.still(), Duration::ZERO);
            Ok(v1::PolicyChunk::default())
        }
    }

    #[test]
    fn while_a_policy_thinks_the_server_is_not_still() {
        let pulse = Pulse::default();
        let policy = Looks(v1::PolicySpec::default(), &pulse);
        let thinker = Thinker {
            policy: &policy,
            pulse: &pulse,
        };
        assert!(thinker.infer(v1::PolicyObservation::default()).is_ok());
        let told = thinker.reset(v1::PolicyResetRequest::default());
        assert!(told.is_err());
        assert!(!pulse.0.lock().thinks, "it is over");
        std::thread::sleep(Duration::from_millis(1));
        assert!(pulse.still() > Duration::ZERO);
    }
}
