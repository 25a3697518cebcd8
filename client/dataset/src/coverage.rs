//! Which sequence numbers of a stream are there: received, doubled, missing.

/// A set of sequence numbers, kept as ranges.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Inclusive ranges, ascending, never touching each other.
    ranges: Vec<(u64, u64)>,
    received: u64,
    late: u64,
}

impl Coverage {
    /// Adds a number; false when it was there already.
    pub fn insert(&mut self, sequence: u64) -> bool {
        let at = self.ranges.partition_point(|r| r.0 <= sequence);
        if at > 0 && self.ranges[at - 1].1 >= sequence {
            return false;
        }
        if at < self.ranges.len() {
            self.late += 1;
        }
        self.received += 1;
        let joins_left = at > 0 && self.ranges[at - 1].1.checked_add(1) == Some(sequence);
        let joins_right =
            at < self.ranges.len() && sequence.checked_add(1) == Some(self.ranges[at].0);
        match (joins_left, joins_right) {
            (true, true) => {
                self.ranges[at - 1].1 = self.ranges[at].1;
                self.ranges.remove(at);
            }
            (true, false) => self.ranges[at - 1].1 = sequence,
            (false, true) => self.ranges[at].0 = sequence,
            (false, false) => self.ranges.insert(at, (sequence, sequence)),
        }
        true
    }

    /// Distinct numbers.
    #[must_use]
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Sequence numbers that arrived after a greater one: retransmitted samples.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Least and greatest number.
    #[must_use]
    pub fn span(&self) -> Option<(u64, u64)> {
        Some((self.ranges.first()?.0, self.ranges.last()?.1))
    }

    /// Numbers missing between the least and the greatest one.
    #[must_use]
    pub fn gaps(&self) -> u64 {
        self.span()
            .map_or(0, |(first, last)| (last - first + 1) - self.received)
    }

    /// Ranges of `first..=last` that are missing, ascending.
    #[must_use]
    pub fn missing(&self, first: u64, last: u64) -> Vec<(u64, u64)> {
        let mut missing = Vec::new();
        let mut next = Some(first);
        for &(start, end) in &self.ranges {
            let Some(from) = next.filter(|from| *from <= last) else {
                break;
            };
            if start > last {
                break;
            }
            if start > from {
                missing.push((from, start - 1));
            }
            if end >= from {
                next = end.checked_add(1);
            }
        }
        if let Some(from) = next.filter(|from| *from <= last) {
            missing.push((from, last));
        }
        missing
    }

    /// Number of received sequence numbers of `first..=last`.
    #[must_use]
    pub fn within(&self, first: u64, last: u64) -> u64 {
        self.ranges
            .iter()
            .filter(|r| r.0 <= last && r.1 >= first)
            .map(|r| r.1.min(last) - r.0.max(first) + 1)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn account_is_independent_of_the_order_of_arrival() {
        let numbers = [5, 9, 6, 4, 4, 12, 8, 7, 5];
        let mut c = Coverage::default();
        let fresh: Vec<bool> = numbers.iter().map(|&n| c.insert(n)).collect();
        assert_eq!(
            fresh,
            [true, true, true, true, false, true, true, true, false]
        );
        assert_eq!(c.received(), 7);
        assert_eq!(c.span(), Some((4, 12)));
        assert_eq!(c.gaps(), 2);
        assert_eq!(c.within(0, 8), 5);
        assert_eq!(c.within(10, 11), 0);
        assert_eq!(c.missing(2, 14), [(2, 3), (10, 11), (13, 14)]);
        assert_eq!(c.missing(11, 12), [(11, 11)]);
        assert_eq!(c.missing(5, 8), []);
        assert_eq!(c.missing(20, 21), [(20, 21)]);
        assert_eq!(c.late(), 4);
        assert!(c.insert(u64::MAX) && !c.insert(u64::MAX) && c.insert(0));
    }
}
