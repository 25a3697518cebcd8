//! The queue from the transport's callbacks to the recorder's thread. It is bounded in
//! bytes and never blocks: a sample that does not fit is dropped and becomes a gap.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};

/// Limit of queued images, bytes: about 20 pairs at 1280x720.
const IMAGE_BYTES: usize = 256 << 20;
/// Additional limit of state samples, bytes, so that images cannot displace them.
const STATE_BYTES: usize = 64 << 20;
/// Time that a state sample waits for others: waking the thread costs more than handling
/// the sample. Images never wait, because a lock-step server waits for them.
const LINGER: Duration = Duration::from_millis(5);
/// Number of queued samples that wakes the thread at once.
const MANY: usize = 1024;

struct Shared<T> {
    linger: Duration,
    waiting: Mutex<Waiting<T>>,
    changed: Condvar,
    /// Bytes of all queued items.
    bytes: AtomicUsize,
    dropped: AtomicU64,
}

struct Waiting<T> {
    items: VecDeque<(T, usize)>,
    /// Arrival of the first item.
    since: Option<Instant>,
    /// One item must not wait for others.
    is_urgent: bool,
    /// Number of [`QueueSender`]s.
    senders: usize,
    /// The [`QueueReceiver`] is dropped.
    is_closed: bool,
}

/// Sender half, for callbacks.
pub(super) struct QueueSender<T>(Arc<Shared<T>>);

impl<T> Clone for QueueSender<T> {
    fn clone(&self) -> Self {
        self.0.waiting.lock().senders += 1;
        Self(Arc::clone(&self.0))
    }
}

impl<T> Drop for QueueSender<T> {
    fn drop(&mut self) {
        self.0.waiting.lock().senders -= 1;
        self.0.changed.notify_one();
    }
}

/// Receiver half, for the recorder's thread.
pub(super) struct QueueReceiver<T> {
    shared: Arc<Shared<T>>,
    /// Items that were taken out together.
    batch: VecDeque<(T, usize)>,
}

impl<T> Drop for QueueReceiver<T> {
    fn drop(&mut self) {
        let mut waiting = self.shared.waiting.lock();
        waiting.is_closed = true;
        waiting.items.clear();
    }
}

/// Creates a queue.
pub(super) fn queue<T>() -> (QueueSender<T>, QueueReceiver<T>) {
    lingering(LINGER)
}

fn lingering<T>(linger: Duration) -> (QueueSender<T>, QueueReceiver<T>) {
    let shared = Arc::new(Shared {
        linger,
        waiting: Mutex::new(Waiting {
            items: VecDeque::new(),
            since: None,
            is_urgent: false,
            senders: 1,
            is_closed: false,
        }),
        changed: Condvar::new(),
        bytes: AtomicUsize::new(0),
        dropped: AtomicU64::new(0),
    });
    let receiver = QueueReceiver {
        shared: Arc::clone(&shared),
        batch: VecDeque::new(),
    };
    (QueueSender(shared), receiver)
}

impl<T> QueueSender<T> {
    /// Adds a sample of `bytes`, or drops it when the queue is full.
    pub fn sample(&self, item: T, bytes: usize, image: bool) {
        let limit = if image {
            IMAGE_BYTES
        } else {
            IMAGE_BYTES + STATE_BYTES
        };
        let shared = &self.0;
        if shared.bytes.fetch_add(bytes, Ordering::AcqRel) + bytes > limit {
            shared.bytes.fetch_sub(bytes, Ordering::AcqRel);
            shared.dropped.fetch_add(1, Ordering::Relaxed);
            return;
        }
        self.add(item, bytes, image);
    }

    /// Adds a message of the protocol; it always fits.
    pub fn control(&self, item: T) {
        self.add(item, 0, true);
    }

    fn add(&self, item: T, bytes: usize, is_urgent: bool) {
        let mut waiting = self.0.waiting.lock();
        // The recorder has ended.
        if waiting.is_closed {
            return;
        }
        waiting.items.push_back((item, bytes));
        waiting.since.get_or_insert_with(Instant::now);
        let first = waiting.items.len() == 1;
        let urgent = is_urgent && !waiting.is_urgent;
        let many = waiting.items.len() == MANY;
        waiting.is_urgent |= is_urgent;
        drop(waiting);
        if first || urgent || many {
            self.0.changed.notify_one();
        }
    }
}

