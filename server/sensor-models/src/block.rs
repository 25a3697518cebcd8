//! What a video coder leaves of a picture: 8×8 blocks of a cosine transform in
//! luma and, at half the size, chroma, each coefficient in whole steps. The step
//! follows from the bit rate, picture by picture. Nothing is coded here: the bits
//! that an entropy coder would take are estimated.

use wheelarm_proto::exact;

/// Bits of a coefficient by its magnitude: 4 of one step, two more for each digit
/// more.
const DIGITS: [i32; 64] = {
    let mut all = [0; 64];
    let mut level = 1;
    while level < 64 {
        all[level] = 4 + 2 * level.ilog2() as i32;
        level += 1;
    }
    all
};
/// More than there are steps of a mean: what is cut off is what lies below.
const MEANS: f32 = 16384.0;
/// Bits of a block without coefficients.
const BITS_OF_BLOCK: f32 = 0.5;
/// A coefficient counts from this part of a step on: two thirds, as H.264's
/// reference coder rounds in pictures of their own.
const ROUND: f32 = 1.0 / 3.0;
/// Finest and coarsest step, levels of 255.
const STEPS: (f64, f64) = (0.5, 120.0);

/// c(u)/2 · cos((2x + 1)uπ/16) of the first four values `[x]`, by the even and by
/// the odd coefficients.
#[derive(Clone, Debug)]
struct Cosine {
    even: [[f32; 4]; 4],
    odd: [[f32; 4]; 4],
}

/// Takes pictures through a coder and back.
#[derive(Clone, Debug)]
pub(crate) struct Coder {
    cosine: Cosine,
    /// The step in force, levels of 255.
    step: f64,
}

type Block = [[f32; 8]; 8];

/// Rows that are coded together: two blocks of luma, one of chroma.
const STRIP: usize = 16;

/// Blocks of 16 rows: luma in pairs above each other, chroma at half the size.
struct Strip {
    /// By 16 columns: the two upper blocks, the two lower ones.
    luma: Vec<[[Block; 2]; 2]>,
    blue: Vec<Block>,
    red: Vec<Block>,
}

impl Strip {
    fn new(width: usize) -> Self {
        let squares = width.div_ceil(STRIP);
        Self {
            luma: vec![[[[[0.0; 8]; 8]; 2]; 2]; squares],
            blue: vec![[[0.0; 8]; 8]; squares],
            red: vec![[[0.0; 8]; 8]; squares],
        }
    }

    /// Takes rows of RGB8 apart; what lies beyond an edge repeats it.
    fn take(&mut self, rows: &[u8], width: usize) {
        let (pixels, _) = rows.as_chunks::<3>();
        let height = (pixels.len() / width).max(1);
        for y in 0..STRIP {
            let from = y.min(height - 1) * width;
            let line = &pixels[from..from + width];
            let last = line[width - 1];
            for (square, columns) in line.chunks(STRIP).enumerate() {
                let mut sixteen = [last; STRIP];
                sixteen[..columns.len()].copy_from_slice(columns);
                self.take_line(square, y, &sixteen);
            }
        }
    }

    #[inline]
    fn take_line(&mut self, square: usize, y: usize, line: &[[u8; 3]; STRIP]) {
        let mut colours = [[0.0_f32; STRIP]; 3];
        for (x, pixel) in line.iter().enumerate() {
            for (colour, value) in colours.iter_mut().zip(pixel) {
                colour[x] = f32::from(*value);
            }
        }
        let [r, g, b] = &colours;
        let mut luma = [0.0_f32; STRIP];
        let mut chroma = [[0.0_f32; STRIP]; 2];
        for x in 0..STRIP {
            // ITU-R BT.601, all levels; a quarter of each of four pixels.
            let level = 0.299 * r[x] + 0.587 * g[x] + 0.114 * b[x];
            luma[x] = level - 128.0;
            chroma[0][x] = 0.25 * 0.564 * (b[x] - level);
            chroma[1][x] = 0.25 * 0.713 * (r[x] - level);
        }
        let pair = &mut self.luma[square][y / 8];
        pair[0][y % 8].copy_from_slice(&luma[..8]);
        pair[1][y % 8].copy_from_slice(&luma[8..]);
        for (chroma, blocks) in chroma.iter().zip([&mut self.blue, &mut self.red]) {
            let row = &mut blocks[square][y / 2];
            for (x, to) in row.iter_mut().enumerate() {
                let two = chroma[2 * x] + chroma[2 * x + 1];
                *to = if y.is_multiple_of(2) { two } else { *to + two };
            }
        }
    }

