//! What the robot feels and sees, computed from snapshots: which sensor is
//! due, inertial measurement, wheel odometry, frame poses, cameras, and what the
//! sensor models of a scenario make of them.
//!
//! Sensors read snapshots and never the physics itself.

pub mod camera;
pub mod frames;
pub mod imu;
pub mod models;
pub mod odometry;
mod schedule;
pub mod signals;

pub use schedule::{BadRate, Schedule};
