//! Subscribed topics as one queue of decoded samples, in order of arrival.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};
use wheelarm_proto::TopicId;
use wheelarm_proto::topic::Sample;
use zenoh::bytes::ZBytes;

use super::ClientError;
use super::error::closed;

/// Bounds of a queue whose reader prefers the newest samples to all samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bound {
    /// Most samples (count).
    pub samples: usize,
    /// Most bytes of payload.
    pub bytes: usize,
}

/// Samples that the reader has not taken yet.
#[derive(Default)]
pub(super) struct Queue {
    waiting: Mutex<Waiting>,
    arrived: Condvar,
}

#[derive(Default)]
struct Waiting {
    samples: VecDeque<(TopicId, ZBytes)>,
    bytes: usize,
    dropped: u64,
    /// Subscribers that may still send.
    senders: usize,
}

/// The sending end of a queue.
pub(super) struct Sender {
    queue: Arc<Queue>,
    bound: Option<Bound>,
}

impl Sender {
    pub(super) fn new(queue: &Arc<Queue>, bound: Option<Bound>) -> Self {
        queue.waiting.lock().senders += 1;
        Self {
            queue: Arc::clone(queue),
            bound,
        }
    }

    /// Appends a sample. A full queue first drops the oldest sample of the topics that
    /// other clients can flood, then the oldest sample.
    pub(super) fn send(&self, topic: TopicId, payload: ZBytes) {
        let mut waiting = self.queue.waiting.lock();
        waiting.bytes += payload.len();
        waiting.samples.push_back((topic, payload));
        if let Some(bound) = self.bound {
            while waiting.samples.len() > bound.samples
                || waiting.bytes > bound.bytes && waiting.samples.len() > 1
            {
                let mut samples = waiting.samples.iter();
                let at = samples.position(|(topic, _)| is_of_others(*topic));
                let dropped = waiting.samples.remove(at.unwrap_or(0));
                waiting.bytes -= dropped.map_or(0, |(_, payload)| payload.len());
                waiting.dropped += 1;
            }
        }
        drop(waiting);
        self.queue.arrived.notify_one();
    }
}

impl Drop for Sender {
    fn drop(&mut self) {
        self.queue.waiting.lock().senders -= 1;
        self.queue.arrived.notify_one();
    }
}

/// Whether any client can cause samples of a topic without control.
fn is_of_others(topic: TopicId) -> bool {
    matches!(topic, TopicId::Refusal | TopicId::Event)
}

/// Subscribed topics in one queue, in the order of arrival.
pub struct Streams {
    pub(super) queue: Arc<Queue>,
    pub(super) _subscribers: Vec<zenoh::pubsub::Subscriber<()>>,
}

impl Streams {
    /// The next sample, or `None` when none arrived within `patience`.
    ///
    /// # Errors
    /// [`ClientError::Garbled`], [`ClientError::Transport`] when the session is closed.
    pub fn next(&self, patience: Duration) -> Result<Option<Sample>, ClientError> {
        let deadline = Instant::now() + patience;
        let mut waiting = self.queue.waiting.lock();
        loop {
            if let Some((topic, payload)) = waiting.samples.pop_front() {
                waiting.bytes -= payload.len();
                drop(waiting);
                return match Sample::decode(topic, &payload.to_bytes()) {
                    Ok(sample) => Ok(Some(sample)),
                    Err(cause) => Err(ClientError::Garbled {
                        what: format!("`{topic}`"),
                        cause,
                    }),
                };
            }
            if waiting.senders == 0 {
                return Err(closed("waiting for a sample"));
            }
            if self
                .queue
                .arrived
                .wait_until(&mut waiting, deadline)
                .timed_out()
                && waiting.samples.is_empty()
            {
                return Ok(None);
            }
        }
    }

    /// Samples that were dropped because the queue was full (count).
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.queue.waiting.lock().dropped
    }
}

#[cfg(test)]
mod tests {
    use wheelarm_proto::{Message, v1};

    use super::*;

    #[test]
    fn full_queue_drops_and_counts_the_oldest_sample_that_others_cause() {
        let queue = Arc::new(Queue::default());
        let bound = Bound {
            samples: 8,
            bytes: 1 << 20,
        };
        let sender = Sender::new(&queue, Some(bound));
        let streams = Streams {
            queue: Arc::clone(&queue),
            _subscribers: Vec::new(),
        };
        let clock = |tick| {
            let header = Some(v1::Header {
                tick,
                ..Default::default()
            });
            let clock = v1::Clock {
                header,
                ..Default::default()
            };
            clock.encode_to_vec()
        };
        for tick in 0..4 {
            sender.send(TopicId::Clock, clock(tick).into());
        }
        for sequence in 0..100_000 {
            let refusal = v1::Refusal {
                sequence,
                ..Default::default()
            };
            sender.send(TopicId::Refusal, refusal.encode_to_vec().into());
        }
        assert_eq!(streams.dropped(), 4 + 100_000 - 8);
        let mut ticks = Vec::new();
        let mut sequences = Vec::new();
        while let Some(sample) = streams.next(Duration::ZERO).unwrap() {
            match sample {
                Sample::Clock(clock) => ticks.push(clock.header.unwrap().tick),
                Sample::Refusal(refusal) => sequences.push(refusal.sequence),
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(ticks, [0, 1, 2, 3]);
        assert_eq!(sequences, [99_996, 99_997, 99_998, 99_999]);
        // Bytes are bounded too, but one sample always fits.
        sender.send(TopicId::Clock, vec![0_u8; 2 << 20].into());
        sender.send(TopicId::Clock, clock(9).into());
        assert_eq!(queue.waiting.lock().samples.len(), 1);
        assert!(matches!(streams.next(Duration::ZERO), Ok(Some(_))));
        drop(sender);
        assert!(streams.next(Duration::ZERO).is_err(), "closed");
    }
}
