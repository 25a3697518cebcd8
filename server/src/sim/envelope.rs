//! The envelope of a stored state: magic, version, length and checksum, so that
//! truncated, mixed-up or damaged bytes are rejected before they are decoded.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `WHEELARM` |
//! | 4 | version of the layout, little-endian |
//! | 8 | length of the content, bytes, little-endian |
//! | 4 | CRC-32 (IEEE) of version, length and content, little-endian |
//! | … | the content |

const MAGIC: &[u8; 8] = b"WHEELARM";
/// Version of the layout of the content.
const VERSION: u32 = 2;
/// Bytes before the content.
const HEAD: usize = 24;

fn checksum(version: u32, content: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&version.to_le_bytes());
    crc.update(&(content.len() as u64).to_le_bytes());
    crc.update(content);
    crc.finalize()
}

/// Puts content into an envelope.
pub(super) fn seal(content: &[u8]) -> Vec<u8> {
    let mut all = Vec::with_capacity(HEAD + content.len());
    all.extend_from_slice(MAGIC);
    all.extend_from_slice(&VERSION.to_le_bytes());
    all.extend_from_slice(&(content.len() as u64).to_le_bytes());
    all.extend_from_slice(&checksum(VERSION, content).to_le_bytes());
    all.extend_from_slice(content);
    all
}

/// The content of an envelope.
///
/// # Errors
/// What is wrong with it.
pub(super) fn open(bytes: &[u8]) -> Result<&[u8], String> {
    let Some((head, content)) = bytes.split_at_checked(HEAD) else {
        return Err(format!("{} bytes, expected more than {HEAD}", bytes.len()));
    };
    let (magic, head) = head.split_at(8);
    if magic != MAGIC {
        return Err("it does not begin like a stored state".to_owned());
    }
    let number = |range: std::ops::Range<usize>| {
        let mut wide = [0; 8];
        wide[..range.len()].copy_from_slice(&head[range]);
        u64::from_le_bytes(wide)
    };
    let (version, length, sum) = (number(0..4), number(4..12), number(12..16));
    if version != u64::from(VERSION) {
        return Err(format!("layout version {version}, expected {VERSION}"));
    }
    if length != content.len() as u64 {
        return Err(format!(
            "it has {} bytes and should have {length}: it is truncated or damaged",
            content.len()
        ));
    }
    if sum != u64::from(checksum(VERSION, content)) {
        return Err("its checksum is wrong: some bytes were changed".to_owned());
    }
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_changed_byte_and_every_truncation_is_detected() {
        let whole = seal(b"a state of some bytes");
        assert_eq!(open(&whole), Ok(&b"a state of some bytes"[..]));
        for i in 0..whole.len() {
            assert!(open(&whole[..i]).is_err(), "cut at {i}");
            for bit in 0..8 {
                let mut damaged = whole.clone();
                damaged[i] ^= 1 << bit;
                assert!(open(&damaged).is_err(), "bit {bit} of byte {i}");
            }
        }
        let longer = [&whole[..], b"!"].concat();
        assert!(open(&longer).unwrap_err().contains("should have"));
    }
}
