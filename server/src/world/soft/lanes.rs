//! Single precision, four lanes at once, of which the fourth is zero: a vector of
//! three, and blocks of 3 x 3 by columns.
//!
//! Only sums, products and quotients, never fused: the same bits everywhere.

use nalgebra::{Matrix3, Vector3};
use wide::f32x4;

/// A vector or a column; the fourth lane is 0.
pub(super) type Lanes = f32x4;
/// Three columns.
pub(super) type Block = [Lanes; 3];

/// A vector as lanes.
pub(super) fn lanes(v: &Vector3<f64>) -> Lanes {
    Lanes::new([v.x as f32, v.y as f32, v.z as f32, 0.0])
}

/// A matrix as a block.
pub(super) fn block(matrix: &Matrix3<f64>) -> Block {
    [0, 1, 2].map(|j| lanes(&matrix.column(j).into_owned()))
}

/// A block times a vector.
pub(super) fn times(block: &Block, of: Lanes) -> Lanes {
    let [a, b, c, _] = of.to_array();
    block[0] * Lanes::splat(a) + block[1] * Lanes::splat(b) + block[2] * Lanes::splat(c)
}

/// Sum of the lanes, in a fixed order.
pub(super) fn sum(lanes: Lanes) -> f32 {
    let [a, b, c, _] = lanes.to_array();
    a + b + c
}

/// Inverse of a block; zero for a singular one.
pub(super) fn inverse(block: &Block) -> Block {
    let columns = block.map(Lanes::to_array);
    let at = |i: usize, j: usize| columns[j][i];
    let minor = |i: [usize; 2], j: [usize; 2]| {
        at(i[0], j[0]) * at(i[1], j[1]) - at(i[0], j[1]) * at(i[1], j[0])
    };
    // Rows of the adjugate.
    let first = [
        minor([1, 2], [1, 2]),
        -minor([0, 2], [1, 2]),
        minor([0, 1], [1, 2]),
    ];
    let determinant = at(0, 0) * first[0] + at(1, 0) * first[1] + at(2, 0) * first[2];
    if determinant == 0.0 || !determinant.is_finite() {
        return Block::default();
    }
    let second = [
        -minor([1, 2], [0, 2]),
        minor([0, 2], [0, 2]),
        -minor([0, 1], [0, 2]),
    ];
    let third = [
        minor([1, 2], [0, 1]),
        -minor([0, 2], [0, 1]),
        minor([0, 1], [0, 1]),
    ];
    let over = 1.0 / determinant;
    [0, 1, 2].map(|j| Lanes::new([first[j] * over, second[j] * over, third[j] * over, 0.0]))
}
