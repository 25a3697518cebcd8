//! The mean of a sampled quantity over a span of time.

/// Mean over `from` to `to` of what goes straight from one of the `values` at
/// rising `stamps` to the next, and holds before the first and after the last;
/// any unit of time. 0 without values, the value at `from` over no time.
#[must_use]
pub fn mean(stamps: &[f64], values: &[f64], from: f64, to: f64) -> f64 {
    let at = |time: f64| {
        let next = stamps.partition_point(|&s| s < time);
        match (next.checked_sub(1), values.get(next)) {
            (None, first) => first.copied().unwrap_or(0.0),
            (Some(before), None) => values.get(before).copied().unwrap_or(0.0),
            (Some(before), Some(after)) => {
                let share = (time - stamps[before]) / (stamps[next] - stamps[before]);
                values[before] + (after - values[before]) * share
            }
        }
    };
    if to <= from {
        return at(from);
    }
    let inside = stamps.partition_point(|&s| s <= from)..stamps.partition_point(|&s| s < to);
    let mut area = 0.0;
    let mut last = (from, at(from));
    for point in inside.map(|i| (stamps[i], values[i])).chain([(to, at(to))]) {
        area += (point.0 - last.0) * (point.1 + last.1) / 2.0;
        last = point;
    }
    area / (to - from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_times_its_span_is_the_area_below() {
        let stamps = [0.0, 1.0, 2.0, 4.0];
        let values = [0.0, 2.0, 2.0, 0.0];
        assert_eq!(mean(&stamps, &values, 0.0, 4.0), 5.0 / 4.0);
        assert_eq!(mean(&stamps, &values, 0.5, 0.5), 1.0);
        // It holds outside.
        assert_eq!(mean(&stamps, &values, -3.0, 0.0), 0.0);
        assert_eq!(mean(&[1.0], &[7.0], -3.0, 9.0), 7.0);
        assert_eq!(mean(&[], &[], 0.0, 1.0), 0.0);
        // Parts add up, wherever they are cut.
        let parts = [0.0, 0.3, 1.7, 2.9, 4.0];
        let sum: f64 = parts
            .windows(2)
            .map(|w| (w[1] - w[0]) * mean(&stamps, &values, w[0], w[1]))
            .sum();
        assert!((sum - 5.0).abs() < 1e-12, "{sum}");
    }
}
