//! Speed of the hand on its way: along all corners with one smooth start and one smooth
//! stop.

use nalgebra::Isometry3;
use wheelarm_planning::footprint_check::wrap;

use super::plan::{Plan, Way};

/// Peak speed of the grasp point on the way round, m/s: below what the guard allows.
const ROUND_SPEED: f64 = 0.12;
/// A radian of turning counts as much as this, metres.
const METRES_PER_RADIAN: f64 = 0.15;
/// A smooth start and stop (fifth order) is faster in the middle than on average.
const PEAK: f64 = 1.875;

impl Plan<'_> {
    /// Seconds of the way round.
    pub fn seconds(&self, way: &Way) -> f64 {
        PEAK * self.lengths(way).iter().sum::<f64>() / (ROUND_SPEED * self.tempo)
    }

    /// The end effector `time` seconds after the start of the way round.
    pub fn along(&self, way: &Way, time: f64) -> Isometry3<f64> {
        let lengths = self.lengths(way);
        let whole: f64 = lengths.iter().sum();
        let t = (time * ROUND_SPEED * self.tempo / (PEAK * whole).max(1e-9)).clamp(0.0, 1.0);
        let mut left = t * t * t * (10.0 - 15.0 * t + 6.0 * t * t) * whole;
        for (pair, length) in way.corners.windows(2).zip(&lengths) {
            if left <= *length {
                let share = left / length.max(1e-9);
                let corner =
                    [0, 1, 2, 3, 4].map(|i| pair[0][i] + (pair[1][i] - pair[0][i]) * share);
                return self.tool(&way.start, corner);
            }
            left -= length;
        }
        let last = way.corners.last().copied().unwrap_or_default();
        self.tool(&way.start, last)
    }

    /// Lengths of the way round from corner to corner, metres; turning counts.
    fn lengths(&self, way: &Way) -> Vec<f64> {
        let leg = |pair: &[[f64; 5]]| {
            let [a, b] = [pair[0], pair[1]].map(|corner| self.tool(&way.start, corner));
            let grips = self.grip(&a) - self.grip(&b);
            let turned = wrap(pair[1][3] - pair[0][3]).abs() + (pair[1][4] - pair[0][4]).abs();
            grips.norm() + METRES_PER_RADIAN * turned
        };
        way.corners.windows(2).map(leg).collect()
    }
}
