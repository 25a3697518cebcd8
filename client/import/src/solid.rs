//! Collision shapes of a model: upright prisms over convex outlines.
//!
//! The model is cut into layers at its level faces. In each band of equal layers the connected
//! parts become prisms; a part that fills its convex hull badly is divided. What surfaces
//! enclose on all six sides is solid. A prism uses the exact corners of the model, so that a
//! table top collides where it is rendered.

use crate::fit::bounds;
use crate::polygon::{self, Point};
use crate::raster::{Grid, Point3, clip, level_face};

/// Largest number of corners of an outline: a hull has twice as many vertices.
const MOST_CORNERS: usize = 12;
/// Largest number of prisms of a model.
pub const MOST_SOLIDS: usize = 40;
/// Number of cells along the longer side of a model.
const CELLS: f64 = 32.0;
/// Least thickness of a shape, metres: thinner ones let objects through.
const THICKNESS: f64 = 0.01;
/// Level faces within this height belong together, metres.
const LEVEL: f64 = 0.008;
/// A face this close to a cut is in it, metres.
const IN_CUT: f64 = 1.0e-5;

/// An upright prism, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Convex outline, counter-clockwise.
    pub outline: Vec<Point>,
    /// Height of the underside.
    pub low: f64,
    /// Height of the top.
    pub high: f64,
}

impl Solid {
    /// The upright box between two corners.
    #[must_use]
    pub fn cuboid(low: Point3, high: Point3) -> Self {
        let mut solid = Self {
            outline: vec![
                [low[0], low[1]],
                [high[0], low[1]],
                [high[0], high[1]],
                [low[0], high[1]],
            ],
            low: low[2],
            high: high[2],
        };
        solid.thicken();
        solid
    }

    /// The middle and the full lengths when it is an upright box along the axes.
    #[must_use]
    pub fn as_box(&self) -> Option<(Point3, Point3)> {
        let (low, high) = polygon::bounds(&self.outline);
        let whole = (high[0] - low[0]) * (high[1] - low[1]);
        let missing = whole - polygon::area(&self.outline);
        let is_box = missing <= 0.03 * whole && missing < 0.004;
        is_box.then(|| (self.middle(), self.size()))
    }

    /// Middle of its extents.
    #[must_use]
    pub fn middle(&self) -> Point3 {
        let (low, high) = polygon::bounds(&self.outline);
        [
            0.5 * (low[0] + high[0]),
            0.5 * (low[1] + high[1]),
            0.5 * (self.low + self.high),
        ]
    }

    /// Lengths of its extents.
    #[must_use]
    pub fn size(&self) -> Point3 {
        let (low, high) = polygon::bounds(&self.outline);
        [high[0] - low[0], high[1] - low[1], self.high - self.low]
    }

    /// Widens what is thinner than a collision shape may be.
    fn thicken(&mut self) {
        if self.high - self.low < THICKNESS {
            self.low = self.high - THICKNESS;
        }
        let (low, high) = polygon::bounds(&self.outline);
        let thin = (0..2).any(|axis| high[axis] - low[axis] < THICKNESS);
        if thin || self.outline.len() < 3 || polygon::area(&self.outline) < 1.0e-4 {
            let half = |axis: usize| (0.5 * (high[axis] - low[axis])).max(0.5 * THICKNESS);
            let middle = |axis: usize| 0.5 * (low[axis] + high[axis]);
            let (x, y) = (half(0), half(1));
            let (mx, my) = (middle(0), middle(1));
            self.outline = vec![
                [mx - x, my - y],
                [mx + x, my - y],
                [mx + x, my + y],
                [mx - x, my + y],
            ];
        }
    }
}

/// One layer: of each cell the corners of the model in it.
struct Layer {
    low: f64,
    high: f64,
    points: Vec<Vec<Point3>>,
    /// Cells with a part of the model, or enclosed.
    filled: Vec<bool>,
}

/// How much a division must save.
#[derive(Clone, Copy)]
struct Limits {
    /// Least share of a hull that its part fills.
    share: f64,
    /// Area of a hull that may be empty, square metres.
    slack: f64,
    /// Share of cells in which merged layers may differ.
    differ: f64,
}

