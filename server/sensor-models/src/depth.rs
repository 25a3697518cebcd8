//! A stereo depth camera: the exact depth of a colour camera seen through the
//! lens and from the place of the depth camera, with what matching two pictures
//! makes of it.
//!
//! Disparity d = f·b/z carries the noise, so that depth has σ = z²·σ_d/(f·b). The
//! second eye stands `baseline` to the right: what it does not see has no return.
//! What the colour camera does not see has none either.

use crate::delay::Delay;
use crate::error::{BadParameter, Bounds};
use crate::noise::{NormalTable, Random};
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
    table: NormalTable,
    /// Deviation of the disparity at the strength, pixels.
    noise: f32,
    /// Shares at the strength, of all 2¹⁶.
    flying: u64,
    edge_holes: u64,
    holes: [u64; Surface::ALL.len()],
    /// Nearest depth of each pixel, m.
    nearest: Vec<f32>,
    /// Class of the surface that it is of.
    class: Vec<u8>,
    columns: Vec<f32>,
}

/// Where a point of the source is seen: depth, m, and place, pixels.
#[derive(Clone, Copy, Default)]
struct Seen {
    z: f32,
    u: f32,
    v: f32,
}

/// The next whole number below, -16 for all that lies further down.
fn floor(x: f32) -> i32 {
    (x.max(-16.0) + 16.0) as i32 - 16
}

/// What stands for no depth while pictures are made.
const NONE: f32 = f32::INFINITY;

