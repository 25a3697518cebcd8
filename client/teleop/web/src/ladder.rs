//! Bitrate ladder: chooses the preview level that a network path can carry. Pure.
//!
//! A step down happens at once when the delay grows over the smallest delay, when images
//! are lost, or when the browser skips images. A step up happens after a quiet time,
//! which doubles after each step up that failed.

use wheelarm_proto::preview::PreviewLevel;

/// Time over which a path is judged, s.
const WINDOW: f64 = 1.5;
/// Mean growth of the delay that is too much, s.
const GROWTH: f64 = 0.25;
/// Share of lost images that is too much.
const MISSED: f64 = 0.15;
/// Share of images skipped by the browser that is too much.
const SKIPPED: f64 = 0.5;
/// Fewer images than this in a window give no verdict.
const ENOUGH: u64 = 3;
/// Quiet time before a step up, least and greatest, s.
const QUIET: [f64; 2] = [4.0, 60.0];
/// After a step down the path drains for this long, s; arrivals meanwhile say nothing
/// about the new level.
const SETTLE: f64 = 2.5;
/// A step up that holds this long was right, s.
const HELD: f64 = 8.0;
/// The smallest delay is taken over one to two times this, s.
const QUICKEST: f64 = 60.0;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Window {
    began: f64,
    arrived: u64,
    missed: u64,
    growth: f64,
    shown: u64,
    skipped: u64,
}

/// Chooses the level.
#[derive(Clone, Debug)]
pub struct Ladder {
    level: PreviewLevel,
    window: Window,
    next: Option<u64>,
    /// Smallest delay of this period and of the previous one, s.
    quickest: [f64; 2],
    period: f64,
    quiet: f64,
    changed: f64,
    went_up: bool,
    went_down: bool,
    growth: f64,
}

impl Ladder {
    /// Begins in the middle.
    #[must_use]
    pub fn new(now: f64) -> Self {
        Self {
            level: PreviewLevel::Medium,
            window: Window {
                began: now,
                ..Window::default()
            },
            next: None,
            quickest: [f64::INFINITY; 2],
            period: now,
            quiet: QUIET[0],
            changed: now,
            went_up: false,
            went_down: false,
            growth: 0.0,
        }
    }

    /// The current level.
    #[must_use]
    pub fn level(&self) -> PreviewLevel {
        self.level
    }

    /// Growth of the delay over the smallest delay, s, smoothed.
    #[must_use]
    pub fn growth(&self) -> f64 {
        self.growth
    }

    /// Records an arrival: sequence number and delay, which is the arrival time of this
    /// host's clock minus the send time of the server's clock.
    pub fn arrived(&mut self, sequence: u64, way: f64, now: f64) {
        if now - self.period > QUICKEST {
            self.quickest = [way, self.quickest[0]];
            self.period = now;
        }
        self.quickest[0] = self.quickest[0].min(way);
        let growth = way - self.quickest[0].min(self.quickest[1]);
        self.growth += 0.2 * (growth - self.growth);
        if let Some(next) = self.next
            && sequence > next
        {
            self.window.missed += sequence - next;
        }
        self.next = Some(sequence + 1);
        self.window.arrived += 1;
        self.window.growth += growth;
    }

    /// Sequence numbers start again: another server, or another subscription.
    pub fn restart(&mut self) {
        self.next = None;
    }

    /// A browser acknowledged an image after it skipped some.
    pub fn shown(&mut self, skipped: u64) {
        self.window.shown += 1;
        self.window.skipped += skipped;
    }

