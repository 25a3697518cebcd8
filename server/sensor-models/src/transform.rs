//! The cosine transform of 8×8 blocks by Arai, Agui and Nakajima (1988), four blocks at
//! a time, one in each lane: five multiplications for eight values. Coefficients are
//! scaled by [`factor`].

use wheelarm_proto::exact;
use wide::f32x4;

/// Four blocks, by row and column.
pub(crate) type Blocks = [[f32x4; 8]; 8];

/// Zero blocks.
pub(crate) const EMPTY: Blocks = [[f32x4::ZERO; 8]; 8];

/// cos(π/4), cos(3π/8), and the other constants of the flow graph.
const FORWARD: [f32; 4] = [
    std::f32::consts::FRAC_1_SQRT_2,
    0.382_683_43,
    0.541_196_1,
    1.306_563,
];
const BACKWARD: [f32; 4] = [
    std::f32::consts::SQRT_2,
    1.847_759_1,
    1.082_392_2,
    2.613_126,
];

/// Scale of coefficient (v, u) in the output of [`forward`] relative to the orthonormal
/// transform; [`backward`] expects the inverse scale. Times 8.
pub(crate) fn factor(v: usize, u: usize) -> f64 {
    let of = |k: usize| match k {
        0 => 1.0,
        _ => exact::cos(k as f64 * std::f64::consts::PI / 16.0) * std::f64::consts::SQRT_2,
    };
    of(v) * of(u)
}

/// Scaled coefficients of blocks, in place.
pub(crate) fn forward(blocks: &mut Blocks) {
    for row in blocks.iter_mut() {
        *row = forward_line(*row);
    }
    columns(blocks, forward_line);
}

/// Blocks from scaled coefficients, in place.
pub(crate) fn backward(blocks: &mut Blocks) {
    columns(blocks, backward_line);
    for row in blocks.iter_mut() {
        *row = backward_line(*row);
    }
}

#[inline]
fn columns(blocks: &mut Blocks, line: impl Fn([f32x4; 8]) -> [f32x4; 8]) {
    for x in 0..8 {
        let column = line(blocks.map(|row| row[x]));
        for (row, value) in blocks.iter_mut().zip(column) {
            row[x] = value;
        }
    }
}

#[inline]
fn forward_line(d: [f32x4; 8]) -> [f32x4; 8] {
    let [c4, c6, less, more] = FORWARD.map(f32x4::splat);
    let [s0, s1, s2, s3] = [d[0] + d[7], d[1] + d[6], d[2] + d[5], d[3] + d[4]];
    let [t0, t1, t2, t3] = [d[0] - d[7], d[1] - d[6], d[2] - d[5], d[3] - d[4]];
    let (a0, a3, a1, a2) = (s0 + s3, s0 - s3, s1 + s2, s1 - s2);
    let z = (a2 + a3) * c4;
    let (b0, b1, b2) = (t3 + t2, t2 + t1, t1 + t0);
    let z5 = (b0 - b2) * c6;
    let (z2, z4, z3) = (less * b0 + z5, more * b2 + z5, b1 * c4);
    let (z11, z13) = (t0 + z3, t0 - z3);
    [
        a0 + a1,
        z11 + z4,
        a3 + z,
        z13 - z2,
        a0 - a1,
        z13 + z2,
        a3 - z,
        z11 - z4,
    ]
}

#[inline]
fn backward_line(c: [f32x4; 8]) -> [f32x4; 8] {
    let [root, a, b, d] = BACKWARD.map(f32x4::splat);
    let (s0, s1, s3) = (c[0] + c[4], c[0] - c[4], c[2] + c[6]);
    let s2 = (c[2] - c[6]) * root - s3;
    let (e0, e3, e1, e2) = (s0 + s3, s0 - s3, s1 + s2, s1 - s2);
    let (z13, z10, z11, z12) = (c[5] + c[3], c[5] - c[3], c[1] + c[7], c[1] - c[7]);
    let o7 = z11 + z13;
    let z5 = (z10 + z12) * a;
    let o6 = z5 - z10 * d - o7;
    let o5 = (z11 - z13) * root - o6;
    let o4 = z5 - z12 * b - o5;
    [
        e0 + o7,
        e1 + o6,
        e2 + o5,
        e3 + o4,
        e3 - o4,
        e2 - o5,
        e1 - o6,
        e0 - o7,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks() -> Blocks {
        let value = |y: usize, x: usize, lane: usize| {
            ((y * 37 + x * 91 + y * x * 13 + lane * 57) % 251) as f32 - 125.0
        };
        std::array::from_fn(|y| {
            std::array::from_fn(|x| f32x4::from([0, 1, 2, 3].map(|lane| value(y, x, lane))))
        })
    }

    #[test]
    fn coefficients_match_the_definition_up_to_their_factor() {
        let (given, mut made) = (blocks(), blocks());
        forward(&mut made);
        let cos = |x: usize, u: usize| {
            let scale = if u == 0 { 0.125_f64.sqrt() } else { 0.5 };
            scale * exact::cos((2 * x + 1) as f64 * u as f64 * std::f64::consts::PI / 16.0)
        };
        for (v, u) in (0..64).map(|k| (k / 8, k % 8)) {
            for lane in 0..4 {
                let of = |(y, x): (usize, usize)| {
                    f64::from(given[y][x].to_array()[lane]) * cos(x, u) * cos(y, v)
                };
                let sum: f64 = (0..64).map(|k| of((k / 8, k % 8))).sum();
                let found = f64::from(made[v][u].to_array()[lane]) / (8.0 * factor(v, u));
                assert!((found - sum).abs() < 2e-3, "{v} {u}: {found} for {sum}");
            }
        }
    }

    #[test]
    fn the_inverse_transform_restores_the_blocks() {
        let (given, mut made) = (blocks(), blocks());
        forward(&mut made);
        // Over 8 f to the orthonormal coefficient, times f / 8 to the scaled one.
        for c in made.as_flattened_mut() {
            *c *= f32x4::splat(1.0 / 64.0);
        }
        backward(&mut made);
        for (a, b) in given.as_flattened().iter().zip(made.as_flattened()) {
            for (a, b) in a.to_array().iter().zip(b.to_array()) {
                assert!((a - b).abs() < 1e-3, "{b} for {a}");
            }
        }
    }
}
