//! Depth as 16-bit millimetres, the convention of ROS REP 118 and of RGB-D
//! cameras: 0 means that nothing was measured.

/// How depth is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthFormat {
    /// float32 metres, bit by bit as rendered; +inf where nothing is hit.
    #[default]
    Metres,
    /// u16 millimetres at half the size, rounded to the nearest; 0 where
    /// nothing is hit or the surface is farther than 65.535 m.
    Millimetres,
}

/// What the attribute of a millimetre dataset says.
pub const MILLIMETRES_NOTE: &str =
    "0 where nothing is hit (+inf) or the surface is farther than 65.535 m";

/// Converts little-endian float32 metres to little-endian u16 millimetres.
pub fn to_millimetres(metres: &[u8], out: &mut Vec<u8>) {
    out.clear();
    out.reserve(metres.len() / 2);
    for bytes in metres.chunks_exact(4) {
        let metres = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        out.extend_from_slice(&millimetres(metres).to_le_bytes());
    }
}

/// One depth in millimetres, rounded; 0 where there is none.
pub(crate) fn millimetres(metres: f32) -> u16 {
    let rounded = (metres * 1000.0).round();
    if metres > 0.0 && rounded <= 65_535.0 {
        // A surface nearer than 0.5 mm must not read as nothing.
        (rounded as u16).max(1)
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millimetres_round_and_mark_what_was_not_measured() {
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
}
