//! A stereo depth camera: the exact depth of a colour camera seen through the
//! lens and from the place of the depth camera, with what matching two pictures
//! makes of it.
//!
//! Disparity d = f·b/z carries the noise, so that depth has σ = z²·σ_d/(f·b). The
//! second eye stands `baseline` to the right: what it does not see has no return.
//! What the colour camera does not see has none either.

use wide::{f32x4, i32x4};

use crate::delay::Delay;
use crate::error::{BadParameter, Bounds};
use crate::noise::{NormalTape, Random};
use crate::parameters::Section;
use crate::picture::{Exact, Lens};
use crate::surface::Surface;

/// Parameters of a depth camera.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthParameters {
    /// Its lens.
    pub lens: Lens,
    /// Place of its optical frame in that of the colour camera, m: x right, y
    /// down, z forward; not turned.
    pub offset: [f64; 3],
    /// Distance of its two eyes, m.
    pub baseline: f64,
    /// Deviation of the disparity, pixels.
    pub disparity_noise: f64,
    /// Steps of the disparity, pixels; 0 for none.
    pub disparity_step: f64,
    /// Nearest and farthest return, m.
    pub range: [f64; 2],
    /// Share of pixels at an edge that lie between near and far.
    pub flying: f64,
    /// Share of pixels at an edge without return.
    pub edge_holes: f64,
    /// A step of the disparity that is an edge, pixels.
    pub edge: f64,
    /// Share without return by surface, in the order of [`Surface::ALL`].
    pub holes: [f64; Surface::ALL.len()],
    /// Side of the blocks that have a return or none together, pixels.
    pub hole_size: f64,
    /// Pictures per second, Hz.
    pub rate: f64,
    /// Of the first exposure, s.
    pub phase: f64,
    /// From exposure to arrival.
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

/// A depth camera at work.
#[derive(Clone, Debug)]
pub struct DepthModel {
    parameters: DepthParameters,
    seed: u64,
    tape: NormalTape,
    /// Deviation of the disparity at the strength, pixels.
    noise: f32,
    /// Shares at the strength, of all 2¹⁶.
    flying: u64,
    edge_holes: u64,
    holes: [u64; Surface::ALL.len()],
    /// The nearest of each pixel by [`Near`], with a rim of one pixel all around
    /// for what falls beside the picture.
    nearest: Vec<Near>,
    /// By column of the source.
    columns: Vec<f32>,
}

/// A depth, m, as the bits of an f32 whose lowest three say the class of the
/// surface: depth is cut by half a millionth of itself, and the nearer is the
/// lesser number.
type Near = u32;

/// Bits of the class.
const CLASS: Near = 7;

/// What stands for no depth while pictures are made.
const NONE: Near = f32::INFINITY.to_bits();

fn depth(near: Near) -> f32 {
    f32::from_bits(near & !CLASS)
}

/// From here to twice as much an f32 tells whole numbers apart and no more: what is
/// added to it is the nearest whole number in its lowest bits.
const WHOLE: f32 = (1 << 23) as f32;

/// Tells the bits of a pixel at an edge from those of a row.
const EDGE: u64 = 1 << 63;

impl DepthModel {
    /// A camera whose noise follows from `seed`, `strength` times as bad as its
    /// parameters say.
    #[must_use]
    pub fn new(parameters: DepthParameters, seed: u64, strength: f64) -> Self {
        let of_all = |share: f64| ((share * strength).min(1.0) * 65536.0) as u64;
        Self {
            seed,
            tape: NormalTape::new(seed, parameters.lens.width),
            noise: (parameters.disparity_noise * strength) as f32,
            flying: of_all(parameters.flying),
            edge_holes: of_all(parameters.edge_holes),
            holes: parameters.holes.map(of_all),
            nearest: Vec::new(),
            columns: Vec::new(),
            parameters,
        }
    }

    /// Its parameters.
    #[must_use]
    pub fn parameters(&self) -> &DepthParameters {
        &self.parameters
    }

    /// The picture, little-endian u16 millimetres along the optical axis, 0 for
    /// no return. `surfaces` gives the class of each instance id.
    pub fn picture(&mut self, exact: &Exact<'_>, surfaces: &[Surface]) -> Vec<u8> {
        self.project(exact, surfaces);
        self.fill_cracks();
        self.match_eyes(exact.tick)
    }

