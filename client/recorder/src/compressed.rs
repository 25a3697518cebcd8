//! What came of one camera in compressed form.

use std::collections::BTreeMap;
use std::time::Instant;

use bytes::Bytes;
use wheelarm_dataset::coverage::Coverage;
use wheelarm_proto::digest::Digest;
use wheelarm_proto::{Message, v1};

use super::digests::Digests;
use super::question::Question;

/// A picture whose planes are compressed, and the digest of the exact one's message.
pub(super) struct Picture {
    pub frame: Box<v1::CompressedCameraFrame>,
    pub exact: Digest,
}

/// The compressed messages of one camera.
#[derive(Debug, Default)]
pub(super) struct Compressed {
    seen: Coverage,
    digests: Digests,
    /// Numbers whose message holds no picture that can be taken: it is to be had as
    /// it is.
    unusable: BTreeMap<u64, Question>,
}

impl Compressed {
    /// Takes account of a message; whether it came before or not, its picture may
    /// still be wanted. Nothing where it holds none that can be taken.
    pub fn take(&mut self, sequence: u64, payload: Bytes, digest: &Digest) -> Option<Picture> {
        if self.seen.within(sequence, sequence) > 0 {
            self.digests.again(sequence, digest);
        } else if !self.digests.is_late(sequence) {
            self.seen.insert(sequence);
            self.digests.add(sequence, *digest);
        }
        let picture = read(payload);
        if let Err(problem) = &picture {
            if let Some(problem) = problem {
                tracing::warn!("compressed picture {sequence} is left out: {problem}");
            }
            self.refuse(sequence);
        }
        picture.ok()
    }

    /// The picture of a number cannot be taken.
    pub fn refuse(&mut self, sequence: u64) {
        self.unusable.entry(sequence).or_default();
    }

    /// The picture of a number is there.
    pub fn has(&mut self, sequence: u64) {
        self.unusable.remove(&sequence);
    }

    /// Ranges of numbers whose picture is to be asked for as it is at `now`.
    pub fn due(&mut self, now: Instant) -> Vec<(u64, u64)> {
        let mut due: Vec<(u64, u64)> = Vec::new();
        for (&number, question) in &mut self.unusable {
            if !question.request(now) {
                continue;
            }
            match due.last_mut() {
                Some((_, last)) if *last + 1 == number => *last = number,
                _ => due.push((number, number)),
            }
        }
        due
    }

    /// A question for `first` to `last` as they are was answered.
    pub fn answered(&mut self, first: u64, last: u64, now: Instant) {
        for (_, question) in self.unusable.range_mut(first..=last.max(first)) {
            question.answered(now);
        }
    }

    /// The connection was lost.
    pub fn begin_again(&mut self) {
        self.unusable.values_mut().for_each(Question::begin_again);
    }

    /// Ranges of `first` to `last` without the numbers whose message holds no picture
    /// that can be taken; those are asked for as they are (`due`).
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

    /// Whether all pictures of `first` to `last` that can be had only as they are were
    /// asked for in vain.
    pub fn gave_up(&self, first: u64, last: u64) -> bool {
        let mut there = self.unusable.range(first..=last);
        there.all(|(_, question)| question.is_given_up())
    }

    /// Numbers beyond `seen` whose picture was asked for so often that it will not
    /// come.
    pub fn given_up(&self, seen: Option<(u64, u64)>) -> u64 {
        let beyond = |n: u64| seen.is_none_or(|(first, last)| n < first || n > last);
        let all = self.unusable.iter();
        let lost = all.filter(|(number, question)| question.is_given_up() && beyond(**number));
        lost.count() as u64
    }

    /// Digest of all messages, where as many came as the manifest lists; empty
    /// otherwise.
    pub fn digest(&self, listed: Option<&v1::StreamCount>) -> Vec<u8> {
        let all = listed.is_some_and(|c| self.seen.within(c.first, c.last) >= c.count);
        match all {
            true => self.digests.value().to_vec(),
            false => Vec::new(),
        }
    }

    /// Numbers that came with two contents.
    pub fn doubtful(&self) -> u64 {
        self.digests.doubtful()
    }
}

/// Reads a message; without words where nobody compressed the picture.
fn read(payload: Bytes) -> Result<Picture, Option<String>> {
    let frame = v1::CompressedCameraFrame::decode(payload).map_err(|e| Some(e.to_string()))?;
    if frame.color.is_empty() && frame.depth.is_empty() && frame.segmentation.is_empty() {
        return Err(None);
    }
    let exact = Digest::try_from(&frame.digest[..])
        .map_err(|_| Some("it has no digest of 32 bytes".to_owned()))?;
    Ok(Picture {
        frame: Box::new(frame),
        exact,
    })
}
