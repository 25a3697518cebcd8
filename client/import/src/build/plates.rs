//! Boxes below surfaces: objects rest on a box, not on a hull. On the top of a wide hull a can
//! or a bottle tips within 3 s, on a box it sleeps.

use std::collections::BTreeMap;

use wheelarm_pack::{KindFile, PartEntry, SurfaceEntry};

use crate::build::rounded3;

/// Tops within this distance of a surface carry it, metres.
const LEVEL: f64 = 0.003;
/// The top of the hull is lowered by this, metres.
const LOWERED: f64 = 0.004;
/// Greatest thickness of a box, metres. Thinner hulls stay as they are.
const THICK: f64 = 0.03;
/// Least thickness of a hull, metres.
const LEAST: f64 = 0.008;

/// Adds boxes to the kinds whose surfaces are on hulls.
pub(super) fn add_plates(kinds: &mut BTreeMap<String, KindFile>) {
    for kind in kinds.values_mut() {
        let Some(collision) = &mut kind.collision else {
            continue;
        };
        for surface in &kind.surfaces {
            let mut thinnest = f64::INFINITY;
            for hull in collision.iter_mut().filter_map(|part| part.hull.as_mut()) {
                if let Some(thickness) = lower(hull, surface) {
                    thinnest = thinnest.min(thickness);
                }
            }
            if thinnest.is_finite() {
                collision.push(plate(surface, thinnest.min(THICK)));
            }
        }
    }
}

/// Lowers the top of a hull that carries a surface; returns how thick it was.
fn lower(hull: &mut [[f64; 3]], surface: &SurfaceEntry) -> Option<f64> {
    let fold = |pick: fn(f64, f64) -> f64, axis: usize, from: f64| {
        hull.iter().map(|point| point[axis]).fold(from, pick)
    };
    let low = [0, 1, 2].map(|axis| fold(f64::min, axis, f64::INFINITY));
    let high = [0, 1, 2].map(|axis| fold(f64::max, axis, f64::NEG_INFINITY));
    let height = surface.edge[2];
    let ends = [
        [surface.edge[0] - surface.depth, surface.edge[0]],
        [
            surface.edge[1] - surface.width / 2.0,
            surface.edge[1] + surface.width / 2.0,
        ],
    ];
    let is_below = (0..2).all(|axis| low[axis] < ends[axis][1] && high[axis] > ends[axis][0]);
    let thickness = high[2] - low[2];
    if (high[2] - height).abs() > LEVEL || !is_below || thickness < LEAST {
        return None;
    }
    for point in hull.iter_mut().filter(|point| point[2] > high[2] - LEVEL) {
        *point = rounded3([point[0], point[1], height - LOWERED]);
    }
    Some(thickness)
}

/// A box with its top at the surface, which is approached from the front.
fn plate(surface: &SurfaceEntry, thickness: f64) -> PartEntry {
    let [x, y, z] = surface.edge;
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
}
