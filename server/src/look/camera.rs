//! By how much a look moves a camera and its lens.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::random::{Random, Row};
use super::setting::{Look, share_of};

/// Farthest along each axis at the greatest strength, metres.
const MOVED: f64 = 0.015;
/// Greatest turn at the greatest strength, degrees.
const TURNED_DEG: f64 = 8.0;
/// Greatest change of the focal length at the greatest strength, its share.
const FOCAL: f64 = 0.12;

/// What a look does to a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraError {
    /// optical_from_optical: applied in the frame of the camera.
    pub moved: Option<Isometry3<f64>>,
    /// Focal lengths are multiplied by it.
    pub focal: Option<f64>,
}

/// What a look does to the robot's camera of this number.
#[must_use]
pub fn camera_error(look: &Look, camera: usize) -> CameraError {
    let number = camera as u32;
    let moved = (look.camera > 0).then(|| {
        let mut random = Random::new(look.seed, Row::Camera, number);
        let share = share_of(look.camera);
        let at = Vector3::from_fn(|_, _| random.about(MOVED * share));
        // About any axis, never farther than the greatest turn.
        let turn = Vector3::from_fn(|_, _| random.about(1.0));
        let most = TURNED_DEG.to_radians() * share;
        let turn = turn * (most / turn.norm().max(1.0));
        Isometry3::from_parts(
            Translation3::from(at),
            UnitQuaternion::from_scaled_axis(turn),
        )
    });
    let focal = (look.lens > 0).then(|| {
        let mut random = Random::new(look.seed, Row::Lens, number);
        1.0 + random.about(FOCAL * share_of(look.lens))
    });
    CameraError { moved, focal }
}
