//! Packs that arrive in pieces.
//!
//! Several clients send at once; each transfer has a place of its own. A client that dies
//! leaves its place to the next ones: a new transfer replaces the one that has waited
//! longest.

use wheelarm_pack::archive::MOST_ZIP_BYTES;
use wheelarm_proto::check::beginning;
use wheelarm_proto::v1;
use wheelarm_proto::v1::FailureCode;

use super::denied::Denied;

/// Largest piece of a pack, bytes.
pub(super) const MOST_PIECE: usize = 256 << 10;
/// Transfers at the same time.
const MOST_TRANSFERS: usize = 4;
/// Longest text of a digest, bytes.
const MOST_DIGEST: usize = 128;

/// State of a transfer after a piece.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Added {
    /// This many bytes have arrived.
    Part(u64),
    /// The whole file.
    Whole(Vec<u8>),
}

/// The transfers that are under way, the one that has waited longest first.
#[derive(Debug, Default)]
pub(super) struct Uploads {
    all: Vec<Upload>,
}

#[derive(Debug)]
struct Upload {
    transfer: u64,
    digest: String,
    length: usize,
    bytes: Vec<u8>,
}

impl Upload {
    fn is_of(&self, request: &v1::PackPutRequest) -> bool {
        self.transfer == request.transfer
            && self.digest == request.zip_digest
            && self.length as u64 == request.zip_length
    }
}

impl Uploads {
    /// Adds a piece.
    ///
    /// # Errors
    /// When the piece is not the next one of its transfer, or the file is too long.
    pub fn add(&mut self, request: &v1::PackPutRequest) -> Result<Added, Denied> {
        let denied = |words: String| Denied::new(FailureCode::Invalid, words);
        let length = usize::try_from(request.zip_length).unwrap_or(usize::MAX);
        if length == 0 || length > MOST_ZIP_BYTES {
            return Err(denied(format!(
                "a pack of {} bytes, expected 1 to {MOST_ZIP_BYTES}; simplify its meshes",
                request.zip_length
            )));
        }
        if request.piece.is_empty() || request.piece.len() > MOST_PIECE {
            return Err(denied(format!(
                "a piece of {} bytes, expected 1 to {MOST_PIECE}",
                request.piece.len()
            )));
        }
        if request.zip_digest.len() > MOST_DIGEST {
            return Err(denied(format!(
                "zip_digest is {:?}, expected 64 hexadecimal digits",
                beginning(&request.zip_digest)
            )));
        }
        if request.offset == 0 {
            self.begin(request, length);
        }
        let Some(place) = self.all.iter().position(|upload| upload.is_of(request)) else {
            return Err(denied(format!(
                "a piece at {} of {length} bytes of a transfer that is not under way: {} later \
                 ones have replaced it, or the server was restarted; send the pack again",
                request.offset,
                self.all.len()
            )));
        };
        let mut upload = self.all.remove(place);
        let (arrived, more) = (upload.bytes.len(), request.piece.len());
        let fits = arrived as u64 == request.offset && arrived + more <= length;
        if fits {
            upload.bytes.extend_from_slice(&request.piece);
            if upload.bytes.len() == length {
                return Ok(Added::Whole(upload.bytes));
            }
        }
        let arrived = upload.bytes.len() as u64;
        self.all.push(upload);
        if !fits {
            return Err(denied(format!(
                "a piece of {more} bytes at {} of {length} bytes, expected one at {arrived}; \
                 begin again with offset 0",
                request.offset
            )));
        }
        Ok(Added::Part(arrived))
    }

    fn begin(&mut self, request: &v1::PackPutRequest, length: usize) {
        self.all.retain(|upload| !upload.is_of(request));
        if self.all.len() == MOST_TRANSFERS {
            self.all.remove(0);
        }
        self.all.push(Upload {
            transfer: request.transfer,
            digest: request.zip_digest.clone(),
            length,
            bytes: Vec::new(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(transfer: u64, offset: u64, length: u64, bytes: usize) -> v1::PackPutRequest {
        v1::PackPutRequest {
            transfer,
            zip_digest: "digest".into(),
            zip_length: length,
            offset,
            piece: vec![7; bytes].into(),
        }
    }

    fn add(
        uploads: &mut Uploads,
        transfer: u64,
        offset: u64,
        length: u64,
        bytes: usize,
    ) -> Result<Added, Denied> {
        uploads.add(&piece(transfer, offset, length, bytes))
    }

    #[test]
    fn pieces_in_order_make_the_file_and_others_are_rejected() {
        let uploads = &mut Uploads::default();
        assert!(add(uploads, 1, 10, 30, 10).is_err());
        assert_eq!(add(uploads, 1, 0, 30, 10), Ok(Added::Part(10)));
        assert!(add(uploads, 1, 20, 30, 10).is_err());
        assert!(add(uploads, 2, 10, 30, 10).is_err());
        assert!(add(uploads, 1, 10, 40, 10).is_err());
        assert!(add(uploads, 1, 10, 30, 21).is_err());
        assert_eq!(add(uploads, 1, 10, 30, 20), Ok(Added::Whole(vec![7; 30])));
        assert!(add(uploads, 1, 30, 30, 1).is_err());
        // A transfer may begin again.
        assert_eq!(add(uploads, 3, 0, 30, 10), Ok(Added::Part(10)));
        assert_eq!(add(uploads, 3, 0, 30, 20), Ok(Added::Part(20)));
        assert_eq!(add(uploads, 3, 20, 30, 10), Ok(Added::Whole(vec![7; 30])));
    }

    #[test]
    fn transfers_at_the_same_time_do_not_disturb_each_other() {
        let uploads = &mut Uploads::default();
        for offset in [0, 10] {
            for transfer in 0..4 {
                let added = add(uploads, transfer, offset, 30, 10);
                assert_eq!(added, Ok(Added::Part(offset + 10)));
            }
        }
        for transfer in 0..4 {
            let added = add(uploads, transfer, 20, 30, 10);
            assert_eq!(added, Ok(Added::Whole(vec![7; 30])));
        }
        assert!(uploads.all.is_empty());
    }

    #[test]
    fn transfer_that_broke_off_is_the_first_to_be_replaced() {
        let uploads = &mut Uploads::default();
        for transfer in 0..4 {
            assert!(add(uploads, transfer, 0, 30, 10).is_ok());
        }
        // 0 continues, so 1 has waited longest.
        assert!(add(uploads, 0, 10, 30, 10).is_ok());
        assert!(add(uploads, 9, 0, 30, 10).is_ok());
        let problem = add(uploads, 1, 10, 30, 10).unwrap_err();
        assert!(problem.words.contains("send the pack again"), "{problem:?}");
        assert!(add(uploads, 0, 20, 30, 10).is_ok());
    }

    #[test]
    fn files_and_pieces_beyond_the_limits_are_rejected() {
        let uploads = &mut Uploads::default();
        let most = MOST_ZIP_BYTES as u64;
        for (offset, length, bytes) in [
            (0, most + 1, 10),
            (0, 0, 10),
            (0, u64::MAX, 10),
            (u64::MAX, most, 10),
            (0, most, MOST_PIECE + 1),
            (0, most, 0),
            (0, 10, 11),
        ] {
            assert!(add(uploads, 1, offset, length, bytes).is_err());
        }
        let mut long = piece(1, 0, 30, 10);
        long.zip_digest = "a".repeat(1 << 20);
        assert!(uploads.add(&long).is_err());
        assert!(add(uploads, 1, 0, most, MOST_PIECE).is_ok());
    }
}
