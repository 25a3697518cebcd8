//! Surfaces of placed furniture: what other pieces and walls cover is cut off.

use std::collections::BTreeMap;

use wheelarm_pack::{KindFile, PieceEntry, SurfaceEntry};
use wheelarm_proto::exact;

use crate::build::kinds::surface_name;
use crate::build::{rounded, rounded3};
use crate::polygon::{self, Point};
use crate::raster::{Grid, largest_rectangle};
use crate::rooms::Names;

/// Side of a cell, metres.
const CELL: f64 = 0.02;
/// Height that must be free above a surface, metres.
const ROOM: f64 = 0.28;
/// What rises less above a surface is level with it, metres.
const FLUSH: f64 = 0.001;
/// Largest number of parts of one surface.
const MOST_PARTS: usize = 2;
/// Least side of a surface, metres.
const LEAST: f64 = 0.22;
/// What covers less of a surface is a drawing error and stays, square metres.
const LEAST_COVER: f64 = 0.0025;

/// A collision shape in the pack.
pub(super) struct Shape {
    /// Convex outline, metres.
    pub outline: Vec<Point>,
    /// Height of the underside, metres.
    pub low: f64,
    /// Height of the top, metres.
    pub high: f64,
    /// Index of its piece; `None` for a wall.
    pub piece: Option<usize>,
}

/// Replaces the kinds of pieces whose surfaces are partly covered by kinds with the free part.
/// Returns the former kind of each new one.
pub(super) fn clear_surfaces(
    pieces: &mut [PieceEntry],
    kinds: &mut BTreeMap<String, KindFile>,
    triangles: &mut BTreeMap<String, usize>,
    names: &mut Names,
    shapes: &[Shape],
) -> BTreeMap<String, String> {
    let mut former = BTreeMap::new();
    // Variants by kind and remaining surfaces.
    let mut variants: BTreeMap<String, String> = BTreeMap::new();
    for (index, piece) in pieces.iter_mut().enumerate() {
        let Some(kind) = kinds
            .get(&piece.kind)
            .filter(|kind| !kind.surfaces.is_empty())
        else {
            continue;
        };
        let mut free: Vec<SurfaceEntry> = kind
            .surfaces
            .iter()
            .flat_map(|surface| free_parts(index, piece, surface, shapes))
            .collect();
        if free == kind.surfaces {
            continue;
        }
        for (number, surface) in free.iter_mut().enumerate() {
            surface.name = surface_name(number);
        }
        let variant = KindFile {
            surfaces: free,
            ..kind.clone()
        };
        let key = format!("{} {:?}", piece.kind, variant.surfaces);
        let name = variants
            .entry(key)
            .or_insert_with(|| names.give(&piece.kind, "kind"))
            .clone();
        let count = triangles.get(&piece.kind).copied().unwrap_or(0);
        triangles.insert(name.clone(), count);
        kinds.insert(name.clone(), variant);
        former.insert(name.clone(), std::mem::replace(&mut piece.kind, name));
    }
    let is_used = |name: &String| pieces.iter().any(|piece| piece.kind == *name);
    kinds.retain(|name, _| is_used(name));
    former
}

