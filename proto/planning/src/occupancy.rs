//! Occupancy of a floor in the cells of a floor map: what is on it, and where a chair can be.

use super::floor_map::FloorMap;
use super::footprint_check::{Pose2, Rectangle};
use super::grid::{CELL, CellPose, Grid, HEADINGS};

/// Cells of a floor, first along x, then along y.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cells {
    grid: Grid,
    marked: Vec<bool>,
}

impl Cells {
    /// Those that a rectangle overlaps, of any of `rectangles`.
    #[must_use]
    pub fn covered(grid: &Grid, rectangles: impl IntoIterator<Item = Rectangle>) -> Self {
        let mut cells = Self::none(grid);
        let [along, across] = grid.count();
        let corner = grid.corner().map(f64::from);
        for rectangle in rectangles {
            let radius = rectangle.radius() + CELL;
            let range = |axis: usize, count: usize| {
                let from = (rectangle.centre[axis] - radius - corner[axis]) / CELL;
                let to = (rectangle.centre[axis] + radius - corner[axis]) / CELL;
                let end = to.ceil().clamp(0.0, count as f64) as usize;
                (from.floor().clamp(0.0, count as f64) as usize).min(end)..end
            };
            for y in range(1, across) {
                for x in range(0, along) {
                    let middle = grid.middle(CellPose { x, y, heading: 0 });
                    let cell = Rectangle {
                        centre: [middle.x, middle.y],
                        half: [CELL / 2.0; 2],
                        along: [1.0, 0.0],
                    };
                    if rectangle.overlaps(&cell) {
                        cells.marked[y * along + x] = true;
                    }
                }
            }
        }
        cells
    }

    /// Those in whose middle the chair of a floor map can be, in some heading, on the part of
    /// the floor that is connected with `from`.
    #[must_use]
    pub fn connected(map: &FloorMap, from: &Pose2) -> Self {
        let grid = *map.grid();
        let mut cells = Self::none(&grid);
        let coarse = grid.coarse();
        let parts: Vec<u16> = (map.open_near(from).into_iter())
            .map(|at| map.parts().part(&coarse, at))
            .collect();
        let [along, across] = grid.count();
        for y in 0..across {
            for x in 0..along {
                let is_there = |heading| {
                    let at = CellPose { x, y, heading };
                    let whole = CellPose {
                        x: x / 2,
                        y: y / 2,
                        heading,
                    };
                    !map.blocked().contains(&grid, at)
                        && parts.contains(&map.parts().part(&coarse, whole))
                };
                cells.marked[y * along + x] = (0..HEADINGS).any(is_there);
            }
        }
        cells
    }

    fn none(grid: &Grid) -> Self {
        let [along, across] = grid.count();
        Self {
            grid: *grid,
            marked: vec![false; along * across],
        }
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Whether each cell is one of them, first along x, then along y.
    #[must_use]
    pub fn marked(&self) -> &[bool] {
        &self.marked
    }

    /// Whether the cell of a point is one of them; false outside of the grid.
    #[must_use]
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        let pose = Pose2 { x, y, heading: 0.0 };
        let at = self.grid.pose_at(&pose);
        at.is_some_and(|at| self.marked[at.y * self.grid.count()[0] + at.x])
    }
}

#[cfg(test)]
mod tests {
    use super::super::footprint_check::{FootprintCheck, Outline};
    use super::*;

    fn block(centre: [f64; 2], half: [f64; 2]) -> Rectangle {
        Rectangle {
            centre,
            half,
            along: [1.0, 0.0],
        }
    }

    #[test]
    fn cells_are_covered_where_something_stands_and_free_where_the_chair_gets_to() {
        // Two rooms of 3 m by 3 m beside each other, with a gap of 0.4 m in the wall.
        let walls = [
            block([0.0, -1.5], [3.0, 0.05]),
            block([0.0, 1.5], [3.0, 0.05]),
            block([-3.0, 0.0], [0.05, 1.5]),
            block([3.0, 0.0], [0.05, 1.5]),
            block([0.0, -0.85], [0.05, 0.65]),
            block([0.0, 0.85], [0.05, 0.65]),
        ];
        let sides = [-0.2, 0.6, -0.3, 0.3];
        let mut check = FootprintCheck::from_outlines(vec![(1.0, Outline { sides })]);
        for wall in walls {
            check.put(wall, [0.0, 2.0]);
        }
        let here = Pose2 {
            x: -1.5,
            y: 0.0,
            heading: 0.0,
        };
        let map = FloorMap::new(&check, 0.05, &[here]);
        let standing = Cells::covered(map.grid(), walls);
        assert!(standing.contains([0.0, 0.8]) && standing.contains([2.98, 1.0]));
        assert!(!standing.contains([0.0, 0.0]) && !standing.contains([-1.5, 0.0]));
        let free = Cells::connected(&map, &here);
        assert!(free.contains([-1.5, 0.0]) && free.contains([-2.0, 0.5]));
        // Beyond the gap, in a wall, outside.
        for blocked in [[1.5, 0.0], [0.0, 0.8], [-1.5, 2.0], [40.0, 0.0]] {
            assert!(!free.contains(blocked), "{blocked:?}");
        }
        let beyond = Pose2 { x: 1.5, ..here };
        assert!(Cells::connected(&map, &beyond).contains([1.5, 0.0]));
    }
}
