//! Procedural pictures that repeat without a seam. Deterministic: no random
//! state, only hashes of lattice points. Colours multiply the material's; a
//! label is a whole picture and stands for the colour itself.

use super::texture_labels as labels;
use super::texture_surfaces as surfaces;

/// Pixels along each side.
pub const SIZE: usize = 512;

/// Halvings down to one pixel, the full size included.
pub const LEVELS: usize = 10;

/// Colour at `(u, v)` in 0..1, `v` upwards; sRGB-like values 0 to 1.
type Pattern = fn(f32, f32) -> [f32; 3];

/// Every pattern by name.
const PATTERNS: [(&str, Pattern); 16] = [
    ("planks", surfaces::planks),
    ("tiles", surfaces::tiles),
    ("plaster", surfaces::plaster),
    ("wood", surfaces::wood),
    ("fabric", surfaces::fabric),
    ("marble", surfaces::marble),
    ("checker", surfaces::checker),
    ("brushed", surfaces::brushed),
    ("leaves", surfaces::leaves),
    ("books", surfaces::books),
    ("stripes", surfaces::stripes),
    ("label_mustard", labels::mustard),
    ("label_soup", labels::soup),
    ("label_crackers", labels::crackers),
    ("label_meat", labels::meat),
    ("label_coke", labels::coke),
];

/// Names of all patterns.
pub fn names() -> impl Iterator<Item = &'static str> {
    PATTERNS.iter().map(|(name, _)| *name)
}

/// Is it the picture of a label: fitted to the height of its body, replacing the colour?
#[must_use]
pub fn is_label(pattern: &str) -> bool {
    pattern.starts_with("label_")
}

/// Has it a grain along `u` that should follow the longer side of a board?
#[must_use]
pub fn has_grain(pattern: &str) -> bool {
    matches!(pattern, "wood" | "brushed")
}

/// A picture with its halvings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// RGBA bytes from the largest to the 1 x 1 level; the first row is `v = 0`.
    /// A value is the square root of the linear colour.
    pub levels: Vec<Vec<u8>>,
}

/// Paints a pattern; `None` when the name is unknown.
#[must_use]
pub fn paint(pattern: &str) -> Option<Picture> {
    let (_, color) = PATTERNS.iter().find(|(name, _)| *name == pattern)?;
    let at = |k: usize| (k as f32 + 0.5) / SIZE as f32;
    let mut linear: Vec<[f32; 3]> = (0..SIZE * SIZE)
        .map(|i| color(at(i % SIZE), at(i / SIZE)).map(|c| c.clamp(0.0, 1.0).powi(2)))
        .collect();
    let mut levels = Vec::with_capacity(LEVELS);
    let mut side = SIZE;
    loop {
        let level: Vec<[u8; 4]> = linear.iter().map(|c| bytes(*c)).collect();
        levels.push(level.into_flattened());
        if side == 1 {
            return Some(Picture { levels });
        }
        let half = side / 2;
        linear = (0..half * half)
            .map(|i| {
                let (x, y) = (2 * (i % half), 2 * (i / half));
                let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .map(|(dx, dy)| linear[(y + dy) * side + x + dx]);
                std::array::from_fn(|k| 0.25 * (a[k] + b[k] + c[k] + d[k]))
            })
            .collect();
        side = half;
    }
}

fn bytes(linear: [f32; 3]) -> [u8; 4] {
    let [r, g, b] = linear.map(|c| (c.sqrt() * 255.0 + 0.5) as u8);
    [r, g, b, 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_repeat_without_a_seam_and_are_not_flat() {
        for (name, _) in PATTERNS {
            let picture = paint(name).unwrap();
            assert_eq!(picture.levels.len(), LEVELS);
            let top = &picture.levels[0];
            let pixel = |x: usize, y: usize| &top[(y * SIZE + x) * 4..][..3];
            let step = |a: &[u8], b: &[u8]| -> f64 {
                a.iter()
                    .zip(b)
                    .map(|(a, b)| f64::from(a.abs_diff(*b)))
                    .sum()
            };
            let column = |a: usize, b: usize| -> f64 {
                (0..SIZE).map(|y| step(pixel(a, y), pixel(b, y))).sum()
            };
            let row = |a: usize, b: usize| -> f64 {
                (0..SIZE).map(|x| step(pixel(x, a), pixel(x, b))).sum()
            };
            let most = |f: &dyn Fn(usize, usize) -> f64| {
                (0..SIZE - 1).map(|i| f(i, i + 1)).fold(0.0, f64::max)
            };
            let (widest, tallest) = (most(&column), most(&row));
            assert!(
                column(SIZE - 1, 0) <= 1.1 * widest,
                "{name}: seam left to right"
            );
            if !is_label(name) {
                assert!(
                    row(SIZE - 1, 0) <= 1.1 * tallest,
                    "{name}: seam bottom to top"
                );
            }
            assert!(widest + tallest > 0.0, "{name} is flat");
            assert!(top.iter().step_by(4).any(|r| *r > 150), "{name} is dark");
        }
        assert_eq!(paint("wallpaper"), None);
    }
}
