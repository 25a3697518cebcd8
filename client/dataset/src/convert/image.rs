//! Images for other programs: scaled, PNG, depth in millimetres.

use std::str::FromStr;

use png::{BitDepth, ColorType, Compression};

/// Size of images, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels from left to right.
    pub width: usize,
    /// Pixels from top to bottom.
    pub height: usize,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |s: &str| s.parse().ok().filter(|n| (1..=8192).contains(n));
        text.split_once('x')
            .and_then(|(w, h)| {
                Some(Self {
                    width: parse(w)?,
                    height: parse(h)?,
                })
            })
            .ok_or_else(|| format!("invalid size {text:?}: write it as 320x180, at most 8192x8192"))
    }
}

/// The part of `from` sources under target pixel `index` of `to`: sources with
/// their weights, which sum to 1.
fn weights(index: usize, to: usize, from: usize) -> Vec<(usize, f32)> {
    let scale = from as f32 / to as f32;
    let (start, end) = (index as f32 * scale, (index + 1) as f32 * scale);
    (start as usize..(end.ceil() as usize).min(from))
        .map(|s| {
            let part = end.min(s as f32 + 1.0) - start.max(s as f32);
            (s, part.max(0.0) / scale)
        })
        .collect()
}

/// RGB8 scaled by area; larger targets repeat pixels.
#[must_use]
pub fn scaled(rgb: Vec<u8>, from: Size, to: Size) -> Vec<u8> {
    if from == to {
        return rgb;
    }
    let columns: Vec<_> = (0..to.width)
        .map(|x| weights(x, to.width, from.width))
        .collect();
    let mut out = Vec::with_capacity(3 * to.width * to.height);
    let mut line = vec![0.0_f32; 3 * from.width];
    for y in 0..to.height {
        line.fill(0.0);
        for (row, weight) in weights(y, to.height, from.height) {
            let source = &rgb[3 * row * from.width..3 * (row + 1) * from.width];
            for (sum, &value) in line.iter_mut().zip(source) {
                *sum += weight * f32::from(value);
            }
        }
        for column in &columns {
            let mut sum = [0.0_f32; 3];
            for &(x, weight) in column {
                for (s, value) in sum.iter_mut().zip(&line[3 * x..3 * x + 3]) {
                    *s += weight * value;
                }
            }
            out.extend(sum.map(|s| s.round().clamp(0.0, 255.0) as u8));
        }
    }
    out
}

fn encode(bytes: &[u8], size: Size, color: ColorType, depth: BitDepth) -> anyhow::Result<Vec<u8>> {
    let mut out = Vec::with_capacity(bytes.len() / 2);
    let mut encoder = png::Encoder::new(
        &mut out,
        u32::try_from(size.width)?,
        u32::try_from(size.height)?,
    );
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()?;
    Ok(out)
}

/// RGB8 as PNG.
///
/// # Errors
/// When the bytes do not have the size.
pub fn png_rgb(rgb: &[u8], size: Size) -> anyhow::Result<Vec<u8>> {
    encode(rgb, size, ColorType::Rgb, BitDepth::Eight)
}

/// Depth as 16-bit PNG in millimetres; 0 where nothing was hit or the surface is
/// farther than 65.535 m.
///
/// # Errors
/// When the values do not have the size.
pub fn png_depth(metres: &[f32], size: Size) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(2 * metres.len());
    for &m in metres {
        bytes.extend(crate::depth::millimetres(m).to_be_bytes());
    }
    encode(&bytes, size, ColorType::Grayscale, BitDepth::Sixteen)
}

/// Depth as grey 8-bit PNG stretched between the least and greatest finite depth
/// of the image, as WheelArm-Sim's script saves it; white where nothing was
/// hit.
///
/// # Errors
/// When the values do not have the size.
pub fn png_grey(metres: &[f32], size: Size) -> anyhow::Result<Vec<u8>> {
    // Without branches this runs on many values at once.
    let (low, high) = metres.iter().fold((f32::MAX, f32::MIN), |(l, h), &m| {
        let there = m.is_finite();
        let (a, b) = if there { (m, m) } else { (l, h) };
        (if a < l { a } else { l }, if b > h { b } else { h })
    });
    let scale = 255.0 / (high - low).max(1e-6);
    let grey: Vec<u8> = metres
        .iter()
        .map(|&m| {
            if m.is_finite() {
                ((m - low) * scale) as u8
            } else {
                255
            }
        })
        .collect();
    encode(&grey, size, ColorType::Grayscale, BitDepth::Eight)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaling_keeps_the_mean_and_a_flat_colour() {
        let from = Size {
            width: 13,
            height: 7,
        };
        let to = Size {
            width: 5,
            height: 3,
        };
        let flat = scaled([10, 200, 30].repeat(13 * 7), from, to);
        assert_eq!(flat, [10, 200, 30].repeat(15));
        let ramp: Vec<u8> = (0..13 * 7 * 3).map(|i| (i % 251) as u8).collect();
        let mean = |v: &[u8]| v.iter().map(|&b| f64::from(b)).sum::<f64>() / v.len() as f64;
        let before = mean(&ramp);
        assert!((mean(&scaled(ramp, from, to)) - before).abs() < 1.0);
    }
}
