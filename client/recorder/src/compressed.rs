//! Received compressed messages of one camera.

use std::collections::BTreeMap;
use std::time::Instant;

use bytes::Bytes;
use wheelarm_dataset::coverage::Coverage;
use wheelarm_proto::digest::Digest;
use wheelarm_proto::{Message, v1};

use super::cache_request::CacheRequest;
use super::digests::Digests;

/// An image whose planes are compressed, and the digest of the exact message.
pub(super) struct CompressedImage {
    pub frame: Box<v1::CompressedCameraFrame>,
    pub exact: Digest,
}

/// The compressed messages of one camera.
#[derive(Debug, Default)]
pub(super) struct Compressed {
    received: Coverage,
    digests: Digests,
    /// Sequence numbers without a usable compressed image: the recorder requests the
    /// exact image.
    unusable: BTreeMap<u64, CacheRequest>,
}

impl Compressed {
    /// Registers a message and returns its image, also of a repeated message, because the
    /// image may still be missing. `None` without a usable image.
    pub fn take(
        &mut self,
        sequence: u64,
        payload: Bytes,
        digest: &Digest,
    ) -> Option<CompressedImage> {
        if self.received.within(sequence, sequence) > 0 {
            self.digests.repeated(sequence, digest);
        } else if !self.digests.is_late(sequence) {
            self.received.insert(sequence);
            self.digests.add(sequence, *digest);
        }
        let image = read(payload);
        if let Err(problem) = &image {
            if let Some(problem) = problem {
                tracing::warn!("compressed image {sequence} is skipped: {problem}");
            }
            self.refuse(sequence);
        }
        image.ok()
    }

    /// The compressed image `sequence` is unusable.
    pub fn refuse(&mut self, sequence: u64) {
        self.unusable.entry(sequence).or_default();
    }

    /// The image `sequence` is recorded.
    pub fn has(&mut self, sequence: u64) {
        self.unusable.remove(&sequence);
    }

    /// Ranges of sequence numbers whose exact image is to be requested at `now`.
    pub fn due(&mut self, now: Instant) -> Vec<(u64, u64)> {
        let mut due: Vec<(u64, u64)> = Vec::new();
        for (&number, request) in &mut self.unusable {
            if !request.start_if_due(now) {
                continue;
            }
            match due.last_mut() {
                Some((_, last)) if *last + 1 == number => *last = number,
                _ => due.push((number, number)),
            }
        }
        due
    }

    /// A request for the exact images `first` to `last` was answered.
    pub fn answered(&mut self, first: u64, last: u64, now: Instant) {
        for (_, request) in self.unusable.range_mut(first..=last.max(first)) {
            request.answered(now);
        }
    }

    /// The connection was lost.
    pub fn restart(&mut self) {
        self.unusable.values_mut().for_each(CacheRequest::restart);
    }

    /// Ranges of `first` to `last` without the numbers that have no usable compressed
    /// image; `due` requests those as exact images.
    pub fn usable(&self, first: u64, last: u64) -> Vec<(u64, u64)> {
        let mut usable = Vec::new();
        let mut from = Some(first);
        for &number in self.unusable.range(first..=last).map(|(number, _)| number) {
            usable.extend(
                from.filter(|from| *from < number)
                    .map(|from| (from, number - 1)),
            );
            from = number.checked_add(1);
        }
        usable.extend(from.filter(|from| *from <= last).map(|from| (from, last)));
        usable
    }

    /// Whether every request for the exact images of `first` to `last` failed.
    pub fn gave_up(&self, first: u64, last: u64) -> bool {
        let mut there = self.unusable.range(first..=last);
        there.all(|(_, request)| request.is_given_up())
    }

    /// Number of given-up images outside of `received`, the range of received images.
    pub fn given_up(&self, received: Option<(u64, u64)>) -> u64 {
        let beyond = |n: u64| received.is_none_or(|(first, last)| n < first || n > last);
        let all = self.unusable.iter();
        let lost = all.filter(|(number, request)| request.is_given_up() && beyond(**number));
        lost.count() as u64
    }

    /// Digest of all messages if all that the manifest lists arrived; empty otherwise.
    pub fn digest(&self, listed: Option<&v1::StreamCount>) -> Vec<u8> {
        let all = listed.is_some_and(|c| self.received.within(c.first, c.last) >= c.count);
        match all {
            true => self.digests.value().to_vec(),
            false => Vec::new(),
        }
    }

    /// Sequence numbers that arrived with two contents.
    pub fn doubtful(&self) -> u64 {
        self.digests.doubtful()
    }
}

/// Decodes a message; an error without text where the server did not compress the image.
fn read(payload: Bytes) -> Result<CompressedImage, Option<String>> {
    let frame = v1::CompressedCameraFrame::decode(payload).map_err(|e| Some(e.to_string()))?;
    if frame.color.is_empty() && frame.depth.is_empty() && frame.segmentation.is_empty() {
        return Err(None);
    }
    let exact = Digest::try_from(&frame.digest[..])
        .map_err(|_| Some("its digest does not have 32 bytes".to_owned()))?;
    Ok(CompressedImage {
        frame: Box::new(frame),
        exact,
    })
}
