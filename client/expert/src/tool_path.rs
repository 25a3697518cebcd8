//! Path of the hand: lines between poses, straight or bowed, timed to start and stop
//! gently. Legs may overlap: the next one begins before the previous one has ended.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use wheelarm_proto::exact;

/// A timed path of the end effector through poses in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolPath {
    start: Isometry3<f64>,
    legs: Vec<Leg>,
    end: Isometry3<f64>,
}

/// The shape of a path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shape {
    /// Bow of a leg, as a share of its length, and its side, radians: 0 is up, positive
    /// to the left of the leg.
    pub bow: [f64; 2],
    /// A leg begins before the end of the one before, by this share of the shorter one.
    pub overlap: f64,
    /// The last leg does not bow.
    pub straight_end: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    step: Vector3<f64>,
    turn: UnitQuaternion<f64>,
    begin: f64,
    seconds: f64,
    /// Off the straight line in the middle of the leg, metres.
    bow: Vector3<f64>,
}

impl Leg {
    fn share(&self, time: f64) -> f64 {
        let t = ((time - self.begin) / self.seconds).clamp(0.0, 1.0);
        // Starts and stops without speed and without acceleration.
        t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
    }
}

/// Metres that count as much as one radian of turning.
const METRES_PER_RADIAN: f64 = 0.3;
/// Shortest leg, seconds.
const SHORTEST: f64 = 0.3;
/// A smooth start and stop (fifth order) is faster in the middle than on
/// average by this factor.
const PEAK: f64 = 1.875;
/// A bowed leg is longer than a straight one by this, times the square of its share.
const LONGER: f64 = 2.44;
/// Distance between poses of a path at which it is checked, metres.
const SPACING: f64 = 0.04;

impl ToolPath {
    /// A path from `start` through `stops`, each with the peak speed of the leg
    /// that leads to it, m/s.
    #[must_use]
    pub fn new(start: Isometry3<f64>, stops: &[(Isometry3<f64>, f64)]) -> Self {
        Self::shaped(start, stops, &Shape::default())
    }

    /// The same, in a shape.
    #[must_use]
    pub fn shaped(start: Isometry3<f64>, stops: &[(Isometry3<f64>, f64)], shape: &Shape) -> Self {
        let mut path = Self {
            start,
            legs: Vec::new(),
            end: start,
        };
        let [share, angle] = shape.bow;
        for (index, (end, speed)) in stops.iter().enumerate() {
            let share = match shape.straight_end && index + 1 == stops.len() {
                true => 0.0,
                false => share,
            };
            let straight = distance(&path.end, end) * (1.0 + LONGER * share * share);
            let length =
                straight.max(METRES_PER_RADIAN * path.end.rotation.angle_to(&end.rotation));
            let seconds = (PEAK * length / speed).max(SHORTEST);
            let step = end.translation.vector - path.end.translation.vector;
            let begin = path.legs.last().map_or(0.0, |leg| {
                leg.begin + leg.seconds - shape.overlap * leg.seconds.min(seconds)
            });
            path.legs.push(Leg {
                step,
                turn: path.end.rotation.inverse() * end.rotation,
                begin,
                seconds,
                bow: bowed(&step, angle) * share,
            });
            path.end = *end;
        }
        path
    }

    /// Seconds from start to end.
    #[must_use]
    pub fn duration(&self) -> f64 {
        let ends = self.legs.iter().map(|leg| leg.begin + leg.seconds);
        ends.fold(0.0, f64::max)
    }

    /// When its last leg begins, seconds.
    #[must_use]
    pub fn last_leg(&self) -> f64 {
        self.legs.last().map_or(0.0, |leg| leg.begin)
    }

    /// Final pose.
    #[must_use]
    pub fn end(&self) -> Isometry3<f64> {
        self.end
    }

