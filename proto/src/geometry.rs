//! Conversions between vectors, rotations and poses of messages and types of `nalgebra`
//! (feature `nalgebra`). Input is checked by [`check`].

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::check::{self, Invalid};
use crate::v1;

/// A vector as a message.
#[must_use]
pub fn vector(v: &Vector3<f64>) -> v1::Vector3 {
    v1::Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

/// A rotation as a message.
#[must_use]
pub fn quaternion(q: &UnitQuaternion<f64>) -> v1::Quaternion {
    v1::Quaternion {
        x: q.i,
        y: q.j,
        z: q.k,
        w: q.w,
    }
}

/// A pose as a message.
#[must_use]
pub fn pose(p: &Isometry3<f64>) -> v1::Pose {
    v1::Pose {
        position: Some(vector(&p.translation.vector)),
        orientation: Some(quaternion(&p.rotation)),
    }
}

/// A twist as a message.
#[must_use]
pub fn twist(linear: &Vector3<f64>, angular: &Vector3<f64>) -> v1::Twist {
    v1::Twist {
        linear: Some(vector(linear)),
        angular: Some(vector(angular)),
    }
}

/// A checked pose; bits are kept where the quaternion is already of unit length.
///
/// # Errors
/// [`Invalid`] as [`check::pose`].
pub fn isometry(what: &'static str, p: Option<&v1::Pose>) -> Result<Isometry3<f64>, Invalid> {
    let ([x, y, z], [i, j, k, w]) = check::pose(what, p)?;
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

/// A checked pose whose quaternion is always divided by its norm, even if it differs
/// only by rounding, as the scripted operator computes.
///
/// # Errors
/// As [`isometry`].
pub fn normalized(what: &'static str, p: Option<&v1::Pose>) -> Result<Isometry3<f64>, Invalid> {
    let ([x, y, z], [i, j, k, w]) = check::pose(what, p)?;
    Ok(from_columns([x, y, z, i, j, k, w]))
}

/// The pose in seven columns of a file: x y z, metres, and a quaternion x y z w, which
/// is divided by its norm.
#[must_use]
pub fn from_columns([x, y, z, i, j, k, w]: [f64; 7]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_survives_a_round_trip_with_the_same_bits() {
        let rotation = UnitQuaternion::from_euler_angles(0.3, -1.1, 2.0);
        let there = Isometry3::from_parts(Translation3::new(1.5, -0.25, 0.1), rotation);
        let message = pose(&there);
        assert_eq!(isometry("pose", Some(&message)), Ok(there));
        let again = normalized("pose", Some(&message)).unwrap();
        assert!((again.inverse() * there).translation.vector.norm() < 1e-12);
        assert!(again.rotation.angle_to(&there.rotation) < 1e-12);
        assert!(isometry("pose", None).is_err());
    }
}