    /// Puts the blocks back into rows of RGB8.
    fn put(&self, rows: &mut [u8], width: usize) {
        for (y, line) in rows.chunks_mut(3 * width).enumerate() {
            let (pixels, _) = line.as_chunks_mut::<3>();
            for (square, columns) in pixels.chunks_mut(STRIP).enumerate() {
                let pair = &self.luma[square][y / 8];
                let (blue, red) = (&self.blue[square][y / 2], &self.red[square][y / 2]);
                let mut colours = [[0.0_f32; STRIP]; 3];
                for (half, block) in pair.iter().enumerate() {
                    for (x, value) in block[y % 8].iter().enumerate() {
                        let at = 8 * half + x;
                        let level = value + 128.5;
                        let (b, r) = (blue[at / 2], red[at / 2]);
                        colours[0][at] = level + 1.403 * r;
                        colours[1][at] = level - 0.714 * r - 0.344 * b;
                        colours[2][at] = level + 1.773 * b;
                    }
                }
                let bytes = colours.map(|colour| colour.map(byte));
                for (x, pixel) in columns.iter_mut().enumerate() {
                    *pixel = [bytes[0][x], bytes[1][x], bytes[2][x]];
                }
            }
        }
    }
}

/// What is cut off is what lies below; limits first, so that the conversion is
/// one instruction.
#[inline]
fn byte(level: f32) -> u8 {
    level.clamp(0.0, 255.0) as i32 as u8
}

impl Coder {
    pub fn new() -> Self {
        let entry = |x: usize, u: usize| {
            let scale = if u == 0 { 0.125_f64.sqrt() } else { 0.5 };
            let angle = (2 * x + 1) as f64 * u as f64 * std::f64::consts::PI / 16.0;
            (scale * exact::cos(angle)) as f32
        };
        let of = |first: usize| {
            std::array::from_fn(|x| std::array::from_fn(|k| entry(x, 2 * k + first)))
        };
        let cosine = Cosine {
            even: of(0),
            odd: of(1),
        };
        Self { cosine, step: 6.0 }
    }

    /// Begins anew.
    pub fn restart(&mut self) {
        self.step = 6.0;
    }

    /// Codes an RGB8 picture and decodes it in place; `bits` is what it may take.
    /// Returns the bits that it took.
    pub fn pass(&mut self, rgb: &mut [u8], [width, height]: [usize; 2], bits: f64) -> f64 {
        if width == 0 {
            return 0.0;
        }
        let step = self.step as f32;
        let mut strip = Strip::new(width);
        let mut taken = 0.0_f64;
        for rows in rgb
            .chunks_mut(3 * width * STRIP)
            .take(height.div_ceil(STRIP))
        {
            strip.take(rows, width);
            let mut of_strip = 0.0_f32;
            for [first, second] in &mut strip.luma {
                for block in first.iter_mut().chain(second) {
                    of_strip += self.block(block, step);
                }
            }
            for block in strip.blue.iter_mut().chain(&mut strip.red) {
                of_strip += self.block(block, step);
            }
            taken += f64::from(of_strip);
            strip.put(rows, width);
        }
        // Halfway to the step that would have done.
        let wanted = self.step * exact::powf((taken / bits).clamp(0.1, 10.0), 0.5);
        self.step = wanted.clamp(STEPS.0, STEPS.1);
        taken
    }

