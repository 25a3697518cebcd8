//! A colour camera: automatic exposure, white balance, photon and read noise, tone
//! curve, video coding, and latency.
//!
//! Not modelled: motion blur and rolling shutter (an exact image is one instant), the
//! colour filter mosaic, lens distortion.

use wheelarm_proto::exact;

use crate::block::Coder;
use crate::delay::Delay;
use crate::error::{BadParameter, Bounds};
use crate::exact_image::{Exact, Lens};
use crate::noise::{NormalTape, Random};
use crate::parameters::Section;

/// Parameters of a colour camera.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorParameters {
    /// Mean linear level targeted by the exposure, 0 to 1.
    pub exposure_target: f64,
    /// Share of the correction per image.
    pub exposure_speed: f64,
    /// Smallest and largest gain of exposure over the exact image.
    pub exposure_range: [f64; 2],
    /// Relative standard deviation of the gains of red and blue.
    pub white_balance: f64,
    /// Exponent of the tone curve relative to that of sRGB.
    pub gamma: f64,
    /// Electrons of a full pixel at gain 1.
    pub full_well: f64,
    /// Standard deviation of an empty pixel, electrons.
    pub read_noise: f64,
    /// Bit rate of the coded video, bit/s; 0 for none.
    pub bit_rate: f64,
    /// Frame rate for which the bit rate is defined, Hz.
    pub coded_rate: f64,
    /// Factor by which prediction from the previous image reduces the bits.
    pub coding_gain: f64,
    /// Images per second, Hz.
    pub rate: f64,
    /// Time of the first exposure, s.
    pub phase: f64,
    /// Latency from exposure to arrival.
    pub age: Delay,
}

impl ColorParameters {
    pub(crate) fn read(s: &mut Section<'_>) -> Result<Self, BadParameter> {
        let share = Bounds(0.0, 1.0);
        Ok(Self {
            exposure_target: s.number("exposure_target", "1", Bounds(0.01, 0.9))?,
            exposure_speed: s.number("exposure_speed", "1", share)?,
            exposure_range: s.numbers("exposure_range", "1", Bounds(0.05, 20.0))?,
            white_balance: s.number("white_balance", "1", Bounds(0.0, 0.5))?,
            gamma: s.number("gamma", "1", Bounds(0.3, 3.0))?,
            full_well: s.number("full_well", "e-", Bounds(100.0, 1e6))?,
            read_noise: s.number("read_noise", "e-", Bounds(0.0, 1000.0))?,
            bit_rate: s.number("bit_rate", "bit/s", Bounds(0.0, 1e9))?,
            coded_rate: s.number("coded_rate", "Hz", Bounds(1.0, 240.0))?,
            coding_gain: s.number("coding_gain", "1", Bounds(1.0, 20.0))?,
            rate: s.number("rate", "Hz", Bounds(1.0, 240.0))?,
            phase: s.number("phase", "s", share)?,
            age: Delay::read(s, "age")?,
        })
    }
}

/// Linear levels of a pixel before the tone curve.
const LEVELS: usize = 1 << 12;
/// From here to twice as much an f32 has no fractional bits.
const WHOLE: f32 = (1 << 23) as f32;

/// State of a colour camera.
#[derive(Clone, Debug)]
pub struct ColorModel {
    parameters: ColorParameters,
    seed: u64,
    strength: f64,
    /// Created with the first image, whose width determines its length.
    tape: Option<(usize, NormalTape)>,
    /// Linear value of each sRGB level.
    linear: [f64; 256],
    /// sRGB level of each linear level.
    tone: Box<[u8; LEVELS]>,
    /// Gains of red, green and blue of this specimen.
    balance: [f64; 3],
    /// Exposure over the exact image; `None` before the first image.
    gain: Option<f64>,
    coder: Coder,
}

impl ColorModel {
    /// A camera whose noise depends on `seed`, with `strength` times the errors of its
    /// parameters.
    #[must_use]
    pub fn new(parameters: ColorParameters, seed: u64, strength: f64) -> Self {
        let mut random = Random::new(seed, [0, u64::MAX]);
        let mut part =
            || 1.0 + parameters.white_balance * strength * random.normal().clamp(-2.5, 2.5);
        let (red, blue) = (part(), part());
        let gamma = 1.0 + (parameters.gamma - 1.0) * strength.min(1.0);
        Self {
            linear: std::array::from_fn(|v| to_linear(v as f64 / 255.0)),
            tone: Box::new(std::array::from_fn(|l| {
                let level = l as f64 / (LEVELS - 1) as f64;
                let toned = exact::powf(level, gamma);
                (255.0 * to_srgb(toned)).round() as u8
            })),
            balance: [red.max(0.2), 1.0, blue.max(0.2)],
            tape: None,
            gain: None,
            coder: Coder::new(),
            seed,
            strength,
            parameters,
        }
    }

