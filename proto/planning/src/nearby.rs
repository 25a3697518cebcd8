//! A fast footprint check for searches: obstacles are sorted into cells, and only those
//! of the chair's cell are checked. The result is that of [`FootprintCheck::is_free`].

use wheelarm_proto::exact;

use super::footprint_check::{FootprintCheck, Outline, Pose2, Rectangle};
use super::grid::{self, Grid};

/// Side of a cell, in cells of the grid: 0.5 m.
const CELLS: usize = 10;
/// The same, metres.
const SIDE: f64 = grid::CELL * CELLS as f64;

/// A footprint check with one margin.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Nearby {
    levels: Vec<Level>,
    margin: f64,
}

#[derive(Clone, Debug, PartialEq)]
struct Level {
    outline: Outline,
    /// Corner of the first cell, metres.
    corner: [f64; 2],
    /// Cells along x and y.
    count: [usize; 2],
    /// Obstacles that an outline with its centre in the cell can touch.
    cells: Vec<Vec<Rectangle>>,
    all: Vec<Rectangle>,
}

impl Nearby {
    pub(super) fn new(footprint: &FootprintCheck, grid: &Grid, margin: f64) -> Self {
        let count = grid.count().map(|cells| cells.div_ceil(CELLS));
        let levels = footprint.levels.iter().map(|level| Level {
            outline: level.outline,
            corner: grid.corner().map(f64::from),
            count,
            cells: vec![Vec::new(); count[0] * count[1]],
            all: Vec::new(),
        });
        let mut nearby = Self {
            levels: levels.collect(),
            margin,
        };
        for (index, level) in footprint.levels.iter().enumerate() {
            for obstacle in &level.obstacles {
                nearby.put(index, *obstacle);
            }
        }
        nearby
    }

    /// Adds an obstacle at a level.
    pub(super) fn put(&mut self, level: usize, obstacle: Rectangle) {
        let level = &mut self.levels[level];
        let origin = Pose2 {
            x: 0.0,
            y: 0.0,
            heading: 0.0,
        };
        let reach = level.outline.rectangle_at(&origin, self.margin).radius();
        let far = obstacle.radius() + reach;
        let range = |axis: usize| {
            let cell = |at: f64| (at - level.corner[axis]) / SIDE;
            let first = cell(obstacle.centre[axis] - far).floor().max(0.0) as usize;
            let last = cell(obstacle.centre[axis] + far).ceil().max(0.0) as usize;
            first..last.min(level.count[axis])
        };
        for y in range(1) {
            for x in range(0) {
                let at = |axis: usize, cell: usize| level.corner[axis] + (cell as f64 + 0.5) * SIDE;
                let around = Rectangle {
                    centre: [at(0, x), at(1, y)],
                    half: [SIDE / 2.0 + reach; 2],
                    along: [1.0, 0.0],
                };
                if obstacle.overlaps(&around) {
                    level.cells[y * level.count[0] + x].push(obstacle);
                }
            }
        }
        level.all.push(obstacle);
    }

    /// Whether the chair is collision-free at `pose`.
    pub(super) fn is_free(&self, pose: &Pose2) -> bool {
        let facing = exact::sin_cos(pose.heading);
        self.levels.iter().all(|level| {
            let outline = level.outline.rectangle_facing(pose, facing, self.margin);
            let near = level.near(outline.centre);
            !near.iter().any(|o| o.overlaps(&outline))
        })
    }
}

impl Level {
    fn near(&self, at: [f64; 2]) -> &[Rectangle] {
        let cell = |i: usize| {
            let cell = ((at[i] - self.corner[i]) / SIDE).floor();
            (cell >= 0.0 && cell < self.count[i] as f64).then_some(cell as usize)
        };
        match (cell(0), cell(1)) {
            (Some(x), Some(y)) => &self.cells[y * self.count[0] + x],
            _ => &self.all,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::floor_map::tests::cluttered;
    use super::*;

    #[test]
    fn cells_give_the_result_of_the_complete_check() {
        let footprint = cluttered();
        let grid = Grid::around(footprint.bounds());
        let mut free = 0;
        for margin in [0.0, 0.05] {
            let nearby = Nearby::new(&footprint, &grid, margin);
            for i in 0..4000 {
                let i = f64::from(i);
                let pose = Pose2 {
                    x: (i * 0.37) % 11.0 - 1.0,
                    y: (i * 0.53) % 8.0 - 1.0,
                    heading: (i * 0.71) % 6.0 - 3.0,
                };
                let is_free = footprint.is_free(&pose, margin);
                assert_eq!(nearby.is_free(&pose), is_free, "{pose:?}");
                free += usize::from(is_free);
            }
        }
        assert!((500..7500).contains(&free), "{free}");
    }
}
