//! Retransmission cache: the newest messages of every stream, under the keys and with
//! the parameters (`_sn`, `_max`, `_time`) of zenoh-ext's cache.
//!
//! zenoh-ext's own cache is not used: it cannot be published to while a reply waits for
//! its connection. One recorder behind a slow connection would stop cameras and time.
//!
//! Here no lock is held while a reply waits. Replies wait on their own threads, never
//! on those that receive commands. The threads are few and cannot identify the client,
//! because subscribers of the transport do not send their ID. While slow connections
//! occupy all of them, other clients get retransmissions later.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use zenoh::bytes::ZBytes;
use zenoh::query::{Query, Queryable, ZenohParameters};
use zenoh::sample::SourceInfo;
use zenoh::session::EntityGlobalId;
use zenoh::time::Timestamp;
use zenoh::{Session, Wait};

/// Threads that send retransmissions.
const THREADS: usize = 8;

/// Queries that may wait. A recorder that joins sends one per stream; a rejected one is
/// sent again.
const ROOM: usize = 1024;

/// Longest time for one reply. A slow reader does not keep a thread longer, and queries
/// again for the rest.
const PATIENCE: Duration = Duration::from_secs(10);

/// One cached message.
#[derive(Clone)]
struct Cached {
    number: u32,
    stamp: Timestamp,
    payload: ZBytes,
}

/// Messages with consecutive sequence numbers.
type Samples = VecDeque<Cached>;

/// A query on its way to a thread.
struct Question {
    query: Query,
    stream: Arc<Stream>,
}

/// A cached stream.
struct Stream {
    key: String,
    encoding: String,
    source: EntityGlobalId,
    samples: Mutex<Samples>,
}

impl Stream {
    /// Sends the requested messages one at a time. Messages that have left the cache in
    /// the meantime are skipped.
    fn answer(&self, query: &Query) {
        let begun = Instant::now();
        let wanted = RequestedMessages::from_query(query);
        let numbers = wanted.matching(&self.samples.lock());
        for number in numbers {
            if begun.elapsed() > PATIENCE {
                return;
            }
            let Some(sample) = find(&self.samples.lock(), number) else {
                continue;
            };
            let reply = query
                .reply(&self.key, sample.payload)
                .encoding(&*self.encoding)
                .timestamp(sample.stamp)
                .source_info(SourceInfo::new(self.source, number));
            if let Err(problem) = reply.wait() {
                tracing::debug!("cannot retransmit {} {number}: {problem}", self.key);
                return;
            }
        }
    }
}

fn find(samples: &Samples, number: u32) -> Option<Cached> {
    let first = samples.front()?.number;
    let sample = samples.get(number.wrapping_sub(first) as usize)?;
    Some(sample.clone())
}

/// The threads that send retransmissions.
pub(super) struct Answers(SyncSender<Question>);

impl Answers {
    /// Starts the threads; they end when this value is dropped.
    pub fn start() -> Self {
        let (sender, questions) = sync_channel(ROOM);
        let questions = Arc::new(Mutex::new(questions));
        for number in 0..THREADS {
            let questions = Arc::clone(&questions);
            let thread = std::thread::Builder::new().name(format!("cache-{number}"));
            if let Err(problem) = thread.spawn(move || work(&questions)) {
                tracing::error!("cannot start a retransmission thread: {problem}");
            }
        }
        Self(sender)
    }
}

fn work(questions: &Mutex<Receiver<Question>>) {
    loop {
        // One thread waits for the next query, the others for the lock.
        let question = questions.lock().recv();
        let Ok(question) = question else {
            return;
        };
        question.stream.answer(&question.query);
    }
}

/// The newest messages of a stream.
pub(super) struct Cache {
    stream: Arc<Stream>,
    capacity: usize,
    _queryable: Queryable<()>,
}

impl Cache {
    /// Keeps the `capacity` newest messages of the publisher `source` of `key`.
    /// `answers` sends them on request.
    ///
    /// # Errors
    /// The transport's error.
    pub fn declare(
        session: &Session,
        answers: &Answers,
        key: &str,
        source: EntityGlobalId,
        capacity: usize,
        encoding: String,
    ) -> zenoh::Result<Self> {
        let stream = Arc::new(Stream {
            key: key.to_owned(),
            encoding,
            source,
            samples: Mutex::default(),
        });
        // Key that subscribers query for missed messages of a publisher.
        let cache_key = format!("{key}/@adv/pub/{}/{}/_", source.zid(), source.eid());
        let queue = answers.0.clone();
        let queried = Arc::clone(&stream);
        let queryable = session.declare_queryable(cache_key).callback(move |query| {
            let question = Question {
                query,
                stream: Arc::clone(&queried),
            };
            if queue.try_send(question).is_err() {
                tracing::debug!(
                    "too many retransmission queries: dropped one for {}",
                    queried.key
                );
            }
        });
        Ok(Self {
            stream,
            capacity,
            _queryable: queryable.wait()?,
        })
    }

