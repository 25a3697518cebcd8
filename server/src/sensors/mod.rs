//! What the robot feels and sees, computed from snapshots: which sensor is
//! due, inertial measurement, wheel odometry, frame poses, cameras.
//!
//! Sensors read snapshots and never the physics itself.

pub mod camera;
pub mod frames;
pub mod imu;
pub mod odometry;
mod schedule;

pub use schedule::{BadRate, Schedule};
