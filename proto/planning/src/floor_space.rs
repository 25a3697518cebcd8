//! Room on a floor, independent of a robot: the clear width of an opening, and squares in
//! which a chair turns.

use super::footprint_check::Rectangle;
use super::grid::{CELL, CellPose, Grid};

/// A passage through a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Middle in `house`, metres.
    pub centre: [f64; 2],
    /// Unit vector along the wall.
    pub along: [f64; 2],
    /// Width of the opening in the wall, metres.
    pub width: f64,
    /// Half of the depth on either side of the middle in which obstacles count, metres.
    pub half_depth: f64,
}

/// The widest gap of a passage.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// Clear width, metres; 0 where the passage is blocked.
    pub width: f64,
    /// Middle of the gap along the wall from the middle of the opening, metres.
    pub middle: f64,
    /// Indices of the obstacles that make the passage narrower than its opening.
    pub blockers: Vec<usize>,
}

/// Intrusions smaller than this are rounding, metres.
const ROUNDING: f64 = 1e-6;

impl Passage {
    /// The widest gap among `obstacles`.
    #[must_use]
    pub fn gap(&self, obstacles: &[Rectangle]) -> Gap {
        let half = self.width / 2.0;
        let mut shadows: Vec<([f64; 2], usize)> = Vec::new();
        for (index, obstacle) in obstacles.iter().enumerate() {
            if let Some([low, high]) = self.shadow(obstacle) {
                let inside = [low.max(-half), high.min(half)];
                if inside[1] - inside[0] > ROUNDING {
                    shadows.push((inside, index));
                }
            }
        }
        shadows.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
        let (mut end, mut best) = (-half, [-half, -half]);
        for ([low, high], _) in &shadows {
            if low - end > best[1] - best[0] {
                best = [end, *low];
            }
            end = end.max(*high);
        }
        if half - end > best[1] - best[0] {
            best = [end, half];
        }
        let mut blockers: Vec<usize> = shadows.into_iter().map(|(_, index)| index).collect();
        blockers.sort_unstable();
        Gap {
            width: best[1] - best[0],
            middle: f64::midpoint(best[0], best[1]),
            blockers,
        }
    }

    /// The interval along the wall that an obstacle covers within the depth of the passage.
    fn shadow(&self, obstacle: &Rectangle) -> Option<[f64; 2]> {
        let across = [-self.along[1], self.along[0]];
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let corner = |side: [f64; 2]| {
            let aside = [-obstacle.along[1], obstacle.along[0]];
            let at = [0, 1].map(|i| {
                obstacle.centre[i] - self.centre[i]
                    + side[0] * obstacle.half[0] * obstacle.along[i]
                    + side[1] * obstacle.half[1] * aside[i]
            });
            [dot(at, self.along), dot(at, across)]
        };
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner);
        // The obstacle is cut at the depth of the passage: corners within it, and points of
        // the edges at its borders.
        let mut covered: Option<[f64; 2]> = None;
        let mut add = |at: f64| {
            let [low, high] = covered.unwrap_or([at, at]);
            covered = Some([low.min(at), high.max(at)]);
        };
        for (index, a) in corners.iter().enumerate() {
            let b = corners[(index + 1) % corners.len()];
            if a[1].abs() <= self.half_depth {
                add(a[0]);
            }
            for border in [-self.half_depth, self.half_depth] {
                let [from, to] = [a[1] - border, b[1] - border];
                if (from < 0.0) != (to < 0.0) {
                    add(a[0] + (b[0] - a[0]) * from / (from - to));
                }
            }
        }
        covered
    }
}

