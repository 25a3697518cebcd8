//! Tells in the log when time is paused for long, for whom, and when it
//! goes on.

use std::time::{Duration, Instant};

/// Shorter waits are nothing to tell of.
const LONG: Duration = Duration::from_secs(2);

/// What an episode waits for, and since when.
#[derive(Debug)]
pub struct Waiting {
    what: String,
    since: Instant,
    told: bool,
}

impl Waiting {
    /// Waits for nothing.
    #[must_use]
    pub fn new() -> Self {
        Self {
            what: String::new(),
            since: Instant::now(),
            told: false,
        }
    }

    /// Notes what is waited for at `now`, nothing when empty; words for the log,
    /// if there is anything to tell.
    pub fn note(&mut self, what: &str, now: Instant) -> Option<String> {
        let waited = now.saturating_duration_since(self.since);
        if what != self.what {
            let over = self.told.then(|| {
                let secs = waited.as_secs_f64();
                format!("waited {secs:.1} s for {}", self.what)
            });
            what.clone_into(&mut self.what);
            self.since = now;
            self.told = false;
            return over;
        }
        if what.is_empty() || self.told || waited < LONG {
            return None;
        }
        self.told = true;
        Some(format!("time is paused: waiting for {what}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_wait_is_told_once_and_its_end_as_well() {
        let start = Instant::now();
        let at = |secs: f64| start + Duration::from_secs_f64(secs);
        let mut waiting = Waiting::new();
        assert_eq!(waiting.note("", at(9.0)), None);
        assert_eq!(waiting.note("recorder two", at(10.0)), None);
        assert_eq!(waiting.note("recorder two", at(11.0)), None);
        let told = waiting.note("recorder two", at(12.5)).unwrap();
        assert!(told.contains("waiting for recorder two"), "{told}");
        assert_eq!(waiting.note("recorder two", at(15.0)), None);
        let over = waiting.note("", at(20.0)).unwrap();
        assert_eq!(over, "waited 10.0 s for recorder two");
        // Short ones are not told of.
        assert_eq!(waiting.note("the commander", at(20.1)), None);
        assert_eq!(waiting.note("", at(20.2)), None);
    }
}
