//! How the hand moves: lines between poses, straight or a little arched, timed
//! so that it starts and stops gently.

use nalgebra::Isometry3;

/// A timed path of the end effector through poses in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolPath {
    legs: Vec<Leg>,
    end: Isometry3<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    start: Isometry3<f64>,
    end: Isometry3<f64>,
    begin: f64,
    seconds: f64,
    /// Height of the arch over the straight line, metres.
    rise: f64,
}

/// Metres that count as much as one radian of turning.
const METRES_PER_RADIAN: f64 = 0.3;
/// Shortest leg, seconds.
const SHORTEST: f64 = 0.3;
/// A smooth start and stop (fifth order) is faster in the middle than on
/// average by this factor.
const PEAK: f64 = 1.875;

impl ToolPath {
    /// A path from `start` through `stops`, each with the peak speed of the leg
    /// that leads to it, m/s.
    #[must_use]
    pub fn new(start: Isometry3<f64>, stops: &[(Isometry3<f64>, f64)]) -> Self {
        Self::arched(start, stops, 0.0)
    }

    /// The same, each leg arched upwards by the share `arch` of its length.
    #[must_use]
    pub fn arched(start: Isometry3<f64>, stops: &[(Isometry3<f64>, f64)], arch: f64) -> Self {
        let mut path = Self {
            legs: Vec::new(),
            end: start,
        };
        let mut begin = 0.0;
        for (end, speed) in stops {
            let length = distance(&path.end, end)
                .max(METRES_PER_RADIAN * path.end.rotation.angle_to(&end.rotation));
            let seconds = (PEAK * length / speed).max(SHORTEST);
            path.legs.push(Leg {
                start: path.end,
                end: *end,
                begin,
                seconds,
                rise: arch * distance(&path.end, end),
            });
            begin += seconds;
            path.end = *end;
        }
        path
    }

    /// Seconds from start to end.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.legs.last().map_or(0.0, |leg| leg.begin + leg.seconds)
    }

    /// Where it ends.
    #[must_use]
    pub fn end(&self) -> Isometry3<f64> {
        self.end
    }

    /// Where the hand is to be `time` seconds after the start.
    #[must_use]
    pub fn at(&self, time: f64) -> Isometry3<f64> {
        let after = self.legs.partition_point(|leg| leg.begin <= time);
        let Some(leg) = after.checked_sub(1).and_then(|i| self.legs.get(i)) else {
            return self.legs.first().map_or(self.end, |leg| leg.start);
        };
        let t = ((time - leg.begin) / leg.seconds).clamp(0.0, 1.0);
        // Starts and stops without speed and without acceleration.
        let share = t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
        let mut pose = leg.start.lerp_slerp(&leg.end, share);
        let arch = 4.0 * share * (1.0 - share);
        pose.translation.z += leg.rise * arch * arch;
        pose
    }
}

/// Distance of two poses' origins, metres.
#[must_use]
pub fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_path_passes_its_stops_and_keeps_its_speeds() {
        let at = |x: f64, yaw: f64| Isometry3::new(Vector3::new(x, 0.0, 0.0), Vector3::z() * yaw);
        let path = ToolPath::new(at(0.0, 0.0), &[(at(0.3, 0.5), 0.25), (at(0.4, 0.5), 0.1)]);
        assert!(distance(&path.at(-1.0), &at(0.0, 0.0)) < 1e-12);
        assert!(distance(&path.at(path.duration() + 1.0), &at(0.4, 0.5)) < 1e-12);
        let dt = 1.0 / 60.0;
        let mut passed = f64::INFINITY;
        for i in 0..(path.duration() / dt) as usize {
            let (a, b) = (path.at(i as f64 * dt), path.at((i + 1) as f64 * dt));
            let speed = distance(&a, &b) / dt;
            let limit = if a.translation.x < 0.299 {
                0.2501
            } else {
                0.1001
            };
            assert!(speed <= limit, "{speed} m/s at x = {}", a.translation.x);
            passed = passed.min(distance(&a, &at(0.3, 0.5)));
        }
        assert!(passed < 1e-3);
    }
}