/// Squares of `side` metres, aligned with `house`, that touch none of `obstacles` and whose
/// middles are `inside`: their middles, metres, not nearer to each other than half a side.
#[must_use]
pub fn free_squares(
    obstacles: &[Rectangle],
    bounds: [f64; 4],
    side: f64,
    inside: &dyn Fn([f64; 2]) -> bool,
) -> Vec<[f64; 2]> {
    let grid = Grid::around(bounds);
    let [along, across] = grid.count();
    let middle = |x: usize, y: usize| {
        let pose = grid.middle(CellPose { x, y, heading: 0 });
        [pose.x, pose.y]
    };
    let mut free = vec![true; along * across];
    for obstacle in obstacles {
        let reach = obstacle.radius() + side;
        let index = |at: f64, axis: usize| {
            let cell = (at - f64::from(grid.corner()[axis])) / CELL;
            cell.clamp(0.0, grid.count()[axis] as f64) as usize
        };
        let [x, y] = obstacle.centre;
        for row in index(y - reach, 1)..index(y + reach, 1) {
            for column in index(x - reach, 0)..index(x + reach, 0) {
                let square = Rectangle {
                    centre: middle(column, row),
                    half: [side / 2.0; 2],
                    along: [1.0, 0.0],
                };
                if free[row * along + column] && square.overlaps(obstacle) {
                    free[row * along + column] = false;
                }
            }
        }
    }
    let mut found: Vec<[f64; 2]> = Vec::new();
    for row in 0..across {
        for column in 0..along {
            let at = middle(column, row);
            let is_near = |other: &[f64; 2]| (0..2).all(|i| (other[i] - at[i]).abs() < side / 2.0);
            if free[row * along + column] && inside(at) && !found.iter().any(is_near) {
                found.push(at);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::floor_map::tests::wall;
    use super::*;

    fn passage(width: f64) -> Passage {
        Passage {
            centre: [4.05, 2.0],
            along: [0.0, 1.0],
            width,
            half_depth: 0.1,
        }
    }

    #[test]
    fn an_empty_opening_is_clear_over_its_width() {
        let walls = [wall([4.0, 4.1], [0.0, 1.55]), wall([4.0, 4.1], [2.45, 4.0])];
        let gap = passage(0.90).gap(&walls);
        assert!((gap.width - 0.90).abs() < 1e-9 && gap.blockers.is_empty());
        assert!(gap.middle.abs() < 1e-9);
    }

    #[test]
    fn a_cabinet_in_the_opening_takes_its_width() {
        let cabinet = wall([4.05, 4.6], [2.3, 3.0]);
        let far = wall([4.3, 4.6], [1.0, 3.0]);
        let gap = passage(0.90).gap(&[far, cabinet]);
        assert!((gap.width - 0.75).abs() < 1e-9, "{gap:?}");
        assert_eq!(gap.blockers, [1]);
        assert!((gap.middle + 0.075).abs() < 1e-9);
        // A turned one that only its corner reaches in.
        let corner = Rectangle {
            centre: [4.05 + 0.1 + 0.3, 2.45],
            half: [0.3, 0.3],
            along: [std::f64::consts::FRAC_1_SQRT_2; 2],
        };
        let gap = passage(0.90).gap(&[corner]);
        let taken = 0.3 * std::f64::consts::SQRT_2 - 0.3;
        assert!((gap.width - (0.90 - taken)).abs() < 1e-9, "{gap:?}");
    }

    #[test]
    fn a_blocked_opening_has_no_width() {
        let gap = passage(0.90).gap(&[wall([4.0, 4.1], [1.0, 2.1]), wall([3.9, 4.2], [2.0, 3.0])]);
        assert_eq!((gap.width, gap.blockers), (0.0, vec![0, 1]));
    }

    #[test]
    fn squares_are_found_where_they_fit() {
        let walls = [
            wall([-0.1, 3.1], [-0.1, 0.0]),
            wall([-0.1, 3.1], [2.0, 2.1]),
            wall([-0.1, 0.0], [-0.1, 2.1]),
            wall([3.0, 3.1], [-0.1, 2.1]),
        ];
        let inside = |[x, y]: [f64; 2]| (0.0..3.0).contains(&x) && (0.0..2.0).contains(&y);
        let bounds = [0.0, 3.0, 0.0, 2.0];
        let found = free_squares(&walls, bounds, 1.5, &inside);
        assert!(!found.is_empty());
        for at in &found {
            assert!((0.75..=2.25).contains(&at[0]) && (0.75..=1.25).contains(&at[1]));
        }
        let table = wall([1.2, 1.8], [0.7, 1.3]);
        let with_table = [&walls[..], &[table]].concat();
        assert!(free_squares(&with_table, bounds, 1.5, &inside).is_empty());
    }
}
