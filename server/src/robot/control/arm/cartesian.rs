//! Velocities of the end effector and the corresponding joint speeds.

use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::robot::kinematics::screw::rotation_vector;

/// Length that converts radians to metres, m: about half the arm.
const LENGTH: f64 = 0.3;
/// Damping of Cartesian speeds: directions with a smaller singular value are dropped.
const DAMPING: f64 = 0.005;

/// Velocity of the end effector along given axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Velocity {
    /// m/s.
    pub linear: Vector3<f64>,
    /// rad/s.
    pub angular: Vector3<f64>,
}

impl Velocity {
    /// Along other axes: `axes` is their `to_from_from` rotation.
    pub(super) fn turned(&self, axes: &UnitQuaternion<f64>) -> Velocity {
        Velocity {
            linear: axes * self.linear,
            angular: axes * self.angular,
        }
    }

    /// Limited to a speed, m/s, and a turn rate, rad/s.
    pub(super) fn cut(&self, linear: f64, angular: f64) -> Velocity {
        Velocity {
            linear: cut(self.linear, linear),
            angular: cut(self.angular, angular),
        }
    }

    /// Moved towards `wanted` by at most the given changes, m/s and rad/s.
    pub(super) fn towards(&self, wanted: &Velocity, linear: f64, angular: f64) -> Velocity {
        Velocity {
            linear: self.linear + cut(wanted.linear - self.linear, linear),
            angular: self.angular + cut(wanted.angular - self.angular, angular),
        }
    }

    /// Without components opposite to `wanted`, which remain of a former command that
    /// the arm could not follow.
    pub(super) fn forgetting(&self, wanted: &Velocity) -> Velocity {
        let keep = |now: f64, wanted: f64| if now * wanted < 0.0 { 0.0 } else { now };
        Velocity {
            linear: self.linear.zip_map(&wanted.linear, keep),
            angular: self.angular.zip_map(&wanted.angular, keep),
        }
    }

    /// From the base's axes to a twist in the end effector's frame, weighted
    /// like [`weighted`].
    pub(super) fn in_tool(&self, pose: &Isometry3<f64>) -> Vector6<f64> {
        let linear = pose.rotation.inverse_transform_vector(&self.linear);
        let angular = pose.rotation.inverse_transform_vector(&self.angular) * LENGTH;
        Vector6::new(
            angular.x, angular.y, angular.z, linear.x, linear.y, linear.z,
        )
    }
}

/// Distance, m, and angle, rad, between two poses.
pub(super) fn apart(one: &Isometry3<f64>, other: &Isometry3<f64>) -> (f64, f64) {
    (
        (other.translation.vector - one.translation.vector).norm(),
        rotation_vector(&one.rotation.rotation_to(&other.rotation)).norm(),
    )
}

/// The vector, shortened to `longest`.
pub(super) fn cut(vector: Vector3<f64>, longest: f64) -> Vector3<f64> {
    let length = vector.norm();
    if length > longest {
        vector * (longest / length)
    } else {
        vector
    }
}

/// Body Jacobian with its angular rows in metres, so that all rows are comparable.
pub(super) fn weighted(jacobian: &Matrix6<f64>) -> Matrix6<f64> {
    let mut weighted = *jacobian;
    for column in 0..6 {
        for row in 0..3 {
            weighted[(row, column)] *= LENGTH;
        }
    }
    weighted
}

/// Joint speeds for a weighted twist, by damped least squares.
pub(super) fn joint_speeds(weighted: &Matrix6<f64>, twist: &Vector6<f64>) -> [f64; 6] {
    let normal = weighted.tr_mul(weighted) + Matrix6::identity() * (DAMPING * DAMPING);
    // Positive definite because of the damping.
    match normal.cholesky() {
        Some(factors) => factors.solve(&weighted.tr_mul(twist)).into(),
        None => [0.0; 6],
    }
}

/// Smallest singular value of a weighted Jacobian, m/rad, and its direction of twist.
pub(super) fn slowest(weighted: &Matrix6<f64>) -> (f64, Vector6<f64>) {
    let eigen = (weighted * weighted.transpose()).symmetric_eigen();
    let (index, value) = eigen.eigenvalues.argmin();
    (
        value.max(0.0).sqrt(),
        eigen.eigenvectors.column(index).into_owned(),
    )
}