/// The collision shapes of triangles.
#[must_use]
pub fn solids(points: &[Point3], triangles: &[[u32; 3]]) -> Vec<Solid> {
    let used: Vec<Point3> = triangles
        .iter()
        .flatten()
        .filter_map(|&corner| points.get(corner as usize).copied())
        .collect();
    if used.is_empty() {
        return Vec::new();
    }
    let (low, high) = bounds(&used);
    let longest = (high[0] - low[0]).max(high[1] - low[1]);
    let cell = (longest / CELLS).clamp(0.02, 0.25);
    let grid = Grid::covering([low[0], low[1]], [high[0], high[1]], cell);
    let corners: Vec<[Point3; 3]> = triangles
        .iter()
        .filter_map(|t| {
            let at = |corner: u32| points.get(corner as usize).copied();
            Some([at(t[0])?, at(t[1])?, at(t[2])?])
        })
        .collect();
    let Cut { mut layers, faces } = cut_into_layers(&grid, &corners, low[2], high[2]);
    fill(&grid, &mut layers, &faces);
    let plates = share_faces(&grid, &mut layers, faces);
    let mut limits = Limits {
        share: 0.93,
        slack: 0.003,
        differ: 0.08,
    };
    for _ in 0..6 {
        let mut found = bands(&grid, &layers, limits);
        for plate in &plates {
            found.extend(bands(&grid, std::slice::from_ref(plate), limits));
        }
        if found.len() <= MOST_SOLIDS {
            return found;
        }
        limits.share -= 0.13;
        limits.slack *= 3.0;
        limits.differ += 0.12;
    }
    vec![Solid::cuboid(low, high)]
}

/// Heights at which the model has level faces of some size, with its lowest and its highest,
/// and heights between them.
fn cuts(corners: &[[Point3; 3]], low: f64, high: f64, footprint: f64) -> Vec<f64> {
    let mut level: Vec<(f64, f64)> = corners
        .iter()
        .filter_map(level_face)
        .filter(|&(height, _)| height > low + LEVEL && height < high - LEVEL)
        .collect();
    level.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let least = (0.08 * footprint).max(0.002);
    let mut heights = vec![low];
    let mut start = 0;
    while start < level.len() {
        let first = level[start].0;
        let end = start + level[start..].partition_point(|face| face.0 <= first + LEVEL);
        let faces = &level[start..end];
        if faces.iter().map(|face| face.1).sum::<f64>() >= least {
            let largest =
                faces.iter().fold(
                    (first, 0.0),
                    |best, &face| {
                        if face.1 > best.1 { face } else { best }
                    },
                );
            heights.push(largest.0);
        }
        start = end;
    }
    heights.push(high);
    let mut all = vec![low];
    for pair in heights.windows(2) {
        let between = pair[1] - pair[0];
        let parts = (between / 0.10).ceil().clamp(1.0, 16.0);
        for part in 1..=parts as usize {
            all.push(pair[0] + between * part as f64 / parts);
        }
    }
    all
}

/// A model in layers, and its level faces in the cuts between them.
struct Cut {
    layers: Vec<Layer>,
    /// Of each cut from the lowest and of each cell: corners of level faces.
    faces: Vec<Vec<Vec<Point3>>>,
}

fn cut_into_layers(grid: &Grid, corners: &[[Point3; 3]], low: f64, high: f64) -> Cut {
    let footprint = grid.len() as f64 * grid.cell * grid.cell;
    let cuts = cuts(corners, low, high.max(low + 1.0e-6), footprint);
    let mut layers: Vec<Layer> = cuts
        .windows(2)
        .map(|cut| Layer {
            low: cut[0],
            high: cut[1],
            points: vec![Vec::new(); grid.len()],
            filled: vec![false; grid.len()],
        })
        .collect();
    let mut faces = vec![vec![Vec::new(); grid.len()]; cuts.len()];
    for triangle in corners {
        let (bottom, top) = bounds(triangle);
        let is_in = |cut: &f64| (bottom[2] - cut).abs() < IN_CUT && (top[2] - cut).abs() < IN_CUT;
        if let Some(cut) = cuts.iter().position(is_in) {
            grid.cover(triangle, |cell, piece| add(&mut faces[cut][cell], piece));
            continue;
        }
        for layer in &mut layers {
            if top[2] <= layer.low + IN_CUT || bottom[2] >= layer.high - IN_CUT {
                continue;
            }
            let part = clip(triangle, 2, layer.low, layer.high);
            grid.cover(&part, |cell, piece| {
                add(&mut layer.points[cell], piece);
                layer.filled[cell] = true;
            });
        }
    }
    Cut { layers, faces }
}

