//! Leaves that are drawn into other furniture or walls: they stay closed. A joint would press
//! its leaf against what is there until the physics breaks.

use std::collections::BTreeMap;

use wheelarm_pack::{KindFile, PieceEntry};
use wheelarm_proto::exact;

use crate::build::clear::Shape;
use crate::polygon::{self, Point};
use crate::rooms::Names;

/// Shapes that overlap by less may touch, metres.
const TOUCH: f64 = 0.001;

/// Replaces the kinds of blocked leaves by kinds without a joint. Returns the former kind of
/// each new one, and the names of the carriers.
pub(super) fn fix_blocked_leaves(
    pieces: &mut [PieceEntry],
    kinds: &mut BTreeMap<String, KindFile>,
    triangles: &mut BTreeMap<String, usize>,
    names: &mut Names,
    shapes: &[Shape],
) -> (BTreeMap<String, String>, Vec<String>) {
    let boxes: Vec<Vec<Shape>> = pieces
        .iter()
        .map(|piece| {
            let kind = kinds.get(&piece.kind).filter(|kind| kind.joint.is_some());
            kind.map_or_else(Vec::new, |kind| leaf_shapes(pieces, piece, kind))
        })
        .collect();
    let is_other = |a: &Shape, b: &Shape| a.piece != b.piece && overlap(a, b);
    let is_blocked = |index: usize| {
        boxes[index].iter().any(|shape| {
            let leaves = boxes.iter().flatten();
            shapes
                .iter()
                .chain(leaves)
                .any(|other| is_other(shape, other))
        })
    };
    let blocked: Vec<usize> = (0..pieces.len()).filter(|&i| is_blocked(i)).collect();
    let mut former = BTreeMap::new();
    let mut fixed: BTreeMap<String, String> = BTreeMap::new();
    let mut carriers = Vec::new();
    for index in blocked {
        let piece = &mut pieces[index];
        carriers.extend(piece.on.take());
        let name = match fixed.get(&piece.kind) {
            Some(name) => name.clone(),
            None => {
                let name = names.give(&piece.kind, "kind");
                let mut kind = kinds.get(&piece.kind).cloned().unwrap_or_default();
                kind.joint = None;
                kind.grasps = Vec::new();
                kinds.insert(name.clone(), kind);
                let count = triangles.get(&piece.kind).copied().unwrap_or(0);
                triangles.insert(name.clone(), count);
                fixed.insert(piece.kind.clone(), name.clone());
                name
            }
        };
        former.insert(name.clone(), std::mem::replace(&mut piece.kind, name));
    }
    let is_used = |name: &String| pieces.iter().any(|piece| piece.kind == *name);
    kinds.retain(|name, _| is_used(name));
    carriers.sort();
    carriers.dedup();
    (former, carriers)
}

/// The boxes of a leaf in the pack; their piece is the carrier.
fn leaf_shapes(pieces: &[PieceEntry], piece: &PieceEntry, kind: &KindFile) -> Vec<Shape> {
    let carrier = piece.on.as_ref();
    let carrier = pieces.iter().position(|other| Some(&other.name) == carrier);
    let (sin, cos) = exact::sin_cos(piece.yaw_deg.to_radians());
    let parts = kind.collision.iter().flatten();
    let boxes = parts.filter_map(|part| Some((part.cuboid?, part.at.unwrap_or_default())));
    boxes
        .map(|(size, at)| {
            let [x, y] = [size[0] / 2.0, size[1] / 2.0];
            let corners = [[-x, -y], [x, -y], [x, y], [-x, y]];
            let to_pack = |p: Point| {
                let [x, y] = [at[0] + p[0], at[1] + p[1]];
                [
                    piece.at[0] + cos * x - sin * y,
                    piece.at[1] + sin * x + cos * y,
                ]
            };
            let middle = piece.at[2] + at[2];
            Shape {
                outline: corners.into_iter().map(to_pack).collect(),
                low: middle - size[2] / 2.0,
                high: middle + size[2] / 2.0,
                piece: carrier,
            }
        })
        .collect()
}

/// Whether two upright prisms with convex outlines overlap by more than a touch.
fn overlap(a: &Shape, b: &Shape) -> bool {
    let is_level = a.high.min(b.high) - a.low.max(b.low) > TOUCH;
    is_level && is_across(&a.outline, &b.outline) && is_across(&b.outline, &a.outline)
}

/// Whether no side of the first outline separates them.
fn is_across(outline: &[Point], other: &[Point]) -> bool {
    let turn = polygon::area(outline).signum();
    let sides = outline.iter().zip(outline.iter().cycle().skip(1));
    let mut sides = sides.filter(|(from, to)| polygon::distance(**from, **to) > 1e-6);
    sides.all(|(from, to)| {
        let length = polygon::distance(*from, *to);
        // How far the other outline is on the inner side of this side.
        let inside = other
            .iter()
            .map(|point| turn * polygon::cross(*from, *to, *point) / length);
        inside.fold(f64::NEG_INFINITY, f64::max) > TOUCH
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::piece_entry;

    fn leaf() -> KindFile {
        toml::from_str(
            "collision = [{ box = [0.03, 0.6, 0.7], at = [0.0, 0.0, 0.35] }]\n\
             joint = { turns = true, axis = [0, 0, 1], travel_deg = 90, mass = 2, \
             com = [0, 0, 0.35], inertia = [0.1, 0.1, 0.1], friction = 1, damping = 1 }",
        )
        .unwrap()
    }

    fn cabinet(x: [f64; 2], y: [f64; 2], piece: usize) -> Shape {
        Shape {
            outline: vec![[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]],
            low: 0.0,
            high: 0.85,
            piece: Some(piece),
        }
    }

    #[test]
    fn only_the_leaf_inside_other_furniture_loses_its_joint() {
        let mut pieces: Vec<PieceEntry> = Vec::new();
        for (name, at) in [("cooker", 0.0), ("oven", 3.0)] {
            pieces.push(piece_entry(name, "carcass", [0.0, at, 0.0], 0.0));
            let mut door = piece_entry(&format!("{name}_door"), "door", [0.3, at, 0.1], 0.0);
            door.on = Some(name.into());
            pieces.push(door);
        }
        let mut kinds = BTreeMap::from([
            ("carcass".to_owned(), KindFile::default()),
            ("door".to_owned(), leaf()),
        ]);
        // Their own carcasses overlap the leaves; a cabinet 5 mm into the first one too.
        let shapes = [
            cabinet([-0.3, 0.3], [-0.3, 0.3], 0),
            cabinet([-0.3, 0.3], [2.7, 3.3], 2),
            cabinet([-0.3, 0.4], [0.295, 0.9], 4),
        ];
        let mut names = Names::default();
        names.give("door", "kind");
        let (former, carriers) = fix_blocked_leaves(
            &mut pieces,
            &mut kinds,
            &mut BTreeMap::new(),
            &mut names,
            &shapes,
        );
        assert_eq!(carriers, ["cooker"]);
        assert_eq!(former["door_2"], "door");
        assert_eq!(
            (pieces[1].kind.as_str(), pieces[1].on.as_deref()),
            ("door_2", None)
        );
        assert!(kinds["door_2"].joint.is_none() && kinds["door"].joint.is_some());
        assert_eq!(pieces[3].on.as_deref(), Some("oven"));
    }
}
