//! ROS 2's messages without ROS 2: how values are encoded, which fields a message
//! has, the hash of its type, and the conversion of ours. No files, and
//! no recordings.

mod cdr;
mod definition;
mod message;

pub(super) use definition::{description, type_hash};
pub(super) use message::{
    CameraInfo, Clock, Image, Imu, JointState, LaserScan, Odometry, PointCloud2, PoseStamped,
    RosMessage, TFMessage, Text, Transform, TwistStamped,
};