fn add(points: &mut Vec<Point3>, piece: &[Point3]) {
    points.extend_from_slice(piece);
    if points.len() > 64 {
        thin_out(points);
    }
}

/// Gives level faces to the filled layers above and below them. Returns the others: plates
/// without a thickness, as layers of their own.
fn share_faces(grid: &Grid, layers: &mut [Layer], faces: Vec<Vec<Vec<Point3>>>) -> Vec<Layer> {
    let mut plates = Vec::new();
    for (cut, cells) in faces.into_iter().enumerate() {
        let mut plate: Option<Layer> = None;
        for (cell, points) in cells.into_iter().enumerate() {
            let Some(first) = points.first() else {
                continue;
            };
            let beside = [cut.checked_sub(1), Some(cut)];
            let mut is_shared = false;
            for layer in beside.into_iter().flatten() {
                if let Some(layer) = layers.get_mut(layer).filter(|layer| layer.filled[cell]) {
                    // Sides reach the cut; a wide face on a leg would widen the leg.
                    if layer.points[cell].is_empty() {
                        add(&mut layer.points[cell], &points);
                    }
                    is_shared = true;
                }
            }
            if !is_shared {
                let plate = plate.get_or_insert_with(|| Layer {
                    low: first[2],
                    high: first[2],
                    points: vec![Vec::new(); grid.len()],
                    filled: vec![false; grid.len()],
                });
                plate.filled[cell] = true;
                plate.points[cell] = points;
            }
        }
        plates.extend(plate);
    }
    plates
}

/// Keeps the corners of the hull in plan at the least and the greatest height.
fn thin_out(points: &mut Vec<Point3>) {
    let (low, high) = bounds(points);
    let plan: Vec<Point> = points.iter().map(|p| [p[0], p[1]]).collect();
    let hull = polygon::convex_hull(&plan);
    points.clear();
    for p in hull {
        points.push([p[0], p[1], low[2]]);
        points.push([p[0], p[1], high[2]]);
    }
}

/// Fills cells that are enclosed along all three axes.
fn fill(grid: &Grid, layers: &mut [Layer], faces: &[Vec<Vec<Point3>>]) {
    let [columns, rows] = grid.count;
    let surface: Vec<Vec<bool>> = layers.iter().map(|layer| layer.filled.clone()).collect();
    // The first and one after the last layer between surfaces, of each cell.
    let mut lowest = vec![usize::MAX; grid.len()];
    let mut highest = vec![0; grid.len()];
    for cell in 0..grid.len() {
        for (k, _) in surface.iter().enumerate().filter(|(_, mask)| mask[cell]) {
            lowest[cell] = lowest[cell].min(k);
            highest[cell] = highest[cell].max(k + 1);
        }
        for (cut, _) in faces
            .iter()
            .enumerate()
            .filter(|(_, f)| !f[cell].is_empty())
        {
            lowest[cell] = lowest[cell].min(cut);
            highest[cell] = highest[cell].max(cut);
        }
    }
    for (k, mask) in surface.iter().enumerate() {
        let extent = |cells: &mut dyn Iterator<Item = usize>| {
            let set: Vec<usize> = cells
                .enumerate()
                .filter(|&(_, c)| mask[c])
                .map(|(n, _)| n)
                .collect();
            (set.first().copied(), set.last().copied())
        };
        let along_x: Vec<_> = (0..rows)
            .map(|j| extent(&mut (0..columns).map(|i| grid.index(i, j))))
            .collect();
        let along_y: Vec<_> = (0..columns)
            .map(|i| extent(&mut (0..rows).map(|j| grid.index(i, j))))
            .collect();
        let within = |range: (Option<usize>, Option<usize>), n: usize| {
            range.0.is_some_and(|first| first <= n) && range.1.is_some_and(|last| n <= last)
        };
        for cell in 0..grid.len() {
            let (i, j) = grid.place(cell);
            let enclosed = lowest[cell] <= k && k < highest[cell];
            if enclosed && within(along_x[j], i) && within(along_y[i], j) {
                layers[k].filled[cell] = true;
            }
        }
    }
}

