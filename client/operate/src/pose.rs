//! Poses of messages as `nalgebra` isometries and back. Checked once, here.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::v1;

/// Reads a pose of a message.
///
/// # Errors
/// [`Invalid`] as in `wheelarm_proto::check::pose`.
pub fn read_pose(what: &'static str, pose: Option<&v1::Pose>) -> Result<Isometry3<f64>, Invalid> {
    let ([x, y, z], [qx, qy, qz, qw]) = check::pose(what, pose)?;
    Ok(Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz)),
    ))
}

/// Writes a pose into a message.
#[must_use]
pub fn write_pose(pose: &Isometry3<f64>) -> v1::Pose {
    let (t, q) = (pose.translation, pose.rotation);
    v1::Pose {
        position: Some(v1::Vector3 {
            x: t.x,
            y: t.y,
            z: t.z,
        }),
        orientation: Some(v1::Quaternion {
            x: q.i,
            y: q.j,
            z: q.k,
            w: q.w,
        }),
    }
}
