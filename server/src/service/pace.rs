//! Pacing: when the next control tick may be taken, and how fast time passes.

use std::time::{Duration, Instant};

use wheelarm_proto::CONTROL_HZ;

use crate::sim::Pacing;

/// How far the simulation may fall behind before real time is let go, s.
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

    /// Starts anew after a pause.
    pub fn restart(&mut self) {
        *self = Self {
            factor: self.factor,
            ..Self::new(self.pacing)
        };
    }

    /// How long to wait at `now` before the next control tick; `None` when it is
    /// due. A command that waits makes a tick of real time due at once, up to one
    /// tick before its time: the clock of the simulation then leads by as much,
    /// and the command does not wait for the schedule.
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

    /// Counts a control tick that was done at `now`. Where the host cannot keep up, the
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

    /// Whether time passes as on the wall.
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
    fn a_command_takes_its_tick_at_once_but_time_leads_by_one_tick_at_most() {
        let mut pace = Pace::new(Pacing::RealTime);
        let start = pace.next;
        assert_eq!(pace.wait(start, false), None);
        pace.tick(start);
        assert_eq!(pace.wait(start + MS, false), Some(TICK - MS));
        assert_eq!(pace.wait(start + MS, true), None, "its tick is taken early");
        pace.tick(start + MS);
        // The tick after it has not even begun.
        assert_eq!(pace.wait(start + 2 * MS, true), Some(TICK - 2 * MS));
        assert_eq!(pace.wait(start + TICK, true), None);
        assert_eq!(
            pace.wait(start + TICK, false),
            Some(TICK),
            "without a command the schedule holds"
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
        // One second of ticks, and the one that leads.
        assert_eq!(ticks, CONTROL_HZ + 1);
    }
}