fn bands(grid: &Grid, layers: &[Layer], limits: Limits) -> Vec<Solid> {
    let mut found = Vec::new();
    let mut start = 0;
    while start < layers.len() {
        let mut mask = layers[start].filled.clone();
        let mut end = start + 1;
        while end < layers.len() && is_like(&mask, &layers[end].filled, limits.differ) {
            for (set, more) in mask.iter_mut().zip(&layers[end].filled) {
                *set |= *more;
            }
            end += 1;
        }
        let band = Band {
            grid,
            layers: &layers[start..end],
            limits,
            plans: plans(grid, &layers[start..end], &mask),
        };
        for part in grid.components(&mask) {
            band.divide(part, 0, &mut found);
        }
        start = end;
    }
    found
}

/// The corners in plan of each cell of a mask; of enclosed cells their own corners.
fn plans(grid: &Grid, layers: &[Layer], mask: &[bool]) -> Vec<Vec<Point>> {
    let of = |cell: usize| {
        if !mask[cell] {
            return Vec::new();
        }
        let points = layers.iter().flat_map(|layer| &layer.points[cell]);
        let plan: Vec<Point> = points.map(|p| [p[0], p[1]]).collect();
        if !plan.is_empty() {
            return polygon::convex_hull(&plan);
        }
        let (i, j) = grid.place(cell);
        let corner = grid.corner(i, j);
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
        corners
            .map(|(x, y)| [corner[0] + x * grid.cell, corner[1] + y * grid.cell])
            .to_vec()
    };
    (0..grid.len()).map(of).collect()
}

/// Whether two masks are equal up to a share of their cells.
fn is_like(a: &[bool], b: &[bool], share: f64) -> bool {
    let either = a.iter().zip(b).filter(|(a, b)| **a || **b).count();
    let differ = a.iter().zip(b).filter(|(a, b)| a != b).count();
    (differ as f64) <= share * either as f64
}

struct Band<'a> {
    grid: &'a Grid,
    layers: &'a [Layer],
    limits: Limits,
    /// Corners in plan of each cell; of enclosed cells their own corners.
    plans: Vec<Vec<Point>>,
}

