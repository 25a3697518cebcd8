//! Pace of the human-like style: submovements whose speed rises fast and falls slowly, with
//! lengths, heights and pauses from log-normal distributions, so that no rhythm repeats.

use std::f64::consts::E;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use wheelarm_proto::exact;

/// Median length of a submovement, seconds, spread of its logarithm, and limits.
const LENGTH: LogNormal = LogNormal(0.6, 0.6, [0.25, 3.0]);
/// Greatest rate within a submovement, as a share of the profile's speeds.
const HEIGHT: LogNormal = LogNormal(0.95, 0.45, [0.4, 1.5]);
/// Pause after a submovement, seconds.
const PAUSE: LogNormal = LogNormal(0.40, 0.9, [0.1, 6.0]);
/// Share of submovements that begin before the one before has ended.
const JOINED: f64 = 0.5;
/// They begin before its end by this share of its length.
const OVERLAP: [f64; 2] = [0.15, 0.45];
/// The greatest rate is reached after this share of a submovement.
const PEAK: [f64; 2] = [0.3, 0.5];
/// Greatest rate of submovements that overlap.
const MOST: f64 = 1.6;

/// Median, standard deviation of the logarithm, limits.
struct LogNormal(f64, f64, [f64; 2]);

impl LogNormal {
    fn sample(&self, rng: &mut ChaCha8Rng) -> f64 {
        // Sum of twelve even samples: normal to within 0.1 standard deviations up to 2.5.
        let normal = (0..12).map(|_| rng.random_range(0.0..1.0)).sum::<f64>() - 6.0;
        let [least, most] = self.2;
        (self.0 * exact::powf(E, self.1 * normal)).clamp(least, most)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Submovement {
    begin: f64,
    length: f64,
    height: f64,
    peak: f64,
}

impl Submovement {
    /// Rate at a time, 0 before it begins and after it ends.
    fn rate(&self, time: f64) -> f64 {
        let share = (time - self.begin) / self.length;
        if !(0.0..1.0).contains(&share) {
            return 0.0;
        }
        let side = match share < self.peak {
            true => share / self.peak,
            false => (1.0 - share) / (1.0 - self.peak),
        };
        self.height * exact::sin(std::f64::consts::FRAC_PI_2 * side).powi(2)
    }
}

/// Rate of the operator at each time of an episode.
#[derive(Clone, Debug)]
pub struct Pace {
    rng: ChaCha8Rng,
    /// Those that have not ended yet, and the next.
    submovements: Vec<Submovement>,
    /// When the next one begins, seconds.
    next: f64,
}

impl Pace {
    /// The pace of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            submovements: Vec::new(),
            next: 0.0,
        }
    }

    /// The rate `time` seconds after the beginning, 0 to `MOST`; times only grow.
    pub fn rate(&mut self, time: f64) -> f64 {
        self.submovements
            .retain(|one| one.begin + one.length > time);
        while self.next <= time {
            let length = LENGTH.sample(&mut self.rng);
            self.submovements.push(Submovement {
                begin: self.next,
                length,
                height: HEIGHT.sample(&mut self.rng),
                peak: self.rng.random_range(PEAK[0]..PEAK[1]),
            });
            let pause = PAUSE.sample(&mut self.rng);
            let overlap = self.rng.random_range(OVERLAP[0]..OVERLAP[1]);
            self.next += match self.rng.random_range(0.0..1.0) < JOINED {
                true => length * (1.0 - overlap),
                false => length + pause,
            };
        }
        let rates = self.submovements.iter().map(|one| one.rate(time));
        rates.sum::<f64>().min(MOST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates at 60 Hz over `seconds`.
    fn rates(seed: u64, seconds: u32) -> Vec<f64> {
        let mut pace = Pace::new(seed);
        (0..60 * seconds)
            .map(|i| pace.rate(f64::from(i) / 60.0))
            .collect()
    }

    #[test]
    fn pace_repeats_for_a_seed_and_differs_between_seeds() {
        assert_eq!(rates(3, 60), rates(3, 60));
        assert_ne!(rates(3, 60), rates(4, 60));
    }

    #[test]
    fn pace_pauses_for_a_third_of_the_time_and_has_no_period() {
        for seed in 1..9 {
            let rates = rates(seed, 240);
            let count = rates.len() as f64;
            let still = rates.iter().filter(|rate| **rate < 0.02).count() as f64 / count;
            assert!((0.15..0.5).contains(&still), "{still}");
            let mean = rates.iter().sum::<f64>() / count;
            let power: f64 = rates.iter().map(|rate| (rate - mean).powi(2)).sum();
            // Power at one frequency of the discrete Fourier transform, by Parseval.
            let at = |k: f64| {
                let waves = rates.iter().enumerate().map(|(i, rate)| {
                    let (sin, cos) = exact::sin_cos(std::f64::consts::TAU * k * i as f64 / count);
                    ((rate - mean) * cos, (rate - mean) * sin)
                });
                let (c, s) = waves.fold((0.0, 0.0), |(c, s), (x, y)| (c + x, s + y));
                2.0 * (c * c + s * s) / count / power
            };
            let peak = (10..480).map(|k| at(f64::from(k))).fold(0.0, f64::max);
            assert!(peak < 0.15, "seed {seed}: {peak}");
        }
    }
}
