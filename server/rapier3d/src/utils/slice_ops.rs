//! Operations on slices of the solver's vectors, written for vectorization with a fixed order
//! of the sums.

use crate::math::Real;

/// Number of entries that are processed side by side.
const LANES: usize = 4;

/// The dot product of two slices of the same length.
#[inline]
pub(crate) fn dot(a: &[Real], b: &[Real]) -> Real {
    let (chunks_a, chunks_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let (rest_a, rest_b) = (chunks_a.remainder(), chunks_b.remainder());
    let mut sums = [0.0; LANES];
    for (a, b) in chunks_a.zip(chunks_b) {
        for i in 0..LANES {
            sums[i] += a[i] * b[i];
        }
    }
    let mut rest = 0.0;
    for (a, b) in rest_a.iter().zip(rest_b) {
        rest += *a * *b;
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Adds `scale` times `x` to `y`, of the same length.
#[inline]
pub(crate) fn add_scaled(y: &mut [Real], scale: Real, x: &[Real]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += scale * *x;
    }
}
