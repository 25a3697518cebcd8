//! Random numbers of sentences: an independent stream for every seed and purpose.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use wheelarm_proto::random::{self, fnv1a};

/// A stream of random numbers.
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    /// The stream of a seed for a purpose.
    pub(crate) fn for_purpose(seed: u64, purpose: &str) -> Self {
        let key = random::stream_key([fnv1a("language"), seed, fnv1a(purpose), 1]);
        Self(ChaCha8Rng::from_seed(key))
    }

    /// Uniform in 0 to 1, from 53 bits.
    pub(crate) fn fraction(&mut self) -> f64 {
        random::fraction(self.0.next_u64())
    }

    /// True with probability `share`.
    pub(crate) fn happens(&mut self, share: f64) -> bool {
        self.fraction() < share
    }

    /// Uniform below `count`; 0 when there is nothing to choose from.
    pub(crate) fn index(&mut self, count: usize) -> usize {
        random::index(self.fraction(), count)
    }

    /// A random entry; `None` for an empty list.
    pub(crate) fn one<'a, T>(&mut self, list: &'a [T]) -> Option<&'a T> {
        list.get(self.index(list.len()))
    }
}
