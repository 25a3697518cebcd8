//! The rotation in a deformation gradient, by an iterative polar
//! decomposition that starts from the last one (Müller et al. 2016, "A Robust Method to
//! Extract the Rotational Part of Deformations"), inverted cells included.
//!
//! Only sums, products, quotients and square roots: the same bits everywhere.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Changes below this are no change, rad.
const ENOUGH: f64 = 1e-9;
/// Most steps; one or two suffice from tick to tick.
const STEPS: usize = 20;

/// Unit quaternion, x y z w.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rotation([f64; 4]);

impl Default for Rotation {
    fn default() -> Self {
        Self([0.0, 0.0, 0.0, 1.0])
    }
}

impl Rotation {
    /// Of a unit quaternion x y z w.
    #[must_use]
    pub fn new(xyzw: [f64; 4]) -> Self {
        Self(xyzw)
    }

    /// Unit quaternion, x y z w.
    #[must_use]
    pub fn xyzw(&self) -> [f64; 4] {
        self.0
    }

    /// As a matrix.
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        let [x, y, z, w] = self.0;
        Matrix3::new(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - z * w),
            2.0 * (x * z + y * w),
            2.0 * (x * y + z * w),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - x * w),
            2.0 * (x * z - y * w),
            2.0 * (y * z + x * w),
            1.0 - 2.0 * (x * x + y * y),
        )
    }

    /// Turns towards the rotation in `f`, from where it is.
    pub fn extract_rotation(&mut self, f: &Matrix3<f64>) {
        for _ in 0..STEPS {
            let r = self.matrix();
            let mut twist = Vector3::zeros();
            let mut grip = 0.0;
            for i in 0..3 {
                let (a, b) = (r.column(i), f.column(i));
                twist += a.cross(&b);
                grip += a.dot(&b);
            }
            let step = twist / (grip.abs() + 1e-9);
            self.rotate(&step);
            if step.norm_squared() < ENOUGH * ENOUGH {
                return;
            }
        }
    }

    /// Turns by a small rotation vector; exact in direction, bounded in angle.
    fn rotate(&mut self, by: &Vector3<f64>) {
        let (a, b, c) = (0.5 * by.x, 0.5 * by.y, 0.5 * by.z);
        let [x, y, z, w] = self.0;
        let turned = [
            x + a * w + b * z - c * y,
            y + b * w + c * x - a * z,
            z + c * w + a * y - b * x,
            w - a * x - b * y - c * z,
        ];
        let norm = turned.iter().map(|q| q * q).sum::<f64>().sqrt();
        self.0 = turned.map(|q| q / norm);
    }
}
