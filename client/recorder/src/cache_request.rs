//! One request to the server's cache, repeated until the samples arrive or are given up.

use std::time::{Duration, Instant};

/// Pause between an answer without the samples and the next request; it doubles up to
/// [`LONGEST`].
pub(super) const PAUSE: Duration = Duration::from_secs(1);
const LONGEST: Duration = Duration::from_secs(4);
/// Number of answers without the samples after which they are given up; a lock-step
/// server waits until then.
pub(super) const TRIES: u32 = 5;
/// Longest wait for an answer of a lock-step server, which waits too: an image takes
/// seconds on a slow line.
pub(super) const LOCK_STEP_PATIENCE: Duration = Duration::from_secs(15);
/// Longest wait for an answer of a real-time server, whose cache soon drops the samples.
pub(super) const REAL_TIME_PATIENCE: Duration = Duration::from_secs(3);

/// A request with its attempts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CacheRequest {
    /// Attempts; more than [`TRIES`] mean given up.
    tries: u32,
    stage: Stage,
}

#[derive(Clone, Copy, Debug, Default)]
enum Stage {
    #[default]
    New,
    /// Sent at this time; the samples may be in flight.
    Sent(Instant),
    /// Answered at this time.
    Answered(Instant),
}

impl CacheRequest {
    /// Starts the next attempt if it is due at `now`; returns whether to send the request.
    pub fn start_if_due(&mut self, now: Instant) -> bool {
        let due = match self.stage {
            Stage::New => true,
            // The end of its answer was lost.
            Stage::Sent(at) => now.saturating_duration_since(at) >= 2 * LOCK_STEP_PATIENCE,
            Stage::Answered(at) => now.saturating_duration_since(at) >= self.pause(),
        };
        if !due || self.is_given_up() {
            return false;
        }
        self.tries += 1;
        self.stage = Stage::Sent(now);
        !self.is_given_up()
    }

    fn pause(&self) -> Duration {
        (PAUSE * 2_u32.saturating_pow(self.tries.saturating_sub(1))).min(LONGEST)
    }

    /// All samples that the server sends for it arrived at `now`, or it timed out.
    pub fn answered(&mut self, now: Instant) {
        if let Stage::Sent(_) = self.stage {
            self.stage = Stage::Answered(now);
        }
    }

    /// The connection was lost with the samples in flight: starts over unless given up.
    pub fn restart(&mut self) {
        if !self.is_given_up() {
            *self = Self::default();
        }
    }

    /// Number of attempts.
    pub fn tries(&self) -> u32 {
        self.tries
    }

    /// Whether all attempts failed.
    pub fn is_given_up(&self) -> bool {
        self.tries > TRIES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn request_is_repeated_after_a_reply_at_most_five_times() {
        let start = Instant::now();
        let at = |seconds: u32| start + seconds * PAUSE;
        let mut request = CacheRequest::default();
        assert!(request.start_if_due(start));
        assert!(!request.start_if_due(at(20)), "the answer may be under way");
        request.restart();
        assert!(request.start_if_due(at(20)), "the connection was lost");
        assert_eq!(request.tries(), 1);
        let (mut sent, mut seconds) = (1, 20);
        while !request.is_given_up() {
            request.answered(at(seconds));
            // A repeated answer counts once.
            request.answered(at(seconds + 9));
            while !request.is_given_up() && !request.start_if_due(at(seconds)) {
                seconds += 1;
                assert!(seconds < 60, "{request:?}");
            }
            sent += u32::from(!request.is_given_up());
        }
        // Pauses of 1, 2, 4, 4 and 4 s, and the step that shows the last is over.
        assert_eq!((sent, seconds), (TRIES, 36));
        request.restart();
        assert!(!request.start_if_due(at(1000)));
        let mut forgotten = CacheRequest::default();
        assert!(forgotten.start_if_due(start));
        assert!(forgotten.start_if_due(start + 2 * LOCK_STEP_PATIENCE));
    }
}
