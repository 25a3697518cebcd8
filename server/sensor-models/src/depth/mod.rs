//! A stereo depth camera: exact depth through its own lens and mount, with the errors
//! of stereo matching.
//!
//! The image is not registered to the color camera. Drivers of such cameras publish
//! depth in the lens of the depth sensor (`depth/image_raw` of ros_kortex_vision) and
//! register it on request; clients can do so with the intrinsics and the pose of each
//! image. Registered depth loses the view outside the color camera's lens, and depth
//! from the color camera's image would never have it.
//!
//! The noise is in the disparity d = f·b/z, so that depth has σ = z²·σ_d/(f·b).
//! Matching sums costs over a square window that neighboring pixels share: the noise is
//! the mean of independent values over that window, and its autocorrelation decreases
//! linearly to 0 at the window's side. The second camera is `baseline` to the right:
//! points that it does not see have no return.
//! see has no return.

use crate::delay::Delay;
use crate::error::{BadParameter, Bounds};
use crate::exact_image::{Exact, Lens};
use crate::noise::{NormalTape, Random};
use crate::parameters::Section;
use crate::surface::Surface;

/// Parameters of a depth camera.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthParameters {
    /// Its lens, used to render its exact images.
    pub lens: Lens,
    /// Position of its optical frame in that of the color camera, m: x right, y down, z
    /// forward; without rotation.
    pub offset: [f64; 3],
    /// Distance of its two cameras, m.
    pub baseline: f64,
    /// Standard deviation of the disparity, pixels.
    pub disparity_noise: f64,
    /// Side of the matching window over which the noise is correlated, pixels.
    pub window: usize,
    /// Steps of the disparity, pixels; 0 for none.
    pub disparity_step: f64,
    /// Nearest and farthest return, m.
    pub range: [f64; 2],
    /// Share of pixels at an edge with a depth between near and far.
    pub flying: f64,
    /// Share of pixels at an edge without return.
    pub edge_holes: f64,
    /// Step of the disparity that counts as an edge, pixels.
    pub edge: f64,
    /// Share without return by surface, in the order of [`Surface::ALL`].
    pub holes: [f64; Surface::ALL.len()],
    /// Side of the blocks that lose their return together, pixels.
    pub hole_size: f64,
    /// Images per second, Hz.
    pub rate: f64,
    /// Time of the first exposure, s.
    pub phase: f64,
    /// Latency from exposure to arrival.
    pub age: Delay,
}

impl DepthParameters {
    pub(crate) fn read(s: &mut Section<'_>) -> Result<Self, BadParameter> {
        let side = Bounds(16.0, 4096.0);
        let [width, height] = s.numbers("size", "px", side)?;
        let share = Bounds(0.0, 1.0);
        let mut holes = [0.0; Surface::ALL.len()];
        for (hole, class) in holes.iter_mut().zip(Surface::ALL) {
            *hole = s.number(&format!("holes_{}", class.name()), "1", share)?;
        }
        Ok(Self {
            lens: Lens {
                width: width as usize,
                height: height as usize,
                focal: s.numbers("focal", "px", Bounds(10.0, 1e4))?,
                principal: s.numbers("principal", "px", Bounds(-4096.0, 8192.0))?,
            },
            offset: s.numbers("offset", "m", Bounds(-0.5, 0.5))?,
            baseline: s.number("baseline", "m", Bounds(0.001, 1.0))?,
            disparity_noise: s.number("disparity_noise", "px", Bounds(0.0, 2.0))?,
            window: s.number("window", "px", Bounds(1.0, 64.0))? as usize,
            disparity_step: s.number("disparity_step", "px", share)?,
            range: s.numbers("range", "m", Bounds(0.0, 65.535))?,
            flying: s.number("flying", "1", share)?,
            edge_holes: s.number("edge_holes", "1", share)?,
            edge: s.number("edge", "px", Bounds(0.1, 100.0))?,
            holes,
            hole_size: s.number("hole_size", "px", Bounds(1.0, 64.0))?,
            rate: s.number("rate", "Hz", Bounds(1.0, 240.0))?,
            phase: s.number("phase", "s", Bounds(0.0, 1.0))?,
            age: Delay::read(s, "age")?,
        })
    }
}

/// State of a depth camera.
#[derive(Clone, Debug)]
pub struct DepthModel {
    parameters: DepthParameters,
    seed: u64,
    tape: NormalTape,
    /// Standard deviation of the disparity at the strength, pixels.
    noise: f32,
    /// Shares at the strength, in units of 2⁻¹⁶.
    flying: u64,
    edge_holes: u64,
    holes: [u64; Surface::ALL.len()],
}

/// Smallest depth, m.
const NEAREST: f32 = 0.01;

/// From here to twice as much an f32 has no fractional bits: adding a number leaves the
/// nearest integer in the lowest bits.
const WHOLE: f32 = (1 << 23) as f32;

/// Separates the random bits of a pixel at an edge from those of a row.
const EDGE: u64 = 1 << 63;

