//! Model of a video codec: 8×8 blocks of a cosine transform in luma and, at half the
//! size, chroma, with quantised coefficients. The quantisation step follows the bit
//! rate, image by image. No stream is produced: the bits of an entropy coder are
//! estimated.
//!
//! Four blocks are processed at a time, one in each lane: a band of 32×16 pixels is two
//! squares of 16×16, four blocks of luma above as many, and two of blue beside two of
//! red.

use wheelarm_proto::exact;
use wide::{f32x4, i32x4};

use crate::transform::{Blocks, EMPTY, backward, factor, forward};

/// Larger than the number of steps of a mean, so that truncation rounds down.
const MEANS: f32 = 16384.0;
/// Bits of a block without coefficients. A coefficient of one step takes 4 more, and
/// two for each binary digit beyond the first.
const BITS_OF_BLOCK: f32 = 0.5;
/// Larger magnitudes take as many bits as this one.
const DIGITS: f32 = 63.0;
/// Rounding offset of a coefficient: it counts from two thirds of a step, as in intra
/// frames of H.264's reference encoder.
const ROUND: f32 = 1.0 / 3.0;
/// Finest and coarsest step, levels of 255.
const STEPS: (f64, f64) = (0.5, 120.0);
/// Side of a square, pixels: four blocks of luma, one of each chroma.
const SQUARE: usize = 16;
/// Columns of a band: two squares.
const BAND: usize = 2 * SQUARE;
/// Bytes of a line, padded so that four can be read at each pixel.
const PADDED: usize = 3 * BAND + 4;

/// ITU-R BT.601, full range: shares of red, green and blue in luma, and of the
/// differences in chroma, with a quarter for each of four pixels.
const LUMA: [f32; 3] = [0.299, 0.587, 0.114];
const CHROMA: [f32; 2] = [0.25 * 0.564, 0.25 * 0.713];

/// Encodes and decodes images.
#[derive(Clone, Debug)]
pub(crate) struct Coder {
    /// Present quantisation step, levels of 255.
    step: f64,
}

/// Scale factors of a quantisation step.
struct Steps {
    /// Steps per scaled coefficient.
    up: [[f32; 8]; 8],
    /// Scaled coefficient per step, for decoding.
    down: [[f32; 8]; 8],
}

impl Steps {
    fn from_step(step: f64) -> Self {
        let each = |of: &dyn Fn(f64) -> f64| {
            std::array::from_fn(|v| std::array::from_fn(|u| of(factor(v, u)) as f32))
        };
        Self {
            up: each(&|factor| 1.0 / (8.0 * factor * step)),
            down: each(&|factor| step * factor / 8.0),
        }
    }

    /// Transforms, quantises and restores blocks; returns the bits of each.
    fn pass(&self, blocks: &mut Blocks) -> [f32; 4] {
        forward(blocks);
        // The mean has a finer step: it is predicted best.
        let finer = blocks[0][0] * f32x4::splat(2.0 * self.up[0][0]);
        let finer = (finer + f32x4::splat(MEANS + 0.5)).fast_trunc_int();
        let finer = finer.round_float() - f32x4::splat(MEANS);
        let mean = finer * f32x4::splat(0.5 * self.down[0][0]);
        blocks[0][0] = f32x4::ZERO;
        let mut bits = i32x4::ZERO;
        for (v, row) in blocks.iter_mut().enumerate() {
            for (u, c) in row.iter_mut().enumerate() {
                let (up, down) = (f32x4::splat(self.up[v][u]), f32x4::splat(self.down[v][u]));
                let level = (c.abs() * up + f32x4::splat(ROUND)).fast_trunc_int();
                let level = level.round_float();
                // The exponent of an integer is its number of digits beyond the first;
                // that of zero is smallest.
                let counted: i32x4 = bytemuck::cast(level.fast_min(f32x4::splat(DIGITS)));
                let digits = (counted >> 23) - i32x4::splat(125);
                let below: i32x4 = digits >> 31;
                bits += (digits + digits) & !below;
                let sign = *c & f32x4::splat(-0.0);
                *c = (level * down) | sign;
            }
        }
        blocks[0][0] = mean;
        if bits == i32x4::ZERO {
            *blocks = [[mean; 8]; 8];
        } else {
            backward(blocks);
        }
        bits.to_array().map(|bits| BITS_OF_BLOCK + bits as f32)
    }
}

