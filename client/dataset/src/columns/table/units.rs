//! Axes and units that several streams share.

use crate::columns::Axis;

pub(super) const XYZ: Axis = Axis::Components(&["x", "y", "z"]);
pub(super) const POSE: Axis = Axis::Components(&["x", "y", "z", "qx", "qy", "qz", "qw"]);
pub(super) const TWIST: Axis = Axis::Components(&["vx", "vy", "vz", "wx", "wy", "wz"]);
pub(super) const WHEELS: Axis = Axis::Names(&["left", "right"]);

pub(super) const POSE_UNIT: &str = "m (x y z), 1 (unit quaternion x y z w)";
pub(super) const TWIST_UNIT: &str = "m/s (linear), rad/s (angular)";
