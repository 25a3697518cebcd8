//! Roles of joints and links, resolved once from `robot.toml`. No other part of the
//! server contains a joint's name.

use super::settings::{FrameRole, JointRole};

/// Joints of the arm.
pub const ARM_JOINTS: usize = 6;

/// Indices into `RobotModel::joints` and `RobotModel::links`. Pairs are left, right.
#[derive(Clone, Debug, PartialEq)]
pub struct Roles {
    /// Recorded joints, in their order.
    pub joints: Vec<RecordedJoint>,
    /// Recorded frames, in their order.
    pub frames: Vec<RecordedFrame>,
    /// Joints of the arm, from base to hand.
    pub arm: [usize; ARM_JOINTS],
    /// Joints of the driven wheels.
    pub wheels: [usize; 2],
    /// Joints of the passive wheels.
    pub casters: [usize; 2],
    /// Joints of the knuckles; the left one is commanded.
    pub knuckles: [usize; 2],
    /// Joints of the finger tips.
    pub finger_tips: [usize; 2],
    /// Joints of the inner knuckles.
    pub inner_knuckles: [usize; 2],
    /// Link of the arm's base.
    pub arm_base: usize,
    /// Link of the end effector.
    pub end_effector: usize,
    /// Link of the IMU.
    pub imu: usize,
}

/// A joint that is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedJoint {
    /// Index.
    pub joint: usize,
    /// Role.
    pub role: JointRole,
}

/// A frame that is recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedFrame {
    /// Short name.
    pub name: String,
    /// Link in which its pose is expressed; `None` for the house.
    pub parent: Option<usize>,
    /// Link of the pose.
    pub link: usize,
    /// Role.
    pub role: FrameRole,
}

/// A role as written in `robot.toml`.
fn word(role: impl std::fmt::Debug) -> String {
    let mut word = String::new();
    for c in format!("{role:?}").chars() {
        if c.is_ascii_uppercase() && !word.is_empty() {
            word.push('_');
        }
        word.push(c.to_ascii_lowercase());
    }
    word
}

impl Roles {
    /// Finds every role among the recorded joints.
    ///
    /// # Errors
    /// The role that not exactly one joint has, or the arm when it does not have six.
    pub(super) fn find(
        joints: Vec<RecordedJoint>,
        frames: Vec<RecordedFrame>,
        [arm_base, end_effector, imu]: [usize; 3],
    ) -> Result<Roles, String> {
        let of = |role: JointRole| {
            joints
                .iter()
                .filter(move |joint| joint.role == role)
                .map(|joint| joint.joint)
        };
        let one = |role: JointRole| {
            let found: Vec<usize> = of(role).collect();
            match found[..] {
                [joint] => Ok(joint),
                _ => Err(format!("{} joints of the role {}", found.len(), word(role))),
            }
        };
        let pair = |left, right| Ok::<_, String>([one(left)?, one(right)?]);
        let mut arm: Vec<usize> = of(JointRole::Arm).collect();
        // Parents precede children.
        arm.sort_unstable();
        let found = arm.len();
        let arm = arm
            .try_into()
            .map_err(|_| format!("{found} joints of the role arm"))?;
        for role in [FrameRole::Chair, FrameRole::EndEffector] {
            let found = frames.iter().filter(|frame| frame.role == role).count();
            if found != 1 {
                return Err(format!("{found} frames of the role {}", word(role)));
            }
        }
        Ok(Roles {
            arm,
            wheels: pair(JointRole::WheelLeft, JointRole::WheelRight)?,
            casters: pair(JointRole::CasterLeft, JointRole::CasterRight)?,
            knuckles: pair(JointRole::Knuckle, JointRole::KnuckleRight)?,
            finger_tips: pair(JointRole::FingerTipLeft, JointRole::FingerTipRight)?,
            inner_knuckles: pair(JointRole::InnerKnuckleLeft, JointRole::InnerKnuckleRight)?,
            joints,
            frames,
            arm_base,
            end_effector,
            imu,
        })
    }

    /// Index of a joint in the arm, from base to hand, if it is one of the arm's.
    #[must_use]
    pub fn arm_index(&self, joint: usize) -> Option<usize> {
        self.arm.iter().position(|&arm| arm == joint)
    }
}
