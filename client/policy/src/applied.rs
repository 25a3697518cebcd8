//! Computes the action of an image from the applied set points of every control tick.

use wheelarm_proto::robot::ARM_JOINTS;
use wheelarm_proto::v1;

use crate::action::ActionKind;
use crate::rotation::to_six;

/// Distance from the set points' pose beyond which a desired pose is a far goal that the
/// server approaches over time, metres. Behind a stream of poses at the arm's greatest speed
/// the set points lag by less (measured on the scripted operator: 0.06 m and 0.5 rad).
pub const NEAR_DISTANCE: f64 = 0.15;
/// The same for the rotation, rad.
pub const NEAR_ANGLE: f64 = 0.8;

/// The stream `applied` of an episode, one entry per control tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Applied {
    /// Stamps, s, rising.
    pub stamps: Vec<f64>,
    /// Set points of the arm's joints, rad.
    pub joints: Vec<[f64; ARM_JOINTS]>,
    /// Their speeds, rad/s.
    pub velocities: Vec<[f64; ARM_JOINTS]>,
    /// End effector in `base_link` at these set points: x y z, qx qy qz qw.
    pub hand: Vec<[f64; 7]>,
    /// Desired pose of the end effector in `base_link`.
    pub desired: Vec<[f64; 7]>,
    /// Speeds of the left and the right wheel, rad/s.
    pub wheels: [Vec<f64>; 2],
    /// Set point of the knuckle, rad.
    pub knuckle: Vec<f64>,
    /// Wheel radius and distance between the wheels, m.
    pub drive: [f64; 2],
    /// Greatest acceleration of the joints' set points, rad/s²; 0 when not known.
    pub acceleration: f64,
}

impl Applied {
    /// An empty stream with the constants of the robot.
    #[must_use]
    pub fn of(robot: &v1::RobotDescription) -> Self {
        let drive = robot.drive.unwrap_or_default();
        let arm = robot.arm.unwrap_or_default();
        Self {
            drive: [drive.wheel_radius, drive.track],
            acceleration: arm.joint_acceleration,
            ..Self::default()
        }
    }

    /// Action of the image at `from`, s; `to` is the time of the next image. The last image
    /// has none, and its action holds the set points. `None` without samples.
    #[must_use]
    pub fn action(&self, kind: ActionKind, from: f64, to: Option<f64>) -> Option<Vec<f64>> {
        let last = self.stamps.len().checked_sub(1)?;
        // Applied values hold after their stamp: the command of the last tick before the
        // next image is in force when that image is rendered.
        let index = |time: f64| self.stamps.partition_point(|&s| s < time - 1e-6).min(last);
        let at = index(to.unwrap_or(from));
        let commanded = index(to.unwrap_or(from)).saturating_sub(1);
        let [linear, angular] = to.map_or([0.0; 2], |_| self.motion(commanded));
        let rest = [self.knuckle[at], linear, angular];
        Some(match kind {
            ActionKind::NextPose => {
                let pose = match is_near(&self.desired[commanded], &self.hand[at]) {
                    true => self.desired[commanded],
                    false => self.hand[at],
                };
                let [x, y, z, qx, qy, qz, qw] = pose;
                let six = to_six([qx, qy, qz, qw]);
                [x, y, z].into_iter().chain(six).chain(rest).collect()
            }
            ActionKind::NextJoints => self.goal(at).into_iter().chain(rest).collect(),
            ActionKind::Applied => {
                let now = index(from);
                let wheels = [0, 1].map(|side| self.wheels[side][now]);
                let joints = self.joints[now].into_iter();
                joints.chain(wheels).chain([self.knuckle[now]]).collect()
            }
        })
    }

    /// The chair's forward speed, m/s, and turn rate, rad/s, at a sample. The server
    /// interpolates linearly between rows and reaches a row with the last tick before the
    /// next image, so the trapezoid rule gives the recorded path. Means until the next image
    /// would be reached half a row late.
    fn motion(&self, at: usize) -> [f64; 2] {
        let [left, right] = [0, 1].map(|side| self.wheels[side][at]);
        let [radius, track] = self.drive;
        [
            (right + left) / 2.0 * radius,
            (right - left) / track * radius,
        ]
    }

    /// Rest position of the joints when they brake now: the goal that
    /// the server's profile follows so closely, rad.
    fn goal(&self, at: usize) -> [f64; ARM_JOINTS] {
        let (now, speed) = (self.joints[at], self.velocities[at]);
        let fastest = speed.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let seconds = match self.acceleration > 0.0 {
            true => fastest / (2.0 * self.acceleration),
            false => 0.0,
        };
        std::array::from_fn(|i| now[i] + speed[i] * seconds)
    }
}

