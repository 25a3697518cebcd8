//! What came of one camera in compressed form.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use bytes::Bytes;
use wheelarm_dataset::coverage::Coverage;
use wheelarm_proto::digest::Digest;
use wheelarm_proto::{Message, v1};

use super::digests::Digests;

/// Pause before the same samples are asked for a second time; it doubles, up to
/// [`LONGEST`].
pub(super) const PAUSE: Duration = Duration::from_secs(1);
const LONGEST: Duration = Duration::from_secs(4);
/// Asked for so many times without an answer, a sample is given up: a server in
/// lock-step waits as long.
pub(super) const TRIES: u32 = 5;

/// Pause after so many questions.
pub(super) fn pause_after(tries: u32) -> Duration {
    (PAUSE * 2_u32.saturating_pow(tries.saturating_sub(1))).min(LONGEST)
}

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
    /// it is. How often it was asked for, and when the last time; once more than that it
    /// is given up.
    unusable: BTreeMap<u64, (u32, Option<Instant>)>,
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
        for (&number, (tries, at)) in &mut self.unusable {
            let rests =
                at.is_some_and(|at| now.saturating_duration_since(at) < pause_after(*tries));
            if rests || *tries > TRIES {
                continue;
            }
            (*tries, *at) = (*tries + 1, Some(now));
            if *tries > TRIES {
                continue;
            }
            match due.last_mut() {
                Some((_, last)) if *last + 1 == number => *last = number,
                _ => due.push((number, number)),
            }
        }
        due
    }

    /// Numbers beyond `seen` whose picture was asked for so often that it will not
    /// come.
    pub fn given_up(&self, seen: Option<(u64, u64)>) -> u64 {
        let beyond = |n: u64| seen.is_none_or(|(first, last)| n < first || n > last);
        let all = self.unusable.iter();
        let lost = all.filter(|(number, (tries, _))| *tries > TRIES && beyond(**number));
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
    if frame.rgb.is_empty() && frame.depth.is_empty() && frame.ids.is_empty() {
        return Err(None);
    }
    let exact = Digest::try_from(&frame.digest[..])
        .map_err(|_| Some("it has no digest of 32 bytes".to_owned()))?;
    Ok(Picture {
        frame: Box::new(frame),
        exact,
    })
}
