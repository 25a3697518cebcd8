//! Hashes and noise that repeat with the image.

/// A number 0 to 1 for a lattice point.
pub(super) fn hash(x: i32, y: i32, seed: u32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B1)
        ^ (y as u32).wrapping_mul(0x85EB_CA77)
        ^ seed.wrapping_mul(0xC2B2_AE3D);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    ((h ^ (h >> 15)) >> 8) as f32 / (1 << 24) as f32
}

/// Smooth noise 0 to 1 with `nx` by `ny` cells in the unit square, periodic.
pub(super) fn noise(u: f32, v: f32, nx: i32, ny: i32, seed: u32) -> f32 {
    let (x, y) = (u * nx as f32, v * ny as f32);
    let (ix, iy) = (below(x), below(y));
    let ease = |t: f32| t * t * (3.0 - 2.0 * t);
    let (fx, fy) = (ease(x - ix as f32), ease(y - iy as f32));
    let (x0, x1) = (wrap(ix, nx), wrap(ix + 1, nx));
    let (y0, y1) = (wrap(iy, ny), wrap(iy + 1, ny));
    let at = |x: i32, y: i32| hash(x, y, seed);
    mix(
        mix(at(x0, y0), at(x1, y0), fx),
        mix(at(x0, y1), at(x1, y1), fx),
        fy,
    )
}

/// The whole number at or below `x`. (`f32::floor` is a call into the C library
/// where the processor's own instruction may not be assumed.)
fn below(x: f32) -> i32 {
    let toward_zero = x as i32;
    toward_zero - i32::from(toward_zero as f32 > x)
}

/// `i` modulo `n`; dividing only where it must.
fn wrap(i: i32, n: i32) -> i32 {
    if (0..n).contains(&i) {
        i
    } else {
        i.rem_euclid(n)
    }
}

/// Octaves of [`noise`], each twice as fine and half as strong; 0 to 1.
pub(super) fn fractal(u: f32, v: f32, nx: i32, ny: i32, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
    for octave in 0..octaves {
        sum += weight * noise(u, v, nx << octave, ny << octave, seed + octave);
        total += weight;
        weight *= 0.5;
    }
    sum / total
}

pub(super) fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

pub(super) fn blend(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    std::array::from_fn(|k| mix(a[k], b[k], t))
}

pub(super) fn scale(a: [f32; 3], t: f32) -> [f32; 3] {
    a.map(|c| c * t)
}

/// 0 below `a`, 1 above `b`, smooth between.
pub(super) fn ramp(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
