//! Random numbers of draws: streams that do not touch each other, uniform numbers
//! that no library's sampling can change.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::area::Range;

/// A stream of its own for every area, seed and purpose. What is drawn from one
/// says nothing about any other.
pub(super) fn stream(area: &str, seed: u64, purpose: &str) -> ChaCha8Rng {
    let mut key = [0; 32];
    let words = [fnv(area), seed, fnv(purpose), 0];
    for (bytes, word) in key.chunks_exact_mut(8).zip(words) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}

/// Fowler-Noll-Vo hash FNV-1a, 64 bits: tells names apart, the same everywhere.
fn fnv(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// Uniform in 0 to 1, from 53 bits.
pub(super) fn fraction(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Uniform in the range.
pub(super) fn number(random: &mut ChaCha8Rng, range: Range) -> f64 {
    range.min + (range.max - range.min) * fraction(random)
}

/// Uniform below `count`; 0 when there is nothing to choose from.
pub(super) fn index(random: &mut ChaCha8Rng, count: usize) -> usize {
    let chosen = (fraction(random) * count as f64) as usize;
    chosen.min(count.saturating_sub(1))
}

/// Puts a list into any order, each as likely as the others (Fisher and Yates).
pub(super) fn shuffle<T>(random: &mut ChaCha8Rng, list: &mut [T]) {
    for i in (1..list.len()).rev() {
        list.swap(i, index(random, i + 1));
    }
}
