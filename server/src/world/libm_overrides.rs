//! Defines the C library functions that the engine calls.
//!
//! Parts of the engine call `f32::acos`, `cos`, `sin` and `sin_cos` regardless of its
//! features: the axes of an inertia, the start of a convex hull, the limits of a hinge.
//! Rust forwards these to the C library, whose last bits depend on its version and on
//! the CPU: glibc 2.41 has another `acosf` than 2.36, and a robot then has other
//! masses. A program's own definition takes precedence over that of a library. These
//! four functions have the C library's names, so they run wherever this crate is linked
//! in.
//!
//! They give the bits of glibc 2.31 to 2.40 without FMA, because recordings contain
//! them: `acosf` is that of Sun's fdlibm ("freely granted"), `cosf` and `sinf` those of
//! Arm's optimized routines (MIT), compared for every number of one turn and more. The
//! engine's soft bodies also call `expf` and `powf`; this program has none.
#![allow(unsafe_code)] // Four names that the linker sees; nothing else here is.

use std::f64::consts::FRAC_PI_2;
use std::mem::MaybeUninit;

use wheelarm_proto::exact;

/// Arc cosine, rad; NaN outside -1 to 1.
#[unsafe(no_mangle)]
pub extern "C" fn acosf(x: f32) -> f32 {
    acos(x)
}

/// Cosine of an angle, rad.
#[unsafe(no_mangle)]
pub extern "C" fn cosf(x: f32) -> f32 {
    wave(x, true)
}

/// Sine of an angle, rad.
#[unsafe(no_mangle)]
pub extern "C" fn sinf(x: f32) -> f32 {
    wave(x, false)
}

/// Sine and cosine of an angle, rad: called when the compiler merges both.
#[unsafe(no_mangle)]
pub extern "C" fn sincosf(x: f32, sine: &mut MaybeUninit<f32>, cosine: &mut MaybeUninit<f32>) {
    sine.write(wave(x, false));
    cosine.write(wave(x, true));
}

/// A quarter turn, rad, in two parts: rounded down, and the remainder.
const QUARTER: [f32; 2] = [f32::from_bits(0x3fc9_0fda), 7.549_789_4e-8];
/// Half a turn, rad, rounded down; its remainder is twice that of a quarter.
const HALF: f32 = f32::from_bits(0x4049_0fda);

fn acos(x: f32) -> f32 {
    let size = x.abs();
    if size.is_nan() || size > 1.0 {
        return f32::NAN;
    }
    if size == 1.0 {
        return if x > 0.0 {
            0.0
        } else {
            HALF + 2.0 * QUARTER[1]
        };
    }
    if size < 0.5 {
        if size <= f32::from_bits(0x3280_0000) {
            return QUARTER[0] + QUARTER[1];
        }
        return QUARTER[0] - (x - (QUARTER[1] - x * ratio(x * x)));
    }
    let z = (1.0 - size) * 0.5;
    let root = z.sqrt();
    if x < 0.0 {
        return HALF - 2.0 * (root + (ratio(z) * root - QUARTER[1]));
    }
    // The root in two parts, the first with half of the digits.
    let high = f32::from_bits(root.to_bits() & 0xffff_f000);
    let low = (z - high * high) / (root + high);
    2.0 * (high + (ratio(z) * root + low))
}

/// (asin(√z) - √z) / z^1.5 by a ratio of two polynomials.
fn ratio(z: f32) -> f32 {
    const P: [f32; 6] = [
        0.16666667,
        -0.32556581,
        0.20121253,
        -0.040055536,
        0.000_791_535,
        0.000_034_793_31,
    ];
    const Q: [f32; 4] = [-2.403395, 2.0209458, -0.688284, 0.077_038_154];
    let over = z * (P[0] + z * (P[1] + z * (P[2] + z * (P[3] + z * (P[4] + z * P[5])))));
    over / (1.0 + z * (Q[0] + z * (Q[1] + z * (Q[2] + z * Q[3]))))
}

