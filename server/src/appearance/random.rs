//! Random numbers of an appearance.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use wheelarm_proto::random::fraction;

/// Random numbers of an appearance: an independent stream per sampled object.
pub(super) struct Random(ChaCha8Rng);

/// Uses with independent streams.
#[derive(Clone, Copy)]
pub(super) enum Row {
    Light,
    Lamps,
    Exposure,
    Decoration,
    Camera,
    Lens,
    /// Numbered by the hash of its name.
    Material,
}

impl Random {
    pub(super) fn new(seed: u64, row: Row, number: u32) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream((row as u64 + 1) << 32 | u64::from(number));
        Self(random)
    }

    /// Uniform in 0 to 1; does not depend on a library's sampling.
    pub(super) fn share(&mut self) -> f64 {
        fraction(self.0.next_u64())
    }

    pub(super) fn range(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.share()
    }

    /// -`most` to `most`.
    pub(super) fn about(&mut self, most: f64) -> f64 {
        self.range([-most, most])
    }

    pub(super) fn one_of<'a, T>(&mut self, list: &'a [T]) -> Option<&'a T> {
        let at = (self.share() * list.len() as f64) as usize;
        list.get(at)
    }
}
