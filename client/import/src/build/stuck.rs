//! Leaves that overlap other furniture where they are drawn: they stay closed. A leaf on a joint
//! inside another body would be pressed out with a force that breaks the state.

use std::collections::BTreeMap;

use wheelarm_pack::{KindFile, PieceEntry};

use crate::build::clear::Shape;
use crate::polygon::Point;
use crate::rooms::Names;

/// Depth up to which shapes may overlap, metres.
const TOUCH: f64 = 0.001;

/// Takes the joints from leaves that overlap something else than their carrier. Returns the
/// former kind of each new one, and the names of the leaves.
pub(super) fn fix_stuck_leaves(
    pieces: &mut [PieceEntry],
    kinds: &mut BTreeMap<String, KindFile>,
    triangles: &mut BTreeMap<String, usize>,
    names: &mut Names,
    shapes: &[Shape],
) -> (BTreeMap<String, String>, Vec<String>) {
    let mut former = BTreeMap::new();
    let mut variants: BTreeMap<String, String> = BTreeMap::new();
    let mut stuck = Vec::new();
    for index in 0..pieces.len() {
        let Some(on) = pieces[index].on.clone() else {
            continue;
        };
        let is_own = |shape: &&Shape| shape.piece == Some(index);
        let carrier = pieces.iter().position(|piece| piece.name == on);
        let is_free = shapes.iter().filter(is_own).all(|own| {
            shapes
                .iter()
                .filter(|other| other.piece != Some(index) && other.piece != carrier)
                .all(|other| !overlap(own, other))
        });
        let Some(kind) = kinds.get(&pieces[index].kind).filter(|_| !is_free) else {
            continue;
        };
        let variant = KindFile {
            joint: None,
            grasps: Vec::new(),
            ..kind.clone()
        };
        let old = pieces[index].kind.clone();
        let name = variants
            .entry(old.clone())
            .or_insert_with(|| names.give(&old, "kind"))
            .clone();
        let count = triangles.get(&old).copied().unwrap_or(0);
        triangles.insert(name.clone(), count);
        kinds.insert(name.clone(), variant);
        former.insert(name.clone(), old);
        pieces[index].kind = name;
        pieces[index].on = None;
        stuck.push(pieces[index].name.clone());
    }
    let is_used = |name: &String| pieces.iter().any(|piece| piece.kind == *name);
    kinds.retain(|name, _| is_used(name));
    (former, stuck)
}

/// Whether two shapes overlap by more than [`TOUCH`].
fn overlap(a: &Shape, b: &Shape) -> bool {
    let height = a.high.min(b.high) - a.low.max(b.low);
    height > TOUCH
        && separation(&a.outline, &b.outline) < -TOUCH
        && separation(&b.outline, &a.outline) < -TOUCH
}

/// Largest distance of `b` beyond a side of `a`; negative when none separates them.
fn separation(a: &[Point], b: &[Point]) -> f64 {
    let mut most = f64::NEG_INFINITY;
    for (i, p) in a.iter().enumerate() {
        let q = a[(i + 1) % a.len()];
        let side = [q[0] - p[0], q[1] - p[1]];
        let length = (side[0] * side[0] + side[1] * side[1]).sqrt();
        if length < 1.0e-9 {
            continue;
        }
        // Outwards of a counter-clockwise outline.
        let normal = [side[1] / length, -side[0] / length];
        let gap = b.iter().fold(f64::INFINITY, |least, r| {
            least.min((r[0] - p[0]) * normal[0] + (r[1] - p[1]) * normal[1])
        });
        most = most.max(gap);
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(x: f64, piece: usize) -> Shape {
        Shape {
            outline: vec![[x, 0.0], [x + 0.1, 0.0], [x + 0.1, 0.5], [x, 0.5]],
            low: 0.0,
            high: 0.8,
            piece: Some(piece),
        }
    }

    #[test]
    fn leaf_inside_other_furniture_loses_its_joint() {
        for (x, is_stuck) in [(0.05, true), (0.0995, false), (0.3, false)] {
            let piece =
                |name: &str, kind: &str| crate::build::piece_entry(name, kind, [0.0; 3], 0.0);
            let mut leaf = piece("cabinet_door", "leaf");
            leaf.on = Some("cabinet".into());
            let mut pieces = vec![piece("cabinet", "box"), leaf, piece("table", "box")];
            let kind = KindFile::default;
            let mut kinds = BTreeMap::from([("leaf".into(), kind()), ("box".into(), kind())]);
            let mut names = Names::default();
            names.give("leaf", "kind");
            // The carrier is at the place of its leaf, the table beside it.
            let shapes = [shape(0.0, 0), shape(0.0, 1), shape(x, 2)];
            let (former, stuck) = fix_stuck_leaves(
                &mut pieces,
                &mut kinds,
                &mut BTreeMap::new(),
                &mut names,
                &shapes,
            );
            assert_eq!(!stuck.is_empty(), is_stuck, "{x}");
            assert_eq!(pieces[1].on.is_none(), is_stuck);
            assert_eq!(former.contains_key("leaf_2"), is_stuck);
        }
    }
}
