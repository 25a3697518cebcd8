//! Boxes below surfaces: objects rest on one box whose top is exactly the drawn plane.
//!
//! On the top of a wide hull a can or a bottle tips within 3 s; on a box it sleeps. A top a
//! millimetre below the drawn plane lets the object fall, one above it presses the object up,
//! and both tip it. Tops of neighboring shapes differ by such amounts.

use std::collections::BTreeMap;

use wheelarm_pack::{KindFile, PartEntry, SurfaceEntry};

use crate::build::rounded3;

/// Tops within this distance of a surface carry it, metres.
const LEVEL: f64 = 0.0035;
/// The tops of shapes that carry a surface are lowered to this below it, metres.
const LOWERED: f64 = 0.004;
/// Greatest thickness of a box, metres.
const THICK: f64 = 0.03;
/// Least thickness of a shape, metres: thinner ones are not lowered.
const LEAST: f64 = 0.008;
/// A top this close to a surface is in its plane, metres.
const EXACT: f64 = 1.0e-5;
/// Half a box has whole tenths of a millimetre: its thickness is a multiple of this, metres.
const STEP: f64 = 2.0e-4;

/// Adds boxes to the kinds whose surfaces are not on one box.
pub(super) fn add_plates(kinds: &mut BTreeMap<String, KindFile>) {
    for kind in kinds.values_mut() {
        let Some(collision) = &mut kind.collision else {
            continue;
        };
        // Two surfaces may be on one shape: all are looked up before the first is lowered.
        let carriers: Vec<Vec<usize>> = kind
            .surfaces
            .iter()
            .map(|surface| {
                let carries = |part: &PartEntry| carries(part, surface);
                let all = collision.iter().enumerate();
                all.filter(|(_, part)| carries(part))
                    .map(|(index, _)| index)
                    .collect()
            })
            .collect();
        let mut plates = Vec::new();
        for (surface, carriers) in kind.surfaces.iter().zip(carriers) {
            if let [only] = carriers[..]
                && is_exact(&collision[only], surface)
            {
                continue;
            }
            let mut thinnest = f64::INFINITY;
            for index in carriers {
                if let Some(thickness) = lower(&mut collision[index], surface.edge[2]) {
                    thinnest = thinnest.min(thickness);
                }
            }
            if thinnest.is_finite() {
                plates.push(plate(surface, thinnest.min(THICK)));
            }
        }
        collision.extend(plates);
    }
}

/// The extents of a box or a hull in the frame of its kind; `None` for other shapes.
fn extents(part: &PartEntry) -> Option<[[f64; 3]; 2]> {
    if let Some(size) = part.cuboid {
        let at = part.at.unwrap_or_default();
        return Some([-0.5, 0.5].map(|half| [0, 1, 2].map(|axis| at[axis] + half * size[axis])));
    }
    let hull = part.hull.as_ref()?;
    let fold = |pick: fn(f64, f64) -> f64, from: f64| {
        [0, 1, 2].map(|axis| hull.iter().map(|point| point[axis]).fold(from, pick))
    };
    Some([
        fold(f64::min, f64::INFINITY),
        fold(f64::max, f64::NEG_INFINITY),
    ])
}

/// The ranges of a surface in plan, which is approached from the front.
fn ranges(surface: &SurfaceEntry) -> [[f64; 2]; 2] {
    let [x, y, _] = surface.edge;
    let half = surface.width / 2.0;
    [[x - surface.depth, x], [y - half, y + half]]
}

/// Whether the top of a shape is at a surface and below some of it.
fn carries(part: &PartEntry, surface: &SurfaceEntry) -> bool {
    let Some([low, high]) = extents(part) else {
        return false;
    };
    let ends = ranges(surface);
    let is_below = (0..2).all(|axis| low[axis] < ends[axis][1] && high[axis] > ends[axis][0]);
    is_below && (high[2] - surface.edge[2]).abs() <= LEVEL
}

/// Whether a shape is a box below all of a surface, with its top in the plane.
fn is_exact(part: &PartEntry, surface: &SurfaceEntry) -> bool {
    let Some([low, high]) = extents(part).filter(|_| part.cuboid.is_some()) else {
        return false;
    };
    // Surfaces are measured in cells of 2 cm.
    const CELL: f64 = 0.02;
    let ends = ranges(surface);
    let covers =
        |axis: usize| low[axis] < ends[axis][0] + CELL && high[axis] > ends[axis][1] - CELL;
    (high[2] - surface.edge[2]).abs() <= EXACT && (0..2).all(covers)
}

/// Lowers the top of a shape that carries a surface at a height; returns how thick it was.
fn lower(part: &mut PartEntry, height: f64) -> Option<f64> {
    let [low, high] = extents(part)?;
    let thickness = high[2] - low[2];
    if thickness < LEAST {
        return None;
    }
    let top = height - LOWERED;
    if let Some(size) = part.cuboid {
        let at = part.at.unwrap_or_default();
        part.cuboid = Some(rounded3([size[0], size[1], top - low[2]]));
        part.at = Some(rounded3([at[0], at[1], f64::midpoint(top, low[2])]));
    } else {
        let hull = part.hull.iter_mut().flatten();
        for point in hull.filter(|point| point[2] > high[2] - LEVEL) {
            *point = rounded3([point[0], point[1], top]);
        }
    }
    Some(thickness)
}