    /// Pose of the hand `time` seconds after the start.
    #[must_use]
    pub fn at(&self, time: f64) -> Isometry3<f64> {
        if time >= self.duration() {
            return self.end;
        }
        let mut pose = self.start;
        for leg in &self.legs {
            let share = leg.share(time);
            let arch = 4.0 * share * (1.0 - share);
            pose.translation.vector += leg.step * share + leg.bow * (arch * arch);
            pose.rotation *= UnitQuaternion::identity().slerp(&leg.turn, share);
        }
        pose
    }

    /// Poses along the path at which it is checked, with both ends.
    #[must_use]
    pub fn poses(&self) -> Vec<Isometry3<f64>> {
        let length: f64 = self.legs.iter().map(|leg| leg.step.norm()).sum();
        // Even in time: fast parts are up to twice as far apart.
        let count = (PEAK * length / SPACING).ceil().max(4.0);
        let at = |i: usize| self.at(self.duration() * i as f64 / count);
        (0..=count as usize).map(at).collect()
    }
}

/// The unit vector to which a leg bows, times its length.
fn bowed(step: &Vector3<f64>, angle: f64) -> Vector3<f64> {
    let left = Vector3::z().cross(step);
    // A vertical step has no left side: use x.
    let left = match left.norm() < 0.2 * step.norm() {
        true => Vector3::x(),
        false => left,
    };
    let up = step.cross(&left);
    let length = step.norm();
    let unit = |v: Vector3<f64>| v / v.norm().max(1e-12);
    let (sin, cos) = exact::sin_cos(angle);
    (unit(up) * cos + unit(left) * sin) * length
}

/// Distance of two poses' origins, metres.
#[must_use]
pub fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn path_passes_its_stops_and_keeps_its_speeds() {
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

    #[test]
    fn bowed_overlapping_legs_are_shorter_in_time_and_longer_in_space() {
        let at = |x: f64, z: f64| Isometry3::translation(x, 0.0, z);
        let stops = [(at(0.4, 0.0), 0.25), (at(0.4, -0.1), 0.1)];
        let straight = ToolPath::new(at(0.0, 0.0), &stops);
        let length = |path: &ToolPath| -> f64 {
            let poses: Vec<_> = (0..=400)
                .map(|i| path.at(path.duration() * f64::from(i) / 400.0))
                .collect();
            poses.windows(2).map(|w| distance(&w[0], &w[1])).sum()
        };
        assert!((length(&straight) - 0.5).abs() < 1e-3);
        let bowed = Shape {
            bow: [0.2, 0.7],
            ..Shape::default()
        };
        let bowed = ToolPath::shaped(at(0.0, 0.0), &stops, &bowed);
        let longer = length(&bowed) / length(&straight);
        assert!((1.06..1.12).contains(&longer), "{longer}");
        let blended = Shape {
            overlap: 0.4,
            ..Shape::default()
        };
        let blended = ToolPath::shaped(at(0.0, 0.0), &stops, &blended);
        assert!(blended.duration() < straight.duration());
        assert!(length(&blended) < 0.495);
        for path in [&straight, &bowed, &blended] {
            assert!(distance(&path.at(path.duration()), &at(0.4, -0.1)) < 1e-12);
        }
    }

    #[test]
    fn turns_of_overlapping_legs_are_continuous_up_to_the_end() {
        let at =
            |x: f64, turn: [f64; 3]| Isometry3::new(Vector3::new(x, 0.0, 0.0), Vector3::from(turn));
        let stops = [
            (at(0.2, [0.3, 0.9, -0.2]), 0.2),
            (at(0.4, [1.2, 0.1, 0.5]), 0.2),
        ];
        for overlap in [0.0, 0.4] {
            let shape = Shape {
                overlap,
                ..Shape::default()
            };
            let path = ToolPath::shaped(at(0.0, [0.0, 0.4, 0.0]), &stops, &shape);
            let mut before = path.at(0.0);
            for i in 1..=600 {
                let pose = path.at((path.duration() + 0.1) * f64::from(i) / 600.0);
                let turned = before.rotation.angle_to(&pose.rotation);
                assert!(turned < 0.02, "{turned} at {i}");
                before = pose;
            }
            assert!(before.rotation.angle_to(&stops[1].0.rotation) < 1e-9);
        }
    }
}