    /// Its parameters.
    #[must_use]
    pub fn parameters(&self) -> &ColorParameters {
        &self.parameters
    }

    /// Resets exposure and codec.
    pub fn restart(&mut self) {
        self.gain = None;
        self.coder.restart();
    }

    /// The image, sRGB, 3 bytes per pixel, with the size of the exact one.
    pub fn image(&mut self, exact: &Exact<'_>) -> Vec<u8> {
        let gain = self.expose(exact.rgb);
        let p = &self.parameters;
        // Electrons of a full level: more gain, fewer electrons.
        let full = p.full_well / gain.max(1.0);
        let top = (LEVELS - 1) as f64;
        let tables: [[(f32, f32); 256]; 3] = self.balance.map(|balance| {
            let entry = |v: usize| {
                let level = (self.linear[v] * gain * balance).min(1.0);
                let electrons = level * full;
                let deviation = (electrons + p.read_noise * p.read_noise).sqrt() / full;
                let deviation = top * deviation * self.strength;
                ((top * level) as f32, deviation as f32)
            };
            std::array::from_fn(entry)
        });
        let mut out = vec![0; exact.rgb.len()];
        let row = (3 * exact.lens.width).max(3);
        let tape = match &self.tape {
            Some((most, tape)) if *most == row => tape,
            _ => &self.tape.insert((row, NormalTape::new(self.seed, row))).1,
        };
        let rows = out.chunks_mut(row).zip(exact.rgb.chunks(row));
        for (y, (to, from)) in rows.enumerate() {
            let bits = Random::new(self.seed, [exact.tick, y as u64]).bits();
            let noise = tape.read(bits, row);
            let (to, _) = to.as_chunks_mut::<3>();
            let (from, _) = from.as_chunks::<3>();
            let (noise, _) = noise.as_chunks::<3>();
            for ((to, from), noise) in to.iter_mut().zip(from).zip(noise) {
                for k in 0..3 {
                    let (level, deviation) = tables[k][usize::from(from[k])];
                    let noisy = level + deviation * noise[k];
                    let noisy = noisy.clamp(0.0, (LEVELS - 1) as f32);
                    // Its lowest bits are the nearest integer.
                    let level = (noisy + WHOLE).to_bits() as usize;
                    to[k] = self.tone[level % LEVELS];
                }
            }
        }
        if p.bit_rate > 0.0 && self.strength > 0.0 {
            let Lens { width, height, .. } = exact.lens;
            let bits = p.bit_rate * p.coding_gain / p.coded_rate / self.strength;
            self.coder.pass(&mut out, [width, height], bits);
        }
        out
    }

    /// The gain of this image, a step from the previous one.
    fn expose(&mut self, rgb: &[u8]) -> f64 {
        let p = &self.parameters;
        let (pixels, _) = rgb.as_chunks::<3>();
        let (mut sum, mut count) = (0.0, 0);
        for pixel in pixels.iter().step_by(61) {
            sum += self.linear[usize::from(pixel[1])];
            count += 1;
        }
        let mean = (sum / f64::from(count.max(1))).max(1e-4);
        let [least, most] = p.exposure_range;
        let wanted = (p.exposure_target / mean).clamp(least, most.max(least));
        let gain = match self.gain {
            None => wanted,
            Some(gain) => gain + p.exposure_speed * (wanted - gain),
        };
        self.gain = Some(gain);
        1.0 + (gain - 1.0) * self.strength.min(1.0)
    }
}

/// sRGB's curve (IEC 61966-2-1).
fn to_linear(v: f64) -> f64 {
    if v <= 0.04045 {
        v / 12.92
    } else {
        exact::powf((v + 0.055) / 1.055, 2.4)
    }
}

fn to_srgb(v: f64) -> f64 {
    if v <= 0.003_130_8 {
        12.92 * v
    } else {
        1.055 * exact::powf(v, 1.0 / 2.4) - 0.055
    }
}

#[cfg(test)]
mod tests;
