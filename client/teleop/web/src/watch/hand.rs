//! Converts hand vectors into directions that a person on the chair understands.

use nalgebra::{UnitQuaternion, Vector3};

/// A vector of `base_link` as forward, left and up of the chair, on which the
/// arm's base is turned by `chair_from_base`.
#[must_use]
pub fn chair_directions(vector: Vector3<f64>, chair_from_base: &UnitQuaternion<f64>) -> [f64; 3] {
    // Without negative zeros.
    (chair_from_base * vector).map(|part| part + 0.0).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_base_that_is_turned_by_a_quarter_points_to_the_left() {
        let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let directions = chair_directions(Vector3::new(1.0, 2.0, 3.0), &turned);
        for (got, expected) in directions.iter().zip([-2.0, 1.0, 3.0]) {
            assert!((got - expected).abs() < 1e-12, "{directions:?}");
        }
    }
}
