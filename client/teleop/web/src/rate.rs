//! Rate limit of the messages of a socket.

/// Messages per second, and at once.
const RATE: [f64; 2] = [100.0, 100.0];

/// Remaining budget of a socket.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    left: f64,
    at: f64,
}

impl Allowance {
    /// Full, at `now`, s.
    #[must_use]
    pub fn new(now: f64) -> Self {
        Self {
            left: RATE[1],
            at: now,
        }
    }

    /// Uses one message at `now`, s; false when the budget is exhausted.
    pub fn take(&mut self, now: f64) -> bool {
        self.left = (self.left + (now - self.at).max(0.0) * RATE[0]).min(RATE[1]);
        self.at = now;
        let allowed = self.left >= 1.0;
        if allowed {
            self.left -= 1.0;
        }
        allowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundred_messages_a_second_are_accepted_and_a_flood_is_not() {
        let mut steady = Allowance::new(0.0);
        assert!((0..1000).all(|i| steady.take(f64::from(i) * 0.01)));
        let mut flood = Allowance::new(0.0);
        let taken = (0..1000)
            .filter(|i| flood.take(f64::from(*i) * 1e-4))
            .count();
        assert!((100..115).contains(&taken), "{taken}");
    }
}