    /// The depth camera's view of the colour camera's depth.
    fn project(&mut self, exact: &Exact<'_>, surfaces: &[Surface]) {
        let (from, to) = (exact.lens, self.parameters.lens);
        let line = to.width + 2;
        self.nearest.clear();
        self.nearest.resize(line * (to.height + 2), NONE);
        let scale = [0, 1].map(|k| to.focal[k] / from.focal[k]);
        // Pixels of the source per pixel here: the others tell nothing more.
        let stride = scale.map(|s| ((1.0 / s) as usize).max(1));
        // Half the side of what one pixel of the source covers here.
        let half = [0, 1].map(|k| (0.5 * scale[k] * stride[k] as f64) as f32);
        let wide = half[0] > 0.5 || half[1] > 0.5;
        let [tx, ty, tz] = self.parameters.offset.map(|t| t as f32);
        let moved = [0, 1].map(|k| {
            let axis = [tx, ty][k];
            to.focal[k] as f32 * axis
        });
        // u' = fx'·(X - tx)/(z - tz) + cx', X = (u - cx)/fx·z.
        let along =
            |k: usize, pixel: usize| (scale[k] * (pixel as f64 + 0.5 - from.principal[k])) as f32;
        let first = stride.map(|s| s / 2);
        self.columns.clear();
        let columns = (first[0]..from.width).step_by(stride[0]);
        self.columns.extend(columns.map(|x| along(0, x)));
        let fours = self.columns.len().next_multiple_of(4);
        self.columns.resize(fours, 0.0);
        let principal = to.principal.map(|c| f32x4::splat(c as f32));
        let moved = moved.map(f32x4::splat);
        // Places count from the rim; what lies further out falls into it.
        let place = |at: f32x4, side: usize| {
            let at = at.fast_max(f32x4::splat(-1.0)) + f32x4::ONE;
            at.fast_min(f32x4::splat(side as f32 + 1.0))
                .fast_trunc_int()
        };
        // A row of the source, in whole fours.
        let mut depths_here = vec![f32::INFINITY; self.columns.len()];
        let mut classes = vec![0; self.columns.len()];
        let (depths, _) = exact.depth.as_chunks::<4>();
        let (ids, _) = exact.ids.as_chunks::<2>();
        for y in (first[1]..from.height).step_by(stride[1]) {
            let begin = y * from.width;
            let Some(depths) = depths.get(begin..begin + from.width) else {
                return;
            };
            let Some(ids) = ids.get(begin..begin + from.width) else {
                return;
            };
            let down = f32x4::splat(along(1, y));
            let sources = (first[0]..from.width).step_by(stride[0]);
            for ((x, z), class) in sources.zip(&mut depths_here).zip(&mut classes) {
                *z = f32::from_le_bytes(depths[x]);
                let surface = surfaces.get(usize::from(u16::from_le_bytes(ids[x])));
                *class = surface.map_or(0, |surface| *surface as u32);
            }
            let fours = self.columns.as_chunks::<4>().0.iter();
            let fours = fours.zip(depths_here.as_chunks::<4>().0);
            for ((right, z), class) in fours.zip(classes.as_chunks::<4>().0) {
                let (z, right) = (f32x4::from(*z), f32x4::from(*right));
                let away = z - f32x4::splat(tz);
                let seen = away.simd_gt(f32x4::splat(0.01)) & away.simd_lt(f32x4::splat(1.0e4));
                let over = f32x4::ONE / away;
                let ratio = z * over;
                let u = right * ratio - moved[0] * over + principal[0];
                let v = down * ratio - moved[1] * over + principal[1];
                let [u, v] = [u, v].map(|at| seen.select(at, f32x4::splat(-1.0)));
                let bits: [u32; 4] = bytemuck::cast(seen.select(away, f32x4::splat(f32::INFINITY)));
                let near = |k: usize| match bits[k] < NONE {
                    true => bits[k] & !CLASS | class[k],
                    false => NONE,
                };
                if !wide {
                    // Within 4096 lines of as many columns, and so within an i32.
                    let [u, v] = [place(u, to.width), place(v, to.height)];
                    let at = bytemuck::cast::<i32x4, [u32; 4]>(v * i32x4::splat(line as i32) + u);
                    for (k, at) in at.into_iter().enumerate() {
                        let at = &mut self.nearest[at as usize];
                        *at = near(k).min(*at);
                    }
                    continue;
                }
                let corners = |at: f32x4, k: usize, side: usize| {
                    let half = f32x4::splat(half[k]);
                    [place(at - half, side), place(at + half, side)].map(i32x4::to_array)
                };
                let [left, right] = corners(u, 0, to.width);
                let [upper, lower] = corners(v, 1, to.height);
                for k in 0..4 {
                    for y in upper[k]..=lower[k] {
                        for x in left[k]..=right[k] {
                            let at = &mut self.nearest[y as usize * line + x as usize];
                            *at = near(k).min(*at);
                        }
                    }
                }
            }
        }
        // The rim is beside the picture.
        let (first, last) = (0, to.height + 1);
        for y in first..=last {
            let row = &mut self.nearest[y * line..(y + 1) * line];
            if y == first || y == last {
                row.fill(NONE);
            }
            (row[0], row[line - 1]) = (NONE, NONE);
        }
    }

