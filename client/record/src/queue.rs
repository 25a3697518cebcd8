//! The way from the transport's callbacks to the recorder's thread: bounded in
//! bytes, never waiting. What does not fit is dropped and shows as a gap.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender};

/// Bytes of pictures that may wait: about 20 pairs at 1280x720.
const PICTURE_BYTES: usize = 256 << 20;
/// Bytes that state samples may use beyond that, so that pictures cannot
/// push them out.
const STATE_BYTES: usize = 64 << 20;

#[derive(Default)]
struct Count {
    bytes: AtomicUsize,
    dropped: AtomicU64,
}

/// The end for callbacks.
pub(super) struct Entrance<T> {
    sender: Sender<(T, usize)>,
    count: Arc<Count>,
}

impl<T> Clone for Entrance<T> {
    fn clone(&self) -> Self {
        Self {
            sender: self.sender.clone(),
            count: Arc::clone(&self.count),
        }
    }
}

/// The end for the recorder's thread.
pub(super) struct Exit<T> {
    receiver: Receiver<(T, usize)>,
    count: Arc<Count>,
}

/// A queue.
pub(super) fn queue<T>() -> (Entrance<T>, Exit<T>) {
    let (sender, receiver) = crossbeam_channel::unbounded();
    let count = Arc::new(Count::default());
    let entrance = Entrance {
        sender,
        count: Arc::clone(&count),
    };
    (entrance, Exit { receiver, count })
}

impl<T> Entrance<T> {
    /// Adds a sample of `bytes`, or drops it when there is no room.
    pub fn sample(&self, item: T, bytes: usize, picture: bool) {
        let limit = if picture {
            PICTURE_BYTES
        } else {
            PICTURE_BYTES + STATE_BYTES
        };
        if self.count.bytes.fetch_add(bytes, Ordering::AcqRel) + bytes > limit {
            self.count.bytes.fetch_sub(bytes, Ordering::AcqRel);
            self.count.dropped.fetch_add(1, Ordering::Relaxed);
            return;
        }
        // A closed queue means that the recorder has ended.
        let _ = self.sender.send((item, bytes));
    }

    /// Adds a message of the protocol; it always fits.
    pub fn control(&self, item: T) {
        let _ = self.sender.send((item, 0));
    }
}

impl<T> Exit<T> {
    /// The next item; `None` after `patience`.
    pub fn next(&self, patience: Duration) -> Result<Option<T>, Closed> {
        match self.receiver.recv_timeout(patience) {
            Ok((item, bytes)) => {
                self.count.bytes.fetch_sub(bytes, Ordering::AcqRel);
                Ok(Some(item))
            }
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(Closed),
        }
    }

    /// Samples dropped so far because the queue was full.
    pub fn dropped(&self) -> u64 {
        self.count.dropped.load(Ordering::Relaxed)
    }
}

/// Nobody can add anything any more.
pub(super) struct Closed;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_cannot_push_state_samples_out() {
        let (entrance, exit) = queue();
        for i in 0..5 {
            entrance.sample(i, PICTURE_BYTES / 4, true);
        }
        entrance.sample(100, 1000, false);
        entrance.control(101);
        let mut got = Vec::new();
        while let Ok(Some(i)) = exit.next(Duration::ZERO) {
            got.push(i);
        }
        assert_eq!(got, [0, 1, 2, 3, 100, 101]);
        assert_eq!(exit.dropped(), 1);
        entrance.sample(6, PICTURE_BYTES, true);
        assert!(matches!(exit.next(Duration::ZERO), Ok(Some(6))));
    }
}
