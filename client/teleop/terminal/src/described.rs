//! A robot for tests.

use wheelarm_proto::v1;

/// A robot: frames hand and chair, joints wheels, knuckle and arm, the arm's
/// base turned by half a turn.
pub(crate) fn robot() -> v1::RobotDescription {
    let frame = |name: &str, role: v1::FrameRole| v1::RobotFrame {
        name: name.to_owned(),
        role: role.into(),
        ..Default::default()
    };
    let joint = |role: v1::JointRole, arm_index| v1::RobotJoint {
        role: role.into(),
        arm_index,
        ..Default::default()
    };
    let wheels = [v1::JointRole::WheelLeft, v1::JointRole::WheelRight];
    let others = wheels.into_iter().chain([v1::JointRole::Knuckle]);
    let arm = (0..6).map(|index| joint(v1::JointRole::Arm, index));
    v1::RobotDescription {
        joints: others.map(|role| joint(role, 0)).chain(arm).collect(),
        frames: vec![
            frame("hand", v1::FrameRole::EndEffector),
            frame("chair", v1::FrameRole::Chair),
        ],
        arm_mount: Some(v1::Pose {
            position: Some(v1::Vector3 {
                x: 0.4,
                y: 0.3,
                z: 0.5,
            }),
            orientation: Some(v1::Quaternion {
                z: 1.0,
                ..Default::default()
            }),
        }),
        gripper: Some(v1::GripperDescription {
            max_knuckle: 0.8,
            ..Default::default()
        }),
        ..Default::default()
    }
}
