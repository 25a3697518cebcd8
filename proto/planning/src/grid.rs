//! Cells of a floor map, and sets of them.

use std::f64::consts::TAU;

use super::footprint_check::{Pose2, Rectangle};

/// Side of a cell, metres.
pub const CELL: f64 = 0.05;
/// Headings per turn: 10° each.
pub const HEADINGS: usize = 36;
/// Largest side of a grid, metres.
const LONGEST: f64 = 200.0;

/// The cells of a rectangular floor, aligned with `house`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Corner with the least x and y, whole metres.
    corner: [i32; 2],
    /// Cells along x and y, an even number.
    count: [usize; 2],
    /// Whether four cells are one.
    is_coarse: bool,
}

/// A pose of a grid: a cell and a heading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct CellPose {
    /// Cell along x.
    pub x: usize,
    /// Cell along y.
    pub y: usize,
    /// Heading, in steps of 10°.
    pub heading: usize,
}

impl Grid {
    /// The smallest grid of whole metres around a box: x min, x max, y min, y max, metres.
    #[must_use]
    pub fn around([x0, x1, y0, y1]: [f64; 4]) -> Self {
        let side = |low: f64, high: f64| {
            let low = low.floor().clamp(-1e6, 1e6);
            let high = high.ceil().clamp(low + 1.0, low + LONGEST);
            (low as i32, ((high - low) / CELL).round() as usize)
        };
        let (x, y) = (side(x0, x1), side(y0, y1));
        Self {
            corner: [x.0, y.0],
            count: [x.1, y.1],
            is_coarse: false,
        }
    }

    /// The same floor in cells of twice the side.
    #[must_use]
    pub fn coarse(&self) -> Self {
        Self {
            count: self.count.map(|cells| cells.div_ceil(2)),
            is_coarse: true,
            ..*self
        }
    }

    /// Side of a cell, metres.
    #[must_use]
    pub fn side(&self) -> f64 {
        if self.is_coarse { 2.0 * CELL } else { CELL }
    }

    /// Corner with the least x and y, whole metres.
    #[must_use]
    pub fn corner(&self) -> [i32; 2] {
        self.corner
    }

    /// Cells along x and y.
    #[must_use]
    pub fn count(&self) -> [usize; 2] {
        self.count
    }

    /// Number of poses: cells times headings.
    #[must_use]
    pub fn poses(&self) -> usize {
        self.count[0] * self.count[1] * HEADINGS
    }

    /// Index of a pose.
    #[must_use]
    pub fn index(&self, at: CellPose) -> usize {
        (at.heading * self.count[1] + at.y) * self.count[0] + at.x
    }

    /// The pose with this index.
    #[must_use]
    pub fn cell_pose(&self, index: usize) -> CellPose {
        let [along, across] = self.count;
        CellPose {
            x: index % along,
            y: index / along % across,
            heading: index / (along * across),
        }
    }

    /// The grid pose that contains `pose`; `None` outside the grid.
    #[must_use]
    pub fn pose_at(&self, pose: &Pose2) -> Option<CellPose> {
        let cell = |at: f64, axis: usize| {
            let cell = ((at - f64::from(self.corner[axis])) / self.side()).floor();
            (cell >= 0.0 && cell < self.count[axis] as f64).then_some(cell as usize)
        };
        let turn = (pose.heading / TAU * HEADINGS as f64).round() as i64;
        Some(CellPose {
            x: cell(pose.x, 0)?,
            y: cell(pose.y, 1)?,
            heading: turn.rem_euclid(HEADINGS as i64) as usize,
        })
    }

    /// The pose in the middle of a cell.
    #[must_use]
    pub fn middle(&self, at: CellPose) -> Pose2 {
        let middle = |cell: usize, axis: usize| {
            f64::from(self.corner[axis]) + (cell as f64 + 0.5) * self.side()
        };
        Pose2 {
            x: middle(at.x, 0),
            y: middle(at.y, 1),
            heading: super::footprint_check::wrap(at.heading as f64 / HEADINGS as f64 * TAU),
        }
    }

    /// A pose some cells away; `None` outside the grid.
    #[must_use]
    pub fn moved(&self, at: CellPose, [x, y]: [i32; 2]) -> Option<CellPose> {
        let [x, y] = [at.x as i64 + i64::from(x), at.y as i64 + i64::from(y)];
        let inside = x >= 0 && y >= 0 && x < self.count[0] as i64 && y < self.count[1] as i64;
        inside.then_some(CellPose {
            x: x as usize,
            y: y as usize,
            heading: at.heading,
        })
    }

    /// The open poses among a pose and its neighbours, at most one cell and one heading
    /// away.
    #[must_use]
    pub fn open_around(&self, at: CellPose, blocked: &PoseSet) -> Vec<CellPose> {
        let mut open = Vec::new();
        for turn in [0, 1, HEADINGS - 1] {
            for y in -1..=1 {
                for x in -1..=1 {
                    if let Some(near) = self.moved(at, [x, y]) {
                        let heading = (near.heading + turn) % HEADINGS;
                        let near = CellPose { heading, ..near };
                        if !blocked.contains(self, near) {
                            open.push(near);
                        }
                    }
                }
            }
        }
        open
    }
}

/// A set of the poses of a grid: one bit each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PoseSet {
    /// Rows of cells along x, each in whole words.
    words: Vec<u64>,
    words_per_row: usize,
}

impl PoseSet {
    /// An empty set.
    #[must_use]
    pub fn empty(grid: &Grid) -> Self {
        let words_per_row = grid.count[0].div_ceil(64);
        Self {
            words: vec![0; words_per_row * grid.count[1] * HEADINGS],
            words_per_row,
        }
    }