/// A band: luma above and below, and chroma, blue in the first two lanes. Lanes of luma
/// are the left half of each square, then the right half.
struct Band {
    luma: [Blocks; 2],
    chroma: Blocks,
}

/// Column of a band for a lane and a position in its block.
#[inline]
fn column(lane: usize, x: usize) -> usize {
    SQUARE * (lane % 2) + 8 * (lane / 2) + x
}

impl Band {
    /// Converts a line of RGB8.
    #[inline]
    fn take(&mut self, y: usize, line: &[[u8; 3]; BAND]) {
        let luma = &mut self.luma[y / 8][y % 8];
        let chroma = &mut self.chroma[y / 2];
        let [of_red, of_green, of_blue] = LUMA.map(f32x4::splat);
        let [blues, reds] = CHROMA.map(f32x4::splat);
        let mut bytes = [0; PADDED];
        bytes[..3 * BAND].copy_from_slice(line.as_flattened());
        // Red is the lowest byte, blue the third; the fourth is of the next pixel.
        let word = |at: usize| {
            let at = 3 * at;
            i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        let low = i32x4::splat(0xff);
        for half in 0..4 {
            let mut both = [f32x4::ZERO; 2];
            for x in [2 * half, 2 * half + 1] {
                let pixels = i32x4::from([
                    word(column(0, x)),
                    word(column(1, x)),
                    word(column(2, x)),
                    word(column(3, x)),
                ]);
                let (green, blue): (i32x4, i32x4) = (pixels >> 8, pixels >> 16);
                let r = (pixels & low).round_float();
                let g = (green & low).round_float();
                let b = (blue & low).round_float();
                let level = of_red * r + of_green * g + of_blue * b;
                luma[x] = level - f32x4::splat(128.0);
                both[0] += blues * (b - level);
                both[1] += reds * (r - level);
            }
            let [[b0, b1, b2, b3], [r0, r1, r2, r3]] = both.map(f32x4::to_array);
            let (left, right) = (f32x4::from([b0, b1, r0, r1]), f32x4::from([b2, b3, r2, r3]));
            if y.is_multiple_of(2) {
                (chroma[half], chroma[4 + half]) = (left, right);
            } else {
                chroma[half] += left;
                chroma[4 + half] += right;
            }
        }
    }

    /// Converts a line back.
    #[inline]
    fn put(&self, y: usize, line: &mut [[u8; 3]; BAND]) {
        let luma = &self.luma[y / 8][y % 8];
        let chroma = &self.chroma[y / 2];
        let mut words = [0_i32; BAND];
        for half in 0..4 {
            let [b0, b1, r0, r1] = chroma[half].to_array();
            let [b2, b3, r2, r3] = chroma[4 + half].to_array();
            let (b, r) = (f32x4::from([b0, b1, b2, b3]), f32x4::from([r0, r1, r2, r3]));
            let colours = [
                r * f32x4::splat(1.403),
                r * f32x4::splat(-0.714) - b * f32x4::splat(0.344),
                b * f32x4::splat(1.773),
            ];
            for x in [2 * half, 2 * half + 1] {
                // Half a level up, because the conversion truncates.
                let level = luma[x] + f32x4::splat(128.5);
                let byte = |colour: f32x4| {
                    let level = (level + colour).fast_max(f32x4::ZERO);
                    level.fast_min(f32x4::splat(255.0)).fast_trunc_int()
                };
                let (green, blue): (i32x4, i32x4) = (byte(colours[1]) << 8, byte(colours[2]) << 16);
                let pixels = (byte(colours[0]) | green | blue).to_array();
                for (lane, pixel) in pixels.into_iter().enumerate() {
                    words[column(lane, x)] = pixel;
                }
            }
        }
        for (pixel, word) in line.iter_mut().zip(words) {
            let [r, g, b, _] = word.to_le_bytes();
            *pixel = [r, g, b];
        }
    }
}

impl Coder {
    pub fn new() -> Self {
        Self { step: 6.0 }
    }

    /// Resets the codec.
    pub fn restart(&mut self) {
        self.step = 6.0;
    }