/// The largest rectangles of a surface without anything above them.
fn free_parts(
    index: usize,
    piece: &PieceEntry,
    surface: &SurfaceEntry,
    shapes: &[Shape],
) -> Vec<SurfaceEntry> {
    // Surfaces are approached from the front: inwards is -x, the edge is along y.
    let (depth, width) = (surface.depth, surface.width);
    let low = [surface.edge[0] - depth, surface.edge[1] - 0.5 * width];
    let grid = Grid {
        low,
        cell: CELL,
        count: [cells(depth), cells(width)],
    };
    let height = piece.at[2] + surface.edge[2];
    let (sin, cos) = exact::sin_cos(piece.yaw_deg.to_radians());
    let to_pack = |p: Point| {
        [
            piece.at[0] + cos * p[0] - sin * p[1],
            piece.at[1] + sin * p[0] + cos * p[1],
        ]
    };
    let reach = depth + width;
    let middle = to_pack([low[0] + 0.5 * depth, low[1] + 0.5 * width]);
    let above: Vec<&Shape> = shapes
        .iter()
        .filter(|shape| {
            let (from, to) = polygon::bounds(&shape.outline);
            let is_near = (0..2)
                .all(|axis| from[axis] < middle[axis] + reach && to[axis] > middle[axis] - reach);
            let is_above = shape.high > height + FLUSH && shape.low < height + ROOM;
            shape.piece != Some(index) && is_above && is_near
        })
        .collect();
    let mut free: Vec<bool> = (0..grid.len())
        .map(|cell| {
            let at = to_pack(grid.middle(cell));
            !above
                .iter()
                .any(|shape| polygon::contains(&shape.outline, at))
        })
        .collect();
    let covered = free.iter().filter(|&&is_free| !is_free).count();
    if (covered as f64) * CELL * CELL < LEAST_COVER {
        return vec![surface.clone()];
    }
    let mut parts = Vec::new();
    while parts.len() < MOST_PARTS {
        let Some(rectangle) = largest_rectangle(&grid, &free) else {
            break;
        };
        let size = |axis: usize| (rectangle.high[axis] - rectangle.low[axis]) as f64 * CELL;
        let [depth, width] = [size(0), size(1)];
        if depth < LEAST || width < LEAST {
            break;
        }
        rectangle.clear(&grid, &mut free);
        let front = grid.corner(rectangle.high[0], rectangle.low[1]);
        parts.push(SurfaceEntry {
            edge: rounded3([front[0], front[1] + 0.5 * width, surface.edge[2]]),
            depth: rounded(depth),
            width: rounded(width),
            ..surface.clone()
        });
    }
    parts
}

fn cells(length: f64) -> usize {
    ((length / CELL + 1.0e-6) as usize).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> (Vec<PieceEntry>, BTreeMap<String, KindFile>) {
        let surface = SurfaceEntry {
            name: "top".into(),
            edge: [0.4, 0.0, 0.74],
            inwards_deg: 180.0,
            depth: 0.8,
            width: 1.2,
        };
        let kind = KindFile {
            surfaces: vec![surface],
            ..KindFile::default()
        };
        // Two tables; the front of the first is to the north.
        let piece = |name: &str, at: [f64; 3]| {
            let mut piece = crate::build::piece_entry(name, "table", at, 90.0);
            piece.kind = "table".into();
            piece
        };
        let pieces = vec![piece("table", [0.0; 3]), piece("table_2", [5.0, 0.0, 0.0])];
        (pieces, BTreeMap::from([("table".into(), kind)]))
    }

    fn lamp(low: f64) -> Shape {
        Shape {
            outline: vec![[-0.6, -0.4], [-0.2, -0.4], [-0.2, 0.4], [-0.6, 0.4]],
            low,
            high: low + 0.4,
            piece: Some(7),
        }
    }

    #[test]
    fn lamp_on_a_table_is_cut_off_its_surface() {
        let (mut pieces, mut kinds) = table();
        let mut names = Names::default();
        names.give("table", "kind");
        let mut triangles = BTreeMap::new();
        let former = clear_surfaces(
            &mut pieces,
            &mut kinds,
            &mut triangles,
            &mut names,
            &[lamp(0.74)],
        );
        assert_eq!(former["table_2"], "table");
        assert_eq!(
            (pieces[0].kind.as_str(), pieces[1].kind.as_str()),
            ("table_2", "table")
        );
        let surface = &kinds["table_2"].surfaces[0];
        assert!((surface.width - 0.8).abs() < 0.03 && (surface.depth - 0.8).abs() < 1e-9);
        // West in the pack is left of the front, +y of the kind.
        assert!((surface.edge[1] + 0.2).abs() < 0.02, "{surface:?}");
    }

    #[test]
    fn what_hangs_high_or_is_below_covers_nothing() {
        for low in [1.2, 0.1] {
            let (mut pieces, mut kinds) = table();
            let before = kinds.clone();
            let mut names = Names::default();
            clear_surfaces(
                &mut pieces,
                &mut kinds,
                &mut BTreeMap::new(),
                &mut names,
                &[lamp(low)],
            );
            assert_eq!(kinds, before);
        }
    }
}
