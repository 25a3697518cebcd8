//! The hand in words and numbers that a person on the chair understands.

use nalgebra::Vector3;

/// A vector of `base_link` as forward, left and up of the chair.
///
/// The arm's base stands on the chair turned by half a turn: its x axis points
/// backwards and its y axis to the right.
#[must_use]
pub fn seen_from_the_chair(vector: Vector3<f64>) -> [f64; 3] {
    // Without the sign of a zero.
    [0.0 - vector.x, 0.0 - vector.y, vector.z]
}

/// Distance between the pads, m, at a knuckle angle, rad.
///
/// Geometry of the 2F-85's fingers, from PickNik's URDF: the knuckle pin lies
/// 30.6 mm from the middle, the tip pin (37.2, 43.4) mm further, the pad's
/// face 25.3 mm inside of it.
#[must_use]
pub fn opening(knuckle: f64) -> f64 {
    let (sin, cos) = knuckle.sin_cos();
    (2.0 * (0.030_601_14 + 0.037_157_5 * cos - 0.043_421_68 * sin - 0.025_26)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_opening_is_the_makers() {
        assert!((opening(0.0) - 0.085).abs() < 1e-4);
        assert!((opening(0.4) - 0.045_31).abs() < 1e-4);
        assert!(opening(0.8) < 5e-4);
    }
}
