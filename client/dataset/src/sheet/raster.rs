//! Images made small, depth made visible.

use std::path::Path;

use crate::read::Frame;

/// An RGB8 canvas.
pub struct Canvas {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<u8>,
}

impl Canvas {
    pub fn new(width: usize, height: usize, colour: (u8, u8, u8)) -> Self {
        let pixels = [colour.0, colour.1, colour.2].repeat(width * height);
        Self {
            width,
            height,
            pixels,
        }
    }

    /// Copies an image with its upper left corner at (x, y), cut at the edges.
    pub fn put(&mut self, image: &Self, x: usize, y: usize) {
        let columns = image.width.min(self.width.saturating_sub(x));
        for row in 0..image.height.min(self.height.saturating_sub(y)) {
            let to = 3 * ((y + row) * self.width + x);
            let from = 3 * row * image.width;
            self.pixels[to..to + 3 * columns]
                .copy_from_slice(&image.pixels[from..from + 3 * columns]);
        }
    }

    /// Writes it as a PNG file; atomically replaces an existing one.
    pub fn write(&self, out: &Path) -> Result<(), png::EncodingError> {
        let mut part = out.as_os_str().to_owned();
        part.push(".part");
        let part = Path::new(&part);
        let written = self.encode(part);
        let placed = written.and_then(|()| Ok(std::fs::rename(part, out)?));
        if placed.is_err() {
            let _ = std::fs::remove_file(part);
        }
        placed
    }

    fn encode(&self, out: &Path) -> Result<(), png::EncodingError> {
        let file = std::io::BufWriter::new(std::fs::File::create(out)?);
        let mut encoder = png::Encoder::new(file, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.pixels)?;
        writer.finish()
    }
}

/// Source rows or columns that one target row or column averages.
fn span(target: usize, targets: usize, sources: usize) -> std::ops::Range<usize> {
    let start = target * sources / targets;
    let end = ((target + 1) * sources).div_ceil(targets);
    start..end.clamp(start + 1, sources.max(start + 1))
}

/// The colour image, averaged down to `width` x `height`.
pub fn colour(frame: &Frame, width: usize, height: usize) -> Canvas {
    let mut out = Canvas::new(width, height, (0, 0, 0));
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0_u32; 3];
            let mut count = 0;
            for sy in span(y, height, frame.height) {
                for sx in span(x, width, frame.width) {
                    let at = 3 * (sy * frame.width + sx);
                    for (s, &v) in sum.iter_mut().zip(&frame.rgb[at..at + 3]) {
                        *s += u32::from(v);
                    }
                    count += 1;
                }
            }
            for (k, s) in sum.iter().enumerate() {
                out.pixels[3 * (y * width + x) + k] = (s / count) as u8;
            }
        }
    }
    out
}

/// The depth image: near is warm, far is cold, nothing is dark grey.
pub fn depth(frame: &Frame, range: (f32, f32), width: usize, height: usize) -> Canvas {
    let mut out = Canvas::new(width, height, (58, 60, 64));
    if frame.depth.is_empty() {
        return out;
    }
    for y in 0..height {
        for x in 0..width {
            // The nearest surface of the block keeps thin objects visible.
            let mut nearest = f32::INFINITY;
            for sy in span(y, height, frame.height) {
                for sx in span(x, width, frame.width) {
                    nearest = nearest.min(frame.depth[sy * frame.width + sx]);
                }
            }
            if nearest.is_finite() {
                let at = 3 * (y * width + x);
                out.pixels[at..at + 3].copy_from_slice(&shade(nearest, range));
            }
        }
    }
    out
}

/// Colour of a depth in metres within the range (near, far), by its logarithm:
/// a gripper at 0.1 m and a wall at 5 m both keep their structure.
pub fn shade(metres: f32, (near, far): (f32, f32)) -> [u8; 3] {
    let share = (metres / near).ln() / (far / near).ln().max(1e-6);
    turbo(1.0 - share)
}

/// The range of depth that the frames show, without the outermost 2 %.
pub fn depth_range(frames: &[Frame]) -> (f32, f32) {
    let mut all: Vec<f32> = frames
        .iter()
        .flat_map(|f| f.depth.iter().step_by(53))
        .copied()
        .filter(|d| d.is_finite())
        .collect();
    if all.is_empty() {
        return (0.1, 1.0);
    }
    all.sort_by(f32::total_cmp);
    let at = |share: f32| all[((all.len() - 1) as f32 * share) as usize];
    let near = at(0.02).max(0.01);
    (near, at(0.98).max(near + 0.01))
}

/// Google's Turbo colour map by its published polynomial, 0 blue to 1 red.
fn turbo(x: f32) -> [u8; 3] {
    const R: [f32; 6] = [
        0.135_721_4,
        4.615_392_6,
        -42.660_32,
        132.131_08,
        -152.942_4,
        59.286_38,
    ];
    const G: [f32; 6] = [
        0.091_402_61,
        2.194_188_4,
        4.842_966_5,
        -14.185_033,
        4.277_298_6,
        2.829_566,
    ];
    const B: [f32; 6] = [
        0.106_673_3,
        12.641_946,
        -60.582_05,
        110.362_77,
        -89.903_11,
        27.348_25,
    ];
    let x = x.clamp(0.0, 1.0);
    [R, G, B].map(|c| {
        let v = c.iter().rev().fold(0.0, |sum, k| sum * x + k);
        (v * 255.0).round().clamp(0.0, 255.0) as u8
    })
}