/// Whether a desired pose is one of a stream; not when it is not a number.
fn is_near(desired: &[f64; 7], hand: &[f64; 7]) -> bool {
    let apart = (0..3).map(|k| (desired[k] - hand[k]).powi(2)).sum::<f64>();
    let dot: f64 = (3..7).map(|k| desired[k] * hand[k]).sum();
    // The cosine of half the angle between them.
    let (sin, cos) = (dot * dot - 1.0, dot.abs());
    let half = wheelarm_proto::exact::atan2((-sin).max(0.0).sqrt(), cos);
    apart.sqrt() <= NEAR_DISTANCE && 2.0 * half <= NEAR_ANGLE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half a second of control ticks: the hand moves along x by 6 mm per tick, the chair
    /// accelerates evenly.
    fn applied() -> Applied {
        let count = 31_u32;
        let tick = |k: u32| f64::from(k);
        let pose = |x: f64| [x, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0];
        let all = || (0..count).map(tick);
        Applied {
            stamps: all().map(|k| k / 60.0).collect(),
            joints: all().map(|k| [0.01 * k; 6]).collect(),
            velocities: vec![[0.6; 6]; 31],
            hand: all().map(|k| pose(0.006 * k)).collect(),
            desired: all().map(|k| pose(0.006 * k + 0.01)).collect(),
            wheels: [0.0, 1.0].map(|more| all().map(|k| 0.1 * k + more).collect()),
            knuckle: all().map(|k| 0.02 * k).collect(),
            drive: [0.2, 0.5],
            acceleration: 5.0,
        }
    }

    fn near(found: &[f64], wanted: &[f64]) {
        let fits = found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(fits && found.len() == wanted.len(), "{found:?}, {wanted:?}");
    }

    #[test]
    fn action_holds_the_set_points_of_the_next_image() {
        let all = applied();
        let row = |kind, from, to| all.action(kind, from, to).unwrap();
        let pose = row(ActionKind::NextPose, 0.1, Some(0.2));
        // Commanded with the tick before the next image, the twelfth.
        near(&pose[..9], &[0.076, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        // The left wheel turns at 1.1 rad/s by then, the right one 1 rad/s faster.
        let rest = [0.24, 1.6 * 0.2, 0.4];
        near(&pose[9..], &rest);
        let joints = row(ActionKind::NextJoints, 0.1, Some(0.2));
        near(&joints[..6], &[0.12 + 0.6 * 0.06; 6]);
        near(&joints[6..], &rest);
        let applied = row(ActionKind::Applied, 0.1, Some(0.2));
        near(&applied[5..], &[0.06, 0.6, 1.6, 0.12]);
        assert_eq!(
            Applied::default().action(ActionKind::Applied, 0.0, None),
            None
        );
    }

    #[test]
    fn linear_interpolation_of_speeds_reproduces_the_recorded_path() {
        let all = applied();
        let speed = |at: usize| all.motion(at)[0];
        // The row at 0.1 s is in force from the sixth tick on and reached by the
        // eleventh; what was in force before is what the row before reached.
        let row = |i: u32| {
            let from = f64::from(i) / 10.0;
            let row = all.action(ActionKind::NextJoints, from, Some(from + 0.1));
            row.unwrap()[7]
        };
        for i in 1..5 {
            for k in 1..=6_u32 {
                let (last, now) = (row(i - 1), row(i));
                let played = last + (now - last) * f64::from(k) / 6.0;
                let tick = usize::try_from(6 * i + k - 1).unwrap();
                assert!((played - speed(tick)).abs() < 1e-12, "{i}, {k}");
            }
        }
    }

    #[test]
    fn last_row_holds_and_far_goals_are_approached() {
        let mut all = applied();
        let last = all.action(ActionKind::NextPose, 0.5, None).unwrap();
        near(&last[9..], &[0.6, 0.0, 0.0]);
        for pose in &mut all.desired {
            pose[0] += 0.3;
        }
        let row = all.action(ActionKind::NextPose, 0.1, Some(0.2)).unwrap();
        near(&row[..3], &[0.072, 0.0, 0.5]);
        all.desired[11] = [f64::NAN; 7];
        let row = all.action(ActionKind::NextPose, 0.1, Some(0.2)).unwrap();
        assert!(row.iter().all(|v| v.is_finite()));
    }

    #[test]
    fn rotation_is_near_by_its_angle() {
        let (sin, cos) = wheelarm_proto::exact::sin_cos(0.39);
        let pose = |z: f64, w: f64| [0.0, 0.0, 0.0, 0.0, 0.0, z, w];
        assert!(is_near(&pose(sin, cos), &pose(0.0, 1.0)));
        assert!(is_near(&pose(-sin, -cos), &pose(0.0, 1.0)));
        let (sin, cos) = wheelarm_proto::exact::sin_cos(0.41);
        assert!(!is_near(&pose(sin, cos), &pose(0.0, 1.0)));
    }
}
