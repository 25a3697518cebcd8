//! What came of one stream, to the last bit, in whatever order it came.

use std::collections::BTreeMap;

use wheelarm_proto::digest::{Digest, StreamDigest};

/// Samples that may still come out of order: several times what the server's
/// cache remembers of any stream. Older ones are folded into one number.
const WINDOW: usize = 8192;

/// The digest of a stream in the making.
#[derive(Debug, Default)]
pub(super) struct Digests {
    folded: StreamDigest,
    /// Greatest number that is folded.
    last: Option<u64>,
    window: BTreeMap<u64, Digest>,
    doubtful: u64,
}

impl Digests {
    /// Whether a sample comes too late to be put in order.
    pub fn is_late(&self, sequence: u64) -> bool {
        self.last.is_some_and(|last| sequence <= last)
    }

    /// Adds a sample that is new.
    pub fn add(&mut self, sequence: u64, digest: Digest) {
        self.window.insert(sequence, digest);
        if self.window.len() > WINDOW
            && let Some((sequence, digest)) = self.window.pop_first()
        {
            self.folded.add(&digest);
            self.last = Some(sequence);
        }
    }

    /// A sample came whose number is taken: with another content somebody else
    /// has written one of the two.
    pub fn again(&mut self, sequence: u64, digest: &Digest) {
        if self.window.get(&sequence).is_some_and(|d| d != digest) {
            self.doubtful += 1;
        }
    }

    /// Numbers that came with two contents.
    pub fn doubtful(&self) -> u64 {
        self.doubtful
    }

    /// Digest of all that came, in order.
    pub fn value(&self) -> Digest {
        let mut all = self.folded.clone();
        for digest in self.window.values() {
            all.add(digest);
        }
        all.value()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(sequence: u64) -> Digest {
        let mut digest = [0; 32];
        digest[..8].copy_from_slice(&sequence.to_le_bytes());
        digest
    }

    #[test]
    fn order_of_arrival_does_not_matter_within_the_window() {
        let count = WINDOW as u64 + 500;
        let all: Vec<Digest> = (0..count).map(of).collect();
        let mut digests = Digests::default();
        // Every seventh comes some hundred samples late.
        for i in 0..count + 300 {
            if i < count && i % 7 != 3 {
                digests.add(i, of(i));
            }
            if let Some(late) = i.checked_sub(300).filter(|late| late % 7 == 3) {
                assert!(!digests.is_late(late));
                digests.add(late, of(late));
            }
        }
        assert_eq!(digests.value(), StreamDigest::from_messages(&all));
        assert!(digests.is_late(0) && !digests.is_late(count));
        digests.again(count - 1, &of(count - 1));
        assert_eq!(digests.doubtful(), 0);
        digests.again(count - 1, &of(7));
        assert_eq!(digests.doubtful(), 1);
    }
}
