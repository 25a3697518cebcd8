//! Ambient light on a surface, by its normal.

use nalgebra::{Matrix4, Vector3, Vector4};

/// Ambient light on a matte surface, by its normal `n`: `(n, 1)ᵀ M (n, 1)` for each of
/// red, green, blue (Ramamoorthi and Hanrahan 2001).
#[derive(Clone, Debug, PartialEq)]
pub struct Irradiance(pub [Matrix4<f32>; 3]);

impl Irradiance {
    /// Hemispheric light, from the colours above and below.
    pub(super) fn hemispheric(sky: [f32; 3], ground: [f32; 3]) -> Self {
        Self(std::array::from_fn(|k| {
            let mut m = Matrix4::zeros();
            m[(3, 3)] = 0.5 * (sky[k] + ground[k]);
            m[(2, 3)] = 0.25 * (sky[k] - ground[k]);
            m[(3, 2)] = m[(2, 3)];
            m
        }))
    }

    /// Adds light from one direction, which a surface receives by its cosine: 1/4 + x/2
    /// + 5/32 (3 x² - 1).
    pub(super) fn add_from(&mut self, towards: &Vector3<f32>, light: [f32; 3]) {
        let w = Vector4::new(towards.x, towards.y, towards.z, 0.0);
        for (m, light) in self.0.iter_mut().zip(light) {
            *m += w * w.transpose() * (light * 15.0 / 32.0);
            for k in 0..3 {
                m[(k, 3)] += 0.25 * light * towards[k];
                m[(3, k)] += 0.25 * light * towards[k];
            }
            m[(3, 3)] += light * (0.25 - 5.0 / 32.0);
        }
    }

    pub(super) fn times(&self, gain: [f32; 3]) -> Self {
        Self(std::array::from_fn(|k| self.0[k] * gain[k]))
    }

    /// Light on a surface with the normal `n`.
    #[must_use]
    pub fn evaluate(&self, n: &Vector3<f32>) -> [f32; 3] {
        let n = Vector4::new(n.x, n.y, n.z, 1.0);
        std::array::from_fn(|k| (n.transpose() * self.0[k] * n)[0])
    }
}

/// Largest number of lamps that light a room.
pub const MOST_LAMPS: usize = 4;

/// Component-wise product.
pub(super) fn times(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| a[k] * b[k])
}
