//! Screws, exponentials and logarithms of rigid motions.
//!
//! Twists are `[angular; linear]` as in Lynch & Park, Modern Robotics (2017), chapter
//! 3. Independent of the robot.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::exact;

/// A revolute joint as a screw of pitch zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Screw {
    /// Unit vector along the axis.
    pub angular: Vector3<f64>,
    /// Velocity of the origin for a unit turn rate, m/rad.
    pub linear: Vector3<f64>,
    /// The point of the axis closest to the origin, m.
    point: Vector3<f64>,
}

impl Screw {
    /// Axis through `point` along the unit vector `axis`.
    #[must_use]
    pub fn revolute(axis: Vector3<f64>, point: Vector3<f64>) -> Screw {
        let linear = point.cross(&axis);
        Screw {
            angular: axis,
            linear,
            point: axis.cross(&linear),
        }
    }

    /// Motion after a turn by `angle` rad.
    #[must_use]
    pub fn exponential(&self, angle: f64) -> Isometry3<f64> {
        let (sin, cos) = exact::sin_cos(angle / 2.0);
        let turn = UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, self.angular * sin));
        Isometry3::from_parts(Translation3::from(self.point - turn * self.point), turn)
    }
}

/// Rotation vector of a rotation, with a length of 0 to pi. Accurate at both ends: the
/// angle is computed from both parts of the quaternion by `atan2`.
#[must_use]
pub fn rotation_vector(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let (scalar, vector) = (rotation.scalar(), rotation.imag());
    let length = vector.norm();
    if length < 1e-12 {
        // sin(angle/2) = angle/2 here; the sign of the quaternion is free.
        return vector * (2.0 * scalar.signum());
    }
    let angle = 2.0 * exact::atan2(length, scalar.abs());
    vector * (angle * scalar.signum() / length)
}

/// Logarithm of a rigid motion as a twist: `(angular, linear)`, rad and m. Lynch & Park
/// 2017, section 3.3.3, with the angle from `atan2`, so that it is valid up to a half
/// turn.
#[must_use]
pub fn logarithm(motion: &Isometry3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let angular = rotation_vector(&motion.rotation);
    let angle_squared = angular.norm_squared();
    let translation = motion.translation.vector;
    // Coefficient of [angular]² in the inverse of the left Jacobian.
    let coefficient = if angle_squared < 1e-4 {
        1.0 / 12.0 + angle_squared / 720.0 + angle_squared * angle_squared / 30240.0
    } else {
        let half = angle_squared.sqrt() / 2.0;
        let (sin, cos) = exact::sin_cos(half);
        (1.0 - half * cos / sin) / angle_squared
    };
    let turned = angular.cross(&translation);
    let linear = translation - turned * 0.5 + angular.cross(&turned) * coefficient;
    (angular, linear)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Exponential of a general twist by scaling and squaring: slow, independent.
    fn exponential(angular: Vector3<f64>, linear: Vector3<f64>) -> nalgebra::Matrix4<f64> {
        let mut twist = nalgebra::Matrix4::zeros();
        twist
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&angular.cross_matrix());
        twist.fixed_view_mut::<3, 1>(0, 3).copy_from(&linear);
        let small = twist / 1024.0;
        let (mut sum, mut term) = (nalgebra::Matrix4::identity(), nalgebra::Matrix4::identity());
        for n in 1..12 {
            term = term * small / f64::from(n);
            sum += term;
        }
        (0..10).fold(sum, |power, _| power * power)
    }

    #[test]
    fn logarithm_inverts_the_exponential_up_to_a_half_turn() {
        let axis = Vector3::new(0.48, -0.6, 0.64).normalize();
        let linear = Vector3::new(0.3, -1.2, 0.7);
        for angle in [
            0.0,
            1e-14,
            1e-9,
            1e-5,
            0.009,
            0.011,
            1.0,
            3.0,
            PI - 1e-4,
            PI - 1e-8,
        ] {
            let matrix = exponential(axis * angle, linear);
            let rotation: nalgebra::Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into();
            let motion = Isometry3::from_parts(
                Translation3::from(Vector3::from(matrix.fixed_view::<3, 1>(0, 3))),
                UnitQuaternion::from_matrix(&rotation),
            );
            let (angular_back, linear_back) = logarithm(&motion);
            let error = (angular_back - axis * angle).norm() + (linear_back - linear).norm();
            assert!(error < 1e-6, "angle {angle}: error {error}");
        }
    }
}
