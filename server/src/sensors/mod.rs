//! Sensors of the robot, computed from snapshots: schedules, inertial measurement,
//! wheel odometry, laser scans, frame poses, cameras, and the sensor models of a scenario.
//!
//! Sensors read snapshots and never the physics itself.

pub mod camera;
pub mod frames;
pub mod imu;
pub mod models;
pub mod odometry;
pub mod scan;
mod schedule;
pub mod signals;

pub use schedule::{BadRate, Schedule};
