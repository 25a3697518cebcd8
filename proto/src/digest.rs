//! Digests of streams, 32 bytes: a recorder uses them to detect foreign samples.

/// BLAKE3 hash of one encoded message, or of a whole stream.
pub type Digest = [u8; 32];

/// Digest of one encoded message, given in consecutive pieces.
#[must_use]
pub fn of_message<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> Digest {
    let mut hasher = blake3::Hasher::new();
    for piece in pieces {
        hasher.update(piece);
    }
    hasher.finalize().into()
}

/// SHA-256 of a file, for senders without BLAKE3.
#[must_use]
pub fn sha256(file: &[u8]) -> Digest {
    use sha2::Digest as _;
    sha2::Sha256::digest(file).into()
}

/// Digest of a stream: BLAKE3 over the digests of its messages in the order of their
/// sequence numbers. A receiver that gets messages out of order can still compute it,
/// and large messages are hashed where they are.
#[derive(Clone, Debug, Default)]
pub struct StreamDigest {
    hasher: blake3::Hasher,
}

impl StreamDigest {
    /// Adds the next message by its digest.
    pub fn add(&mut self, message: &Digest) {
        self.hasher.update(message);
    }

    /// Digest of the added messages.
    #[must_use]
    pub fn value(&self) -> Digest {
        self.hasher.finalize().into()
    }

    /// Digest of a stream from the digests of its messages, in order.
    #[must_use]
    pub fn from_messages<'a>(messages: impl IntoIterator<Item = &'a Digest>) -> Digest {
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
    fn digests_depend_on_order_and_every_bit_but_not_on_pieces() {
        let (a, b) = (of_message([&b"one"[..]]), of_message([&b"two"[..]]));
        assert_eq!(a, of_message([&b"o"[..], b"", b"ne"]));
        assert_ne!(
            StreamDigest::from_messages([&a, &b]),
            StreamDigest::from_messages([&b, &a])
        );
        let mut other = b;
        other[31] ^= 1;
        assert_ne!(
            StreamDigest::from_messages([&a, &b]),
            StreamDigest::from_messages([&a, &other])
        );
        assert_ne!(
            StreamDigest::from_messages([&a]),
            StreamDigest::from_messages([&a, &a])
        );
        // As `b3sum` prints it for an empty file.
        let none = StreamDigest::default().value();
        assert_eq!(none[..4], [0xaf, 0x13, 0x49, 0xb9]);
    }
}
