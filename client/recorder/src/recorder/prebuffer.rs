//! Buffers samples that arrive before their episode is open, up to a limit.

use std::collections::VecDeque;

use bytes::Bytes;
use wheelarm_proto::v1;

use super::super::episode::id;

/// Limit of buffered samples, bytes.
const LIMIT_BYTES: usize = 256 << 20;

/// Samples that arrived before their episode was open.
#[derive(Default)]
pub(super) struct Prebuffer {
    pub(super) samples: VecDeque<(v1::Header, String, Bytes)>,
    pub(super) bytes: usize,
}

impl Prebuffer {
    pub(super) fn keep(&mut self, header: v1::Header, stream: String, payload: Bytes) {
        // A full buffer drops the newest; the manifest then shows them as missing.
        if self.bytes + payload.len() <= LIMIT_BYTES {
            self.bytes += payload.len();
            self.samples.push_back((header, stream, payload));
        }
    }

    /// Drops the samples of one episode.
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
