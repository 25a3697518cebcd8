//! Depth in metres as 16-bit millimetres; 0 means no measurement.

/// Converts little-endian float32 metres to little-endian u16 millimetres.
pub fn to_millimetres(metres: &[u8], out: &mut Vec<u8>) {
    let (metres, _) = metres.as_chunks::<4>();
    // Every byte is overwritten below, so it need not be cleared.
    out.resize(metres.len() * 2, 0);
    let (out, _) = out.as_chunks_mut::<2>();
    for (to, from) in out.iter_mut().zip(metres) {
        *to = millimetres(f32::from_le_bytes(*from)).to_le_bytes();
    }
}

/// One depth in millimetres, rounded; 0 for none. `f32::round` would call the C library
/// when the CPU's rounding instruction cannot be assumed, and this runs for every
/// pixel.
#[must_use]
pub fn millimetres(metres: f32) -> u16 {
    let exact = metres * 1000.0;
    // Values that round to more than 65 535 are too far, including +inf.
    let measured = metres > 0.0 && exact < 65_535.5;
    let exact = if measured { exact } else { 0.0 };
    let whole = exact as u16;
    let rounded = whole + u16::from(exact - f32::from(whole) >= 0.5);
    // A surface nearer than 0.5 mm must not become 0.
    rounded.max(u16::from(measured))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millimetres_are_rounded_and_mark_missing_measurements() {
        let cases = [
            (0.0, 0),
            (-1.0, 0),
            (f32::NAN, 0),
            (f32::INFINITY, 0),
            (65.536, 0),
            (65.535, 65_535),
            (1.2344, 1234),
            (1.2346, 1235),
            (0.0001, 1),
        ];
        for (metres, expected) in cases {
            assert_eq!(millimetres(metres), expected, "{metres} m");
        }
    }

    #[test]
    fn rounding_is_that_of_the_standard_library() {
        for step in 0..2_000_000_u32 {
            let metres = f32::from_bits(0x3a00_0000 + 131 * step);
            let rounded = (metres * 1000.0).round();
            let expected = if rounded <= 65_535.0 {
                (rounded as u16).max(1)
            } else {
                0
            };
            assert_eq!(millimetres(metres), expected, "{metres} m");
        }
    }
}
