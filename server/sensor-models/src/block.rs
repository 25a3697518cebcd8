//! What a video coder leaves of a picture: 8×8 blocks of a cosine transform in
//! luma and, at half the size, chroma, each coefficient in whole steps. The step
//! follows from the bit rate, picture by picture. Nothing is coded here: the bits
//! that an entropy coder would take are estimated.

use wheelarm_proto::exact;

/// Bits of a coefficient of magnitude 1; one more digit costs two more.
const BITS_OF_ONE: f32 = 4.0;
/// Bits of a block without coefficients.
const BITS_OF_BLOCK: f32 = 0.5;
/// A coefficient counts from this part of a step on: two thirds, as H.264's
/// reference coder rounds in pictures of their own.
const ROUND: f32 = 1.0 / 3.0;
/// Finest and coarsest step, levels of 255.
const STEPS: (f64, f64) = (0.5, 120.0);

/// Takes pictures through a coder and back.
#[derive(Clone, Debug)]
pub(crate) struct Coder {
    /// `cosine[x][u]` = c(u)/2 · cos((2x + 1)uπ/16).
    cosine: [[f32; 8]; 8],
    /// The same with rows and columns exchanged.
    turned: [[f32; 8]; 8],
    /// The step in force, levels of 255.
    step: f64,
}

type Block = [[f32; 8]; 8];

impl Coder {
    pub fn new() -> Self {
        let mut cosine = [[0.0; 8]; 8];
        for (x, row) in cosine.iter_mut().enumerate() {
            for (u, c) in row.iter_mut().enumerate() {
                let scale = if u == 0 { 0.125_f64.sqrt() } else { 0.5 };
                let angle = (2 * x + 1) as f64 * u as f64 * std::f64::consts::PI / 16.0;
                *c = (scale * exact::cos(angle)) as f32;
            }
        }
        let turned = std::array::from_fn(|u| std::array::from_fn(|x| cosine[x][u]));
        Self {
            cosine,
            turned,
            step: 6.0,
        }
    }

    /// Begins anew.
    pub fn restart(&mut self) {
        self.step = 6.0;
    }

    /// Codes an RGB8 picture and decodes it in place; `bits` is what it may take.
    /// Returns the bits that it took.
    pub fn pass(&mut self, rgb: &mut [u8], [width, height]: [usize; 2], bits: f64) -> f64 {
        let step = self.step as f32;
        let mut taken = 0.0_f64;
        for top in (0..height).step_by(16) {
            let mut of_row = 0.0_f32;
            for left in (0..width).step_by(16) {
                of_row += self.square(rgb, [width, height], [left, top], step);
            }
            taken += f64::from(of_row);
        }
        // Halfway to the step that would have done.
        let wanted = self.step * exact::powf((taken / bits).clamp(0.1, 10.0), 0.5);
        self.step = wanted.clamp(STEPS.0, STEPS.1);
        taken
    }

    /// One square of 16×16 pixels: four blocks of luma, one of each chroma.
    fn square(
        &self,
        rgb: &mut [u8],
        [width, height]: [usize; 2],
        [left, top]: [usize; 2],
        step: f32,
    ) -> f32 {
        let mut luma = [[[0.0_f32; 8]; 8]; 4];
        let mut blue = [[0.0_f32; 8]; 8];
        let mut red = [[0.0_f32; 8]; 8];
        for dy in 0..16 {
            let row = (top + dy).min(height - 1) * width;
            for dx in 0..16 {
                let at = 3 * (row + (left + dx).min(width - 1));
                let [r, g, b] = [rgb[at], rgb[at + 1], rgb[at + 2]].map(f32::from);
                // ITU-R BT.601, all levels.
                let y = 0.299 * r + 0.587 * g + 0.114 * b;
                luma[dy / 8 * 2 + dx / 8][dy % 8][dx % 8] = y - 128.0;
                blue[dy / 2][dx / 2] += 0.25 * 0.564 * (b - y);
                red[dy / 2][dx / 2] += 0.25 * 0.713 * (r - y);
            }
        }
        let mut bits = 0.0;
        for block in &mut luma {
            bits += self.block(block, step);
        }
        bits += self.block(&mut blue, step) + self.block(&mut red, step);
        for dy in 0..16.min(height - top) {
            let row = (top + dy) * width;
            for dx in 0..16.min(width - left) {
                let at = 3 * (row + left + dx);
                let y = luma[dy / 8 * 2 + dx / 8][dy % 8][dx % 8] + 128.5;
                let (b, r) = (blue[dy / 2][dx / 2], red[dy / 2][dx / 2]);
                rgb[at] = (y + 1.403 * r) as u8;
                rgb[at + 1] = (y - 0.714 * r - 0.344 * b) as u8;
                rgb[at + 2] = (y + 1.773 * b) as u8;
            }
        }
        bits
    }

    /// A block through transform, steps and back; the bits that it took.
    fn block(&self, block: &mut Block, step: f32) -> f32 {
        let mut there = through(&through(block, &self.cosine), &self.cosine);
        let over = 1.0 / step;
        let mut bits = BITS_OF_BLOCK;
        let mut flat = true;
        for (v, row) in there.iter_mut().enumerate() {
            for (u, c) in row.iter_mut().enumerate() {
                let first = u == 0 && v == 0;
                // The mean is kept finer: it is what is predicted best.
                let (one, over) = if first {
                    (step * 0.5, over * 2.0)
                } else {
                    (step, over)
                };
                let level = (c.abs() * over + if first { 0.5 } else { ROUND }) as u32;
                if level > 0 && !first {
                    flat = false;
                    bits += BITS_OF_ONE + 2.0 * level.ilog2() as f32;
                }
                let whole = one * level as f32;
                *c = if *c < 0.0 { -whole } else { whole };
            }
        }
        if flat {
            *block = [[there[0][0] * 0.125; 8]; 8];
        } else {
            *block = through(&through(&there, &self.turned), &self.turned);
        }
        bits
    }
}

/// `blockᵀ`'s rows by a matrix: twice makes a transform of rows and columns.
fn through(block: &Block, matrix: &Block) -> Block {
    let mut out = [[0.0_f32; 8]; 8];
    for (i, row) in block.iter().enumerate() {
        let mut sums = [0.0_f32; 8];
        for (value, weights) in row.iter().zip(matrix) {
            for (sum, weight) in sums.iter_mut().zip(weights) {
                *sum += value * weight;
            }
        }
        for (u, sum) in sums.into_iter().enumerate() {
            out[u][i] = sum;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Vec<u8> {
        let at = |x: usize, y: usize| [(x * 5) as u8, (y * 7) as u8, (x ^ y) as u8];
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
        for bits in [8_000.0, 3_000.0] {
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
