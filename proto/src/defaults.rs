//! Values of a scenario that names none. Server, campaigns and command lines take them from
//! here. The comments of the contract and the guides repeat them; a test compares those.

use crate::{CONTROL_HZ, PHYSICS_HZ};

/// Scene below assets/scenes.
pub const SCENE: &str = "home";

/// Robot below assets/robots.
pub const ROBOT: &str = "wheelarm";

/// Task below assets/tasks.
pub const TASK: &str = "pick_mustard";

/// Rate of the state streams, Hz.
pub const STATE_RATE_HZ: f64 = CONTROL_HZ as f64;

/// Rate of the IMU, Hz.
pub const IMU_RATE_HZ: f64 = PHYSICS_HZ as f64;

/// Rate of the shapes of deformables, Hz.
pub const DEFORMABLE_RATE_HZ: f64 = 10.0;

/// Rate of the laser scanner, Hz: off.
pub const SCAN_RATE_HZ: f64 = 0.0;

/// Rate of a camera, Hz.
pub const CAMERA_RATE_HZ: f64 = 10.0;

/// Width and height of the images of a robot camera, pixels.
pub const CAMERA_SIZE: [u32; 2] = [1280, 720];
