//! The robot from its description: indices of joints and frames by role, and the
//! gripper's linkage.
//!
//! This module contains no name and no number of a robot.

use crate::check::{self, Invalid};
use crate::exact;
use crate::v1::{self, FrameRole, JointRole};

/// Joints of the arm.
pub const ARM_JOINTS: usize = 6;

/// Indices of joints and frames in `JointState` and `PoseSet`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Roles {
    /// Joints of the arm, from base to hand, among the recorded joints.
    pub arm: [usize; ARM_JOINTS],
    /// Left and right driven wheel among the recorded joints.
    pub wheels: [usize; 2],
    /// The commanded knuckle among the recorded joints.
    pub knuckle: usize,
    /// The chair among the recorded frames.
    pub chair: usize,
    /// The end effector among the recorded frames.
    pub end_effector: usize,
}

impl Roles {
    /// Finds every role, once.
    ///
    /// # Errors
    /// [`Invalid::Word`] that names the robot and the role, when none or several have
    /// it.
    pub fn find(robot: &v1::RobotDescription) -> Result<Self, Invalid> {
        let joint = |role: JointRole, index: Option<u32>| {
            let fits = |joint: &v1::RobotJoint| {
                joint.role() == role && index.is_none_or(|index| joint.arm_index == index)
            };
            let word = || match index {
                Some(index) => format!("{} {index}", role.as_str_name()),
                None => role.as_str_name().to_owned(),
            };
            only(&robot.joints, fits).ok_or_else(|| amiss("role of a joint", word()))
        };
        let frame = |role: FrameRole| {
            only(&robot.frames, |frame| frame.role() == role)
                .ok_or_else(|| amiss("role of a frame", role.as_str_name().to_owned()))
        };
        let mut arm = [0; ARM_JOINTS];
        for (index, slot) in (0..).zip(&mut arm) {
            *slot = joint(JointRole::Arm, Some(index))?;
        }
        Ok(Self {
            arm,
            wheels: [
                joint(JointRole::WheelLeft, None)?,
                joint(JointRole::WheelRight, None)?,
            ],
            knuckle: joint(JointRole::Knuckle, None)?,
            chair: frame(FrameRole::Chair)?,
            end_effector: frame(FrameRole::EndEffector)?,
        })
    }

    /// Values of the arm's joints among those of all recorded joints; `None` when some
    /// are missing.
    #[must_use]
    pub fn arm_of(&self, joints: &[f64]) -> Option<[f64; ARM_JOINTS]> {
        let mut arm = [0.0; ARM_JOINTS];
        for (slot, &index) in arm.iter_mut().zip(&self.arm) {
            *slot = *joints.get(index)?;
        }
        Some(arm)
    }
}

impl v1::ScannerDescription {
    /// Angle of the last ray, radians.
    #[must_use]
    pub fn last_angle(&self) -> f64 {
        self.first_angle + self.angle_step * f64::from(self.rays.saturating_sub(1))
    }
}

fn only<T>(list: &[T], fits: impl Fn(&T) -> bool) -> Option<usize> {
    let mut found = list.iter().enumerate().filter(|(_, item)| fits(item));
    let (index, _) = found.next()?;
    found.next().is_none().then_some(index)
}

fn amiss(what: &'static str, value: String) -> Invalid {
    Invalid::Word {
        what,
        value,
        expected: "exactly one in the robot's description; is the server of this version?",
    }
}

impl v1::RobotDescription {
    /// Names of the recorded joints, in the order of `JointState`.
    pub fn joint_names(&self) -> impl Iterator<Item = &str> {
        self.joints.iter().map(|joint| joint.name.as_str())
    }

    /// Names of the recorded frames, in the order of `PoseSet`.
    pub fn frame_names(&self) -> impl Iterator<Item = &str> {
        self.frames.iter().map(|frame| frame.name.as_str())
    }

    /// Names of the arm's joints, from base to hand.
    #[must_use]
    pub fn arm_joint_names(&self) -> Vec<&str> {
        let mut arm: Vec<&v1::RobotJoint> = self
            .joints
            .iter()
            .filter(|joint| joint.role() == JointRole::Arm)
            .collect();
        arm.sort_by_key(|joint| joint.arm_index);
        arm.iter().map(|joint| joint.name.as_str()).collect()
    }

    /// The gripper; zero when the description has none.
    #[must_use]
    pub fn gripper_or_default(&self) -> v1::GripperDescription {
        self.gripper.clone().unwrap_or_default()
    }

    /// Distance between the pads at a knuckle angle, rad, metres; `None`
    /// without a gripper.
    #[must_use]
    pub fn opening(&self, knuckle: f64) -> Option<f64> {
        Some(self.gripper.as_ref()?.linkage.as_ref()?.opening(knuckle))
    }
}

impl v1::GripperLinkage {
    /// Distance between the pads, metres, at a knuckle angle, rad; slightly below 0
    /// beyond the angle at which they meet.
    #[must_use]
    pub fn opening(&self, knuckle: f64) -> f64 {
        let (sin, cos) = exact::sin_cos(knuckle);
        2.0 * (self.pin_x + self.crank_x * cos - self.crank_z * sin - self.pad_x)
    }

    /// Knuckle angle, rad, at which the pads are `opening` metres apart; clamped to the
    /// linkage's range.
    #[must_use]
    pub fn knuckle(&self, opening: f64) -> f64 {
        let length = exact::hypot(self.crank_x, self.crank_z);
        let across = (opening / 2.0 + self.pad_x - self.pin_x) / length;
        exact::atan2(self.crank_x, self.crank_z) - exact::asin(across.clamp(-1.0, 1.0))
    }

