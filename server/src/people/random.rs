//! Random numbers by counting: each is a hash of seed, row and place, so that none
//! depends on how many were drawn before.

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014).
fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Tells these rows from those of other users of the same seed.
const PEOPLE: u64 = 0x7065_6f70_6c65;

/// Above 0 and below 1.
pub(super) fn uniform(seed: u64, row: u64, place: u64) -> f64 {
    let bits = mix(mix(mix(seed ^ PEOPLE) ^ row) ^ place);
    ((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}

/// One of `count`, 0 where there is none.
pub(super) fn index(seed: u64, row: u64, count: usize) -> usize {
    let chosen = (uniform(seed, row, 0) * count as f64) as usize;
    chosen.min(count.saturating_sub(1))
}
