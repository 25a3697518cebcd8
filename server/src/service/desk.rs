//! Queries that wait for the simulation thread: two bounded lanes, taken in
//! turn, each in order. What changes something stands in one, what only looks
//! in the other, so that a flood of questions keeps no `episode_stop` out, and a
//! long act keeps no `status` waiting.

use std::collections::VecDeque;

use parking_lot::Mutex;
use wheelarm_proto::Query;

/// Queries that may wait in each lane.
const ROOM: usize = 256;

/// Bytes that their requests may hold in memory, in each lane.
const BYTES: usize = 16 << 20;

/// A query with its kind.
pub struct Request {
    /// Kind.
    pub query: Query,
    /// The query to answer.
    pub asked: zenoh::query::Query,
}

/// What a query does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lane {
    /// Changes something; one after the other, and one may take long.
    Act,
    /// Only looks, or ends everything.
    Look,
}

impl Lane {
    /// The lane of a query.
    #[must_use]
    pub fn of(query: Query) -> Self {
        match query {
            Query::Shutdown => Self::Look,
            looks if looks.only_looks() => Self::Look,
            _ => Self::Act,
        }
    }
}

/// The two lanes.
#[derive(Debug)]
pub struct Desk<T>(Mutex<Lanes<T>>);

#[derive(Debug)]
struct Lanes<T> {
    acts: Waiting<T>,
    looks: Waiting<T>,
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

impl<T> Default for Desk<T> {
    fn default() -> Self {
        Self(Mutex::new(Lanes {
            acts: Waiting::new(),
            looks: Waiting::new(),
            last: Lane::Look,
        }))
    }
}

impl<T> Desk<T> {
    /// Queues a request of so many bytes.
    ///
    /// # Errors
    /// The request again when its lane is full.
    pub fn put(&self, lane: Lane, bytes: usize, request: T) -> Result<(), T> {
        let mut lanes = self.0.lock();
        match lane {
            Lane::Act => lanes.acts.put(bytes, request),
            Lane::Look => lanes.looks.put(bytes, request),
        }
    }

    /// The next request, of either lane in turn; of the acts only where `acts`
    /// may begin.
    pub fn next(&self, acts: bool) -> Option<T> {
        let mut lanes = self.0.lock();
        let turn = match lanes.last {
            Lane::Act => [Lane::Look, Lane::Act],
            Lane::Look => [Lane::Act, Lane::Look],
        };
        turn.into_iter().find_map(|lane| {
            let next = match lane {
                Lane::Act if acts => lanes.acts.next(),
                Lane::Act => None,
                Lane::Look => lanes.looks.next(),
            };
            lanes.last = if next.is_some() { lane } else { lanes.last };
            next
        })
    }

    /// Whether [`Desk::next`] has something.
    pub fn is_waiting(&self, acts: bool) -> bool {
        let lanes = self.0.lock();
        !lanes.looks.queue.is_empty() || (acts && !lanes.acts.queue.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_bounded_served_in_order_and_in_turn() {
        let desk = Desk::default();
        for number in 0..ROOM {
            desk.put(Lane::Look, 10, number).unwrap();
        }
        assert_eq!(desk.put(Lane::Look, 10, 9999), Err(9999), "one too many");
        desk.put(Lane::Act, 10, 1000).unwrap();
        desk.put(Lane::Act, 10, 1001).unwrap();
        let served: Vec<_> = (0..5).filter_map(|_| desk.next(true)).collect();
        assert_eq!(served, [1000, 0, 1001, 1, 2]);
        // While an act takes its time, the others of its kind wait.
        desk.put(Lane::Act, 10, 1002).unwrap();
        let rest: Vec<_> = std::iter::from_fn(|| desk.next(false)).collect();
        assert_eq!(rest, (3..ROOM).collect::<Vec<_>>());
        assert!(!desk.is_waiting(false) && desk.is_waiting(true));
        assert_eq!(desk.next(true), Some(1002));
        assert!(!desk.is_waiting(true));
    }

    #[test]
    fn large_requests_fill_a_lane_by_their_bytes() {
        let desk = Desk::default();
        let large = BYTES / 4;
        for number in 0..4 {
            desk.put(Lane::Act, large, number).unwrap();
        }
        assert_eq!(desk.put(Lane::Act, 1, 4), Err(4));
        desk.put(Lane::Look, 1, 5).unwrap();
        assert_eq!(desk.next(true), Some(0));
        desk.put(Lane::Act, large, 6).unwrap();
    }
}
