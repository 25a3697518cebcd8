//! Additive mass properties: several rigidly joined links are one body.

use nalgebra::{Isometry3, Matrix3, Point3};

/// Mass properties of a body in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mass {
    /// kg.
    pub mass: f64,
    /// Centre of mass, metres.
    pub com: Point3<f64>,
    /// Inertia about the centre of mass along the body axes, kg·m².
    pub inertia: Matrix3<f64>,
}

impl Mass {
    /// No mass.
    pub(super) fn none() -> Self {
        Self {
            mass: 0.0,
            com: Point3::origin(),
            inertia: Matrix3::zeros(),
        }
    }

    /// The same body in a frame in which its own frame is at `frame_from_body`.
    pub(super) fn transformed_by(&self, frame_from_body: &Isometry3<f64>) -> Self {
        let r = frame_from_body.rotation.to_rotation_matrix();
        Self {
            mass: self.mass,
            com: frame_from_body * self.com,
            inertia: r * self.inertia * r.transpose(),
        }
    }

    /// Both together (parallel axis theorem).
    pub(super) fn plus(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        if mass <= 0.0 {
            return Self::none();
        }
        let com =
            Point3::from((self.com.coords * self.mass + other.com.coords * other.mass) / mass);
        let about = |m: &Self| {
            let d = m.com - com;
            m.inertia + (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * m.mass
        };
        Self {
            mass,
            com,
            inertia: about(self) + about(other),
        }
    }

    /// Whether a body with these properties can move: positive mass and positive
    /// definite inertia, all finite.
    pub(super) fn is_physical(&self) -> bool {
        self.mass > 0.0
            && self.mass.is_finite()
            && self.com.coords.iter().all(|x| x.is_finite())
            && self.inertia.iter().all(|x| x.is_finite())
            && self
                .inertia
                .symmetric_eigenvalues()
                .iter()
                .all(|&e| e > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two halves of a rod equal the whole rod.
    #[test]
    fn two_halves_equal_the_whole() {
        let rod = |m: f64, l: f64, x: f64| Mass {
            mass: m,
            com: Point3::new(x, 0.0, 0.0),
            inertia: Matrix3::from_diagonal(&nalgebra::Vector3::new(
                1e-3 * m,
                m * l * l / 12.0,
                m * l * l / 12.0,
            )),
        };
        let turn = Isometry3::new(
            nalgebra::Vector3::new(0.3, 0.2, 0.1),
            nalgebra::Vector3::new(0.4, -0.2, 0.9),
        );
        let half = |x| rod(1.0, 1.0, x).transformed_by(&turn);
        let sum = half(-0.5).plus(&half(0.5));
        let whole = rod(2.0, 2.0, 0.0).transformed_by(&turn);
        assert!((sum.mass - whole.mass).abs() < 1e-12);
        assert!((sum.com - whole.com).norm() < 1e-12);
        assert!((sum.inertia - whole.inertia).norm() < 1e-12);
        assert!(sum.is_physical());
        assert!(!rod(-1.0, 1.0, 0.0).is_physical());
    }
}
