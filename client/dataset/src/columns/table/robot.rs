//! The robot's measurements: joints, frames, the IMU and odometry, exact and as its
//! sensor models report them.

use wheelarm_proto::v1;

use super::units::{POSE, POSE_UNIT, TWIST, TWIST_UNIT, XYZ};
use crate::columns::codec::{f64s, list, number, part, singles};
use crate::columns::values::{self as take, put_each, to_pose, to_twist, to_vector};
use crate::columns::{Axis, Codec, Table};

const QUATERNION: Axis = Axis::Components(&["x", "y", "z", "w"]);

const FRAMES_FRAME: &str = "the chair in house, all others in base_link";

pub(super) static JOINT_STATE: Table<v1::JointState> = Table {
    columns: &[
        f64s("position", "rad", "", &[Axis::Joints], list!(positions)),
        f64s("velocity", "rad/s", "", &[Axis::Joints], list!(velocities)),
        f64s("effort", "N.m", "", &[Axis::Joints], list!(efforts)),
        f64s(
            "opening",
            "m",
            "",
            &[],
            Codec {
                take: |m, _, o| o.push(m.opening.unwrap_or(f64::NAN)),
                put: |m, _, v| m.opening = v.first().copied().filter(|v| !v.is_nan()),
            },
        ),
    ],
};

pub(super) static POSE_SET: Table<v1::PoseSet> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            FRAMES_FRAME,
            &[Axis::Frames, POSE],
            Codec {
                take: |m, _, o| m.frames.iter().for_each(|f| take::pose(f.pose.as_ref(), o)),
                put: |m, _, v| put_each(&mut m.frames, v, 7, |f, v| f.pose = to_pose(v)),
            },
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            FRAMES_FRAME,
            &[Axis::Frames, TWIST],
            Codec {
                take: |m, _, o| {
                    m.frames
                        .iter()
                        .for_each(|f| take::twist(f.twist.as_ref(), o))
                },
                put: |m, _, v| put_each(&mut m.frames, v, 6, |f, v| f.twist = to_twist(v)),
            },
        ),
    ],
};

pub(super) static IMU: Table<v1::Imu> = Table {
    columns: &[
        f64s(
            "orientation",
            "1",
            "imu_link in house",
            &[QUATERNION],
            part!(orientation, take::quaternion, take::to_quaternion),
        ),
        f64s(
            "angular_velocity",
            "rad/s",
            "imu_link",
            &[XYZ],
            part!(angular_velocity, take::vector, to_vector),
        ),
        f64s(
            "linear_acceleration",
            "m/s^2",
            "imu_link",
            &[XYZ],
            part!(linear_acceleration, take::vector, to_vector),
        ),
    ],
};

/// Frame of a scan; the description has its name and pose.
const SCANNER_FRAME: &str = "scanner";

pub(super) static SCAN: Table<v1::Scan> = Table {
    columns: &[f64s(
        "ranges",
        "m",
        SCANNER_FRAME,
        &[Axis::Rays],
        singles!(ranges),
    )],
};

pub(super) static SENSED_SCAN: Table<v1::SensedScan> = Table {
    columns: &[f64s(
        "ranges",
        "m",
        SCANNER_FRAME,
        &[Axis::Rays],
        singles!(ranges),
    )],
};

pub(super) static ODOMETRY: Table<v1::Odometry> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            "wheelchair_root where the odometry started",
            &[POSE],
            part!(pose, take::pose, to_pose),
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            "wheelchair_root",
            &[TWIST],
            part!(twist, take::twist, to_twist),
        ),
    ],
};

pub(super) static SENSED_JOINT: Table<v1::SensedJoints> = Table {
    columns: &[
        f64s("position", "rad", "", &[Axis::ArmJoints], list!(positions)),
        f64s(
            "velocity",
            "rad/s",
            "",
            &[Axis::ArmJoints],
            list!(velocities),
        ),
        f64s("effort", "N.m", "", &[Axis::ArmJoints], list!(efforts)),
        f64s("opening", "m", "", &[], number!(opening)),
    ],
};

pub(super) static SENSED_ODOMETRY: Table<v1::SensedOdometry> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            "wheelchair_root where the episode began",
            &[POSE],
            part!(pose, take::pose, to_pose),
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            "wheelchair_root",
            &[TWIST],
            part!(twist, take::twist, to_twist),
        ),
    ],
};

pub(super) static SENSED_IMU: Table<v1::SensedImu> = Table {
    columns: &[
        f64s(
            "angular_velocity",
            "rad/s",
            "imu_link",
            &[XYZ],
            part!(angular_velocity, take::vector, to_vector),
        ),
        f64s(
            "linear_acceleration",
            "m/s^2",
            "imu_link",
            &[XYZ],
            part!(linear_acceleration, take::vector, to_vector),
        ),
    ],
};
