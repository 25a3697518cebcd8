//! What comes before its episode is open waits here, up to a limit.

use std::collections::VecDeque;

use bytes::Bytes;
use wheelarm_proto::v1;

use super::super::episode::id;

/// Bytes of samples kept while their episode is not open yet.
const EARLY_BYTES: usize = 256 << 20;

/// Samples that came before their episode was open.
#[derive(Default)]
pub(super) struct Early {
    pub(super) samples: VecDeque<(v1::Header, String, Bytes)>,
    pub(super) bytes: usize,
}

impl Early {
    pub(super) fn keep(&mut self, header: v1::Header, stream: String, payload: Bytes) {
        // A full store drops the newest; the manifest then shows them missing.
        if self.bytes + payload.len() <= EARLY_BYTES {
            self.bytes += payload.len();
            self.samples.push_back((header, stream, payload));
        }
    }

    /// Lets go of the samples of one episode.
    pub(super) fn forget(&mut self, of: Option<&(String, u64)>) {
        self.samples
            .retain(|(header, ..)| Some(&id(Some(header))) != of);
        self.bytes = self.samples.iter().map(|(_, _, p)| p.len()).sum();
    }

    pub(super) fn take(&mut self) -> VecDeque<(v1::Header, String, Bytes)> {
        self.bytes = 0;
        std::mem::take(&mut self.samples)
    }
}
