//! Latencies of samples: a truncated normal distribution, and queues of delayed items.

use std::collections::VecDeque;

use crate::error::{BadParameter, Bounds};
use crate::noise::Random;
use crate::parameters::Section;

/// Ticks per second.
const TICKS: f64 = wheelarm_proto::PHYSICS_HZ as f64;

/// A distribution of delays: a truncated normal one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delay {
    /// Mean of the normal distribution, s.
    pub mean: f64,
    /// Its standard deviation, s.
    pub deviation: f64,
    /// Shortest delay, s.
    pub least: f64,
    /// Longest delay, s.
    pub most: f64,
}

impl Delay {
    /// No delay.
    pub const NONE: Self = Self {
        mean: 0.0,
        deviation: 0.0,
        least: 0.0,
        most: 0.0,
    };

    /// `{name}_mean`, `{name}_deviation`, `{name}_range` of a table.
    pub(crate) fn read(section: &mut Section<'_>, name: &str) -> Result<Self, BadParameter> {
        let bounds = Bounds(0.0, 2.0);
        let mean = section.number(&format!("{name}_mean"), "s", bounds)?;
        let deviation = section.number(&format!("{name}_deviation"), "s", bounds)?;
        let [least, most] = section.numbers(&format!("{name}_range"), "s", bounds)?;
        Ok(Self {
            mean,
            deviation,
            least: least.min(most),
            most,
        })
    }

    /// Scales all delays.
    #[must_use]
    pub fn times(self, strength: f64) -> Self {
        Self {
            mean: self.mean * strength,
            deviation: self.deviation * strength,
            least: self.least * strength,
            most: self.most * strength,
        }
    }

    /// A sampled delay, ticks of 1/240 s: resampled until it is within the range.
    pub fn ticks(&self, random: &mut Random) -> u64 {
        let mut seconds = self.mean;
        for _ in 0..64 {
            seconds = self.mean + self.deviation * random.normal();
            if (self.least..=self.most).contains(&seconds) {
                break;
            }
        }
        (seconds.clamp(self.least, self.most) * TICKS).round() as u64
    }
}

/// Delayed items, in order: none overtakes another.
#[derive(Clone, Debug)]
pub struct DelayLine<T> {
    waiting: VecDeque<(u64, T)>,
    last: u64,
}

impl<T> Default for DelayLine<T> {
    fn default() -> Self {
        Self {
            waiting: VecDeque::new(),
            last: 0,
        }
    }
}

impl<T> DelayLine<T> {
    /// Adds an item that is due at tick `due`, or together with the previous one.
    /// Returns its time of arrival.
    pub fn send(&mut self, due: u64, item: T) -> u64 {
        self.last = self.last.max(due);
        self.waiting.push_back((self.last, item));
        self.last
    }

    /// As [`DelayLine::send`], at least a tick after the previous one.
    pub fn send_after(&mut self, due: u64, item: T) -> u64 {
        let next = if self.last == 0 { due } else { self.last + 1 };
        self.send(due.max(next), item)
    }

    /// The next item that has arrived by tick `now`, and its time of arrival.
    pub fn arrived(&mut self, now: u64) -> Option<(u64, T)> {
        let &(due, _) = self.waiting.front()?;
        if due <= now {
            self.waiting.pop_front()
        } else {
            None
        }
    }

    /// Delayed items, in order.
    pub fn waiting(&mut self) -> impl Iterator<Item = &mut T> {
        self.waiting.iter_mut().map(|(_, item)| item)
    }

    /// Whether no item is delayed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Drops all delayed items.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_have_the_given_mean_and_spread() {
        let delay = Delay {
            mean: 0.12,
            deviation: 0.02,
            least: 0.06,
            most: 0.2,
        };
        for strength in [1.0, 2.0] {
            let delay = delay.times(strength);
            let mut random = Random::new(3, [0, 0]);
            let all: Vec<f64> = (0..40_000)
                .map(|_| delay.ticks(&mut random) as f64 / TICKS)
                .collect();
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / all.len() as f64;
            // Rounding to ticks adds a negligible 1/12 of a tick squared.
            assert!((mean / (0.12 * strength) - 1.0).abs() < 0.01, "mean {mean}");
            let deviation = variance.sqrt() / (0.02 * strength);
            assert!((deviation - 1.0).abs() < 0.05, "deviation {deviation}");
            let half = 0.5 / TICKS;
            assert!(
                all.iter()
                    .all(|x| *x >= delay.least - half && *x <= delay.most + half)
            );
        }
        assert_eq!(delay.times(0.0).ticks(&mut Random::new(0, [0, 0])), 0);
    }

    #[test]
    fn no_item_overtakes_another() {
        let mut line = DelayLine::default();
        assert_eq!(line.send(10, 'a'), 10);
        assert_eq!(line.send(8, 'b'), 10);
        assert_eq!(line.arrived(9), None);
        assert_eq!(line.arrived(10), Some((10, 'a')));
        assert_eq!(line.arrived(10), Some((10, 'b')));
        assert!(line.is_empty());
        assert_eq!(line.send_after(10, 'c'), 11);
        assert_eq!(line.send_after(20, 'd'), 20);
    }
}