impl Band<'_> {
    /// Adds the prism of a part, or those of its halves when it fills its hull badly.
    fn divide(&self, cells: Vec<usize>, depth: usize, found: &mut Vec<Solid>) {
        let plan = self.plan(&cells);
        let hull = polygon::convex_hull(&plan);
        let area = polygon::area(&hull);
        let filled = cells.len() as f64 * self.grid.cell * self.grid.cell;
        let fits = filled >= self.limits.share * area || area - filled < self.limits.slack;
        if fits || depth >= 6 || cells.len() < 4 {
            self.emit(&cells, hull, found);
            return;
        }
        match self.best_cut(&cells, area) {
            Some((axis, at)) => {
                for side in [true, false] {
                    let mut mask = vec![false; self.grid.len()];
                    for &cell in &cells {
                        mask[cell] = (self.along(axis, cell) < at) == side;
                    }
                    for part in self.grid.components(&mask) {
                        self.divide(part, depth + 1, found);
                    }
                }
            }
            None => self.emit(&cells, hull, found),
        }
    }

    fn along(&self, axis: usize, cell: usize) -> usize {
        let (i, j) = self.grid.place(cell);
        [i, j][axis]
    }

    /// Corners in plan of some cells.
    fn plan(&self, cells: &[usize]) -> Vec<Point> {
        let plans = cells.iter().flat_map(|&cell| &self.plans[cell]);
        plans.copied().collect()
    }

    /// The cut with the least area of both hulls, if it saves a tenth.
    fn best_cut(&self, cells: &[usize], whole: f64) -> Option<(usize, usize)> {
        let mut best = (0.93 * whole, None);
        for axis in 0..2 {
            let places: Vec<usize> = cells.iter().map(|&cell| self.along(axis, cell)).collect();
            let first = places.iter().min().copied().unwrap_or(0);
            let last = places.iter().max().copied().unwrap_or(0);
            for at in first + 1..=last {
                let (a, b): (Vec<usize>, Vec<usize>) =
                    cells.iter().partition(|&&cell| self.along(axis, cell) < at);
                let hull = |part: &[usize]| polygon::area(&polygon::convex_hull(&self.plan(part)));
                let sum = hull(&a) + hull(&b);
                if sum < best.0 {
                    best = (sum, Some((axis, at)));
                }
            }
        }
        best.1
    }

    fn emit(&self, cells: &[usize], mut outline: Vec<Point>, found: &mut Vec<Solid>) {
        let mut low = f64::INFINITY;
        let mut high = f64::NEG_INFINITY;
        for layer in self.layers {
            for &cell in cells {
                for point in &layer.points[cell] {
                    low = low.min(point[2]);
                    high = high.max(point[2]);
                }
                if layer.filled[cell] && layer.points[cell].is_empty() {
                    low = low.min(layer.low);
                    high = high.max(layer.high);
                }
            }
        }
        if low > high {
            return;
        }
        polygon::reduce(&mut outline, MOST_CORNERS, 1.0e-4);
        let mut solid = Solid { outline, low, high };
        solid.thicken();
        found.push(solid);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners and triangles of boxes.
    fn boxes(all: &[(Point3, Point3)]) -> (Vec<Point3>, Vec<[u32; 3]>) {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for (low, high) in all {
            let first = points.len() as u32;
            for k in 0..8 {
                let pick = |axis: usize| {
                    if k >> axis & 1 == 1 {
                        high[axis]
                    } else {
                        low[axis]
                    }
                };
                points.push([pick(0), pick(1), pick(2)]);
            }
            let faces = [
                [0, 1, 3, 2],
                [4, 5, 7, 6],
                [0, 1, 5, 4],
                [2, 3, 7, 6],
                [0, 2, 6, 4],
                [1, 3, 7, 5],
            ];
            for [a, b, c, d] in faces {
                triangles.push([first + a, first + b, first + c]);
                triangles.push([first + a, first + c, first + d]);
            }
        }
        (points, triangles)
    }

    #[test]
    fn table_is_a_top_and_four_legs() {
        let mut parts = vec![([-0.4, -0.6, 0.70], [0.4, 0.6, 0.74])];
        for (x, y) in [(-0.38, -0.58), (-0.38, 0.53), (0.33, -0.58), (0.33, 0.53)] {
            parts.push(([x, y, 0.0], [x + 0.05, y + 0.05, 0.70]));
        }
        let (points, triangles) = boxes(&parts);
        let found = solids(&points, &triangles);
        assert_eq!(found.len(), 5, "{found:#?}");
        let top = found.iter().find(|s| s.high > 0.73).unwrap();
        assert_eq!(top.high, 0.74, "exactly where it is rendered");
        assert!(top.low > 0.69);
        let (_, size) = top.as_box().unwrap();
        assert!((size[0] - 0.8).abs() < 1e-9 && (size[1] - 1.2).abs() < 1e-9);
        let leg = found.iter().find(|s| s.low < 0.01).unwrap();
        let size = leg.as_box().unwrap().1;
        assert!((size[0] - 0.05).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn closed_box_is_solid_and_an_open_one_hollow() {
        let (points, triangles) = boxes(&[([0.0; 3], [0.6, 0.6, 0.9])]);
        let found = solids(&points, &triangles);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].as_box().unwrap().1, [0.6, 0.6, 0.9]);
        // Without its front, x = 0.6.
        let open: Vec<_> = triangles[..10].to_vec();
        let found = solids(&points, &open);
        let inside = found
            .iter()
            .any(|s| s.low < 0.4 && s.high > 0.5 && polygon::contains(&s.outline, [0.4, 0.3]));
        assert!(!inside, "{found:#?}");
    }

    #[test]
    fn plates_have_a_thickness() {
        let (points, triangles) = boxes(&[([0.0, 0.0, 0.0], [0.001, 0.6, 0.7])]);
        let found = solids(&points, &triangles);
        let size = found[0].as_box().unwrap().1;
        assert!(size[0] >= 0.01 && (size[1] - 0.6).abs() < 1e-9, "{size:?}");
    }

    #[test]
    fn number_of_shapes_is_bounded() {
        let many: Vec<_> = (0..15)
            .flat_map(|i| (0..15).map(move |j| (f64::from(i) * 0.1, f64::from(j) * 0.1)))
            .map(|(x, y)| ([x, y, 0.0], [x + 0.04, y + 0.04, 0.5]))
            .collect();
        let (points, triangles) = boxes(&many);
        assert!(solids(&points, &triangles).len() <= MOST_SOLIDS);
    }
}
