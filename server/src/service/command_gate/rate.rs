//! A token bucket: a steady rate with a burst. It reads no clock.

/// Allows `per_second` on average and `burst` at once.
#[derive(Clone, Debug)]
pub struct Bucket {
    per_second: f64,
    burst: f64,
    tokens: f64,
    updated: f64,
}

impl Bucket {
    /// A full bucket.
    #[must_use]
    pub fn new(per_second: f64, burst: f64) -> Self {
        Self {
            per_second,
            burst,
            tokens: burst,
            updated: 0.0,
        }
    }

    /// Whether one more is allowed at `now`, seconds of a monotonic clock.
    pub fn take(&mut self, now: f64) -> bool {
        let passed = (now - self.updated).max(0.0);
        self.updated = self.updated.max(now);
        self.tokens = (self.tokens + passed * self.per_second).min(self.burst);
        let allowed = self.tokens >= 1.0;
        if allowed {
            self.tokens -= 1.0;
        }
        allowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_passes_and_then_the_rate_holds() {
        let mut bucket = Bucket::new(100.0, 20.0);
        let passed = |bucket: &mut Bucket, from: f64, seconds: f64, per_second: u32| {
            let times = (0..(seconds * f64::from(per_second)) as u32)
                .map(|i| from + f64::from(i) / f64::from(per_second));
            times.filter(|&t| bucket.take(t)).count()
        };
        assert_eq!(passed(&mut bucket, 0.0, 0.001, 20_000), 20);
        let flood = passed(&mut bucket, 1.0, 2.0, 10_000);
        assert!((218..=222).contains(&flood), "{flood} of 200 + 20");
        let steady = passed(&mut bucket, 10.0, 2.0, 60);
        assert_eq!(steady, 120, "a rate below the limit always passes");
        assert!(bucket.take(5.0), "a clock that goes back removes no tokens");
    }
}
