//! Digest of the received messages of one stream, independent of the order of arrival.

use std::collections::BTreeMap;

use wheelarm_proto::digest::{Digest, StreamDigest};

/// Samples that may still arrive out of order: several times what the server's
/// cache holds of any stream. Older ones are folded into one digest.
const WINDOW: usize = 8192;

/// The digest of a stream while it is received.
#[derive(Debug, Default)]
pub(super) struct Digests {
    folded: StreamDigest,
    /// Greatest sequence number that is folded.
    last: Option<u64>,
    window: BTreeMap<u64, Digest>,
    doubtful: u64,
}

impl Digests {
    /// Whether a sample arrives too late to be put in order.
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

    /// A sample arrived again. Different content means that another publisher wrote one of
    /// the two.
    pub fn repeated(&mut self, sequence: u64, digest: &Digest) {
        if self.window.get(&sequence).is_some_and(|d| d != digest) {
            self.doubtful += 1;
        }
    }

    /// Sequence numbers that arrived with two contents.
    pub fn doubtful(&self) -> u64 {
        self.doubtful
    }

    /// Digest of all received messages, in order.
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
        // Every seventh arrives some hundred samples late.
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
        digests.repeated(count - 1, &of(count - 1));
        assert_eq!(digests.doubtful(), 0);
        digests.repeated(count - 1, &of(7));
        assert_eq!(digests.doubtful(), 1);
    }
}