impl DepthModel {
    /// A camera whose noise follows from `seed`, `strength` times as bad as its
    /// parameters say.
    #[must_use]
    pub fn new(parameters: DepthParameters, seed: u64, strength: f64) -> Self {
        let of_all = |share: f64| ((share * strength).min(1.0) * 65536.0) as u64;
        Self {
            seed,
            table: NormalTable::new(),
            noise: (parameters.disparity_noise * strength) as f32,
            flying: of_all(parameters.flying),
            edge_holes: of_all(parameters.edge_holes),
            holes: parameters.holes.map(of_all),
            nearest: Vec::new(),
            class: Vec::new(),
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
        let (width, height) = (to.width, to.height);
        self.nearest.clear();
        self.nearest.resize(width * height, NONE);
        self.class.clear();
        self.class.resize(width * height, 0);
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
        let principal = to.principal.map(|c| c as f32);
        let (depths, _) = exact.depth.as_chunks::<4>();
        let (ids, _) = exact.ids.as_chunks::<2>();
        let mut row = vec![Seen::default(); self.columns.len()];
        for y in (first[1]..from.height).step_by(stride[1]) {
            let begin = y * from.width;
            let Some(depths) = depths.get(begin..begin + from.width) else {
                return;
            };
            let Some(ids) = ids.get(begin..begin + from.width) else {
                return;
            };
            let down = along(1, y);
            let depths = depths.iter().skip(first[0]).step_by(stride[0]);
            for ((seen, depth), right) in row.iter_mut().zip(depths).zip(&self.columns) {
                let z = f32::from_le_bytes(*depth);
                let away = z - tz;
                let over = 1.0 / away;
                let near = z * over;
                *seen = Seen {
                    z: away,
                    u: right * near - moved[0] * over + principal[0],
                    v: down * near - moved[1] * over + principal[1],
                };
            }
            for (x, seen) in row.iter().enumerate() {
                let Seen { z, u, v } = *seen;
                let within = |x: f32, side: usize| x > -1.0 && x < side as f32 + 1.0;
                if !(z > 0.01 && z < 1.0e4 && within(u, width) && within(v, height)) {
                    continue;
                }
                let mut put = |column: i32, line: i32| {
                    let (Ok(column), Ok(line)) = (usize::try_from(column), usize::try_from(line))
                    else {
                        return;
                    };
                    let at = line * width + column;
                    if column < width && line < height && z < self.nearest[at] {
                        self.nearest[at] = z;
                        let id = ids[first[0] + x * stride[0]];
                        let class = surfaces.get(usize::from(u16::from_le_bytes(id)));
                        self.class[at] = class.copied().unwrap_or_default() as u8;
                    }
                };
                if wide {
                    for line in floor(v - half[1])..=floor(v + half[1]) {
                        for column in floor(u - half[0])..=floor(u + half[0]) {
                            put(column, line);
                        }
                    }
                } else {
                    put(floor(u), floor(v));
                }
            }
        }
    }

    /// Pixels that fell between those of the source.
    fn fill_cracks(&mut self) {
        let Lens { width, height, .. } = self.parameters.lens;
        let alike = |a: f32, b: f32| a < NONE && b < NONE && (a - b).abs() < 0.03 * a;
        for y in 0..height {
            for x in 1..width.saturating_sub(1) {
                let i = y * width + x;
                if self.nearest[i] < NONE {
                    continue;
                }
                let beside = (self.nearest[i - 1], self.nearest[i + 1], i - 1);
                let above = match (y > 0 && y + 1 < height).then_some(()) {
                    Some(()) => (self.nearest[i - width], self.nearest[i + width], i - width),
                    None => beside,
                };
                for (a, b, of) in [beside, above] {
                    if alike(a, b) {
                        self.nearest[i] = 0.5 * (a + b);
                        self.class[i] = self.class[of];
                        break;
                    }
                }
            }
        }
    }

    /// What matching the pictures of two eyes makes of the view.
    fn match_eyes(&self, tick: u64) -> Vec<u8> {
        let p = &self.parameters;
        let Lens { width, height, .. } = p.lens;
        let span = (p.lens.focal[0] * p.baseline) as f32;
        let step = p.disparity_step as f32;
        let [least, most] = p.range.map(|z| z as f32);
        let edge = p.edge as f32;
        let block = (p.hole_size as usize).max(1);
        let mut out = vec![0_u8; width * height * 2];
        let mut hidden = vec![false; width];
        let mut disparity = vec![0.0_f32; width];
        let mut below = vec![0.0_f32; width];
        let row_of = |y: usize, into: &mut [f32]| {
            let row = &self.nearest[y * width..(y + 1) * width];
            for (d, z) in into.iter_mut().zip(row) {
                // No depth is no disparity.
                *d = span / z;
            }
        };
        if height > 0 {
            row_of(0, &mut below);
        }
        for y in 0..height {
            std::mem::swap(&mut disparity, &mut below);
            if y + 1 < height {
                row_of(y + 1, &mut below);
            } else {
                below.copy_from_slice(&disparity);
            }
            shadow(&disparity, &mut hidden);
            let classes = &self.class[y * width..(y + 1) * width];
            let (pixels, _) = out[y * width * 2..(y + 1) * width * 2].as_chunks_mut::<2>();
            let mut random = Random::new(self.seed, [tick, y as u64]);
            let blocks = (y / block) as u64;
            let mut patch = 0;
            for x in 0..width {
                let bits = random.bits();
                if x % block == 0 {
                    let key = [tick, (blocks << 32) | (x / block) as u64];
                    patch = Random::new(!self.seed, key).bits() & 0xffff;
                }
                let mut d = disparity[x];
                let is_seen = d > 0.0;
                if !is_seen || hidden[x] || patch < self.holes[usize::from(classes[x])] {
                    continue;
                }
                let beside = disparity[(x + 1).min(width - 1)];
                let other = if (beside - d).abs() > (below[x] - d).abs() {
                    beside
                } else {
                    below[x]
                };
                if (other - d).abs() > edge && other > 0.0 {
                    let luck = (bits >> 12) & 0xffff;
                    if luck < self.edge_holes {
                        continue;
                    }
                    if luck < self.edge_holes + self.flying {
                        let share = ((bits >> 28) & 0xffff) as f32 / 65536.0;
                        d += share * (other - d);
                    }
                }
                d += self.noise * self.table.at(bits);
                if step > 0.0 {
                    d = step * ((d / step + 0.5) as u32) as f32;
                }
                let z = span / d;
                if d > 0.0 && z >= least && z <= most {
                    pixels[x] = ((z * 1000.0 + 0.5) as u16).to_le_bytes();
                }
            }
        }
        out
    }
}

/// Which pixels of a row the second eye does not see: what is nearer stands
/// before them, or they lie beyond its picture's left edge.
fn shadow(disparity: &[f32], hidden: &mut [bool]) {
    // Leftmost place in the second picture that something nearer has taken.
    let mut taken = f32::INFINITY;
    for (x, (d, hidden)) in disparity.iter().zip(hidden).enumerate().rev() {
        let at = x as f32 + 0.5 - d;
        *hidden = at < 0.0 || at > taken + 1.0;
        if *d > 0.0 && at < taken {
            taken = at;
        }
    }
}

#[cfg(test)]
mod tests;