impl DepthModel {
    /// A camera whose noise depends on `seed`, with `strength` times the errors of its
    /// parameters.
    #[must_use]
    pub fn new(parameters: DepthParameters, seed: u64, strength: f64) -> Self {
        let of_all = |share: f64| ((share * strength).min(1.0) * 65536.0) as u64;
        Self {
            seed,
            tape: NormalTape::averaged(seed, parameters.lens.width, parameters.window),
            noise: (parameters.disparity_noise * strength) as f32,
            flying: of_all(parameters.flying),
            edge_holes: of_all(parameters.edge_holes),
            holes: parameters.holes.map(of_all),
            parameters,
        }
    }

    /// Its parameters.
    #[must_use]
    pub fn parameters(&self) -> &DepthParameters {
        &self.parameters
    }

    /// The image, little-endian u16 millimetres along the optical axis, 0 for no
    /// return, from an exact one through the lens of the parameters. `surfaces`
    /// contains the class of each instance ID. All 0 when the exact image has another
    /// size.
    #[must_use]
    pub fn image(&self, exact: &Exact<'_>, surfaces: &[Surface]) -> Vec<u8> {
        let p = &self.parameters;
        let Lens { width, height, .. } = p.lens;
        let mut out = vec![0_u8; width * height * 2];
        let (depths, _) = exact.depth.as_chunks::<4>();
        let (ids, _) = exact.ids.as_chunks::<2>();
        if width == 0 || depths.len() != width * height || ids.len() != depths.len() {
            return out;
        }
        let span = (p.lens.focal[0] * p.baseline) as f32;
        let block = (p.hole_size as usize).max(1);
        let row_of = |y: usize, into: &mut [f32]| {
            for (d, depth) in into.iter_mut().zip(&depths[y * width..]) {
                let z = f32::from_le_bytes(*depth);
                // No depth means no disparity.
                *d = if z > NEAREST { span / z } else { 0.0 };
            }
        };
        let class_of = |id: &[u8; 2]| {
            let surface = surfaces.get(usize::from(u16::from_le_bytes(*id)));
            surface.map_or(0, |surface| *surface as u8)
        };
        let mut noise = RunningMean::new(self, exact.tick, width);
        let [mut disparity, mut below, mut left, mut jumps] = [(); 4].map(|()| vec![0.0; width]);
        let [mut classes, mut lost] = [(); 2].map(|()| vec![0_u8; width]);
        row_of(0, &mut below);
        for (y, pixels) in out.chunks_exact_mut(2 * width).enumerate() {
            std::mem::swap(&mut disparity, &mut below);
            if y + 1 < height {
                row_of(y + 1, &mut below);
            } else {
                below.copy_from_slice(&disparity);
            }
            for (class, id) in classes.iter_mut().zip(&ids[y * width..]) {
                *class = class_of(id);
            }
            if y.is_multiple_of(block) {
                self.lose(exact.tick, y / block, &mut lost);
            }
            shadow(&disparity, &classes, &lost, &mut left);
            if edges(&disparity, &below, p.edge as f32, &mut jumps) {
                self.smear(exact.tick, y, &jumps, &mut left);
            }
            self.measure(span, &left, noise.row(y), pixels);
        }
        out
    }

    /// Independent noise of a row, each value the mean over `window` columns with
    /// standard deviation 1.
    fn row_noise(&self, tick: u64, row: usize, width: usize) -> &[f32] {
        let bits = Random::new(self.seed, [tick, row as u64]).bits();
        self.tape.read(bits, width)
    }

    /// Surface classes without return in a row of blocks, one bit each, by column.
    fn lose(&self, tick: u64, row: usize, lost: &mut [u8]) {
        let block = (self.parameters.hole_size as usize).max(1);
        for (column, lost) in lost.chunks_mut(block).enumerate() {
            let key = [tick, ((row as u64) << 32) | column as u64];
            let patch = Random::new(!self.seed, key).bits() & 0xffff;
            let classes = self.holes.iter().enumerate();
            lost.fill(classes.fold(0, |all, (k, hole)| all | u8::from(patch < *hole) << k));
        }
    }

    /// At edges some pixels have no return, others a depth between near and far.
    fn smear(&self, tick: u64, y: usize, jumps: &[f32], disparity: &mut [f32]) {
        const EIGHT: usize = 8;
        let chunks = jumps.chunks(EIGHT).zip(disparity.chunks_mut(EIGHT));
        for (chunk, (jumps, disparity)) in chunks.enumerate() {
            if jumps.iter().fold(0, |all, jump| all | jump.to_bits()) == 0 {
                continue;
            }
            for (k, (jump, d)) in jumps.iter().zip(disparity).enumerate() {
                if *jump == 0.0 || *d == 0.0 {
                    continue;
                }
                let key = ((y as u64) << 32) | (EIGHT * chunk + k) as u64;
                let bits = Random::new(self.seed, [tick | EDGE, key]).bits();
                let luck = bits & 0xffff;
                if luck < self.edge_holes {
                    *d = 0.0;
                } else if luck < self.edge_holes + self.flying {
                    *d += ((bits >> 16) & 0xffff) as f32 / 65536.0 * jump;
                }
            }
        }
    }

