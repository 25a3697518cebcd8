//! The state row: proprioception of the real robot. It does not contain the true pose of the
//! chair in the house.

use wheelarm_proto::robot::ARM_JOINTS;
use wheelarm_proto::v1;

use crate::rotation::to_six;

/// Values of a row of state.
pub const STATE: usize = 27;

/// Measurements of a robot at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observed {
    /// Positions of the arm's joints, rad.
    pub joints: [f64; ARM_JOINTS],
    /// Their velocities, rad/s.
    pub velocities: [f64; ARM_JOINTS],
    /// Position, rad, and velocity, rad/s, of the knuckle.
    pub knuckle: [f64; 2],
    /// End effector in `base_link`: x y z, m, and qx qy qz qw.
    pub hand: [f64; 7],
    /// Pose by odometry: x y z, m, and qx qy qz qw, in any frame.
    pub odometry: [f64; 7],
    /// That pose where the policy began, in the same frame.
    pub start: [f64; 7],
}

/// Names of the values of [`state`].
#[must_use]
pub fn state_names(robot: &v1::RobotDescription) -> Vec<String> {
    let joints = robot.arm_joint_names();
    let of = |what: &'static str| joints.iter().map(move |joint| format!("{joint}.{what}"));
    let rest = [
        "knuckle.position",
        "knuckle.velocity",
        "hand.x",
        "hand.y",
        "hand.z",
    ];
    let odometry = ["x", "y", "cos", "sin"].map(|part| format!("odometry.{part}"));
    of("position")
        .chain(of("velocity"))
        .chain(rest.map(String::from))
        .chain(SIX.map(|part| format!("hand.{part}")))
        .chain(odometry)
        .collect()
}

/// Names of the six numbers of a rotation.
pub(crate) const SIX: [&str; 6] = ["xx", "xy", "xz", "yx", "yy", "yz"];

/// Units of the values of [`state`], in their order.
pub fn state_units() -> impl Iterator<Item = &'static str> {
    let runs = [
        ("rad", ARM_JOINTS),
        ("rad/s", ARM_JOINTS),
        ("rad", 1),
        ("rad/s", 1),
        ("m", 3),
        ("1", 6),
        ("m", 2),
        ("1", 2),
    ];
    runs.into_iter()
        .flat_map(|(unit, count)| std::iter::repeat_n(unit, count))
}

/// The row: joints 6 + 6, knuckle 2, hand 3 + 6 (see [`to_six`]), odometry since
/// the start: x, y, cosine and sine of the yaw.
#[must_use]
pub fn state(observed: &Observed) -> [f64; STATE] {
    let mut out = [0.0; STATE];
    let (from, to) = (heading(&observed.start), heading(&observed.odometry));
    let away = [0, 1].map(|k| observed.odometry[k] - observed.start[k]);
    let [cos, sin] = from;
    let since = [
        cos * away[0] + sin * away[1],
        cos * away[1] - sin * away[0],
        cos * to[0] + sin * to[1],
        cos * to[1] - sin * to[0],
    ];
    let [x, y, z, qx, qy, qz, qw] = observed.hand;
    let values = observed.joints.into_iter().chain(observed.velocities);
    let values = values.chain(observed.knuckle).chain([x, y, z]);
    let values = values.chain(to_six([qx, qy, qz, qw])).chain(since);
    for (slot, value) in out.iter_mut().zip(values) {
        *slot = value;
    }
    out
}

/// Cosine and sine of the yaw of a pose.
fn heading(&[_, _, _, x, y, z, w]: &[f64; 7]) -> [f64; 2] {
    let (cos, sin) = (1.0 - 2.0 * (y * y + z * z), 2.0 * (w * z + x * y));
    let norm = (cos * cos + sin * sin).sqrt();
    [cos / norm, sin / norm]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn yawed(x: f64, y: f64, yaw: f64) -> [f64; 7] {
        let (sin, cos) = wheelarm_proto::exact::sin_cos(yaw / 2.0);
        [x, y, 0.0, 0.0, 0.0, sin, cos]
    }

    #[test]
    fn odometry_is_relative_to_the_start_of_the_policy() {
        let mut observed = Observed {
            joints: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            velocities: [0.1; 6],
            knuckle: [0.3, 0.4],
            hand: [0.5, 0.6, 0.7, 0.0, 0.0, 0.0, 1.0],
            odometry: yawed(2.0, 5.0, 2.5),
            start: yawed(2.0, 3.0, FRAC_PI_2),
        };
        let row = state(&observed);
        assert_eq!(row[..6], observed.joints);
        assert_eq!(row[12..17], [0.3, 0.4, 0.5, 0.6, 0.7]);
        assert_eq!(row[17..23], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        // Two metres ahead of a chair that looked along y.
        let (sin, cos) = wheelarm_proto::exact::sin_cos(2.5 - FRAC_PI_2);
        let wanted = [2.0, 0.0, cos, sin];
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(&row[23..], &wanted), "{row:?}");
        // Independent of the origin of the odometry.
        observed.odometry = yawed(7.0, 1.0, 0.4);
        observed.start = observed.odometry;
        assert!(near(&state(&observed)[23..], &[0.0, 0.0, 1.0, 0.0]));
    }

    #[test]
    fn every_value_has_a_name_and_a_unit() {
        let arm = |i| v1::RobotJoint {
            name: format!("j{i}"),
            role: v1::JointRole::Arm.into(),
            arm_index: i,
            ..Default::default()
        };
        let robot = v1::RobotDescription {
            joints: (0..6).rev().map(arm).collect(),
            ..Default::default()
        };
        let names = state_names(&robot);
        assert_eq!((names.len(), state_units().count()), (STATE, STATE));
        assert_eq!([&names[0], &names[11]], ["j0.position", "j5.velocity"]);
    }
}
