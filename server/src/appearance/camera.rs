//! Offsets of a camera and its lens by an appearance.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::random::{Random, Row};
use super::setting::{Appearance, share_of};

/// Largest offset along each axis at the largest strength, metres.
const MOVED: f64 = 0.015;
/// Largest rotation at the largest strength, degrees.
const TURNED_DEG: f64 = 8.0;
/// Largest relative change of the focal length at the largest strength.
const FOCAL: f64 = 0.12;

/// Offset of a camera by an appearance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraError {
    /// optical_from_optical: applied in the frame of the camera.
    pub moved: Option<Isometry3<f64>>,
    /// Factor on the focal lengths.
    pub focal: Option<f64>,
}

/// The offset of the robot's camera with this number.
#[must_use]
pub fn camera_error(appearance: &Appearance, camera: usize) -> CameraError {
    let number = camera as u32;
    let moved = (appearance.camera > 0).then(|| {
        let mut random = Random::new(appearance.seed, Row::Camera, number);
        let share = share_of(appearance.camera);
        let at = Vector3::from_fn(|_, _| random.about(MOVED * share));
        // About any axis, by at most the largest rotation.
        let turn = Vector3::from_fn(|_, _| random.about(1.0));
        let most = TURNED_DEG.to_radians() * share;
        let turn = turn * (most / turn.norm().max(1.0));
        Isometry3::from_parts(
            Translation3::from(at),
            UnitQuaternion::from_scaled_axis(turn),
        )
    });
    let focal = (appearance.lens > 0).then(|| {
        let mut random = Random::new(appearance.seed, Row::Lens, number);
        1.0 + random.about(FOCAL * share_of(appearance.lens))
    });
    CameraError { moved, focal }
}
