//! Polygons cut by planes and by the cells of a grid.

/// A point, metres.
pub type Point3 = [f64; 3];

/// The part of a convex polygon with `low <= coordinate <= high` along `axis`.
#[must_use]
pub fn clip(polygon: &[Point3], axis: usize, low: f64, high: f64) -> Vec<Point3> {
    let below = half(polygon, axis, high, 1.0);
    half(&below, axis, low, -1.0)
}

/// The part on one side of a plane: `sign * (coordinate - bound) <= 0`.
fn half(polygon: &[Point3], axis: usize, bound: f64, sign: f64) -> Vec<Point3> {
    let over = |p: &Point3| sign * (p[axis] - bound);
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        let (from, to) = (over(a), over(b));
        if from <= 0.0 {
            kept.push(*a);
        }
        if (from < 0.0 && to > 0.0) || (from > 0.0 && to < 0.0) {
            let share = from / (from - to);
            let mut crossing = [0, 1, 2].map(|k| a[k] + share * (b[k] - a[k]));
            crossing[axis] = bound;
            kept.push(crossing);
        }
    }
    kept
}

/// Height and area of a triangle that is level.
#[must_use]
pub fn level_face(corners: &[Point3; 3]) -> Option<(f64, f64)> {
    let [a, b, c] = *corners;
    let (u, v) = (sub(b, a), sub(c, a));
    let normal = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    // Some catalogues turn faces the wrong way round: both directions count.
    let is_level = length > 1.0e-9 && normal[2].abs() > 0.97 * length;
    is_level.then(|| ((a[2] + b[2] + c[2]) / 3.0, 0.5 * length))
}

fn sub(a: Point3, b: Point3) -> Point3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A grid in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Lower corner, metres.
    pub low: [f64; 2],
    /// Side of a cell, metres.
    pub cell: f64,
    /// Numbers of cells along x and y.
    pub count: [usize; 2],
}

impl Grid {
    /// The grid that covers a rectangle.
    #[must_use]
    pub fn covering(low: [f64; 2], high: [f64; 2], cell: f64) -> Self {
        let along = |axis: usize| {
            let cells = ((high[axis] - low[axis]) / cell - 1.0e-6).ceil();
            (cells as usize).max(1)
        };
        Self {
            low,
            cell,
            count: [along(0), along(1)],
        }
    }

    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count[0] * self.count[1]
    }

    /// Index of the cell in column `i` and row `j`.
    #[must_use]
    pub fn index(&self, i: usize, j: usize) -> usize {
        j * self.count[0] + i
    }

    /// Column and row of a cell.
    #[must_use]
    pub fn place(&self, index: usize) -> (usize, usize) {
        (index % self.count[0], index / self.count[0])
    }

    /// Lower corner of the cell in column `i` and row `j`.
    #[must_use]
    pub fn corner(&self, i: usize, j: usize) -> [f64; 2] {
        [
            self.low[0] + i as f64 * self.cell,
            self.low[1] + j as f64 * self.cell,
        ]
    }

    /// Middle of a cell.
    #[must_use]
    pub fn middle(&self, index: usize) -> [f64; 2] {
        let (i, j) = self.place(index);
        self.corner(i, j).map(|c| c + 0.5 * self.cell)
    }

    /// The columns or rows that an interval touches.
    #[must_use]
    pub fn range(&self, axis: usize, low: f64, high: f64) -> std::ops::Range<usize> {
        let at = |x: f64| ((x - self.low[axis]) / self.cell).clamp(0.0, 1.0e9);
        let last = self.count[axis] - 1;
        let first = (at(low + 1.0e-9) as usize).min(last);
        let end = (at(high - 1.0e-9) as usize).min(last);
        first..end.max(first) + 1
    }

    /// Calls `found` with each cell that a convex polygon touches in plan, and its part there.
    pub fn cover(&self, polygon: &[Point3], mut found: impl FnMut(usize, &[Point3])) {
        if polygon.is_empty() {
            return;
        }
        let (low, high) = crate::fit::bounds(polygon);
        for i in self.range(0, low[0], high[0]) {
            let left = self.low[0] + i as f64 * self.cell;
            let column = if high[0] - low[0] <= self.cell && self.is_one(0, low[0], high[0]) {
                polygon.to_vec()
            } else {
                clip(polygon, 0, left, left + self.cell)
            };
            if column.is_empty() {
                continue;
            }
            let (low, high) = crate::fit::bounds(&column);
            for j in self.range(1, low[1], high[1]) {
                let front = self.low[1] + j as f64 * self.cell;
                if self.is_one(1, low[1], high[1]) {
                    found(self.index(i, j), &column);
                    continue;
                }
                let part = clip(&column, 1, front, front + self.cell);
                if !part.is_empty() {
                    found(self.index(i, j), &part);
                }
            }
        }
    }

    fn is_one(&self, axis: usize, low: f64, high: f64) -> bool {
        self.range(axis, low, high).len() == 1
    }

    /// The connected parts of a mask, each with its cells in ascending order.
    #[must_use]
    pub fn components(&self, mask: &[bool]) -> Vec<Vec<usize>> {
        let mut visited = vec![false; self.len()];
        let mut parts = Vec::new();
        for start in 0..self.len() {
            if !mask[start] || visited[start] {
                continue;
            }
            let mut part = Vec::new();
            let mut pending = vec![start];
            visited[start] = true;
            while let Some(cell) = pending.pop() {
                part.push(cell);
                for next in self.neighbours(cell) {
                    if mask[next] && !visited[next] {
                        visited[next] = true;
                        pending.push(next);
                    }
                }
            }
            part.sort_unstable();
            parts.push(part);
        }
        parts
    }

    /// The cells beside a cell, up to four.
    pub fn neighbours(&self, cell: usize) -> impl Iterator<Item = usize> {
        let (i, j) = self.place(cell);
        let [columns, rows] = self.count;
        let steps = [(1, 0), (-1, 0), (0, 1), (0, -1)];
        steps.into_iter().filter_map(move |(x, y)| {
            let (i, j) = (i.checked_add_signed(x)?, j.checked_add_signed(y)?);
            (i < columns && j < rows).then_some(j * columns + i)
        })
    }
}

