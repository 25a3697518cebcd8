//! Seeded noise: 64 random bits from a counter, and normal variates from a table, so
//! that a pixel costs one multiplication and the bits are the same everywhere.

use wheelarm_proto::exact;
use wheelarm_proto::random::{SplitMix64, open_fraction};

/// Entries of the table of the normal distribution.
const ENTRIES: usize = 1 << 12;

/// Random bits that depend only on seed and key (SplitMix64).
#[derive(Clone, Debug)]
pub struct Random(SplitMix64);

impl Random {
    /// The generator of one use, distinguished by `key`.
    #[must_use]
    pub fn new(seed: u64, key: [u64; 2]) -> Self {
        let mut random = Self(SplitMix64(seed));
        for part in key {
            random.0 = SplitMix64(random.bits() ^ part.wrapping_mul(0xd6e8_feb8_6659_fd93));
        }
        random
    }

    /// The next 64 bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// Uniform in 0 to 1, both excluded.
    pub fn uniform(&mut self) -> f64 {
        open_fraction(self.bits())
    }

    /// Standard normal, by Box and Muller (1958).
    pub fn normal(&mut self) -> f64 {
        let (a, b) = (self.uniform(), self.uniform());
        (-2.0 * exact::ln(a)).sqrt() * exact::cos(std::f64::consts::TAU * b)
    }
}

/// Quantiles of the standard normal distribution, indexed by 12 bits: mean 0, standard
/// deviation 1, nothing beyond 3.7.
#[derive(Clone, Debug)]
pub struct NormalTable(Vec<f32>);

impl NormalTable {
    /// The table, computed from a fine sum of the density.
    #[must_use]
    pub fn new() -> Self {
        // The density is summed from -4 to 4 by trapezoids; exp is computed as 1 / e^x
        // by powf of the pure library.
        const STEPS: usize = 1 << 14;
        let at = |i: usize| -4.0 + 8.0 * i as f64 / STEPS as f64;
        let density = |x: f64| exact::powf(std::f64::consts::E, -0.5 * x * x);
        let mut sums = vec![0.0; STEPS + 1];
        for i in 1..=STEPS {
            sums[i] = sums[i - 1] + 0.5 * (density(at(i - 1)) + density(at(i)));
        }
        let whole = sums[STEPS];
        let mut i = 0;
        let raw = (0..ENTRIES).map(|k| {
            let share = (k as f64 + 0.5) / ENTRIES as f64 * whole;
            while sums[i + 1] < share {
                i += 1;
            }
            let within = (share - sums[i]) / (sums[i + 1] - sums[i]);
            at(i) + within * 8.0 / STEPS as f64
        });
        let raw: Vec<f64> = raw.collect();
        let deviation = (raw.iter().map(|x| x * x).sum::<f64>() / raw.len() as f64).sqrt();
        Self(raw.iter().map(|x| (x / deviation) as f32).collect())
    }

    /// The variate indexed by the lowest 12 bits.
    #[inline]
    #[must_use]
    pub fn variate(&self, bits: u64) -> f32 {
        self.0[(bits & (ENTRIES as u64 - 1)) as usize]
    }
}

impl Default for NormalTable {
    fn default() -> Self {
        Self::new()
    }
}

/// A long sequence of normal variates that is read from a random position; its length
/// hides the repetition.
#[derive(Clone, Debug)]
pub struct NormalTape(Vec<f32>);

/// Length of a tape.
const TAPE: usize = 1 << 16;

impl NormalTape {
    /// A tape that depends on a seed; up to `longest` variates can be read at once.
    #[must_use]
    pub fn new(seed: u64, most: usize) -> Self {
        let table = NormalTable::new();
        let mut random = Random::new(seed, [u64::MAX, TAPE as u64]);
        let mut tape: Vec<f32> = (0..TAPE).map(|_| table.variate(random.bits())).collect();
        for i in 0..most {
            tape.push(tape[i]);
        }
        Self(tape)
    }

    /// As [`NormalTape::new`], each variate the mean over `window` neighbors, scaled to
    /// standard deviation 1: their correlation decreases linearly to 0 at `window`.
    #[must_use]
    pub fn averaged(seed: u64, most: usize, window: usize) -> Self {
        let Self(plain) = Self::new(seed, 0);
        let window = window.clamp(1, TAPE);
        let scale = 1.0 / (window as f32).sqrt();
        let mean = |i: usize| (0..window).map(|k| plain[(i + k) % TAPE]).sum::<f32>() * scale;
        Self((0..TAPE + most).map(|i| mean(i % TAPE)).collect())
    }

    /// `count` variates from a position given by random bits.
    #[must_use]
    pub fn read(&self, bits: u64, count: usize) -> &[f32] {
        let from = (bits % TAPE as u64) as usize;
        &self.0[from..(from + count).min(self.0.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_normal() {
        let table = NormalTable::new();
        let mut random = Random::new(1, [2, 3]);
        let all: Vec<f64> = (0..200_000)
            .map(|_| f64::from(table.variate(random.bits())))
            .collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let moment = |k: i32| all.iter().map(|x| x.powi(k)).sum::<f64>() / all.len() as f64;
        assert!(mean.abs() < 0.01, "mean {mean}");
        assert!((moment(2) - 1.0).abs() < 0.01, "variance {}", moment(2));
        assert!((moment(4) - 3.0).abs() < 0.1, "kurtosis {}", moment(4));
    }

    #[test]
    fn another_seed_or_key_gives_other_bits() {
        let first = |seed, key| Random::new(seed, key).bits();
        let all = [
            first(1, [0, 0]),
            first(2, [0, 0]),
            first(1, [1, 0]),
            first(1, [0, 1]),
        ];
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b));
        }
        assert_eq!(first(5, [6, 7]), first(5, [6, 7]));
    }
}