    /// Adds a message; its number follows the previous one.
    pub fn add(&self, number: u32, stamp: Timestamp, payload: ZBytes) {
        let mut samples = self.stream.samples.lock();
        if samples.len() >= self.capacity {
            samples.pop_front();
        }
        samples.push_back(Cached {
            number,
            stamp,
            payload,
        });
    }
}

/// The requested messages.
#[derive(Debug, Default, PartialEq)]
struct RequestedMessages {
    first: Option<u32>,
    last: Option<u32>,
    /// At most this many of the newest ones.
    most: Option<usize>,
    time: Option<zenoh::query::TimeRange>,
}

impl RequestedMessages {
    fn from_query(query: &Query) -> Self {
        let parameters = query.parameters();
        let (first, last) = parameters.get("_sn").map_or((None, None), numbers);
        Self {
            first,
            last,
            most: parameters.get("_max").and_then(|most| most.parse().ok()),
            time: parameters.time_range().and_then(Result::ok),
        }
    }

    /// Sequence numbers of the requested messages among `samples`.
    fn matching(&self, samples: &Samples) -> Vec<u32> {
        let is_wanted = |sample: &&Cached| {
            // Numbers wrap: a number less than half the range ahead is later.
            let follows = |later: u32, earlier: u32| later.wrapping_sub(earlier) <= u32::MAX / 2;
            self.first.is_none_or(|first| follows(sample.number, first))
                && self.last.is_none_or(|last| follows(last, sample.number))
                && self
                    .time
                    .as_ref()
                    .is_none_or(|time| time.contains(sample.stamp.get_time().to_system_time()))
        };
        let wanted = samples.iter().filter(is_wanted);
        let mut wanted: Vec<u32> = wanted.map(|sample| sample.number).collect();
        if let Some(most) = self.most {
            wanted.drain(..wanted.len().saturating_sub(most));
        }
        wanted
    }
}

/// Bounds of `FIRST..LAST`, either of which may be absent, or of `NUMBER`. A part that
/// does not parse sets no bound.
fn numbers(text: &str) -> (Option<u32>, Option<u32>) {
    match text.split_once("..") {
        Some((first, last)) => (first.parse().ok(), last.parse().ok()),
        None => (text.parse().ok(), text.parse().ok()),
    }
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use zenoh::query::{TimeBound, TimeExpr, TimeRange};
    use zenoh::time::{NTP64, TimestampId};

    use super::*;

    fn samples(from: u32, count: u32) -> Samples {
        let made = (0..count).map(|i| Cached {
            number: from.wrapping_add(i),
            stamp: Timestamp::new(
                NTP64::from(Duration::from_secs(u64::from(i))),
                TimestampId::rand(),
            ),
            payload: ZBytes::new(),
        });
        made.collect()
    }

    #[test]
    fn range_parameters_of_subscribers_are_parsed() {
        assert_eq!(numbers("3..7"), (Some(3), Some(7)));
        assert_eq!(numbers("3.."), (Some(3), None));
        assert_eq!(numbers("..7"), (None, Some(7)));
        assert_eq!(numbers(".."), (None, None));
        assert_eq!(numbers("5"), (Some(5), Some(5)));
        assert_eq!(numbers("all"), (None, None));
    }

    #[test]
    fn numbers_may_wrap_and_the_newest_are_selected() {
        let four = samples(u32::MAX - 1, 4);
        let all = [u32::MAX - 1, u32::MAX, 0, 1];
        assert_eq!(RequestedMessages::default().matching(&four), all);
        let found = all.map(|number| find(&four, number).map(|sample| sample.number));
        assert_eq!(found, all.map(Some));
        assert!([u32::MAX - 2, 2].iter().all(|n| find(&four, *n).is_none()));
        let range = |first, last| RequestedMessages {
            first,
            last,
            ..RequestedMessages::default()
        };
        assert_eq!(range(Some(u32::MAX), None).matching(&four), all[1..]);
        assert_eq!(range(Some(u32::MAX), Some(0)).matching(&four), all[1..3]);
        assert_eq!(range(None, Some(u32::MAX)).matching(&four), all[..2]);
        assert!(range(Some(2), None).matching(&four).is_empty());
        let newest = RequestedMessages {
            last: Some(0),
            most: Some(2),
            ..RequestedMessages::default()
        };
        assert_eq!(newest.matching(&four), all[1..3]);
        let from = SystemTime::UNIX_EPOCH + Duration::from_secs(2);
        let late = RequestedMessages {
            time: Some(TimeRange {
                start: TimeBound::Inclusive(TimeExpr::Fixed(from)),
                end: TimeBound::Unbounded,
            }),
            ..RequestedMessages::default()
        };
        assert_eq!(late.matching(&four), all[2..]);
    }
}