    /// Depth of a row from its disparity, little-endian millimetres.
    fn measure(&self, span: f32, disparity: &[f32], noise: &[f32], pixels: &mut [u8]) {
        let p = &self.parameters;
        let [least, most] = p.range.map(|z| z as f32);
        let (step, over) = match p.disparity_step > 0.0 {
            true => (p.disparity_step as f32, (1.0 / p.disparity_step) as f32),
            false => (0.0, 0.0),
        };
        let (pixels, _) = pixels.as_chunks_mut::<2>();
        for ((pixel, d), noise) in pixels.iter_mut().zip(disparity).zip(noise) {
            let noisy = (d + self.noise * noise).max(0.0);
            let whole = (noisy * over + WHOLE) - WHOLE;
            let rounded = if step > 0.0 { step * whole } else { noisy };
            let z = span / rounded;
            let is_valid = (*d > 0.0) & (z >= least) & (z <= most);
            // Finite or not, the conversion saturates at 16 bits.
            let millimetres = (z.min(65.535) * 1000.0 + WHOLE).to_bits();
            *pixel = (if is_valid { millimetres as u16 } else { 0 }).to_le_bytes();
        }
    }
}

/// Largest difference of the disparity to the right or lower neighbour; 0 when it is
/// not an edge. Returns whether there are any.
fn edges(disparity: &[f32], below: &[f32], edge: f32, jumps: &mut [f32]) -> bool {
    let jump_of = |d: f32, right: f32, below: f32| {
        let (beside, under) = (right - d, below - d);
        let is_beside = beside.abs() > under.abs();
        let by = if is_beside { beside } else { under };
        let other = if is_beside { right } else { below };
        let is_edge = (by.abs() > edge) & (other > 0.0);
        if is_edge { by } else { 0.0 }
    };
    let rights = disparity.get(1..).unwrap_or_default();
    let mut any = 0;
    for (((jump, d), right), below) in jumps.iter_mut().zip(disparity).zip(rights).zip(below) {
        *jump = jump_of(*d, *right, *below);
        any |= jump.to_bits();
    }
    // The last has nothing to its right.
    if let ([.., jump], [.., d], [.., below]) = (jumps, disparity, below) {
        *jump = jump_of(*d, *d, *below);
        any |= jump.to_bits();
    }
    any != 0
}

/// The disparity of the pixels of a row with a return, 0 for the others: pixels that
/// the second camera does not see, because they are occluded or beyond its image's left
/// border, and those whose class has no return.
fn shadow(disparity: &[f32], classes: &[u8], lost: &[u8], left: &mut [f32]) {
    // Leftmost position in the second image covered by a nearer surface.
    let mut taken = f32::INFINITY;
    let all = disparity.iter().zip(classes).zip(lost).zip(left);
    for (x, (((d, class), lost), left)) in all.enumerate().rev() {
        let at = x as f32 + 0.5 - d;
        let is_lost = (lost >> class) & 1 != 0;
        let is_hidden = (at < 0.0) | (at > taken + 1.0) | is_lost;
        *left = if is_hidden { 0.0 } else { *d };
        let at = if *d > 0.0 { at } else { f32::INFINITY };
        taken = if at < taken { at } else { taken };
    }
}

/// Noise row by row, each the mean over a window of rows, with standard deviation 1.
/// Rows are added and subtracted: the rounding error stays below 1e-4.
struct RunningMean<'a> {
    model: &'a DepthModel,
    tick: u64,
    width: usize,
    sum: Vec<f32>,
    mean: Vec<f32>,
}

impl<'a> RunningMean<'a> {
    /// Before row 0.
    fn new(model: &'a DepthModel, tick: u64, width: usize) -> Self {
        let mut mean = Self {
            model,
            tick,
            width,
            sum: vec![0.0; width],
            mean: vec![0.0; width],
        };
        for row in 0..model.parameters.window.saturating_sub(1) {
            mean.add(row, 1.0);
        }
        mean
    }

    fn add(&mut self, row: usize, sign: f32) {
        let noise = self.model.row_noise(self.tick, row, self.width);
        for (sum, noise) in self.sum.iter_mut().zip(noise) {
            *sum += sign * noise;
        }
    }

    /// Noise of row `y`, which must be the next one.
    fn row(&mut self, y: usize) -> &[f32] {
        let window = self.model.parameters.window.max(1);
        self.add(y + window - 1, 1.0);
        let scale = 1.0 / (window as f32).sqrt();
        for (mean, sum) in self.mean.iter_mut().zip(&self.sum) {
            *mean = sum * scale;
        }
        self.add(y, -1.0);
        &self.mean
    }
}

#[cfg(test)]
mod tests;