/// A box with its top at the surface.
fn plate(surface: &SurfaceEntry, thickness: f64) -> PartEntry {
    let [x, y, z] = surface.edge;
    let thickness = (thickness / STEP).round().max(1.0) * STEP;
    PartEntry {
        cuboid: Some(rounded3([surface.depth, surface.width, thickness])),
        at: Some(rounded3([x - surface.depth / 2.0, y, z - thickness / 2.0])),
        ..PartEntry::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surface_on_a_hull_gets_a_box() {
        let surface = SurfaceEntry {
            name: "top".into(),
            edge: [0.2, 0.0, 0.74],
            inwards_deg: 180.0,
            depth: 0.4,
            width: 0.5,
        };
        let ring = [[0.4, 0.0], [0.0, 0.4], [-0.4, 0.0], [0.0, -0.4]];
        let hull = |low: f64, high: f64| PartEntry {
            hull: Some(
                [low, high]
                    .iter()
                    .flat_map(|&z| ring.map(|[x, y]| [x, y, z]))
                    .collect(),
            ),
            ..PartEntry::default()
        };
        let foot = hull(0.0, 0.05);
        let mut kinds = BTreeMap::from([(
            "round_table".to_owned(),
            KindFile {
                collision: Some(vec![foot.clone(), hull(0.7, 0.74)]),
                surfaces: vec![surface.clone()],
                ..KindFile::default()
            },
        )]);
        add_plates(&mut kinds);
        let parts = kinds["round_table"].collision.as_ref().unwrap();
        assert_eq!((parts.len(), &parts[0]), (3, &foot));
        let top = parts[1].hull.as_ref().unwrap();
        assert!(top.iter().all(|point| point[2] <= 0.736 + 1e-9));
        assert_eq!(parts[2].cuboid, Some([0.4, 0.5, 0.03]));
        assert_eq!(parts[2].at, Some([0.0, 0.0, 0.725]));
        // A second pass finds no hull at the surface.
        let before = kinds.clone();
        add_plates(&mut kinds);
        assert_eq!(kinds, before);
    }

    fn board(high: f64, x: [f64; 2]) -> PartEntry {
        PartEntry {
            cuboid: Some([x[1] - x[0], 0.6, 0.04]),
            at: Some([f64::midpoint(x[0], x[1]), 0.0, high - 0.02]),
            ..PartEntry::default()
        }
    }

    fn surface(y: f64, width: f64) -> SurfaceEntry {
        SurfaceEntry {
            name: "top".into(),
            edge: [0.3, y, 0.74],
            inwards_deg: 180.0,
            depth: 0.6,
            width,
        }
    }

    /// The shapes of a kind with these shapes and surfaces.
    fn plated(collision: Vec<PartEntry>, surfaces: Vec<SurfaceEntry>) -> Vec<PartEntry> {
        let kind = KindFile {
            collision: Some(collision),
            surfaces,
            ..KindFile::default()
        };
        let mut kinds = BTreeMap::from([("table".to_owned(), kind)]);
        add_plates(&mut kinds);
        kinds["table"].collision.clone().unwrap()
    }

    fn top(part: &PartEntry) -> f64 {
        extents(part).unwrap()[1][2]
    }

    #[test]
    fn box_in_the_plane_stays_and_others_end_below_a_box_in_the_plane() {
        let exact = vec![board(0.74, [-0.3, 0.3])];
        assert_eq!(plated(exact.clone(), vec![surface(0.0, 0.6)]), exact);
        // Below the drawn plane, above it, and two boxes with a step between them.
        for boards in [
            vec![board(0.738, [-0.3, 0.3])],
            vec![board(0.742, [-0.3, 0.3])],
            vec![board(0.74, [-0.3, 0.0]), board(0.7385, [0.0, 0.3])],
        ] {
            let parts = plated(boards.clone(), vec![surface(0.0, 0.6)]);
            let (plate, others) = parts.split_last().unwrap();
            assert_eq!(others.len(), boards.len());
            assert!((top(plate) - 0.74).abs() < 1e-9, "{plate:?}");
            assert!(others.iter().all(|part| top(part) < 0.7365), "{others:?}");
        }
    }

    #[test]
    fn both_surfaces_of_one_hull_get_a_box() {
        let ring = [[0.3, -1.0], [0.3, 1.0], [-0.3, 0.9], [-0.3, -1.0]];
        let hull = [0.70, 0.74].map(|z| ring.map(|[x, y]| [x, y, z]));
        let hull = PartEntry {
            hull: Some(hull.concat()),
            ..PartEntry::default()
        };
        let parts = plated(vec![hull], vec![surface(-0.6, 0.6), surface(0.6, 0.6)]);
        assert_eq!(parts.len(), 3);
        assert!(top(&parts[0]) < 0.7365);
        assert!(
            parts[1..]
                .iter()
                .all(|plate| (top(plate) - 0.74).abs() < 1e-9)
        );
    }
}
