//! Pictures that were lost behind the last that came. Nothing shows that they lack: in
//! lock-step the server waits for them and sends no others.

use std::time::{Duration, Instant};

/// Neither pictures nor time come for so long: a picture may be lost, or somebody paused.
/// On a slow line one may be under way.
pub(super) const LOOK: Duration = Duration::from_secs(5);
/// Longest pause between looks.
const LONGEST: Duration = Duration::from_secs(40);

/// When to look for them.
#[derive(Debug, Default)]
pub(super) struct Latest {
    /// Pictures and tick at the last look, and since when they are the same.
    since: Option<((u64, u64), Instant)>,
    pause: Duration,
    /// The next look need not wait.
    hurries: bool,
    /// Questions without an answer.
    asked: usize,
}

impl Latest {
    /// Whether to look now that so many pictures are here, and the newest tick is this.
    pub fn is_due(&mut self, news: (u64, u64), now: Instant) -> bool {
        match self.since {
            Some((before, since)) if before == news => {
                let rested = now.saturating_duration_since(since) >= self.pause;
                self.asked == 0 && (self.hurries || rested)
            }
            _ => {
                self.since = Some((news, now));
                self.pause = LOOK;
                false
            }
        }
    }

    /// Whether nothing has come for a while.
    pub fn is_quiet(&self, news: (u64, u64), now: Instant) -> bool {
        self.since.is_some_and(|(before, since)| {
            before == news && now.saturating_duration_since(since) >= LOOK
        })
    }

    /// The connection was lost, and with it what was under way: the next look need not
    /// wait.
    pub fn hurry(&mut self) {
        self.hurries = true;
        self.asked = 0;
    }

    /// So many streams were asked for at `now`.
    pub fn asked(&mut self, streams: usize, now: Instant) {
        self.asked = streams;
        self.hurries = false;
        self.again(now);
        self.pause = (2 * self.pause).min(LONGEST);
    }

    /// A question was answered.
    pub fn answered(&mut self, now: Instant) {
        self.asked = self.asked.saturating_sub(1);
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
    fn who_hears_nothing_looks_ever_more_rarely_and_not_before_the_answer() {
        let start = Instant::now();
        let at = |seconds: u64| start + Duration::from_secs(seconds);
        let mut latest = Latest::default();
        let mut looks = Vec::new();
        for second in 0..100 {
            let news = (u64::from(second >= 3), u64::from(second >= 60));
            if latest.is_due(news, at(second)) {
                looks.push(second);
                latest.asked(2, at(second));
                assert!(!latest.is_due(news, at(second + 99)));
                latest.answered(at(second + 1));
                latest.answered(at(second + 1));
            }
        }
        assert_eq!(looks, [8, 19, 40, 65, 76, 97]);
        latest.hurry();
        assert!(!latest.is_due((1, 2), at(100)), "something comes");
        assert!(latest.is_due((1, 2), at(100)));
        latest.asked(0, at(100));
        assert!(!latest.is_due((1, 2), at(109)));
        assert!(latest.is_due((1, 2), at(110)));
    }
}
