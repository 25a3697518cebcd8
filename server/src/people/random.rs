//! Counter-based random numbers: each is a hash of seed, row and place, independent of
//! how many were sampled before.

use wheelarm_proto::random::{self, splitmix64 as mix};

/// Separates these rows from other uses of the same seed.
const PEOPLE: u64 = 0x7065_6f70_6c65;

/// Uniform in 0 to 1, both excluded.
pub(super) fn uniform(seed: u64, row: u64, place: u64) -> f64 {
    let bits = mix(mix(mix(seed ^ PEOPLE) ^ row) ^ place);
    random::open_fraction(bits)
}

/// Index below `count`; 0 when `count` is 0.
pub(super) fn index(seed: u64, row: u64, count: usize) -> usize {
    random::index(uniform(seed, row, 0), count)
}
