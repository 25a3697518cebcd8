//! Depth as LeRobot 0.6 puts it into a video: 12-bit codes on a logarithmic
//! scale, with its own default range (lerobot/configs/video.py, `quantize_depth`
//! in lerobot/datasets/depth_utils.py). At 1 m a step is 1.5 mm.

use std::sync::LazyLock;

/// Depth of code 0, m. No return reads as this.
pub const LEAST: f64 = 0.01;
/// Depth of the greatest code, m. Greater depths are clamped to it.
pub const MOST: f64 = 10.0;
/// Added to a depth before the logarithm, m.
pub const SHIFT: f64 = 3.5;
/// The greatest code.
const GREATEST: f64 = 4095.0;

/// Code of every depth in millimetres.
static CODES: LazyLock<Vec<u16>> = LazyLock::new(|| (0..=u16::MAX).map(code).collect());

fn code(millimetres: u16) -> u16 {
    let scale = |metres: f64| (metres + SHIFT).ln();
    let share =
        (scale(f64::from(millimetres) * 1e-3) - scale(LEAST)) / (scale(MOST) - scale(LEAST));
    (share * GREATEST).round_ties_even().clamp(0.0, GREATEST) as u16
}

/// A depth (m; 0 or infinite for no return), clamped to the range of codes.
#[must_use]
pub fn quantized(metres: f32) -> f32 {
    let some = crate::depth::millimetres(metres) > 0;
    let metres = if some { metres } else { 0.0 };
    metres.clamp(LEAST as f32, MOST as f32)
}

/// Codes of a depth image (m; 0 or infinite for no return), little-endian.
#[must_use]
pub fn frame(depth: &[f32]) -> Vec<u8> {
    let codes = depth.iter().map(|&metres| {
        let millimetres = crate::depth::millimetres(metres);
        CODES[usize::from(millimetres)].to_le_bytes()
    });
    codes.flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `dequantize_depth` in millimetres.
    fn read(code: u16) -> f64 {
        let (least, most) = ((LEAST + SHIFT).ln(), (MOST + SHIFT).ln());
        let metres = (f64::from(code) / GREATEST * (most - least) + least).exp() - SHIFT;
        metres.clamp(LEAST, MOST) * 1e3
    }

    #[test]
    fn a_depth_reads_back_within_half_a_step() {
        for millimetres in 10..=10_000_u16 {
            let half = (f64::from(millimetres) * 1e-3 + SHIFT) * 0.165 + 1e-3;
            let off = (read(code(millimetres)) - f64::from(millimetres)).abs();
            assert!(off <= half, "{millimetres} mm is off by {off} mm");
        }
        assert_eq!(
            (code(0), code(10), code(10_000), code(u16::MAX)),
            (0, 0, 4095, 4095)
        );
    }

    #[test]
    fn no_return_is_code_zero() {
        let depth = [0.0, f32::INFINITY, 20.0];
        assert_eq!(frame(&depth), [0, 0, 0, 0, 255, 15]);
        assert_eq!(depth.map(quantized), [0.01, 0.01, 10.0]);
    }
}
