//! Pose and twist of one link relative to another.

use nalgebra::{Isometry3, Vector3};

use crate::snapshot::BodyState;

/// Pose and velocity of a frame relative to a parent and expressed in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeState {
    /// parent_from_child.
    pub pose: Isometry3<f64>,
    /// Velocity of the child's origin as seen in the parent, m/s.
    pub linear: Vector3<f64>,
    /// Angular velocity relative to the parent, rad/s.
    pub angular: Vector3<f64>,
}

/// Pose and twist in the world, unchanged.
#[must_use]
pub fn in_world(child: &BodyState) -> RelativeState {
    RelativeState {
        pose: child.pose,
        linear: child.linear,
        angular: child.angular,
    }
}

/// Pose and twist of `child` relative to the moving `parent`.
#[must_use]
pub fn relative(parent: &BodyState, child: &BodyState) -> RelativeState {
    let parent_from_world = parent.pose.inverse();
    let offset = child.pose.translation.vector - parent.pose.translation.vector;
    let linear = child.linear - parent.linear - parent.angular.cross(&offset);
    RelativeState {
        pose: parent_from_world * child.pose,
        linear: parent_from_world.rotation * linear,
        angular: parent_from_world.rotation * (child.angular - parent.angular),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion};

    #[test]
    fn a_frame_carried_along_has_no_relative_velocity() {
        let angular = Vector3::new(0.0, 0.0, 2.0);
        let parent = BodyState {
            pose: Isometry3::from_parts(
                Translation3::new(1.0, 2.0, 0.0),
                UnitQuaternion::from_euler_angles(0.0, 0.0, 0.7),
            ),
            linear: Vector3::new(0.3, -0.1, 0.0),
            angular,
        };
        let offset = Vector3::new(0.5, 0.2, 0.1);
        let child = BodyState {
            pose: Isometry3::from_parts(
                Translation3::from(parent.pose.translation.vector + offset),
                parent.pose.rotation,
            ),
            linear: parent.linear + angular.cross(&offset),
            angular,
        };
        let state = relative(&parent, &child);
        assert!(state.linear.norm() < 1e-12 && state.angular.norm() < 1e-12);
        assert!((state.pose.translation.vector.norm() - offset.norm()).abs() < 1e-12);
    }
}
