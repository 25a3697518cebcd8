//! Axes with round numbers: ticks at multiples of 1, 2 or 5 times a power of
//! ten, with enough decimals to distinguish them.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// The part of an axis that is shown, and its ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    range: Range<f64>,
    ticks: Vec<f64>,
    decimals: usize,
}

impl Axis {
    /// An axis from `low` to `high` with about `count` ticks.
    pub fn new(low: f64, high: f64, count: usize) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        let least = (high - low) / count.max(1) as f64;
        // One tick alone gives no scale.
        let halves = [1.0, 0.5, 0.25].map(|s| Self::with_step(low..high, round_step(s * least)));
        let [wide, middle, narrow] = halves;
        match (wide.ticks.len(), middle.ticks.len()) {
            (2.., _) => wide,
            (_, 2..) => middle,
            _ => narrow,
        }
    }

    /// An axis of whole numbers from 0 to beyond `most`.
    pub fn counts(most: f64, count: usize) -> Self {
        let high = most.max(1.0) * 1.05;
        Self::with_step(0.0..high, round_step(high / count.max(1) as f64).max(1.0))
    }

    fn with_step(range: Range<f64>, step: f64) -> Self {
        // A hundredth of a step compensates the rounding of the division.
        let first = (range.start / step - 0.01).ceil() as i64;
        let last = (range.end / step + 0.01).floor() as i64;
        Self {
            ticks: (first..=last).map(|k| k as f64 * step).collect(),
            decimals: (-step.log10().floor()).clamp(0.0, 9.0) as usize,
            range,
        }
    }

    /// A value with the decimals of the ticks.
    pub fn words(&self, value: f64) -> String {
        let (unit, decimals) = (10_f64.powi(self.decimals as i32), self.decimals);
        // Rounded first: a zero must not read as -0.
        format!("{:.decimals$}", (value * unit).round() / unit + 0.0)
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let span = self.range.end - self.range.start;
        let share = (value - self.range.start) / span;
        let way = f64::from(limit.1 - limit.0) * share;
        // Far outside and NaN end at a pixel that exists.
        limit.0 + way.round().clamp(-1e6, 1e6) as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.ticks.clone()
        }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        self.words(*value)
    }
}

/// The least round step that is not below `least`.
fn round_step(least: f64) -> f64 {
    let power = 10_f64.powf(least.max(1e-9).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * power);
    let enough = steps.into_iter().find(|s| *s >= least * (1.0 - 1e-9));
    enough.unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks.iter().map(|t| axis.words(*t)).collect()
    }

    #[test]
    fn ticks_are_round_and_distinct() {
        let axis = Axis::new(-0.038, 0.626, 5);
        assert_eq!(labels(&axis), ["0.0", "0.2", "0.4", "0.6"]);
        let axis = Axis::new(0.0, 15.8, 6);
        assert_eq!(labels(&axis), ["0", "5", "10", "15"]);
        let axis = Axis::new(-0.0031, 0.0042, 6);
        assert_eq!(labels(&axis), ["-0.002", "0.000", "0.002", "0.004"]);
        let axis = Axis::new(9.7, 9.9, 4);
        assert_eq!(labels(&axis), ["9.70", "9.75", "9.80", "9.85", "9.90"]);
        let axis = Axis::new(0.31, 0.59, 1);
        assert_eq!(labels(&axis), ["0.4", "0.5"]);
        for (low, high) in [(0.0, 3.0), (-7.3, 1e4), (1e-5, 2e-5), (2.0, 2.0)] {
            let labels = labels(&Axis::new(low, high, 6));
            let mut once = labels.clone();
            once.dedup();
            assert_eq!(labels, once, "{low} to {high}");
            assert!(
                (2..=8).contains(&labels.len()),
                "{low} to {high}: {labels:?}"
            );
        }
    }

    #[test]
    fn an_axis_of_counts_has_whole_numbers() {
        assert_eq!(labels(&Axis::counts(3.0, 8)), ["0", "1", "2", "3"]);
        assert_eq!(labels(&Axis::counts(1.0, 8)), ["0", "1"]);
        assert_eq!(
            labels(&Axis::counts(47.0, 5)),
            ["0", "10", "20", "30", "40"]
        );
    }
}