/// Sine or cosine: computed in double precision, rounded once.
fn wave(angle: f32, cosine: bool) -> f32 {
    /// Quarters of a turn in one radian, times 2^24.
    const QUARTERS: f64 = 10_680_707.430_881_744;
    // Compared by the upper bits: 0.75, 2^-12 and 120 rad.
    let size = (angle.to_bits() >> 20) & 0x7ff;
    let x = f64::from(angle);
    match size {
        0..0x398 => return if cosine { 1.0 } else { angle },
        0x398..0x3f4 => return part(x, x * x, cosine, 1.0),
        0x3f4..0x42f => (),
        _ if cosine => return exact::cos(angle),
        _ => return exact::sin(angle),
    }
    let quarter = ((x * QUARTERS) as i32).wrapping_add(0x80_0000) >> 24;
    let x = x - f64::from(quarter) * FRAC_PI_2;
    let sign = if matches!(quarter & 3, 1 | 2) {
        -1.0
    } else {
        1.0
    };
    let turned = if quarter & 2 == 0 { 1.0 } else { -1.0 };
    part(x * sign, x * x, (quarter & 1 != 0) != cosine, turned)
}

/// Sine or, times `turned`, cosine of an angle of at most an eighth of a turn.
fn part(x: f64, x2: f64, cosine: bool, turned: f64) -> f32 {
    if cosine {
        const C: [f64; 4] = [
            -0.499_999_997_251_082_24,
            0.041_666_623_324_344_516,
            -0.001_388_676_379_437_604,
            2.439_045_070_356_454_2e-5,
        ];
        let x4 = x2 * x2;
        let high = C[2] + x2 * C[3];
        let sum = (1.0 + x2 * C[0]) + x4 * C[1];
        return (turned * (sum + (x4 * x2) * high)) as f32;
    }
    const S: [f64; 3] = [
        -0.166_666_549_437_010_84,
        0.008_332_178_146_138_854,
        -0.000_195_172_989_813_857_25,
    ];
    let x3 = x * x2;
    let high = S[1] + x2 * S[2];
    ((x + x3 * S[0]) + (x3 * x2) * high) as f32
}

#[cfg(test)]
mod tests {
    use std::hint::black_box;

    /// Numbers for which C libraries differ: with FMA or without, before glibc 2.41 or
    /// since. Rust's methods must give the bits of this module.
    #[test]
    fn engine_functions_have_the_same_bits_with_every_c_library() {
        let acos = [
            (0x3e99_999d, 1.266_103_5),
            (0x3ecc_ccd3, 1.159_279_4),
            (0x3f4c_d291, 0.643_354_4),
        ];
        for (bits, angle) in acos {
            let x = f32::from_bits(bits);
            assert_eq!(black_box(x).acos().to_bits(), f32::to_bits(angle), "{x}");
        }
        let x: f32 = black_box(17.278738);
        assert_eq!(x.cos(), -2.1572892e-5);
        assert_eq!(x.sin_cos().1, -2.1572892e-5);
        let x: f32 = black_box(-53.42252);
        assert_eq!(x.sin(), 0.015443958);
        assert_eq!(x.sin_cos().0, 0.015443958);
    }

    #[test]
    fn engine_functions_are_accurate_everywhere() {
        for i in -600_000..=600_000 {
            let x = i as f32 * 2.5e-4;
            let (sine, cosine) = black_box(x).sin_cos();
            assert!((f64::from(sine) - f64::from(x).sin()).abs() < 1e-7, "{x}");
            assert!((f64::from(cosine) - f64::from(x).cos()).abs() < 1e-7, "{x}");
            let c = (i as f32 / 6e5).clamp(-1.0, 1.0);
            let angle = f64::from(black_box(c).acos());
            assert!((angle - f64::from(c).acos()).abs() < 4e-7, "{c}");
        }
        for none in [f32::NAN, f32::INFINITY, 1.5, -1.5] {
            assert!(black_box(none).acos().is_nan());
        }
        for none in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let (sine, cosine) = black_box(none).sin_cos();
            assert!(sine.is_nan() && cosine.is_nan());
        }
    }
}
