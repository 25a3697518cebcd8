//! Positions in a frame, pixels from the top left.

use anyhow::ensure;

use crate::convert::Size;

/// A rectangle: left, top, and its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub x: usize,
    pub y: usize,
    pub size: Size,
}

/// The parts of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// The frame; both sides are even, as encoders want them.
    pub size: Size,
    /// Images from left to right, all of one height.
    pub images: Vec<Place>,
    /// The progress bar of the episode.
    pub strip: Option<Place>,
    /// The text below it.
    pub words: Option<Place>,
    /// Height of the letters of the instruction.
    pub letters: usize,
}

/// Least width and height of a frame.
const LEAST: usize = 64;
/// Greatest width of a frame.
const MOST: usize = 3840;

impl Layout {
    /// Images of `sizes` side by side in `width`, each as wide as its shape requires.
    ///
    /// # Errors
    /// When the frame would be too small or too large.
    pub fn new(sizes: &[Size], width: usize, has_words: bool) -> anyhow::Result<Self> {
        ensure!(
            (LEAST..=MOST).contains(&width),
            "--width {width} is outside of {LEAST} to {MOST} pixels"
        );
        let width = width & !1;
        let gap = (width / 200).max(2);
        let shape = |size: &Size| size.width as f64 / size.height as f64;
        let shapes: f64 = sizes.iter().map(shape).sum();
        let room = width.saturating_sub(gap * sizes.len().saturating_sub(1));
        let height = ((room as f64 / shapes).round() as usize).max(2);
        let mut images = Vec::new();
        let mut x = 0;
        for (k, size) in sizes.iter().enumerate() {
            // The last one gets the rounding remainder.
            let wide = match k + 1 == sizes.len() {
                true => width.saturating_sub(x),
                false => (height as f64 * shape(size)).round() as usize,
            };
            ensure!(
                wide >= 8 && height >= 8,
                "{} images do not fit into --width {width}",
                sizes.len()
            );
            let size = Size {
                width: wide,
                height,
            };
            images.push(Place { x, y: 0, size });
            x += wide + gap;
        }
        let row = |y, height| Place {
            x: 0,
            y,
            size: Size { width, height },
        };
        // Text is relatively larger in a narrow frame, so that it is readable.
        let letters = (width / 46).clamp(13, 44);
        let (mut strip, mut words, mut bottom) = (None, None, height);
        if has_words {
            let high = (letters / 3).max(4);
            strip = Some(row(bottom, high));
            bottom += high;
            words = Some(row(bottom, letters * 3 + letters / 4));
            bottom += letters * 3 + letters / 4;
        }
        let size = Size {
            width,
            height: bottom.next_multiple_of(2),
        };
        if let Some(words) = &mut words {
            words.size.height += size.height - bottom;
        }
        Ok(Self {
            size,
            images,
            strip,
            words,
            letters,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: Size = Size {
        width: 640,
        height: 360,
    };

    #[test]
    fn images_fill_the_width_without_overlap() {
        let square = Size {
            width: 100,
            height: 100,
        };
        for sizes in [vec![WIDE], vec![WIDE, WIDE], vec![square, WIDE, WIDE]] {
            for width in [320, 801, 1290] {
                for has_words in [false, true] {
                    let layout = Layout::new(&sizes, width, has_words).unwrap();
                    assert_eq!(layout.size.width, width & !1);
                    assert_eq!(layout.size.height % 2, 0);
                    let mut x = 0;
                    for (place, size) in layout.images.iter().zip(&sizes) {
                        assert!(place.x >= x);
                        x = place.x + place.size.width;
                        let shape = place.size.width as f64 / place.size.height as f64;
                        let wanted = size.width as f64 / size.height as f64;
                        assert!((shape / wanted - 1.0).abs() < 0.05, "{shape}, {wanted}");
                    }
                    assert_eq!(x, layout.size.width);
                    let below = layout.words.map(|words| words.y + words.size.height);
                    let end = below.unwrap_or(layout.images[0].size.height);
                    assert!(layout.size.height - end <= 1, "{layout:?}");
                }
            }
        }
    }

    #[test]
    fn a_width_too_small_for_the_images_is_rejected() {
        for (count, width) in [(1, 10), (1, 100_000), (12, 64)] {
            let error = Layout::new(&vec![WIDE; count], width, true);
            let error = error.unwrap_err().to_string();
            assert!(error.contains("--width"), "{error}");
        }
    }
}
