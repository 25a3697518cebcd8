//! Random numbers of layouts: an independent stream for every plan, seed and purpose.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use wheelarm_proto::random::{self, fnv1a};

/// A stream of random numbers.
pub struct Random(ChaCha8Rng);

impl Random {
    /// The stream of a plan and a seed for a purpose.
    #[must_use]
    pub fn for_purpose(plan: &str, seed: u64, purpose: &str) -> Self {
        let key = random::stream_key([fnv1a("own homes"), fnv1a(plan), seed, fnv1a(purpose)]);
        Self(ChaCha8Rng::from_seed(key))
    }

    /// Uniform in 0 to 1, from 53 bits.
    pub fn fraction(&mut self) -> f64 {
        random::fraction(self.0.next_u64())
    }

    /// True with probability `share`.
    pub fn happens(&mut self, share: f64) -> bool {
        self.fraction() < share
    }

    /// Uniform in a range, in whole centimetres. An empty range gives its first end.
    pub fn length(&mut self, [low, high]: [f64; 2]) -> f64 {
        let value = low + (high - low).max(0.0) * self.fraction();
        (value * 100.0).round() / 100.0
    }

    /// Uniform in a range, not rounded.
    pub fn number(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.fraction()
    }

    /// Uniform below `count`; 0 when there is nothing to choose from.
    pub fn index(&mut self, count: usize) -> usize {
        random::index(self.fraction(), count)
    }

    /// A random entry; `None` for an empty list.
    pub fn one<T: Copy>(&mut self, list: &[T]) -> Option<T> {
        list.get(self.index(list.len())).copied()
    }

    /// Shuffles a list uniformly (Fisher and Yates).
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for i in (1..list.len()).rev() {
            list.swap(i, self.index(i + 1));
        }
    }
}