    /// A point of the left crank at a knuckle angle, rad: `point` is relative to the
    /// knuckle's axis at angle 0, the result to the end effector, x and z, metres.
    #[must_use]
    pub fn turned(&self, point: [f64; 2], knuckle: f64) -> [f64; 2] {
        let (sin, cos) = exact::sin_cos(knuckle);
        [
            self.pin_x + point[0] * cos - point[1] * sin,
            self.pin_z + point[0] * sin + point[1] * cos,
        ]
    }

    /// Axis of the left finger tip at a knuckle angle, rad: x and z relative to the end
    /// effector, metres.
    #[must_use]
    pub fn tip(&self, knuckle: f64) -> [f64; 2] {
        self.turned([self.crank_x, self.crank_z], knuckle)
    }
}

impl v1::GripperDescription {
    /// Checks a gripper command against its ranges.
    ///
    /// # Errors
    /// [`Invalid`] that names the field and the range.
    pub fn check(&self, command: &v1::GripperCommand) -> Result<(), Invalid> {
        use v1::gripper_command::Target;
        match &command.target {
            Some(Target::Opening(metres)) => {
                check::within("gripper opening", *metres, 0.0, self.stroke)?;
            }
            Some(Target::Knuckle(radians)) => {
                check::within("gripper knuckle angle", *radians, 0.0, self.max_knuckle)?;
            }
            None => return Err(Invalid::Missing("gripper target")),
        }
        if let Some(cap) = command.max_force {
            check::within("gripper force", cap, 0.0, self.max_force)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> v1::RobotDescription {
        let joint = |name: &str, role: JointRole, arm_index| v1::RobotJoint {
            name: name.to_owned(),
            role: role.into(),
            arm_index,
            ..v1::RobotJoint::default()
        };
        let frame = |name: &str, role: FrameRole| v1::RobotFrame {
            name: name.to_owned(),
            role: role.into(),
            ..v1::RobotFrame::default()
        };
        v1::RobotDescription {
            joints: vec![
                joint("f", JointRole::Arm, 5),
                joint("grip", JointRole::Knuckle, 0),
                joint("e", JointRole::Arm, 4),
                joint("d", JointRole::Arm, 3),
                joint("right", JointRole::WheelRight, 0),
                joint("c", JointRole::Arm, 2),
                joint("b", JointRole::Arm, 1),
                joint("left", JointRole::WheelLeft, 0),
                joint("a", JointRole::Arm, 0),
            ],
            frames: vec![
                frame("hand", FrameRole::EndEffector),
                frame("elbow", FrameRole::ArmLink),
                frame("chair", FrameRole::Chair),
            ],
            ..v1::RobotDescription::default()
        }
    }

    #[test]
    fn roles_are_found_in_any_order() {
        let robot = robot();
        let roles = Roles::find(&robot).unwrap();
        assert_eq!(roles.arm, [8, 6, 5, 3, 2, 0]);
        assert_eq!((roles.wheels, roles.knuckle), ([7, 4], 1));
        assert_eq!((roles.chair, roles.end_effector), (2, 0));
        assert_eq!(robot.arm_joint_names(), ["a", "b", "c", "d", "e", "f"]);
        let values: Vec<f64> = (0..9).map(f64::from).collect();
        assert_eq!(roles.arm_of(&values), Some([8.0, 6.0, 5.0, 3.0, 2.0, 0.0]));
        assert_eq!(roles.arm_of(&values[..8]), None);
    }

    #[test]
    fn a_missing_or_repeated_role_is_named() {
        let mut without = robot();
        without.joints.remove(1);
        let message = Roles::find(&without).unwrap_err().to_string();
        assert!(message.contains("JOINT_ROLE_KNUCKLE"), "{message}");
        let mut twice = robot();
        twice.joints[3].arm_index = 2;
        let message = Roles::find(&twice).unwrap_err().to_string();
        assert!(message.contains("JOINT_ROLE_ARM 2"), "{message}");
    }

    #[test]
    fn the_linkage_maps_openings_to_angles_and_back() {
        let linkage = v1::GripperLinkage {
            pin_x: 0.03,
            pin_z: 0.055,
            crank_x: 0.037,
            crank_z: 0.043,
            pad_x: 0.025,
            pad_z: 0.03,
            pad_half: 0.02,
        };
        for opening in [0.0, 0.02, 0.05, 0.08] {
            let knuckle = linkage.knuckle(opening);
            assert!((linkage.opening(knuckle) - opening).abs() < 1e-12);
            let tip = linkage.tip(knuckle);
            assert!((2.0 * (tip[0] - linkage.pad_x) - opening).abs() < 1e-12);
        }
    }

    #[test]
    fn commands_beyond_the_gripper_are_rejected() {
        use v1::gripper_command::Target;
        let gripper = v1::GripperDescription {
            stroke: 0.1,
            max_knuckle: 0.7,
            max_force: 50.0,
            ..v1::GripperDescription::default()
        };
        let request = |target, max_force| {
            let target = Some(target);
            gripper.check(&v1::GripperCommand { target, max_force })
        };
        assert_eq!(request(Target::Opening(0.1), Some(50.0)), Ok(()));
        for (target, force, word) in [
            (Target::Opening(0.101), None, "opening"),
            (Target::Knuckle(-0.1), None, "knuckle"),
            (Target::Knuckle(0.71), None, "knuckle"),
            (Target::Opening(0.0), Some(51.0), "force"),
        ] {
            let message = request(target, force).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
    }
}
