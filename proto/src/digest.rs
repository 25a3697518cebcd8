//! What a stream published, to the last bit, in 32 bytes: by it a recorder
//! finds that somebody else wrote into a stream.

/// BLAKE3 hash of one encoded message, or of a whole stream.
pub type Digest = [u8; 32];

/// Digest of one encoded message, given in pieces that follow each other.
#[must_use]
pub fn of_message<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> Digest {
    let mut hasher = blake3::Hasher::new();
    for piece in pieces {
        hasher.update(piece);
    }
    hasher.finalize().into()
}

/// Digest of a stream: BLAKE3 over the digests of its messages in the order of
/// their sequence numbers. Whoever gets messages out of order can still make
/// it, and large ones are hashed where they are at hand.
#[derive(Clone, Debug, Default)]
pub struct StreamDigest {
    hasher: blake3::Hasher,
}

impl StreamDigest {
    /// Adds the next message by its digest.
    pub fn add(&mut self, message: &Digest) {
        self.hasher.update(message);
    }

    /// Digest of what has been added.
    #[must_use]
    pub fn value(&self) -> Digest {
        self.hasher.finalize().into()
    }

    /// Digest of messages given by theirs, in order.
    #[must_use]
    pub fn of<'a>(messages: impl IntoIterator<Item = &'a Digest>) -> Digest {
        let mut digest = Self::default();
        for message in messages {
            digest.add(message);
        }
        digest.value()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_do_not_matter_but_order_and_every_bit_do() {
        let (a, b) = (of_message([&b"one"[..]]), of_message([&b"two"[..]]));
        assert_eq!(a, of_message([&b"o"[..], b"", b"ne"]));
        assert_ne!(StreamDigest::of([&a, &b]), StreamDigest::of([&b, &a]));
        let mut other = b;
        other[31] ^= 1;
        assert_ne!(StreamDigest::of([&a, &b]), StreamDigest::of([&a, &other]));
        assert_ne!(StreamDigest::of([&a]), StreamDigest::of([&a, &a]));
        // As `b3sum` prints it for a file without a byte.
        let none = StreamDigest::default().value();
        assert_eq!(none[..4], [0xaf, 0x13, 0x49, 0xb9]);
    }
}
