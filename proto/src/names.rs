//! Names that stand in files and messages, in their one order.

/// The 16 recorded joints, in the order of `JointState` and of every file.
pub const JOINT_NAMES: [&str; 16] = [
    "back_left_wheel_joint",
    "back_right_wheel_joint",
    "front_left_wheel_joint",
    "front_right_wheel_joint",
    "joint_1",
    "joint_2",
    "joint_3",
    "joint_4",
    "joint_5",
    "joint_6",
    "left_inner_knuckle_finger_tip_joint",
    "right_inner_knuckle_finger_tip_joint",
    "robotiq_85_left_finger_tip_joint",
    "robotiq_85_left_knuckle_joint",
    "robotiq_85_right_finger_tip_joint",
    "robotiq_85_right_knuckle_joint",
];

/// One frame of `PoseSet`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Short name, used in datasets.
    pub name: &'static str,
    /// Frame in which the pose is expressed.
    pub parent: &'static str,
    /// Link of the robot whose pose it is.
    pub link: &'static str,
}

const fn frame(name: &'static str, parent: &'static str, link: &'static str) -> Frame {
    Frame { name, parent, link }
}

/// The recorded frames, in the order of `PoseSet`.
pub const FRAMES: [Frame; 7] = [
    frame("wheelchair", "house", "wheelchair_root"),
    frame("shoulder", "base_link", "shoulder_link"),
    frame("bicep", "base_link", "bicep_link"),
    frame("forearm", "base_link", "forearm_link"),
    frame("spherical_wrist_1", "base_link", "spherical_wrist_1_link"),
    frame("spherical_wrist_2", "base_link", "spherical_wrist_2_link"),
    frame("end_effector", "base_link", "robotiq_85_base_link"),
];
