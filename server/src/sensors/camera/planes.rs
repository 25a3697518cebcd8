//! How a packed picture lies in memory.

use std::ops::Range;

use super::target::Target;

/// Where the planes of a packed picture lie, bytes. Each begins at a whole word.
#[derive(Clone, Copy)]
pub(super) struct Planes {
    pub(super) width: u32,
    pub(super) pixels: usize,
}

impl Planes {
    pub(super) fn of(target: &Target) -> Self {
        let lens = &target.spec.intrinsics;
        Self {
            width: lens.width,
            pixels: lens.width as usize * lens.height as usize,
        }
    }

    /// Pixels, four by four.
    fn fours(self) -> usize {
        self.pixels.div_ceil(4)
    }

    /// Colour, depth, ids.
    pub(super) fn ranges(self) -> [Range<usize>; 3] {
        let (depth, ids) = (self.fours() * 12, self.fours() * 28);
        [
            0..self.pixels * 3,
            depth..depth + self.pixels * 4,
            ids..ids + self.pixels * 2,
        ]
    }

    /// All of it.
    pub(super) fn bytes(self) -> u64 {
        self.fours() as u64 * 36
    }
}