/// Columns and rows of a rectangle of cells, ends excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rectangle {
    /// First column and row.
    pub low: [usize; 2],
    /// Column and row after the last.
    pub high: [usize; 2],
}

impl Rectangle {
    /// Clears its cells in a mask.
    pub fn clear(&self, grid: &Grid, mask: &mut [bool]) {
        for j in self.low[1]..self.high[1] {
            for i in self.low[0]..self.high[0] {
                mask[grid.index(i, j)] = false;
            }
        }
    }
}

/// The largest rectangle of a mask, by number of cells.
#[must_use]
pub fn largest_rectangle(grid: &Grid, mask: &[bool]) -> Option<Rectangle> {
    let [columns, rows] = grid.count;
    let mut heights = vec![0; columns + 1];
    let mut best = (0, None);
    for row in 0..rows {
        for (column, height) in heights.iter_mut().take(columns).enumerate() {
            let set = mask[grid.index(column, row)];
            *height = if set { *height + 1 } else { 0 };
        }
        let mut stack: Vec<(usize, usize)> = Vec::new();
        for (column, &height) in heights.iter().enumerate() {
            let mut start = column;
            while let Some(&(first, top)) = stack.last() {
                if top < height {
                    break;
                }
                stack.pop();
                let size = top * (column - first);
                if size > best.0 {
                    let low = [first, row + 1 - top];
                    let high = [column, row + 1];
                    best = (size, Some(Rectangle { low, high }));
                }
                start = first;
            }
            stack.push((start, height));
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipped_triangle_keeps_its_part() {
        let triangle = [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [2.0, 0.0, 0.0]];
        let part = clip(&triangle, 2, 0.5, 1.0);
        let (low, high) = crate::fit::bounds(&part);
        assert_eq!((low[2], high[2]), (0.5, 1.0));
        assert_eq!(high[0], 1.5);
        assert!(clip(&triangle, 2, 3.0, 4.0).is_empty());
    }

    #[test]
    fn largest_rectangle_of_an_angle() {
        let grid = Grid::covering([0.0; 2], [4.0, 3.0], 1.0);
        // The first row, and the two first columns.
        let mask: Vec<bool> = (0..12)
            .map(|c| grid.place(c).1 == 0 || grid.place(c).0 < 2)
            .collect();
        let found = largest_rectangle(&grid, &mask).unwrap();
        assert_eq!((found.low, found.high), ([0, 0], [2, 3]));
        assert_eq!(largest_rectangle(&grid, &[false; 12]), None);
    }

    #[test]
    fn covered_cells_are_those_that_a_polygon_touches() {
        let grid = Grid::covering([0.0; 2], [3.0, 3.0], 1.0);
        let mut cells = Vec::new();
        let polygon = [[0.5, 0.5, 1.0], [2.5, 0.5, 1.0], [2.5, 0.6, 1.0]];
        grid.cover(&polygon, |cell, _| cells.push(cell));
        assert_eq!(cells, [0, 1, 2]);
    }
}
