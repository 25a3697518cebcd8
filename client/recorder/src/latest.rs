//! Finds images that were lost after the last received one. No gap shows them: in
//! lock-step the server waits for them and sends no others.

use std::time::{Duration, Instant};

/// Time without a new image or tick after which an image may be lost. The user may also
/// have paused, or an image may be in flight on a slow line.
pub(super) const LOOK: Duration = Duration::from_secs(5);
/// Longest pause between checks.
const LONGEST: Duration = Duration::from_secs(40);

/// Schedule of the requests.
#[derive(Debug, Default)]
pub(super) struct Latest {
    /// Images and tick at the last check, and since when they have not changed.
    since: Option<((u64, u64), Instant)>,
    pause: Duration,
    /// The next check does not wait.
    skips_pause: bool,
    /// Unanswered requests.
    pending: usize,
}

impl Latest {
    /// Whether to request images now; `news` is the number of images and the newest tick.
    pub fn is_due(&mut self, news: (u64, u64), now: Instant) -> bool {
        match self.since {
            Some((before, since)) if before == news => {
                let rested = now.saturating_duration_since(since) >= self.pause;
                self.pending == 0 && (self.skips_pause || rested)
            }
            _ => {
                self.since = Some((news, now));
                self.pause = LOOK;
                false
            }
        }
    }

    /// Whether nothing arrived for [`LOOK`].
    pub fn is_quiet(&self, news: (u64, u64), now: Instant) -> bool {
        self.since.is_some_and(|(before, since)| {
            before == news && now.saturating_duration_since(since) >= LOOK
        })
    }

    /// The connection was lost with the samples in flight: the next check does not wait.
    pub fn skip_pause(&mut self) {
        self.skips_pause = true;
        self.pending = 0;
    }

    /// Samples of `streams` streams were requested at `now`.
    pub fn requested(&mut self, streams: usize, now: Instant) {
        self.pending = streams;
        self.skips_pause = false;
        self.again(now);
        self.pause = (2 * self.pause).min(LONGEST);
    }

    /// A request was answered.
    pub fn answered(&mut self, now: Instant) {
        self.pending = self.pending.saturating_sub(1);
        self.again(now);
    }

    fn again(&mut self, now: Instant) {
        if let Some((_, since)) = &mut self.since {
            *since = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_makes_requests_rarer_and_never_before_the_answer() {
        let start = Instant::now();
        let at = |seconds: u64| start + Duration::from_secs(seconds);
        let mut latest = Latest::default();
        let mut looks = Vec::new();
        for second in 0..100 {
            let news = (u64::from(second >= 3), u64::from(second >= 60));
            if latest.is_due(news, at(second)) {
                looks.push(second);
                latest.requested(2, at(second));
                assert!(!latest.is_due(news, at(second + 99)));
                latest.answered(at(second + 1));
                latest.answered(at(second + 1));
            }
        }
        assert_eq!(looks, [8, 19, 40, 65, 76, 97]);
        latest.skip_pause();
        assert!(!latest.is_due((1, 2), at(100)), "a new tick");
        assert!(latest.is_due((1, 2), at(100)));
        latest.requested(0, at(100));
        assert!(!latest.is_due((1, 2), at(109)));
        assert!(latest.is_due((1, 2), at(110)));
    }
}