    /// Encodes and decodes an RGB8 image in place with a budget of `bits`. Returns the
    /// bits used.
    pub fn pass(&mut self, rgb: &mut [u8], [width, height]: [usize; 2], bits: f64) -> f64 {
        if width == 0 {
            return 0.0;
        }
        let steps = Steps::from_step(self.step);
        let (pixels, _) = rgb.as_chunks_mut::<3>();
        let count = (width * height).min(pixels.len());
        let mut taken = 0.0_f64;
        for rows in pixels[..count].chunks_mut(width * SQUARE) {
            for from in (0..width).step_by(BAND) {
                taken += f64::from(pass_band(&steps, rows, width, from));
            }
        }
        // Halfway to the step that would have met the budget.
        let wanted = self.step * exact::powf((taken / bits).clamp(0.1, 10.0), 0.5);
        self.step = wanted.clamp(STEPS.0, STEPS.1);
        taken
    }
}

/// Processes a band of rows, starting at a column, and returns its bits. Pixels beyond
/// an edge repeat it.
fn pass_band(steps: &Steps, rows: &mut [[u8; 3]], width: usize, from: usize) -> f32 {
    let to = (from + BAND).min(width);
    let height = (rows.len() / width).max(1);
    let mut band = Band {
        luma: [EMPTY; 2],
        chroma: EMPTY,
    };
    for y in 0..SQUARE {
        let row = y.min(height - 1) * width;
        let Some(part) = rows.get(row + from..row + to) else {
            break;
        };
        match part.as_array() {
            Some(line) => band.take(y, line),
            None => {
                let mut line = [part[part.len() - 1]; BAND];
                line[..part.len()].copy_from_slice(part);
                band.take(y, &line);
            }
        }
    }
    let squares = (to - from).div_ceil(SQUARE);
    let mut taken = 0.0;
    for blocks in band.luma.iter_mut().chain([&mut band.chroma]) {
        let bits = steps.pass(blocks);
        for square in 0..squares {
            taken += bits[square] + bits[2 + square];
        }
    }
    for (y, row) in rows.chunks_mut(width).enumerate() {
        let Some(part) = row.get_mut(from..to) else {
            break;
        };
        match part.as_mut_array() {
            Some(line) => band.put(y, line),
            None => {
                let mut line = [[0; 3]; BAND];
                band.put(y, &mut line);
                let count = part.len();
                part.copy_from_slice(&line[..count]);
            }
        }
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey, with detail at every scale.
    fn image() -> Vec<u8> {
        let at = |x: usize, y: usize| [((x * x / 8 + y * 5 + (x * y) % 7 * 6) % 200 + 20) as u8; 3];
        (0..48)
            .flat_map(|y| (0..64).flat_map(move |x| at(x, y)))
            .collect()
    }

    fn error(a: &[u8], b: &[u8]) -> f64 {
        let square = |(a, b): (&u8, &u8)| (f64::from(*a) - f64::from(*b)).powi(2);
        (a.iter().zip(b).map(square).sum::<f64>() / a.len() as f64).sqrt()
    }

    #[test]
    fn a_grey_image_is_restored_up_to_the_steps() {
        let grey: Vec<u8> = (0..64 * 48)
            .flat_map(|i: usize| [(100 + i % 64 + i / 64) as u8; 3])
            .collect();
        let mut coder = Coder::new();
        coder.step = STEPS.0;
        let mut passed = grey.clone();
        coder.pass(&mut passed, [64, 48], 1e9);
        assert!(error(&grey, &passed) < 0.6, "{}", error(&grey, &passed));
    }

    #[test]
    fn bits_converge_to_the_budget_and_fewer_bits_give_larger_errors() {
        let mut errors = Vec::new();
        let usual = Coder::new().pass(&mut image(), [64, 48], 1.0);
        for bits in [0.8 * usual, 0.4 * usual] {
            let mut coder = Coder::new();
            let mut taken = 0.0;
            let mut passed = Vec::new();
            for _ in 0..30 {
                passed = image();
                taken = coder.pass(&mut passed, [64, 48], bits);
            }
            assert!((taken / bits - 1.0).abs() < 0.15, "{taken} of {bits}");
            errors.push(error(&image(), &passed));
        }
        assert!(errors[0] + 1.0 < errors[1], "{errors:?}");
    }

    #[test]
    fn any_size_is_accepted() {
        let mut rgb: Vec<u8> = vec![90; 3 * 37 * 21];
        Coder::new().pass(&mut rgb, [37, 21], 1000.0);
        assert!(rgb.iter().all(|v| v.abs_diff(90) <= 3));
    }
}
