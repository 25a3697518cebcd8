//! Queries that wait for the simulation thread: two bounded lanes, served in turn, each
//! in order. One lane holds queries that change state, the other read-only ones. A
//! flood of reads cannot block `episode_stop`, and a long operation cannot block
//! `status`.

use std::collections::VecDeque;

use parking_lot::Mutex;
use wheelarm_proto::Query;

/// Largest number of queries in each lane.
const ROOM: usize = 256;

/// Largest total size of the requests in each lane, bytes.
const BYTES: usize = 16 << 20;

/// A query with its kind.
pub struct Request {
    /// Kind.
    pub kind: Query,
    /// The query to answer.
    pub query: zenoh::query::Query,
}

/// Lane of a query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lane {
    /// Changes state; executed one after the other, possibly for long.
    Act,
    /// Reads only, or shuts down.
    Appearance,
}

impl Lane {
    /// The lane of a query.
    #[must_use]
    pub fn for_query(kind: Query) -> Self {
        match kind {
            Query::Shutdown => Self::Appearance,
            appearances if appearances.only_looks() => Self::Appearance,
            _ => Self::Act,
        }
    }
}

/// The two lanes.
#[derive(Debug)]
pub struct RequestQueue<T>(Mutex<Lanes<T>>);

#[derive(Debug)]
struct Lanes<T> {
    acts: Waiting<T>,
    appearances: Waiting<T>,
    /// The lane that was served last.
    last: Lane,
}

/// Requests with the size of each.
#[derive(Debug)]
struct Waiting<T> {
    queue: VecDeque<(usize, T)>,
    bytes: usize,
}

impl<T> Waiting<T> {
    fn new() -> Self {
        Self {
            queue: VecDeque::new(),
            bytes: 0,
        }
    }

    fn put(&mut self, bytes: usize, request: T) -> Result<(), T> {
        if self.queue.len() >= ROOM || self.bytes + bytes > BYTES {
            return Err(request);
        }
        self.bytes += bytes;
        self.queue.push_back((bytes, request));
        Ok(())
    }

    fn next(&mut self) -> Option<T> {
        let (bytes, request) = self.queue.pop_front()?;
        self.bytes -= bytes;
        Some(request)
    }
}

impl<T> Default for RequestQueue<T> {
    fn default() -> Self {
        Self(Mutex::new(Lanes {
            acts: Waiting::new(),
            appearances: Waiting::new(),
            last: Lane::Appearance,
        }))
    }
}

impl<T> RequestQueue<T> {
    /// Queues a request of `bytes` bytes.
    ///
    /// # Errors
    /// The request, when its lane is full.
    pub fn put(&self, lane: Lane, bytes: usize, request: T) -> Result<(), T> {
        let mut lanes = self.0.lock();
        match lane {
            Lane::Act => lanes.acts.put(bytes, request),
            Lane::Appearance => lanes.appearances.put(bytes, request),
        }
    }

    /// The next request, from either lane in turn; from the acting lane only if `acts`.
    pub fn next(&self, acts: bool) -> Option<T> {
        let mut lanes = self.0.lock();
        let turn = match lanes.last {
            Lane::Act => [Lane::Appearance, Lane::Act],
            Lane::Appearance => [Lane::Act, Lane::Appearance],
        };
        turn.into_iter().find_map(|lane| {
            let next = match lane {
                Lane::Act if acts => lanes.acts.next(),
                Lane::Act => None,
                Lane::Appearance => lanes.appearances.next(),
            };
            lanes.last = if next.is_some() { lane } else { lanes.last };
            next
        })
    }

    /// Whether [`RequestQueue::next`] would return a request.
    pub fn is_waiting(&self, acts: bool) -> bool {
        let lanes = self.0.lock();
        !lanes.appearances.queue.is_empty() || (acts && !lanes.acts.queue.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_bounded_served_in_order_and_in_turn() {
        let request_queue = RequestQueue::default();
        for number in 0..ROOM {
            request_queue.put(Lane::Appearance, 10, number).unwrap();
        }
        assert_eq!(
            request_queue.put(Lane::Appearance, 10, 9999),
            Err(9999),
            "one too many"
        );
        request_queue.put(Lane::Act, 10, 1000).unwrap();
        request_queue.put(Lane::Act, 10, 1001).unwrap();
        let served: Vec<_> = (0..5).filter_map(|_| request_queue.next(true)).collect();
        assert_eq!(served, [1000, 0, 1001, 1, 2]);
        // While an operation runs, the other acting queries wait.
        request_queue.put(Lane::Act, 10, 1002).unwrap();
        let rest: Vec<_> = std::iter::from_fn(|| request_queue.next(false)).collect();
        assert_eq!(rest, (3..ROOM).collect::<Vec<_>>());
        assert!(!request_queue.is_waiting(false) && request_queue.is_waiting(true));
        assert_eq!(request_queue.next(true), Some(1002));
        assert!(!request_queue.is_waiting(true));
    }

    #[test]
    fn large_requests_fill_a_lane_by_their_bytes() {
        let request_queue = RequestQueue::default();
        let large = BYTES / 4;
        for number in 0..4 {
            request_queue.put(Lane::Act, large, number).unwrap();
        }
        assert_eq!(request_queue.put(Lane::Act, 1, 4), Err(4));
        request_queue.put(Lane::Appearance, 1, 5).unwrap();
        assert_eq!(request_queue.next(true), Some(0));
        request_queue.put(Lane::Act, large, 6).unwrap();
    }
}
