//! What a stream published last, for who missed it: the cache of the transport's
//! recovery and history, under its keys and with its parameters (`_sn`, `_max`,
//! `_time`).
//!
//! The transport has one of its own, which nothing can be published to while an
//! answer waits for its link: one recorder behind a slow link that asks for what it
//! missed would stop cameras and time for as long. Here an answer holds what it sends
//! and nothing else; it waits on the thread that reads from its asker's link.

use std::collections::VecDeque;
use std::sync::Arc;

use parking_lot::Mutex;
use zenoh::bytes::ZBytes;
use zenoh::query::{Query, Queryable, ZenohParameters};
use zenoh::sample::SourceInfo;
use zenoh::session::EntityGlobalId;
use zenoh::time::Timestamp;
use zenoh::{Session, Wait};

/// One message.
#[derive(Clone)]
struct Sample {
    number: u32,
    stamp: Timestamp,
    payload: ZBytes,
}

/// The newest messages of a stream.
pub(super) struct Kept {
    samples: Arc<Mutex<VecDeque<Sample>>>,
    most: usize,
    _queryable: Queryable<()>,
}

impl Kept {
    /// Keeps the `most` newest messages of the publisher `source` of `key`, and answers
    /// who asks for them.
    ///
    /// # Errors
    /// The transport's error.
    pub fn declare(
        session: &Session,
        key: &str,
        source: EntityGlobalId,
        most: usize,
        encoding: &str,
    ) -> zenoh::Result<Self> {
        let samples: Arc<Mutex<VecDeque<Sample>>> = Arc::default();
        // Where subscribers ask a publisher that counts its messages.
        let asked_at = format!("{key}/@adv/pub/{}/{}/_", source.zid(), source.eid());
        let answer = {
            let (key, encoding) = (key.to_owned(), encoding.to_owned());
            let samples = Arc::clone(&samples);
            move |asked: Query| {
                let wanted = Wanted::read(&asked);
                let samples = wanted.of(&samples.lock());
                for sample in samples {
                    let reply = asked
                        .reply(&key, sample.payload)
                        .encoding(&*encoding)
                        .timestamp(sample.stamp)
                        .source_info(SourceInfo::new(source, sample.number));
                    if let Err(problem) = reply.wait() {
                        tracing::debug!("cannot send {key} {} again: {problem}", sample.number);
                        return;
                    }
                }
            }
        };
        let queryable = session.declare_queryable(asked_at).callback(answer);
        Ok(Self {
            samples,
            most,
            _queryable: queryable.wait()?,
        })
    }

    /// Keeps one more, in the order of the numbers.
    pub fn add(&self, number: u32, stamp: Timestamp, payload: ZBytes) {
        let mut samples = self.samples.lock();
        if samples.len() >= self.most {
            samples.pop_front();
        }
        samples.push_back(Sample {
            number,
            stamp,
            payload,
        });
    }
}

/// Which messages are asked for.
#[derive(Debug, Default, PartialEq)]
struct Wanted {
    first: Option<u32>,
    last: Option<u32>,
    /// So many of the newest of them.
    most: Option<usize>,
    time: Option<zenoh::query::TimeRange>,
}

impl Wanted {
    fn read(asked: &Query) -> Self {
        let parameters = asked.parameters();
        let (first, last) = parameters.get("_sn").map_or((None, None), numbers);
        Self {
            first,
            last,
            most: parameters.get("_max").and_then(|most| most.parse().ok()),
            time: parameters.time_range().and_then(Result::ok),
        }
    }

    fn of(&self, samples: &VecDeque<Sample>) -> Vec<Sample> {
        let is_wanted = |sample: &&Sample| {
            // Numbers wrap: what is less than half of them ahead is later.
            let follows = |later: u32, earlier: u32| later.wrapping_sub(earlier) <= u32::MAX / 2;
            self.first.is_none_or(|first| follows(sample.number, first))
                && self.last.is_none_or(|last| follows(last, sample.number))
                && self
                    .time
                    .as_ref()
                    .is_none_or(|time| time.contains(sample.stamp.get_time().to_system_time()))
        };
        let mut wanted: Vec<Sample> = samples.iter().filter(is_wanted).cloned().collect();
        if let Some(most) = self.most {
            wanted.drain(..wanted.len().saturating_sub(most));
        }
        wanted
    }
}

/// Bounds of `FIRST..LAST`, either of which may be absent, or of `NUMBER`; what is
/// no number bounds nothing.
fn numbers(text: &str) -> (Option<u32>, Option<u32>) {
    match text.split_once("..") {
        Some((first, last)) => (first.parse().ok(), last.parse().ok()),
        None => (text.parse().ok(), text.parse().ok()),
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime};

    use zenoh::query::{TimeBound, TimeExpr, TimeRange};
    use zenoh::time::{NTP64, TimestampId};

    use super::*;

    fn samples(from: u32, count: u32) -> VecDeque<Sample> {
        let made = (0..count).map(|i| Sample {
            number: from.wrapping_add(i),
            stamp: Timestamp::new(
                NTP64::from(Duration::from_secs(u64::from(i))),
                TimestampId::rand(),
            ),
            payload: ZBytes::new(),
        });
        made.collect()
    }

    fn told(wanted: &Wanted, samples: &VecDeque<Sample>) -> Vec<u32> {
        wanted.of(samples).iter().map(|s| s.number).collect()
    }

    #[test]
    fn what_is_asked_for_is_read_as_subscribers_write_it() {
        assert_eq!(numbers("3..7"), (Some(3), Some(7)));
        assert_eq!(numbers("3.."), (Some(3), None));
        assert_eq!(numbers("..7"), (None, Some(7)));
        assert_eq!(numbers(".."), (None, None));
        assert_eq!(numbers("5"), (Some(5), Some(5)));
        assert_eq!(numbers("all"), (None, None));
    }

    #[test]
    fn numbers_may_wrap_and_the_newest_are_told() {
        let four = samples(u32::MAX - 1, 4);
        let all = [u32::MAX - 1, u32::MAX, 0, 1];
        assert_eq!(told(&Wanted::default(), &four), all);
        let range = |first, last| Wanted {
            first,
            last,
            ..Wanted::default()
        };
        assert_eq!(told(&range(Some(u32::MAX), None), &four), all[1..]);
        assert_eq!(told(&range(Some(u32::MAX), Some(0)), &four), all[1..3]);
        assert_eq!(told(&range(None, Some(u32::MAX)), &four), all[..2]);
        assert!(told(&range(Some(2), None), &four).is_empty());
        let newest = Wanted {
            last: Some(0),
            most: Some(2),
            ..Wanted::default()
        };
        assert_eq!(told(&newest, &four), all[1..3]);
        let from = SystemTime::UNIX_EPOCH + Duration::from_secs(2);
        let late = Wanted {
            time: Some(TimeRange {
                start: TimeBound::Inclusive(TimeExpr::Fixed(from)),
                end: TimeBound::Unbounded,
            }),
            ..Wanted::default()
        };
        assert_eq!(told(&late, &four), all[2..]);
    }
}
