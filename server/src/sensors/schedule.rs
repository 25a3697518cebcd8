//! Schedules of sensors. Rates divide the physics rate, so that every sample has an
//! exact tick.

use wheelarm_proto::PHYSICS_HZ;

/// A rate that does not divide the base rate.
#[derive(Debug, thiserror::Error, PartialEq)]
#[error(
    "rate of {what} is {} Hz, expected a whole number of hertz that divides {base} (or 0 for off)",
    wheelarm_proto::check::Number(*.rate)
)]
pub struct BadRate {
    /// The sensor.
    pub what: String,
    /// The requested rate.
    pub rate: f64,
    /// The rate it must divide.
    pub base: u64,
}

/// Due times of one sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Ticks between samples; 0 is off.
    period: u64,
}

impl Schedule {
    /// A sensor of `rate` Hz; the rate must divide `base` Hz, which divides 240.
    ///
    /// # Errors
    /// [`BadRate`] when it does not.
    pub fn new(what: &str, rate: f64, base: u64) -> Result<Self, BadRate> {
        let bad = || BadRate {
            what: what.to_owned(),
            rate,
            base,
        };
        if rate == 0.0 {
            return Ok(Self { period: 0 });
        }
        if !rate.is_finite() || rate.fract() != 0.0 || rate < 1.0 || rate > base as f64 {
            return Err(bad());
        }
        let rate_hz = rate as u64;
        if !base.is_multiple_of(rate_hz) {
            return Err(bad());
        }
        Ok(Self {
            period: PHYSICS_HZ / rate_hz,
        })
    }

    /// Whether a sample is due at this tick.
    #[must_use]
    pub fn due(&self, tick: u64) -> bool {
        self.period > 0 && tick.is_multiple_of(self.period)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_hertz_is_due_every_24_ticks() {
        let camera = Schedule::new("camera", 10.0, 240).unwrap();
        let due: Vec<u64> = (0..60).filter(|t| camera.due(*t)).collect();
        assert_eq!(due, [0, 24, 48]);
        assert!(!Schedule::new("off", 0.0, 240).unwrap().due(0));
    }

    #[test]
    fn rates_that_do_not_divide_the_base_are_refused() {
        for bad in [7.0, 0.5, 480.0, -1.0, f64::NAN, 33.3] {
            assert!(Schedule::new("x", bad, 240).is_err(), "{bad} was accepted");
        }
    }
}