    /// Judges the window when it is complete; returns the new level when it changes.
    pub fn decide(&mut self, now: f64) -> Option<PreviewLevel> {
        if now - self.window.began < WINDOW {
            return None;
        }
        let window = std::mem::replace(
            &mut self.window,
            Window {
                began: now,
                ..Window::default()
            },
        );
        if self.went_down && now - self.changed < SETTLE {
            return None;
        }
        let share = |part: u64, rest: u64| part as f64 / (part + rest).max(1) as f64;
        let trouble = window.arrived + window.missed >= ENOUGH
            && (window.growth / window.arrived.max(1) as f64 > GROWTH
                || share(window.missed, window.arrived) > MISSED)
            || window.shown >= ENOUGH && share(window.skipped, window.shown) > SKIPPED;
        let step = PreviewLevel::ALL.iter().position(|l| *l == self.level)?;
        if trouble {
            if self.went_up && now - self.changed < HELD {
                self.quiet = (2.0 * self.quiet).min(QUIET[1]);
            }
            let down = step.checked_sub(1)?;
            return self.go(down, false, now);
        }
        if self.went_up && now - self.changed > HELD {
            self.went_up = false;
            self.quiet = QUIET[0];
        }
        // No verdict without images: simulation may be paused.
        if window.arrived == 0 {
            self.changed = self.changed.max(now - self.quiet);
            return None;
        }
        if now - self.changed >= self.quiet && step + 1 < PreviewLevel::ALL.len() {
            return self.go(step + 1, true, now);
        }
        None
    }

    fn go(&mut self, step: usize, up: bool, now: f64) -> Option<PreviewLevel> {
        self.level = *PreviewLevel::ALL.get(step)?;
        self.changed = now;
        self.went_up = up;
        self.went_down = !up;
        self.next = None;
        Some(self.level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A path of some bytes per second with a queue of one second; images of
    /// 8, 35 and 160 kB at 5, 10 and 10 Hz. Returns the levels over time.
    fn levels(bytes_per_second: impl Fn(f64) -> f64, seconds: f64) -> Vec<PreviewLevel> {
        let mut ladder = Ladder::new(0.0);
        let (mut queue, mut sequence, mut levels) = (0.0_f64, 0, Vec::new());
        let (mut now, mut next) = (0.0, 0.0);
        while now < seconds {
            let speed = bytes_per_second(now);
            queue = (queue - speed * 0.01).max(0.0);
            if now >= next {
                let (bytes, rate) = match ladder.level() {
                    PreviewLevel::Low => (8e3, 5.0),
                    PreviewLevel::Medium => (35e3, 10.0),
                    _ => (160e3, 10.0),
                };
                next = now + 1.0 / rate;
                sequence += 1;
                if queue < speed {
                    queue += bytes;
                    // The clocks of both ends differ by a thousand seconds.
                    ladder.arrived(sequence, 1000.0 + queue / speed, now);
                    ladder.shown(0);
                }
            }
            ladder.decide(now);
            levels.push(ladder.level());
            now += 0.01;
        }
        levels
    }

    fn share(levels: &[PreviewLevel], level: PreviewLevel) -> f64 {
        levels.iter().filter(|l| **l == level).count() as f64 / levels.len() as f64
    }

    #[test]
    fn a_fast_path_climbs_to_the_top_and_stays() {
        let levels = levels(|_| 100e6, 60.0);
        assert!(share(&levels[1500..], PreviewLevel::High) > 0.99);
    }

    #[test]
    fn a_path_of_5_mbit_carries_medium_and_rarely_attempts_more() {
        let levels = levels(|_| 625e3, 240.0);
        assert!(share(&levels, PreviewLevel::Low) < 0.1);
        assert!(share(&levels[12_000..], PreviewLevel::Medium) > 0.8);
    }

    #[test]
    fn a_path_that_becomes_slow_falls_and_one_that_recovers_climbs() {
        let speed = |now: f64| {
            if (30.0..60.0).contains(&now) {
                60e3
            } else {
                50e6
            }
        };
        let levels = levels(speed, 120.0);
        assert_eq!(levels[2900], PreviewLevel::High);
        assert_eq!(levels[4500], PreviewLevel::Low);
        assert_eq!(levels[11_900], PreviewLevel::High);
    }

    #[test]
    fn a_browser_that_cannot_follow_gets_smaller_images() {
        let mut ladder = Ladder::new(0.0);
        for i in 0..60_u64 {
            let now = i as f64 * 0.1;
            ladder.arrived(i, 0.02, now);
            if i % 4 == 0 {
                ladder.shown(3);
            }
            ladder.decide(now);
        }
        assert_eq!(ladder.level(), PreviewLevel::Low);
    }
}
