//! Deterministic damage to bytes: the same number gives the same damage.

use wheelarm_proto::random::{SPLITMIX64_STEP, splitmix64};

/// A generator of damage (SplitMix64); the field is its state.
#[derive(Clone, Debug)]
pub struct Mutator(pub u64);

impl Mutator {
    fn bits(&mut self) -> u64 {
        let bits = splitmix64(self.0);
        self.0 = self.0.wrapping_add(SPLITMIX64_STEP);
        bits
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n.max(1) as u64) as usize
    }

    /// A damaged copy of `good`: bits flipped, bytes replaced by telling ones,
    /// pieces cut out, doubled or moved, the end cut off.
    #[must_use]
    pub fn mutate(&mut self, good: &[u8]) -> Vec<u8> {
        const TELLING: [u8; 12] = [
            0, 1, 0x7f, 0x80, 0xff, b'0', b'9', b'-', b'.', b'"', b'\n', b'[',
        ];
        const WORDS: [&[u8]; 8] = [
            b"nan",
            b"inf",
            b"-1e308",
            b"99999999999999999999",
            b"\"\"",
            b"[]",
            b"\xff\xff\xff\xff\x0f",
            b"\x00\x00\x00\x00\x00\x00\xf8\x7f",
        ];
        let mut bytes = good.to_vec();
        for _ in 0..=self.below(4) {
            let at = self.below(bytes.len());
            let end = (at + 1 + self.below(24)).min(bytes.len());
            match self.below(7) {
                0 if !bytes.is_empty() => bytes[at] ^= 1 << self.below(8),
                1 if !bytes.is_empty() => bytes[at] = TELLING[self.below(TELLING.len())],
                2 => bytes.truncate(at),
                3 => drop(bytes.drain(at.min(end)..end)),
                4 => {
                    let piece = bytes[at.min(end)..end].to_vec();
                    let to = self.below(bytes.len() + 1);
                    bytes.splice(to..to, piece);
                }
                5 => {
                    let word = WORDS[self.below(WORDS.len())];
                    bytes.splice(at.min(end)..end, word.iter().copied());
                }
                _ => {
                    let word = WORDS[self.below(WORDS.len())];
                    bytes.splice(
                        at.min(bytes.len())..at.min(bytes.len()),
                        word.iter().copied(),
                    );
                }
            }
        }
        bytes
    }
}