    /// A block through transform, steps and back; the bits that it took.
    fn block(&self, block: &mut Block, step: f32) -> f32 {
        // Rows and columns are exchanged: steps are the same for both.
        let mut there = forward(&turned(&forward(block, &self.cosine)), &self.cosine);
        let over = 1.0 / step;
        // The mean is kept finer: it is what is predicted best.
        let mean = there[0][0];
        let mean = 0.5 * step * (((mean * over * 2.0 + MEANS + 0.5) as i32) as f32 - MEANS);
        there[0][0] = 0.0;
        let mut digits = 0;
        for c in there.as_flattened_mut() {
            let level = (c.abs() * over + ROUND) as i32;
            digits += DIGITS[(level as usize).min(DIGITS.len() - 1)];
            let whole = step * level as f32;
            *c = if *c < 0.0 { -whole } else { whole };
        }
        if digits == 0 {
            *block = [[mean * 0.125; 8]; 8];
            return BITS_OF_BLOCK;
        }
        there[0][0] = mean;
        *block = backward(&turned(&backward(&there, &self.cosine)), &self.cosine);
        BITS_OF_BLOCK + digits as f32
    }
}

/// Cosine transform of the columns, eight at a time. Even coefficients see the
/// sums of opposite values, odd ones the differences: half the multiplications.
#[inline]
fn forward(block: &Block, cosine: &Cosine) -> Block {
    let mut sums = [[0.0_f32; 8]; 4];
    let mut differences = [[0.0_f32; 8]; 4];
    for x in 0..4 {
        for lane in 0..8 {
            sums[x][lane] = block[x][lane] + block[7 - x][lane];
            differences[x][lane] = block[x][lane] - block[7 - x][lane];
        }
    }
    let mut out = [[0.0_f32; 8]; 8];
    for k in 0..4 {
        for x in 0..4 {
            let (even, odd) = (cosine.even[x][k], cosine.odd[x][k]);
            for lane in 0..8 {
                out[2 * k][lane] += sums[x][lane] * even;
                out[2 * k + 1][lane] += differences[x][lane] * odd;
            }
        }
    }
    out
}

/// The way back.
#[inline]
fn backward(block: &Block, cosine: &Cosine) -> Block {
    let mut out = [[0.0_f32; 8]; 8];
    for x in 0..4 {
        let mut even = [0.0_f32; 8];
        let mut odd = [0.0_f32; 8];
        for k in 0..4 {
            let (of_even, of_odd) = (cosine.even[x][k], cosine.odd[x][k]);
            for lane in 0..8 {
                even[lane] += block[2 * k][lane] * of_even;
                odd[lane] += block[2 * k + 1][lane] * of_odd;
            }
        }
        for lane in 0..8 {
            out[x][lane] = even[lane] + odd[lane];
            out[7 - x][lane] = even[lane] - odd[lane];
        }
    }
    out
}

#[inline]
fn turned(block: &Block) -> Block {
    let mut out = [[0.0_f32; 8]; 8];
    for (i, row) in block.iter().enumerate() {
        for (k, value) in row.iter().enumerate() {
            out[k][i] = *value;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey, with detail of every size.
    fn picture() -> Vec<u8> {
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
    fn a_grey_picture_comes_back_but_for_the_steps() {
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
    fn bits_settle_at_what_is_asked_and_fewer_cost_more_error() {
        let mut errors = Vec::new();
        let usual = Coder::new().pass(&mut picture(), [64, 48], 1.0);
        for bits in [0.8 * usual, 0.4 * usual] {
            let mut coder = Coder::new();
            let mut taken = 0.0;
            let mut passed = Vec::new();
            for _ in 0..30 {
                passed = picture();
                taken = coder.pass(&mut passed, [64, 48], bits);
            }
            assert!((taken / bits - 1.0).abs() < 0.15, "{taken} of {bits}");
            errors.push(error(&picture(), &passed));
        }
        assert!(errors[0] + 1.0 < errors[1], "{errors:?}");
    }

    #[test]
    fn a_size_that_is_no_multiple_of_16_is_taken() {
        let mut rgb: Vec<u8> = vec![90; 3 * 37 * 21];
        Coder::new().pass(&mut rgb, [37, 21], 1000.0);
        assert!(rgb.iter().all(|v| v.abs_diff(90) <= 3));
    }
}
