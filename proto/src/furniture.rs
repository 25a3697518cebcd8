//! Motion of furniture on a joint: a drawer slides, a door turns.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::v1;

/// Kind of motion of furniture on a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JointMotion {
    /// Along the axis; positions are metres.
    Slides,
    /// About the axis through the origin of the body's frame; positions are radians.
    Turns,
}

impl JointMotion {
    /// The motion of a joint of the `scene` query; anything but a revolute joint slides.
    #[must_use]
    pub fn of(joint: &v1::FurnitureJoint) -> Self {
        match joint.r#type() {
            v1::JointType::Revolute => Self::Turns,
            _ => Self::Slides,
        }
    }

    /// The type in messages.
    #[must_use]
    pub fn joint_type(self) -> v1::JointType {
        match self {
            Self::Slides => v1::JointType::Prismatic,
            Self::Turns => v1::JointType::Revolute,
        }
    }

    /// Pose of the body at a joint position (metres or radians); `rest` is the pose at
    /// position 0, and both it and `axis` are in the same frame, for example `house`.
    #[must_use]
    pub fn pose(
        self,
        axis: &Unit<Vector3<f64>>,
        rest: &Isometry3<f64>,
        position: f64,
    ) -> Isometry3<f64> {
        match self {
            Self::Slides => Translation3::from(axis.scale(position)) * rest,
            Self::Turns => {
                let turn = UnitQuaternion::from_axis_angle(axis, position);
                Isometry3::from_parts(rest.translation, turn * rest.rotation)
            }
        }
    }

    /// Displacement, in the frame of `axis` and `rest`, of what rides on the body when
    /// its position changes by `by`, metres or radians.
    #[must_use]
    pub fn displacement(
        self,
        axis: &Unit<Vector3<f64>>,
        rest: &Isometry3<f64>,
        by: f64,
    ) -> Isometry3<f64> {
        match self {
            Self::Slides => Translation3::from(axis.scale(by)).into(),
            Self::Turns => {
                let at = rest.translation;
                let turn = UnitQuaternion::from_axis_angle(axis, by);
                at * Isometry3::from_parts(Translation3::identity(), turn) * at.inverse()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn a_door_turns_about_its_hinge_and_a_drawer_slides() {
        let rest = Isometry3::new(
            Vector3::new(1.0, 2.0, 0.5),
            Vector3::z() * std::f64::consts::FRAC_PI_2,
        );
        let axis = Vector3::z_axis();
        let handle = Point3::new(0.4, 0.0, 0.0);
        let opened = JointMotion::Turns.pose(&axis, &rest, std::f64::consts::FRAC_PI_2);
        assert!((opened.translation.vector - rest.translation.vector).norm() < 1e-12);
        assert!((opened * handle - Point3::new(0.6, 2.0, 0.5)).norm() < 1e-12);
        let drawn = JointMotion::Slides.pose(&axis, &rest, 0.25);
        assert!((drawn * handle - Point3::new(1.0, 2.4, 0.75)).norm() < 1e-12);
    }

    /// A displacement carries the pose at one position to that at another.
    #[test]
    fn displacements_agree_with_poses() {
        let rest = Isometry3::new(Vector3::new(-1.0, 0.5, 1.0), Vector3::new(0.1, 0.2, 0.3));
        let axis = Unit::new_normalize(Vector3::new(0.2, -0.3, 0.9));
        for motion in [JointMotion::Slides, JointMotion::Turns] {
            let before = motion.pose(&axis, &rest, 0.3);
            let after = motion.displacement(&axis, &rest, 0.5) * before;
            let expected = motion.pose(&axis, &rest, 0.8);
            assert!((after.translation.vector - expected.translation.vector).norm() < 1e-12);
            assert!(after.rotation.angle_to(&expected.rotation) < 1e-12);
            let joint = v1::FurnitureJoint {
                r#type: motion.joint_type().into(),
                ..Default::default()
            };
            assert_eq!(JointMotion::of(&joint), motion);
        }
    }
}
