//! What every stream published last, for who missed it, under the keys and with the
//! parameters (`_sn`, `_max`, `_time`) of zenoh-ext's cache, which is not used: it
//! cannot be published to while an answer waits for its link, so that one recorder
//! behind a slow link that asks for what it missed would stop cameras and time.
//!
//! Here nothing is held while an answer waits, and it waits on threads of its own:
//! those that hear commands never do. These threads are few and do not know whose
//! question it is (subscribers of the transport do not say it): while slow links keep
//! all of them, others get what they missed later.

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

/// Threads that answer.
const THREADS: usize = 8;

/// Questions that may wait. A recorder that joins asks one of each stream; who finds
/// no room asks again.
const ROOM: usize = 1024;

/// So long messages of an answer are sent: those who read too slowly do not keep a thread
/// for longer, and ask for the rest again.
const PATIENCE: Duration = Duration::from_secs(10);

/// One message.
#[derive(Clone)]
struct Cached {
    number: u32,
    stamp: Timestamp,
    payload: ZBytes,
}

/// Messages whose numbers follow each other.
type Samples = VecDeque<Cached>;

/// A question on its way to a thread.
struct Question {
    asked: Query,
    stream: Arc<Stream>,
}

/// What is known of a stream.
struct Stream {
    key: String,
    encoding: String,
    source: EntityGlobalId,
    samples: Mutex<Samples>,
}

impl Stream {
    /// Sends what is asked for, one message at a time: no more is held than the one
    /// that waits for its link. What has left the cache meanwhile is left out.
    fn answer(&self, asked: &Query) {
        let begun = Instant::now();
        let wanted = Wanted::read(asked);
        let numbers = wanted.of(&self.samples.lock());
        for number in numbers {
            if begun.elapsed() > PATIENCE {
                return;
            }
            let Some(sample) = find(&self.samples.lock(), number) else {
                continue;
            };
            let reply = asked
                .reply(&self.key, sample.payload)
                .encoding(&*self.encoding)
                .timestamp(sample.stamp)
                .source_info(SourceInfo::new(self.source, number));
            if let Err(problem) = reply.wait() {
                tracing::debug!("cannot send {} {number} again: {problem}", self.key);
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

/// The threads that answer.
pub(super) struct Answers(SyncSender<Question>);

impl Answers {
    /// Starts them; they end with their value.
    pub fn start() -> Self {
        let (sender, questions) = sync_channel(ROOM);
        let questions = Arc::new(Mutex::new(questions));
        for number in 0..THREADS {
            let questions = Arc::clone(&questions);
            let thread = std::thread::Builder::new().name(format!("cache-{number}"));
            if let Err(problem) = thread.spawn(move || work(&questions)) {
                tracing::error!("a thread that sends samples again cannot be started: {problem}");
            }
        }
        Self(sender)
    }
}

fn work(questions: &Mutex<Receiver<Question>>) {
    loop {
        // One waits for the next question, the others for their turn.
        let question = questions.lock().recv();
        let Ok(question) = question else {
            return;
        };
        question.stream.answer(&question.asked);
    }
}

/// The newest messages of a stream.
pub(super) struct Cache {
    stream: Arc<Stream>,
    capacity: usize,
    _queryable: Queryable<()>,
}

impl Cache {
    /// Keeps the `capacity` newest messages of the publisher `source` of `key`, and has
    /// `answers` send them to who asks.
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
        // Where subscribers ask a publisher that counts its messages.
        let asked_at = format!("{key}/@adv/pub/{}/{}/_", source.zid(), source.eid());
        let queue = answers.0.clone();
        let asked = Arc::clone(&stream);
        let queryable = session.declare_queryable(asked_at).callback(move |query| {
            let question = Question {
                asked: query,
                stream: Arc::clone(&asked),
            };
            if queue.try_send(question).is_err() {
                tracing::debug!("too many ask for what they missed: {} ends", asked.key);
            }
        });
        Ok(Self {
            stream,
            capacity,
            _queryable: queryable.wait()?,
        })
    }

    /// Keeps one more, whose number follows that of the one before.
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

    /// Numbers of the wanted ones among `samples`.
    fn of(&self, samples: &Samples) -> Vec<u32> {
        let is_wanted = |sample: &&Cached| {
            // Numbers wrap: what is less than half of them ahead is later.
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
        assert_eq!(Wanted::default().of(&four), all);
        let found = all.map(|number| find(&four, number).map(|sample| sample.number));
        assert_eq!(found, all.map(Some));
        assert!([u32::MAX - 2, 2].iter().all(|n| find(&four, *n).is_none()));
        let range = |first, last| Wanted {
            first,
            last,
            ..Wanted::default()
        };
        assert_eq!(range(Some(u32::MAX), None).of(&four), all[1..]);
        assert_eq!(range(Some(u32::MAX), Some(0)).of(&four), all[1..3]);
        assert_eq!(range(None, Some(u32::MAX)).of(&four), all[..2]);
        assert!(range(Some(2), None).of(&four).is_empty());
        let newest = Wanted {
            last: Some(0),
            most: Some(2),
            ..Wanted::default()
        };
        assert_eq!(newest.of(&four), all[1..3]);
        let from = SystemTime::UNIX_EPOCH + Duration::from_secs(2);
        let late = Wanted {
            time: Some(TimeRange {
                start: TimeBound::Inclusive(TimeExpr::Fixed(from)),
                end: TimeBound::Unbounded,
            }),
            ..Wanted::default()
        };
        assert_eq!(late.of(&four), all[2..]);
    }
}
