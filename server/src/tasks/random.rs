//! Random numbers for sampling: independent streams, and uniform numbers that do not
//! depend on a library's sampling.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use wheelarm_proto::random::{self, fnv1a};

use super::area::Range;

/// An independent random stream for every area, seed and purpose.
pub(super) fn stream(area: &str, seed: u64, purpose: &str) -> ChaCha8Rng {
    let key = random::stream_key([fnv1a(area), seed, fnv1a(purpose), 0]);
    ChaCha8Rng::from_seed(key)
}

/// Uniform in 0 to 1, from 53 bits.
pub(super) fn fraction(stream: &mut ChaCha8Rng) -> f64 {
    random::fraction(stream.next_u64())
}

/// Uniform in the range.
pub(super) fn number(random: &mut ChaCha8Rng, range: Range) -> f64 {
    range.min + (range.max - range.min) * fraction(random)
}

/// Uniform below `count`; 0 when there is nothing to choose from.
pub(super) fn index(stream: &mut ChaCha8Rng, count: usize) -> usize {
    random::index(fraction(stream), count)
}

/// Shuffles a list uniformly (Fisher and Yates).
pub(super) fn shuffle<T>(random: &mut ChaCha8Rng, list: &mut [T]) {
    for i in (1..list.len()).rev() {
        list.swap(i, index(random, i + 1));
    }
}
