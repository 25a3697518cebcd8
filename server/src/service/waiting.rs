//! Logs long pauses of simulation time, what they wait for, and their end.

use std::time::{Duration, Instant};

/// Shorter waits are not logged.
const LONG: Duration = Duration::from_secs(2);

/// What an episode waits for, and since when.
#[derive(Debug)]
pub struct Waiting {
    what: String,
    since: Instant,
    reported: bool,
}

impl Waiting {
    /// Not waiting.
    #[must_use]
    pub fn new() -> Self {
        Self {
            what: String::new(),
            since: Instant::now(),
            reported: false,
        }
    }

    /// Records what is waited for at `now` (empty for nothing); returns a message to
    /// log, if any.
    pub fn note(&mut self, what: &str, now: Instant) -> Option<String> {
        let waited = now.saturating_duration_since(self.since);
        if what != self.what {
            let over = self.reported.then(|| {
                let secs = waited.as_secs_f64();
                format!("waited {secs:.1} s for {}", self.what)
            });
            what.clone_into(&mut self.what);
            self.since = now;
            self.reported = false;
            return over;
        }
        if what.is_empty() || self.reported || waited < LONG {
            return None;
        }
        self.reported = true;
        Some(format!("time is paused: waiting for {what}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_wait_and_its_end_are_logged_once() {
        let start = Instant::now();
        let at = |secs: f64| start + Duration::from_secs_f64(secs);
        let mut waiting = Waiting::new();
        assert_eq!(waiting.note("", at(9.0)), None);
        assert_eq!(waiting.note("recorder two", at(10.0)), None);
        assert_eq!(waiting.note("recorder two", at(11.0)), None);
        let reported = waiting.note("recorder two", at(12.5)).unwrap();
        assert!(reported.contains("waiting for recorder two"), "{reported}");
        assert_eq!(waiting.note("recorder two", at(15.0)), None);
        let over = waiting.note("", at(20.0)).unwrap();
        assert_eq!(over, "waited 10.0 s for recorder two");
        // Short waits are not logged.
        assert_eq!(waiting.note("the commander", at(20.1)), None);
        assert_eq!(waiting.note("", at(20.2)), None);
    }
}
