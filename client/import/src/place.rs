//! Start of the chair and place of the room camera.

use wheelarm_proto::exact;

use crate::polygon::{self, Point};
use crate::raster::Grid;

/// Side of a cell, metres.
const CELL: f64 = 0.05;
/// Distance beyond which more room does not count, metres.
const ENOUGH: f64 = 1.2;
/// Least distance of the camera from walls and furniture, metres.
const CAMERA_GAP: f64 = 0.3;

/// Half the width of the free view of the camera over its first 1.5 m, metres.
const VIEW_GAP: f64 = 0.25;
/// Factor of the value of a place whose view is hidden.
const HIDDEN: f64 = 0.2;

/// An obstacle on the floor: a convex outline.
pub struct Obstacle {
    /// Outline, metres of the pack.
    pub outline: Vec<Point>,
}

/// Where the chair starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Position.
    pub at: Point,
    /// Direction of its front, degrees.
    pub yaw_deg: f64,
    /// Radius of the free circle, metres.
    pub free: f64,
}

/// Free floor: distances to the next obstacle.
pub struct FreeFloor {
    grid: Grid,
    /// Distance of each cell from the next cell that is not free, metres.
    distance: Vec<f64>,
}

impl FreeFloor {
    /// The floor inside `rooms` that obstacles and openings leave free.
    #[must_use]
    pub fn new(
        rooms: &[&[Point]],
        obstacles: &[Obstacle],
        openings: &[Vec<Point>],
    ) -> Option<Self> {
        let corners: Vec<Point> = rooms.iter().flat_map(|room| room.iter().copied()).collect();
        if corners.is_empty() {
            return None;
        }
        let (low, high) = polygon::bounds(&corners);
        let side = (high[0] - low[0]).max(high[1] - low[1]);
        let cell = if side > 60.0 { side / 1_200.0 } else { CELL };
        let grid = Grid::covering(low.map(|c| c - cell), high.map(|c| c + cell), cell);
        let mut free: Vec<bool> = (0..grid.len())
            .map(|cell| {
                let middle = grid.middle(cell);
                rooms.iter().any(|room| polygon::contains(room, middle))
            })
            .collect();
        let blocks = obstacles.iter().map(|obstacle| &obstacle.outline);
        for outline in blocks.chain(openings) {
            let flat: Vec<[f64; 3]> = outline.iter().map(|&[x, y]| [x, y, 0.0]).collect();
            grid.cover(&flat, |cell, _| free[cell] = false);
        }
        let distance = distances(&grid, &free);
        Some(Self { grid, distance })
    }

    /// Distance of a place from the next obstacle, metres; 0 outside.
    #[must_use]
    pub fn distance(&self, at: Point) -> f64 {
        let [x, y] = [0, 1].map(|axis| (at[axis] - self.grid.low[axis]) / self.grid.cell);
        let [columns, rows] = self.grid.count;
        if x < 0.0 || y < 0.0 || x >= columns as f64 || y >= rows as f64 {
            return 0.0;
        }
        self.distance[self.grid.index(x as usize, y as usize)]
    }

    /// The place inside an outline with the most room, looking along the longest free line.
    #[must_use]
    pub fn start(&self, outline: &[Point]) -> Option<Start> {
        let (low, high) = polygon::bounds(outline);
        let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        let mut best: Option<(f64, Point, f64)> = None;
        for cell in 0..self.grid.len() {
            let free = self.distance[cell];
            if free <= 0.0 {
                continue;
            }
            let at = self.grid.middle(cell);
            if !polygon::contains(outline, at) {
                continue;
            }
            let value = free.min(ENOUGH) - 0.01 * polygon::distance(at, middle);
            if best.is_none_or(|best| value > best.0) {
                best = Some((value, at, free));
            }
        }
        let (_, at, free) = best?;
        let longest = (0..8)
            .map(|eighth| (eighth, self.run(at, f64::from(eighth) * 45.0)))
            .fold(
                (0, 0.0),
                |best, next| if next.1 > best.1 + 0.1 { next } else { best },
            );
        let degrees = f64::from(longest.0) * 45.0;
        Some(Start {
            at,
            yaw_deg: if degrees > 180.0 {
                degrees - 360.0
            } else {
                degrees
            },
            free,
        })
    }

    /// Length of the free line from a place, metres.
    fn run(&self, at: Point, degrees: f64) -> f64 {
        let (sin, cos) = exact::sin_cos(degrees.to_radians());
        let mut length = 0.0;
        while length < 10.0 {
            let next = length + self.grid.cell;
            if self.distance([at[0] + next * cos, at[1] + next * sin]) <= 0.0 {
                break;
            }
            length = next;
        }
        length
    }

