//! Memory layout of a packed image.

use std::ops::Range;

use super::target::Target;

/// Offsets of the planes of a packed image, bytes. Each begins at a whole word.
#[derive(Clone, Copy)]
pub(super) struct Planes {
    pub(super) width: u32,
    pub(super) pixels: usize,
}

impl Planes {
    pub(super) fn from_target(target: &Target) -> Self {
        let lens = &target.spec.intrinsics;
        Self {
            width: lens.width,
            pixels: lens.width as usize * lens.height as usize,
        }
    }

    /// Groups of four pixels.
    fn fours(self) -> usize {
        self.pixels.div_ceil(4)
    }

    /// Ranges of colour, depth, IDs.
    pub(super) fn ranges(self) -> [Range<usize>; 3] {
        let (depth, ids) = (self.fours() * 12, self.fours() * 28);
        [
            0..self.pixels * 3,
            depth..depth + self.pixels * 4,
            ids..ids + self.pixels * 2,
        ]
    }

    /// Total size, bytes.
    pub(super) fn bytes(self) -> u64 {
        self.fours() as u64 * 36
    }
}
