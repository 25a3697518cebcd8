//! Transcendental functions with the same bits on every machine.
//!
//! The methods of `f64` call the C library, whose last bits depend on CPU and version.
//! That is enough for a replay to diverge from its recording within a second. All
//! values that reach the simulation state, its samples or a command therefore use this
//! module, which computes in Rust (crate `libm`). Angles in radians.

/// A floating-point number with exact functions: `f32` and `f64`.
pub trait Real: Copy {
    /// See [`sin`].
    fn exact_sin(self) -> Self;
    /// See [`cos`].
    fn exact_cos(self) -> Self;
    /// See [`sin_cos`].
    fn exact_sin_cos(self) -> (Self, Self);
    /// See [`tan`].
    fn exact_tan(self) -> Self;
    /// See [`asin`].
    fn exact_asin(self) -> Self;
    /// See [`acos`].
    fn exact_acos(self) -> Self;
    /// See [`atan2`].
    fn exact_atan2(self, x: Self) -> Self;
    /// See [`ln`].
    fn exact_ln(self) -> Self;
    /// See [`powf`].
    fn exact_powf(self, exponent: Self) -> Self;
    /// See [`hypot`].
    fn exact_hypot(self, other: Self) -> Self;
}

macro_rules! real {
    ($number:ty, $sin:ident, $cos:ident, $sincos:ident, $tan:ident, $asin:ident, $acos:ident, $atan2:ident, $log:ident, $pow:ident, $hypot:ident) => {
        impl Real for $number {
            fn exact_sin(self) -> Self {
                libm::$sin(self)
            }
            fn exact_cos(self) -> Self {
                libm::$cos(self)
            }
            fn exact_sin_cos(self) -> (Self, Self) {
                libm::$sincos(self)
            }
            fn exact_tan(self) -> Self {
                libm::$tan(self)
            }
            fn exact_asin(self) -> Self {
                libm::$asin(self)
            }
            fn exact_acos(self) -> Self {
                libm::$acos(self)
            }
            fn exact_atan2(self, x: Self) -> Self {
                libm::$atan2(self, x)
            }
            fn exact_ln(self) -> Self {
                libm::$log(self)
            }
            fn exact_powf(self, exponent: Self) -> Self {
                libm::$pow(self, exponent)
            }
            fn exact_hypot(self, other: Self) -> Self {
                libm::$hypot(self, other)
            }
        }
    };
}

real!(
    f64, sin, cos, sincos, tan, asin, acos, atan2, log, pow, hypot
);
real!(
    f32, sinf, cosf, sincosf, tanf, asinf, acosf, atan2f, logf, powf, hypotf
);

/// Sine.
#[must_use]
pub fn sin<T: Real>(angle: T) -> T {
    angle.exact_sin()
}

/// Cosine.
#[must_use]
pub fn cos<T: Real>(angle: T) -> T {
    angle.exact_cos()
}

/// Sine and cosine.
#[must_use]
pub fn sin_cos<T: Real>(angle: T) -> (T, T) {
    angle.exact_sin_cos()
}

/// Tangent.
#[must_use]
pub fn tan<T: Real>(angle: T) -> T {
    angle.exact_tan()
}

/// Arc sine, -π/2 to π/2; NaN beyond -1 and 1.
#[must_use]
pub fn asin<T: Real>(x: T) -> T {
    x.exact_asin()
}

/// Arc cosine, 0 to π; NaN beyond -1 and 1.
#[must_use]
pub fn acos<T: Real>(x: T) -> T {
    x.exact_acos()
}

/// Angle of the point (x, y), -π to π.
#[must_use]
pub fn atan2<T: Real>(y: T, x: T) -> T {
    y.exact_atan2(x)
}

/// Natural logarithm; NaN below 0.
#[must_use]
pub fn ln<T: Real>(x: T) -> T {
    x.exact_ln()
}

/// Power; NaN for a root of a negative number.
#[must_use]
pub fn powf<T: Real>(x: T, exponent: T) -> T {
    x.exact_powf(exponent)
}

/// Length of the hypotenuse.
#[must_use]
pub fn hypot<T: Real>(x: T, y: T) -> T {
    x.exact_hypot(y)
}

/// `value` clamped to two limits. Unlike `clamp` it never panics: NaN becomes 0, a NaN
/// limit does not apply, and of crossed limits the upper one applies.
#[must_use]
pub fn within(value: f64, lower: f64, upper: f64) -> f64 {
    if value.is_nan() {
        0.0
    } else {
        value.max(lower).min(upper)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Covers arguments where C libraries differ in the last bits; every machine must
    /// agree with this hash.
    #[test]
    fn bits_are_the_same_on_every_machine() {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut add = |x: f64| {
            hash = (hash ^ x.to_bits()).wrapping_mul(0x0000_0100_0000_01b3);
        };
        for i in 0..2000 {
            let x = f64::from(i) * 0.0137 - 13.0;
            let part = f64::from(i) / 1000.0 - 1.0;
            let (s, c) = sin_cos(x);
            assert_eq!((s, c), (sin(x), cos(x)));
            for y in [
                s,
                c,
                tan(x),
                asin(part),
                acos(part),
                atan2(x, part),
                ln(x.abs()),
                powf(x.abs(), 2.4),
                hypot(x, part),
            ] {
                add(y);
            }
        }
        assert_eq!(hash, 0xa212_82cd_03d0_b034, "{hash:#018x}");
    }

    #[test]
    fn invalid_limits_do_not_panic() {
        assert_eq!(within(2.0, -1.0, 1.0), 1.0);
        assert_eq!(within(-2.0, -1.0, 1.0), -1.0);
        assert_eq!(within(f64::NAN, -1.0, 1.0), 0.0);
        assert_eq!(within(0.5, f64::NAN, f64::NAN), 0.5);
        assert_eq!(within(0.5, 1.0, -1.0), -1.0);
    }
}
