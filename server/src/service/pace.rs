//! Pacing: when the next control tick may be taken, and how fast time passes.

use std::time::{Duration, Instant};

use wheelarm_proto::CONTROL_HZ;

use crate::sim::Pacing;

/// How far the simulation may fall behind before real time is let go, s.
const MAX_LAG: Duration = Duration::from_millis(50);

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

    /// How long to wait before the next control tick; `None` when it is due.
    #[must_use]
    pub fn wait(&self) -> Option<Duration> {
        match self.pacing {
            Pacing::RealTime => {
                let wait = self.next.saturating_duration_since(Instant::now());
                (!wait.is_zero()).then_some(wait)
            }
            Pacing::LockStep | Pacing::Fast => None,
        }
    }

    /// Counts a control tick. Where the host cannot keep up, the schedule
    /// moves: simulation time slows down and no tick is skipped.
    pub fn tick(&mut self) {
        let now = Instant::now();
        self.next += Duration::from_nanos(1_000_000_000 / CONTROL_HZ);
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

    /// Simulated seconds per wall second over the last second.
    #[must_use]
    pub fn factor(&self) -> f64 {
        self.factor
    }
}