    /// A place for the camera in a corner of a room, with the widest view of its middle, which
    /// neither furniture that is `tall` nor `walls` hide.
    #[must_use]
    pub fn camera(
        &self,
        outline: &[Point],
        target: Point,
        tall: &[&[Point]],
        walls: &[&[Point]],
    ) -> Point {
        let count = outline.len();
        let mut best = (-1.0, target);
        for i in 0..count {
            let corner = outline[i];
            let (before, after) = (outline[(i + count - 1) % count], outline[(i + 1) % count]);
            // Along both sides, into the room.
            for share in [0.35, 0.6, 0.9] {
                let along = |to: Point| {
                    let length = polygon::distance(corner, to).max(1.0e-9);
                    [0, 1].map(|axis| (to[axis] - corner[axis]) / length * share)
                };
                let (a, b) = (along(before), along(after));
                let at = [corner[0] + a[0] + b[0], corner[1] + a[1] + b[1]];
                let inside = polygon::contains(outline, at)
                    && polygon::distance_to_outline(outline, at) >= CAMERA_GAP;
                let mut value = polygon::distance(at, target).min(6.0) - 0.5 * share;
                if tall.iter().any(|other| is_before(at, target, other)) {
                    value *= HIDDEN;
                }
                if walls.iter().any(|wall| is_between(at, target, wall)) {
                    value *= HIDDEN;
                }
                if inside && value > best.0 {
                    best = (value, at);
                }
            }
        }
        best.1
    }
}

/// Whether an outline is around a camera or close before it.
fn is_before(at: Point, target: Point, outline: &[Point]) -> bool {
    let far = polygon::distance(at, target).max(1.0e-9);
    let ahead =
        |length: f64| [0, 1].map(|axis| at[axis] + (target[axis] - at[axis]) * length / far);
    let mut steps = (0..=15).map(|step| ahead(f64::from(step) * 0.1));
    steps.any(|place| {
        polygon::contains(outline, place) || polygon::distance_to_outline(outline, place) < VIEW_GAP
    })
}

/// Whether the line from a camera to its target meets an outline.
fn is_between(at: Point, target: Point, outline: &[Point]) -> bool {
    let steps = (polygon::distance(at, target) / 0.05).ceil().max(1.0);
    let place = |step: f64| [0, 1].map(|axis| at[axis] + (target[axis] - at[axis]) * step / steps);
    (0..=steps as i32).any(|step| polygon::contains(outline, place(f64::from(step))))
}

/// Distances by two passes over the cells (chamfer 1, sqrt 2).
fn distances(grid: &Grid, free: &[bool]) -> Vec<f64> {
    let [columns, rows] = grid.count;
    let diagonal = std::f64::consts::SQRT_2;
    let mut distance: Vec<f64> = free.iter().map(|&f| if f { 1.0e9 } else { 0.0 }).collect();
    let relax = |distance: &mut Vec<f64>, i: usize, j: usize, steps: [(isize, isize, f64); 4]| {
        let here = grid.index(i, j);
        for (x, y, cost) in steps {
            let (Some(i), Some(j)) = (i.checked_add_signed(x), j.checked_add_signed(y)) else {
                continue;
            };
            if i < columns && j < rows {
                let through = distance[grid.index(i, j)] + cost;
                distance[here] = distance[here].min(through);
            }
        }
    };
    for j in 0..rows {
        for i in 0..columns {
            let steps = [
                (-1, 0, 1.0),
                (0, -1, 1.0),
                (-1, -1, diagonal),
                (1, -1, diagonal),
            ];
            relax(&mut distance, i, j, steps);
        }
    }
    for j in (0..rows).rev() {
        for i in (0..columns).rev() {
            let steps = [
                (1, 0, 1.0),
                (0, 1, 1.0),
                (1, 1, diagonal),
                (-1, 1, diagonal),
            ];
            relax(&mut distance, i, j, steps);
        }
    }
    for value in &mut distance {
        *value *= grid.cell;
    }
    distance
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: [Point; 4] = [[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 4.0]];

    #[test]
    fn start_keeps_away_from_furniture_and_openings() {
        let table = Obstacle {
            outline: vec![[3.0, 1.0], [5.0, 1.0], [5.0, 3.0], [3.0, 3.0]],
        };
        let stairs = vec![[0.0, 3.0], [2.0, 3.0], [2.0, 4.0], [0.0, 4.0]];
        let floor = FreeFloor::new(&[&ROOM], &[table], &[stairs]).unwrap();
        let start = floor.start(&ROOM).unwrap();
        assert!(start.free > 1.2, "{start:?}");
        assert!(start.at[0] < 2.0 && start.at[1] < 2.0, "{start:?}");
        assert_eq!(floor.distance([4.0, 2.0]), 0.0);
        assert_eq!(floor.distance([9.0, 9.0]), 0.0);
    }

    #[test]
    fn camera_is_inside_and_far_from_its_target() {
        let floor = FreeFloor::new(&[&ROOM], &[], &[]).unwrap();
        let at = floor.camera(&ROOM, [4.0, 3.0], &[], &[]);
        assert!(polygon::contains(&ROOM, at));
        assert!(polygon::distance(at, [4.0, 3.0]) > 3.5, "{at:?}");
        // A lamp in its view: another corner is better.
        let lamp = [0.2, -0.2].map(|x| [0.2, -0.2].map(|y| [at[0] + 0.7 + x, at[1] + 0.6 + y]));
        let lamp = [lamp[1][1], lamp[0][1], lamp[0][0], lamp[1][0]];
        let other = floor.camera(&ROOM, [4.0, 3.0], &[&lamp], &[]);
        assert!(polygon::distance(at, other) > 1.0, "{other:?}");
    }
}
