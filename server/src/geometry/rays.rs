//! Rays of a scanner in one plane.

use std::f64::consts::TAU;

/// Rays of a scanner: ray `i` points to the angle `first + i * step` about z of the
/// scanner's frame, from x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rays {
    /// Angle of the first ray, rad.
    pub first: f64,
    /// Angle between two rays, rad.
    pub step: f64,
    /// Rays of a scan.
    pub count: usize,
    /// Greatest distance, metres.
    pub greatest: f64,
}

impl Rays {
    /// Angle of a ray, rad.
    #[must_use]
    pub fn angle(&self, ray: usize) -> f64 {
        self.first + self.step * ray as f64
    }

    /// The rays whose angles are from `from` to `to`, rad; `to - from` is below a turn.
    pub fn between(&self, from: f64, to: f64) -> impl Iterator<Item = usize> {
        // Once around and back, whatever the first angle is.
        let turns = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|turns| turns * TAU);
        let (rays, count) = (*self, self.count as f64);
        turns.into_iter().flat_map(move |turn| {
            let place = |angle: f64| (angle + turn - rays.first) / rays.step;
            let least = place(from).ceil().max(0.0);
            let end = (place(to).floor() + 1.0).min(count);
            match least < end {
                true => least as usize..end as usize,
                false => 0..0,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn rays_between_two_angles_are_found_over_the_seam() {
        let rays = Rays {
            first: -PI,
            step: TAU / 8.0,
            count: 8,
            greatest: 1.0,
        };
        let between = |from: f64, to: f64| {
            let mut all: Vec<_> = rays.between(from, to).collect();
            all.sort_unstable();
            all
        };
        assert_eq!(between(-0.1, 0.1), [4]);
        assert_eq!(between(PI - 1.0, PI + 1.0), [0, 1, 7]);
        assert_eq!(between(3.0 * PI - 1.0, 3.0 * PI + 1.0), [0, 1, 7]);
        assert_eq!(between(0.1, 0.2), [0; 0]);
        assert_eq!(between(-PI, PI - 1e-9).len(), 8);
        let half = Rays { count: 4, ..rays };
        assert_eq!(half.between(-PI - 0.1, -PI + 0.1).collect::<Vec<_>>(), [0]);
    }
}