impl<T> QueueReceiver<T> {
    /// Waits for items: `patience` at most for the first one, and then until it waited
    /// long enough for others.
    ///
    /// # Errors
    /// When the queue is empty and every [`QueueSender`] is dropped.
    pub fn wait(&mut self, patience: Duration) -> Result<(), Closed> {
        if !self.batch.is_empty() {
            return Ok(());
        }
        let end = Instant::now() + patience;
        let mut waiting = self.shared.waiting.lock();
        loop {
            let now = Instant::now();
            let until = match waiting.since {
                Some(since) => since + self.shared.linger,
                None if waiting.senders == 0 => return Err(Closed),
                None => end,
            };
            let due = waiting.is_urgent || waiting.items.len() >= MANY || waiting.senders == 0;
            if due || now >= until {
                std::mem::swap(&mut self.batch, &mut waiting.items);
                waiting.since = None;
                waiting.is_urgent = false;
                return Ok(());
            }
            self.shared.changed.wait_until(&mut waiting, until);
        }
    }

    /// The next of the items that were waited for.
    pub fn take(&mut self) -> Option<T> {
        let (item, bytes) = self.batch.pop_front()?;
        self.shared.bytes.fetch_sub(bytes, Ordering::AcqRel);
        Some(item)
    }

    /// Samples dropped so far because the queue was full.
    pub fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

/// Every [`QueueSender`] is dropped and the queue is empty.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Closed;

#[cfg(test)]
mod tests {
    use super::*;

    /// All queued items.
    fn all(receiver: &mut QueueReceiver<i32>) -> Vec<i32> {
        receiver.wait(Duration::ZERO).unwrap();
        std::iter::from_fn(|| receiver.take()).collect()
    }

    #[test]
    fn images_cannot_displace_state_samples() {
        let (sender, mut receiver) = queue();
        for i in 0..5 {
            sender.sample(i, IMAGE_BYTES / 4, true);
        }
        sender.sample(100, 1000, false);
        sender.control(101);
        // Items of a batch count until they are taken.
        receiver.wait(Duration::ZERO).unwrap();
        sender.sample(6, 1, true);
        assert_eq!(receiver.dropped(), 2);
        assert_eq!(all(&mut receiver), [0, 1, 2, 3, 100, 101]);
        sender.sample(7, IMAGE_BYTES, true);
        assert_eq!(all(&mut receiver), [7]);
    }

    #[test]
    fn state_samples_wait_for_others_but_not_forever() {
        let (sender, mut receiver) = queue();
        assert!(all(&mut receiver).is_empty());
        sender.sample(1, 10, false);
        sender.sample(2, 10, false);
        assert_eq!(all(&mut receiver), [1, 2]);
        for i in 0..MANY {
            sender.sample(i32::try_from(i).unwrap(), 10, false);
        }
        assert_eq!(all(&mut receiver).len(), MANY);
        let other = sender.clone();
        let thread = std::thread::spawn(move || {
            other.sample(3, 10, false);
            other.control(4);
        });
        thread.join().unwrap();
        assert_eq!(all(&mut receiver), [3, 4]);
        sender.sample(5, 10, false);
        drop(sender);
        assert_eq!(all(&mut receiver), [5]);
        assert_eq!(receiver.wait(Duration::MAX / 4), Err(Closed));
    }

    /// Items that another thread receives; it waits until an item ends its wait.
    fn taken(of: impl FnOnce(&QueueSender<i32>)) -> Vec<i32> {
        const HOUR: Duration = Duration::from_secs(3600);
        let (sender, mut receiver) = lingering(HOUR);
        let (sent, batches) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            receiver.wait(HOUR).unwrap();
            sent.send(std::iter::from_fn(|| receiver.take()).collect())
        });
        of(&sender);
        drop(sender);
        batches.recv_timeout(Duration::from_secs(60)).unwrap()
    }

    #[test]
    fn an_urgent_item_or_many_items_end_the_wait_and_one_state_sample_does_not() {
        let pause = || std::thread::sleep(Duration::from_millis(50));
        let mut kept = None;
        let mut with = |last: &dyn Fn(&QueueSender<i32>)| {
            taken(|sender| {
                pause();
                sender.sample(1, 10, false);
                pause();
                last(sender);
                // So that not its end ends the wait.
                kept = Some(sender.clone());
            })
        };
        assert_eq!(with(&|sender| sender.control(2)), [1, 2]);
        assert_eq!(with(&|sender| sender.sample(2, 10, true)), [1, 2]);
        let many = |sender: &QueueSender<i32>| {
            (1..MANY).for_each(|_| sender.sample(2, 10, false));
        };
        assert_eq!(with(&many).len(), MANY);
        // The last entrance is dropped.
        assert_eq!(taken(|sender| sender.sample(1, 10, false)), [1]);
    }

    #[test]
    fn items_added_after_the_end_are_dropped() {
        let (sender, receiver) = queue();
        drop(receiver);
        let item = Arc::new(());
        sender.control(Arc::clone(&item));
        assert_eq!(Arc::strong_count(&item), 1);
    }
}
