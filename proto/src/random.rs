//! Random bits and hashes that are the same on every machine: SplitMix64 and FNV-1a.
//!
//! Recordings, saved states and samples depend on these bits: never change them.

/// Step of the SplitMix64 counter.
pub const SPLITMIX64_STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// The first output of SplitMix64 (Steele, Lea and Flood 2014) for the state `x`; also a
/// hash of `x`.
#[must_use]
#[inline]
pub fn splitmix64(x: u64) -> u64 {
    let mut z = x.wrapping_add(SPLITMIX64_STEP);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The generator SplitMix64; the field is its state.
#[derive(Clone, Debug)]
pub struct SplitMix64(pub u64);

impl SplitMix64 {
    /// The next 64 bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        let bits = splitmix64(self.0);
        self.0 = self.0.wrapping_add(SPLITMIX64_STEP);
        bits
    }
}

/// Uniform in 0 (included) to 1 (excluded), from the upper 53 bits.
#[must_use]
#[inline]
pub fn fraction(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// Uniform in 0 to 1, both excluded, from the upper 53 bits.
#[must_use]
#[inline]
pub fn open_fraction(bits: u64) -> f64 {
    ((bits >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
}

/// Index below `count` at a fraction of 0 to 1; 0 when `count` is 0.
#[must_use]
pub fn index(fraction: f64, count: usize) -> usize {
    let chosen = (fraction * count as f64) as usize;
    chosen.min(count.saturating_sub(1))
}

/// Key of a random stream from four words, little-endian.
#[must_use]
pub fn stream_key(words: [u64; 4]) -> [u8; 32] {
    let mut key = [0; 32];
    for (bytes, word) in key.chunks_exact_mut(8).zip(words) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    key
}

/// FNV-1a hash, 64 bits; the field is its value.
#[derive(Clone, Debug)]
pub struct Fnv1a(pub u64);

impl Default for Fnv1a {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv1a {
    /// Adds bytes.
    #[inline]
    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

/// FNV-1a hash of a text, 64 bits.
#[must_use]
pub fn fnv1a(text: &str) -> u64 {
    let mut hash = Fnv1a::default();
    hash.add(text.as_bytes());
    hash.0
}

/// FNV-1a hash of a text, 32 bits.
#[must_use]
pub fn fnv1a_32(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |hash, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_match_the_published_test_vectors() {
        // The reference implementation of SplitMix64 with the seed 1234567.
        let mut random = SplitMix64(1_234_567);
        assert_eq!(random.bits(), 6_457_827_717_110_365_317);
        assert_eq!(random.bits(), 3_203_168_211_198_807_973);
        // Vectors of the FNV reference implementation.
        assert_eq!(fnv1a(""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a("foobar"), 0x8594_4171_f739_67e8);
        assert_eq!(fnv1a_32("foobar"), 0xbf9c_f968);
    }

    #[test]
    fn fractions_and_indices_stay_in_range() {
        assert_eq!((fraction(0), index(0.0, 3)), (0.0, 0));
        assert!(fraction(u64::MAX) < 1.0 && open_fraction(0) > 0.0);
        assert_eq!((index(fraction(u64::MAX), 3), index(0.5, 0)), (2, 0));
    }
}