    /// Pixels that fell between those of the source.
    fn fill_cracks(&mut self) {
        let Lens { width, height, .. } = self.parameters.lens;
        let line = width + 2;
        let between = |a: Near, b: Near| {
            let (a, b) = (depth(a), depth(b));
            let alike = a < f32::INFINITY && b < f32::INFINITY && (a - b).abs() < 0.03 * a;
            alike.then_some((0.5 * (a + b)).to_bits() & !CLASS)
        };
        for y in 1..=height {
            let open = |all: u32, near: &Near| all | u32::from(*near == NONE);
            if self.row(y - 1).iter().fold(0, open) == 0 {
                continue;
            }
            for i in y * line + 2..y * line + width {
                if self.nearest[i] != NONE {
                    continue;
                }
                for beside in [1, line] {
                    let (a, b) = (self.nearest[i - beside], self.nearest[i + beside]);
                    if let Some(filled) = between(a, b) {
                        self.nearest[i] = filled | a & CLASS;
                        break;
                    }
                }
            }
        }
    }

    /// A row of the view, without its rim.
    fn row(&self, y: usize) -> &[Near] {
        let width = self.parameters.lens.width;
        let from = (y + 1) * (width + 2) + 1;
        &self.nearest[from..from + width]
    }

    /// What matching the pictures of two eyes makes of the view.
    fn match_eyes(&self, tick: u64) -> Vec<u8> {
        let p = &self.parameters;
        let Lens { width, height, .. } = p.lens;
        let span = (p.lens.focal[0] * p.baseline) as f32;
        let block = (p.hole_size as usize).max(1);
        let mut out = vec![0_u8; width * height * 2];
        let mut disparity = vec![0.0_f32; width];
        let mut below = vec![0.0_f32; width];
        let mut left = vec![0.0_f32; width];
        let mut jumps = vec![0.0_f32; width];
        let mut lost = vec![0_u8; width];
        let row_of = |y: usize, into: &mut [f32]| {
            for (d, near) in into.iter_mut().zip(self.row(y)) {
                // No depth is no disparity.
                *d = span / depth(*near);
            }
        };
        if height > 0 && width > 0 {
            row_of(0, &mut below);
        }
        for (y, pixels) in out.chunks_exact_mut((2 * width).max(1)).enumerate() {
            std::mem::swap(&mut disparity, &mut below);
            if y + 1 < height {
                row_of(y + 1, &mut below);
            } else {
                below.copy_from_slice(&disparity);
            }
            if y.is_multiple_of(block) {
                self.lose(tick, y / block, &mut lost);
            }
            shadow(&disparity, self.row(y), &lost, &mut left);
            if edges(&disparity, &below, p.edge as f32, &mut jumps) {
                self.smear(tick, y, &jumps, &mut left);
            }
            let bits = Random::new(self.seed, [tick, y as u64]).bits();
            self.measure(span, &left, self.tape.read(bits, width), pixels);
        }
        out
    }

    /// Which classes of surface have no return in a row of blocks, a bit each, by
    /// column.
    fn lose(&self, tick: u64, row: usize, lost: &mut [u8]) {
        let block = (self.parameters.hole_size as usize).max(1);
        for (column, lost) in lost.chunks_mut(block).enumerate() {
            let key = [tick, ((row as u64) << 32) | column as u64];
            let patch = Random::new(!self.seed, key).bits() & 0xffff;
            let classes = self.holes.iter().enumerate();
            lost.fill(classes.fold(0, |all, (k, hole)| all | u8::from(patch < *hole) << k));
        }
    }

    /// At edges some pixels have no return, others lie between near and far.
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
            let told = if step > 0.0 { step * whole } else { noisy };
            let z = span / told;
            let is_told = (*d > 0.0) & (z >= least) & (z <= most);
            // Infinite or not, its limit is 16 bits.
            let millimetres = (z.min(65.535) * 1000.0 + WHOLE).to_bits();
            *pixel = (if is_told { millimetres as u16 } else { 0 }).to_le_bytes();
        }
    }
}

/// By how much the disparity differs from that of the neighbour, to the right or
/// below, that it differs most from; 0 where that is no edge. Tells whether there
/// are any.
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

/// The disparity of the pixels of a row that have a return, 0 for the others: those
/// that the second eye does not see, because what is nearer stands before them or
/// they lie beyond its picture's left edge, and those whose class is lost.
fn shadow(disparity: &[f32], row: &[Near], lost: &[u8], left: &mut [f32]) {
    // Leftmost place in the second picture that something nearer has taken.
    let mut taken = f32::INFINITY;
    let all = disparity.iter().zip(row).zip(lost).zip(left);
    for (x, (((d, near), lost), left)) in all.enumerate().rev() {
        let at = x as f32 + 0.5 - d;
        let is_lost = (lost >> (near & CLASS)) & 1 != 0;
        let is_hidden = (at < 0.0) | (at > taken + 1.0) | is_lost;
        *left = if is_hidden { 0.0 } else { *d };
        let at = if *d > 0.0 { at } else { f32::INFINITY };
        taken = if at < taken { at } else { taken };
    }
}

#[cfg(test)]
mod tests;
