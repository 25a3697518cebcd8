//! Pacing: when the next control tick may run, and how fast time passes.

use std::time::{Duration, Instant};

use wheelarm_proto::CONTROL_HZ;

use crate::sim::Pacing;

/// Largest delay of the simulation before the real-time schedule is moved.
const MAX_LAG: Duration = Duration::from_millis(50);

/// One control tick of wall time.
const TICK: Duration = Duration::from_nanos(1_000_000_000 / CONTROL_HZ);

/// The clock of the loop.
#[derive(Debug)]
pub struct Pace {
    pacing: Pacing,
    next: Instant,
    window: (Instant, u32),
    factor: f64,
}

impl Pace {
    /// A clock that starts now.
    #[must_use]
    pub fn new(pacing: Pacing) -> Self {
        let now = Instant::now();
        Self {
            pacing,
            next: now,
            window: (now, 0),
            factor: 0.0,
        }
    }

    /// Restarts the schedule after a pause.
    pub fn restart(&mut self) {
        *self = Self {
            factor: self.factor,
            ..Self::new(self.pacing)
        };
    }

    /// Wait from `now` until the next control tick; `None` when it is due. In real time
    /// a waiting command makes its tick due at once, up to one tick early. Simulation
    /// time then leads by at most one tick.
    #[must_use]
    pub fn wait(&self, now: Instant, command_waits: bool) -> Option<Duration> {
        match self.pacing {
            Pacing::RealTime => {
                let lead = if command_waits { TICK } else { Duration::ZERO };
                let wait = self.next.saturating_duration_since(now + lead);
                (!wait.is_zero()).then_some(wait)
            }
            Pacing::LockStep | Pacing::Fast => None,
        }
    }

    /// Counts a control tick that ended at `now`. When the host cannot keep up the
    /// schedule moves: simulation time slows down and no tick is skipped.
    pub fn tick(&mut self, now: Instant) {
        self.next += TICK;
        if now.saturating_duration_since(self.next) > MAX_LAG {
            self.next = now;
        }
        self.window.1 += 1;
        let elapsed = now.duration_since(self.window.0).as_secs_f64();
        if elapsed >= 1.0 {
            self.factor = f64::from(self.window.1) / CONTROL_HZ as f64 / elapsed;
            self.window = (now, 0);
        }
    }

    /// Whether the pacing is real time.
    #[must_use]
    pub fn is_real_time(&self) -> bool {
        self.pacing == Pacing::RealTime
    }

    /// Simulated seconds per wall second over the last second.
    #[must_use]
    pub fn factor(&self) -> f64 {
        self.factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_command_makes_its_tick_due_at_once_and_time_leads_by_one_tick_at_most() {
        let mut pace = Pace::new(Pacing::RealTime);
        let start = pace.next;
        assert_eq!(pace.wait(start, false), None);
        pace.tick(start);
        assert_eq!(pace.wait(start + MS, false), Some(TICK - MS));
        assert_eq!(pace.wait(start + MS, true), None, "its tick is due early");
        pace.tick(start + MS);
        // The next tick has not begun.
        assert_eq!(pace.wait(start + 2 * MS, true), Some(TICK - 2 * MS));
        assert_eq!(pace.wait(start + TICK, true), None);
        assert_eq!(
            pace.wait(start + TICK, false),
            Some(TICK),
            "without a command the schedule applies"
        );
    }

    #[test]
    fn a_flood_of_commands_does_not_make_time_run_faster() {
        let mut pace = Pace::new(Pacing::RealTime);
        let start = pace.next;
        let mut ticks = 0;
        for millisecond in 0..1000 {
            let now = start + millisecond * MS;
            if pace.wait(now, true).is_none() {
                pace.tick(now);
                ticks += 1;
            }
        }
        // One second of ticks, and the leading one.
        assert_eq!(ticks, CONTROL_HZ + 1);
    }
}
