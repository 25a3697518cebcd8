//! Level places of a model that can carry objects, by measurement.

use crate::polygon;
use crate::raster::{Grid, Point3, clip, largest_rectangle, level_face};
use crate::solid::Solid;

/// Side of a cell, metres.
const CELL: f64 = 0.02;
/// Height that must be free above a surface, metres.
const ROOM: f64 = 0.28;
/// Least side of a surface, metres.
const LEAST: f64 = 0.22;
/// Largest number of surfaces of a kind.
const MOST: usize = 6;
/// Largest number of surfaces at one height: a worktop on both sides of its basin.
const MOST_LEVEL: usize = 2;
/// Two surfaces are at least this far apart in height, metres.
const APART: f64 = 0.05;

/// A level rectangle in the frame of its kind, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Height.
    pub height: f64,
    /// Corner with the smallest coordinates.
    pub low: [f64; 2],
    /// Corner with the largest coordinates.
    pub high: [f64; 2],
}

impl Surface {
    fn area(&self) -> f64 {
        (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])
    }
}

/// The surfaces of a model between the heights `from` and `to`, the largest first.
///
/// A point belongs to a surface when a face of the model is there, a collision shape ends
/// exactly there, and nothing of the model or of its shapes is above it for 0.28 m.
#[must_use]
pub fn surfaces(corners: &[[Point3; 3]], solids: &[Solid], from: f64, to: f64) -> Vec<Surface> {
    let all: Vec<Point3> = corners.iter().flatten().copied().collect();
    if all.is_empty() {
        return Vec::new();
    }
    let (low, high) = crate::fit::bounds(&all);
    if high[0] - low[0] > 20.0 || high[1] - low[1] > 20.0 {
        return Vec::new();
    }
    let grid = Grid::covering([low[0], low[1]], [high[0], high[1]], CELL);
    let mut found: Vec<Surface> = heights(corners, from, to)
        .into_iter()
        .flat_map(|height| measure(&grid, corners, solids, height))
        .collect();
    found.sort_by(|a, b| b.area().total_cmp(&a.area()));
    let mut kept: Vec<Surface> = Vec::new();
    for surface in found {
        // Rectangles of one height do not overlap.
        let is_apart = |other: &Surface| {
            let gap = (other.height - surface.height).abs();
            gap > APART || gap == 0.0
        };
        if kept.len() < MOST && kept.iter().all(is_apart) {
            kept.push(surface);
        }
    }
    kept
}

/// Heights with level faces of some size, within 4 mm of each other taken as one.
fn heights(corners: &[[Point3; 3]], from: f64, to: f64) -> Vec<f64> {
    let mut faces: Vec<(f64, f64)> = corners
        .iter()
        .filter_map(level_face)
        .filter(|&(height, _)| from <= height && height <= to)
        .collect();
    faces.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut heights = Vec::new();
    let mut start = 0;
    while start < faces.len() {
        let first = faces[start].0;
        let end = start + faces[start..].partition_point(|face| face.0 <= first + 0.004);
        let group = &faces[start..end];
        if group.iter().map(|face| face.1).sum::<f64>() >= LEAST * LEAST {
            let largest =
                group.iter().fold(
                    (first, 0.0),
                    |best, &face| if face.1 > best.1 { face } else { best },
                );
            heights.push(largest.0);
        }
        start = end;
    }
    heights
}