    /// The poses of the coarse grid whose four cells are all in it.
    pub(super) fn coarsened(&self, grid: &Grid) -> Self {
        let coarse = grid.coarse();
        let mut set = Self::empty(&coarse);
        for heading in 0..HEADINGS {
            for y in 0..coarse.count[1] {
                let rows = [2 * y, 2 * y + 1].map(|y| self.row(grid, heading, y));
                let to = set.row(&coarse, heading, y);
                for word in 0..self.words_per_row {
                    let all = self.words[rows[0] + word] & self.words[rows[1] + word];
                    let pairs = even_bits(all & all >> 1);
                    set.words[to + word / 2] |= pairs << (32 * (word % 2));
                }
            }
        }
        set
    }

    fn row(&self, grid: &Grid, heading: usize, y: usize) -> usize {
        (heading * grid.count[1] + y) * self.words_per_row
    }

    /// Adds a pose.
    pub(super) fn insert(&mut self, grid: &Grid, at: CellPose) {
        let word = self.row(grid, at.heading, at.y) + at.x / 64;
        self.words[word] |= 1 << (at.x % 64);
    }

    /// Whether it contains a pose.
    #[must_use]
    pub fn contains(&self, grid: &Grid, at: CellPose) -> bool {
        let word = self.words[self.row(grid, at.heading, at.y) + at.x / 64];
        word >> (at.x % 64) & 1 == 1
    }

    /// Number of poses.
    #[must_use]
    pub fn len(&self) -> usize {
        self.words
            .iter()
            .map(|word| word.count_ones() as usize)
            .sum()
    }

    /// Whether it has no pose.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|word| *word == 0)
    }

    /// Adds all poses with this heading whose middles are in `shape`.
    pub(super) fn add(&mut self, grid: &Grid, heading: usize, shape: &Overlap) {
        let cells = |[low, high]: [f64; 2], axis: usize| {
            let corner = f64::from(grid.corner[axis]);
            let first = ((low - corner) / CELL - 0.5).ceil().max(0.0);
            let last = ((high - corner) / CELL - 0.5).floor();
            let last = last.min(grid.count[axis] as f64 - 1.0);
            (first <= last).then_some((first as usize, last as usize))
        };
        let Some((first, last)) = cells(shape.rows(), 1) else {
            return;
        };
        for y in first..=last {
            let middle = f64::from(grid.corner[1]) + (y as f64 + 0.5) * CELL;
            if let Some((from, to)) = shape.columns(middle).and_then(|x| cells(x, 0)) {
                let row = self.row(grid, heading, y);
                for word in from / 64..=to / 64 {
                    let low = from.max(word * 64) % 64;
                    let high = to.min(word * 64 + 63) % 64;
                    self.words[row + word] |= (u64::MAX << low) & (u64::MAX >> (63 - high));
                }
            }
        }
    }
}

/// Every second bit of a word, beginning with the lowest.
fn even_bits(word: u64) -> u64 {
    let masks = [
        (1, 0x3333_3333_3333_3333),
        (2, 0x0f0f_0f0f_0f0f_0f0f),
        (4, 0x00ff_00ff_00ff_00ff),
        (8, 0x0000_ffff_0000_ffff),
        (16, 0x0000_0000_ffff_ffff),
    ];
    masks
        .iter()
        .fold(word & 0x5555_5555_5555_5555, |bits, (by, mask)| {
            (bits | bits >> by) & mask
        })
}

/// The positions at which one rectangle overlaps another: their separating axes.
pub(super) struct Overlap {
    centre: [f64; 2],
    /// Axis, and greatest distance from the centre along it.
    axes: [([f64; 2], f64); 4],
    /// Half the height, metres.
    tall: f64,
}

impl Overlap {
    /// Positions of a rectangle's origin at which it overlaps `obstacle`; `outline` is the
    /// rectangle with its origin at 0. Every side is extended by `slack` metres along x
    /// and y.
    pub(super) fn new(obstacle: &Rectangle, outline: &Rectangle, slack: f64) -> Self {
        let across = |v: [f64; 2]| [-v[1], v[0]];
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let extent = |r: &Rectangle, axis: [f64; 2]| {
            r.half[0] * dot(r.along, axis).abs() + r.half[1] * dot(across(r.along), axis).abs()
        };
        let wide = |axis: [f64; 2]| {
            extent(obstacle, axis) + extent(outline, axis) + slack * (axis[0].abs() + axis[1].abs())
        };
        let axes = [
            obstacle.along,
            across(obstacle.along),
            outline.along,
            across(outline.along),
        ];
        Self {
            centre: [0, 1].map(|i| obstacle.centre[i] - outline.centre[i]),
            axes: axes.map(|axis| (axis, wide(axis))),
            tall: wide([0.0, 1.0]),
        }
    }

    /// Lowest and highest y, metres.
    fn rows(&self) -> [f64; 2] {
        [self.centre[1] - self.tall, self.centre[1] + self.tall]
    }

    /// Lowest and highest x at a y, metres; `None` beside it.
    fn columns(&self, y: f64) -> Option<[f64; 2]> {
        let dy = y - self.centre[1];
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for ([ax, ay], wide) in self.axes {
            let off = ay * dy;
            if ax.abs() < 1e-9 {
                if off.abs() > wide {
                    return None;
                }
                continue;
            }
            let (a, b) = ((-wide - off) / ax, (wide - off) / ax);
            low = low.max(a.min(b));
            high = high.min(a.max(b));
        }
        (low <= high).then(|| [low + self.centre[0], high + self.centre[0]])
    }
}
