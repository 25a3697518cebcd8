//! The rotation of a deformation gradient, by an iterative polar decomposition that
//! starts from the last one: Newton steps near the present rotation, otherwise steps of
//! Müller et al. 2016 ("A Robust Method to Extract the Rotational Part of
//! Deformations"), which handle inverted cells.
//!
//! Only sums, products, quotients and square roots: the same bits everywhere.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Convergence threshold, rad.
const ENOUGH: f64 = 1e-9;
/// The same for a Newton step, whose error is squared.
const NEAR: f64 = 1e-5;
/// Smallest curvature for a Newton step, in units of the mean.
const CURVED: f64 = 0.1;
/// Largest number of steps; one or two suffice from tick to tick.
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
    /// From a unit quaternion x y z w.
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

    /// Rotates towards the rotation in `f`, from the present one.
    pub fn extract_rotation(&mut self, f: &Matrix3<f64>) {
        for _ in 0..STEPS {
            // The remaining deformation, seen from outside: symmetric when the rotation
            // is found.
            let q = f * self.matrix().transpose();
            let twist = Vector3::new(
                q[(2, 1)] - q[(1, 2)],
                q[(0, 2)] - q[(2, 0)],
                q[(1, 0)] - q[(0, 1)],
            );
            let newton = newton(&q, &twist);
            let step = newton.unwrap_or_else(|| twist / (q.trace().abs() + 1e-9));
            self.rotate(&step);
            let enough = if newton.is_some() { NEAR } else { ENOUGH };
            if step.norm_squared() < enough * enough {
                return;
            }
        }
    }

    /// Rotates by a small rotation vector; exact in direction, bounded in angle.
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

/// The step to the largest trace of the remainder, if it is near: the trace must be
/// concave in all directions.
fn newton(q: &Matrix3<f64>, twist: &Vector3<f64>) -> Option<Vector3<f64>> {
    let trace = q.trace();
    let least = CURVED * trace;
    // trace - symmetric part, by its Cholesky factors.
    let (xx, yy, zz) = (trace - q[(0, 0)], trace - q[(1, 1)], trace - q[(2, 2)]);
    let (xy, xz, yz) = (
        -0.5 * (q[(0, 1)] + q[(1, 0)]),
        -0.5 * (q[(0, 2)] + q[(2, 0)]),
        -0.5 * (q[(1, 2)] + q[(2, 1)]),
    );
    if !(least > 0.0 && xx > least) {
        return None;
    }
    let (a, b) = (xy / xx, xz / xx);
    let second = yy - a * xy;
    let mixed = yz - a * xz;
    if second <= least {
        return None;
    }
    let c = mixed / second;
    let third = zz - b * xz - c * mixed;
    if third <= least {
        return None;
    }
    let y = twist.y - a * twist.x;
    let z = (twist.z - b * twist.x - c * y) / third;
    let y = y / second - c * z;
    let x = twist.x / xx - a * y - b * z;
    Some(Vector3::new(x, y, z))
}