fn measure(grid: &Grid, corners: &[[Point3; 3]], solids: &[Solid], height: f64) -> Vec<Surface> {
    let mut free = vec![false; grid.len()];
    let mut taken = vec![false; grid.len()];
    for triangle in corners {
        let face = level_face(triangle);
        if face.is_some_and(|(at, _)| (at - height).abs() <= 0.004) {
            let plan = triangle.map(|p| [p[0], p[1]]);
            grid.cover(triangle, |cell, piece| {
                let whole = polygon::contains(&plan, grid.middle(cell));
                free[cell] |= whole || share(piece) > 0.5 * grid.cell * grid.cell;
            });
        }
        let above = clip(triangle, 2, height + 0.02, height + ROOM);
        grid.cover(&above, |cell, _| taken[cell] = true);
    }
    for cell in 0..grid.len() {
        let middle = grid.middle(cell);
        let mut carried = false;
        for solid in solids {
            let near = solid.high >= height - 0.003 && solid.low <= height + ROOM;
            if near && polygon::contains(&solid.outline, middle) {
                let ends = (solid.high - height).abs() <= 0.003;
                carried |= ends;
                taken[cell] |= !ends;
            }
        }
        free[cell] &= carried && !taken[cell];
    }
    let mut found = Vec::new();
    while found.len() < MOST_LEVEL {
        let Some(rectangle) = largest_rectangle(grid, &free) else {
            break;
        };
        let (low, high) = (
            grid.corner(rectangle.low[0], rectangle.low[1]),
            grid.corner(rectangle.high[0], rectangle.high[1]),
        );
        if (0..2).any(|axis| high[axis] - low[axis] < LEAST) {
            break;
        }
        rectangle.clear(grid, &mut free);
        found.push(Surface { height, low, high });
    }
    found
}

/// Area in plan of a convex polygon.
fn share(piece: &[Point3]) -> f64 {
    let plan: Vec<polygon::Point> = piece.iter().map(|p| [p[0], p[1]]).collect();
    polygon::area(&plan).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plate(low: [f64; 2], high: [f64; 2], z: f64) -> [[Point3; 3]; 2] {
        let at = |x: f64, y: f64| [x, y, z];
        [
            [
                at(low[0], low[1]),
                at(high[0], low[1]),
                at(high[0], high[1]),
            ],
            [
                at(low[0], low[1]),
                at(high[0], high[1]),
                at(low[0], high[1]),
            ],
        ]
    }

    #[test]
    fn worktop_beside_a_tap_is_a_surface() {
        let mut corners = plate([0.0, 0.0], [0.6, 1.2], 0.85).to_vec();
        // A tap across the middle, 0.2 m high.
        corners.push([[0.0, 0.5, 0.85], [0.6, 0.5, 0.85], [0.3, 0.5, 1.05]]);
        let top = Solid::cuboid([0.0, 0.0, 0.0], [0.6, 1.2, 0.85]);
        let found = surfaces(&corners, std::slice::from_ref(&top), 0.3, 1.2);
        assert_eq!(found.len(), 2, "one on each side");
        let surface = found[0];
        assert_eq!(surface.height, 0.85);
        assert!(found[1].high[1] <= 0.52, "{found:?}");
        assert!(
            surface.low[1] >= 0.5 && surface.high[1] > 1.15,
            "{surface:?}"
        );
        assert!(surfaces(&corners, &[top], 0.9, 1.2).is_empty());
    }

    #[test]
    fn face_without_a_collision_shape_carries_nothing() {
        let corners = plate([0.0, 0.0], [0.6, 0.6], 0.75).to_vec();
        assert!(surfaces(&corners, &[], 0.3, 1.2).is_empty());
        let inside = Solid::cuboid([0.0; 3], [0.6, 0.6, 1.0]);
        assert!(surfaces(&corners, &[inside], 0.3, 1.2).is_empty());
    }

    #[test]
    fn low_shelf_below_a_board_is_none() {
        let mut corners = plate([0.0, 0.0], [0.4, 0.8], 0.40).to_vec();
        corners.extend(plate([0.0, 0.0], [0.4, 0.8], 0.60));
        let boards = [
            Solid::cuboid([0.0, 0.0, 0.38], [0.4, 0.8, 0.40]),
            Solid::cuboid([0.0, 0.0, 0.58], [0.4, 0.8, 0.60]),
        ];
        let found = surfaces(&corners, &boards, 0.3, 1.2);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].height, 0.60);
    }
}
