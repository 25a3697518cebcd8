//! The moments of a video, and the newest images at each.

use anyhow::ensure;

/// A stretch of an episode, nanoseconds of simulation time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    /// Beginning of the episode.
    pub start: u64,
    /// First moment that is shown.
    pub from: u64,
    /// Last moment that is shown.
    pub to: u64,
}

impl Span {
    /// The stretch between two moments, seconds from the beginning of the episode.
    ///
    /// # Errors
    /// When there is nothing between them.
    pub fn new(
        (start, end): (u64, u64),
        from: Option<f64>,
        to: Option<f64>,
    ) -> anyhow::Result<Self> {
        let length = end - start;
        let nanos = |seconds: f64| (seconds * 1e9).round() as u64;
        let span = Self {
            start,
            from: start + from.map_or(0, nanos),
            to: start + to.map_or(length, nanos).min(length),
        };
        ensure!(
            span.from < span.to || length == 0,
            "the interval from --from {} to --to {} is empty; the episode is {:.2} s long",
            from.unwrap_or_default(),
            to.unwrap_or(length as f64 * 1e-9),
            length as f64 * 1e-9
        );
        Ok(span)
    }

    /// The moments of the frames: `speed` simulated seconds per second, and `rate`
    /// frames per second.
    pub fn moments(&self, speed: f64, rate: f64) -> Vec<u64> {
        let step = speed / rate * 1e9;
        let last = (self.to - self.from) as f64 / step;
        // A hundredth of a step compensates the rounding of stamps.
        let last = (last + 0.01).floor() as u64;
        let moment = |k: u64| (self.from + (k as f64 * step).round() as u64).min(self.to);
        (0..=last).map(moment).collect()
    }
}

/// Images per simulated second of the fastest camera; 1 where unknown.
pub(super) fn rate<'a>(all: impl Iterator<Item = &'a [u64]>) -> f64 {
    let rates = all.filter_map(|stamps| {
        let mut steps: Vec<u64> = stamps.windows(2).map(|two| two[1] - two[0]).collect();
        steps.sort_unstable();
        let step = steps.get(steps.len() / 2).copied()?;
        (step > 0).then(|| 1e9 / step as f64)
    });
    rates.reduce(f64::max).unwrap_or(1.0)
}

/// The newest of `stamps` at a moment; the first one before any.
pub(super) fn newest(stamps: &[u64], moment: u64) -> usize {
    // Stamps are rounded to nanoseconds, and so are moments.
    stamps
        .partition_point(|&stamp| stamp <= moment + 1000)
        .max(1)
        - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    #[test]
    fn a_video_at_twice_the_speed_has_half_the_frames_and_ends_with_the_episode() {
        let span = Span::new((SECOND, 3 * SECOND), None, None).unwrap();
        let moments = span.moments(1.0, 10.0);
        assert_eq!((moments.len(), moments[0]), (21, SECOND));
        assert_eq!(moments[20], 3 * SECOND);
        let fast = span.moments(2.0, 10.0);
        assert_eq!((fast.len(), fast[10]), (11, 3 * SECOND));
        assert_eq!(fast[1] - fast[0], SECOND / 5);
    }

    #[test]
    fn a_stretch_counts_from_the_beginning_of_the_episode() {
        let whole = (5 * SECOND, 9 * SECOND);
        let span = Span::new(whole, Some(1.0), Some(2.5)).unwrap();
        assert_eq!((span.from, span.to), (6 * SECOND, 7_500_000_000));
        assert_eq!(Span::new(whole, None, Some(99.0)).unwrap().to, 9 * SECOND);
        for (from, to) in [(Some(4.0), None), (Some(2.0), Some(1.0))] {
            let error = Span::new(whole, from, to).unwrap_err().to_string();
            assert!(error.contains("4.00 s long"), "{error}");
        }
    }

    #[test]
    fn the_newest_image_is_shown_and_the_first_one_before_it_arrived() {
        let stamps = [100_000, 200_000, 300_000];
        let at = [0, 100_000, 199_000, 250_000, 900_000].map(|t| newest(&stamps, t));
        assert_eq!(at, [0, 0, 1, 1, 2]);
        let ten = [0, 100_000_000, 200_000_000, 300_000_000];
        let five = [0, 200_000_000];
        assert!((rate([&five[..], &ten[..]].into_iter()) - 10.0).abs() < 1e-9);
        assert!((rate([&five[..1]].into_iter()) - 1.0).abs() < 1e-9);
    }
}
