//! Turns surfaces of furniture to the edge from which the robot reaches them.

use std::collections::BTreeMap;

use wheelarm_pack::{HomeFile, KindFile, Manifest, SurfaceEntry};
use wheelarm_proto::exact;

use super::spot::Spot;

/// Longest name of a kind without its number.
const LONGEST: usize = 56;

/// Gives the surfaces of `spots` their edges. A kind that other pieces share is copied.
pub(super) fn turn(
    home: &mut HomeFile,
    kinds: &mut BTreeMap<String, KindFile>,
    manifest: &mut Manifest,
    spots: &[Spot],
) {
    // Copies by kind and surfaces.
    let mut copies: BTreeMap<String, String> = BTreeMap::new();
    for index in 0..home.piece.len() {
        let (name, kind_name) = {
            let piece = &home.piece[index];
            (piece.name.clone(), piece.kind.clone())
        };
        let turned: Vec<&Spot> = spots
            .iter()
            .filter(|spot| spot.piece == name && spot.side != 0)
            .collect();
        let Some(kind) = kinds.get(&kind_name).filter(|_| !turned.is_empty()) else {
            continue;
        };
        let mut kind = kind.clone();
        for spot in turned {
            for surface in kind.surfaces.iter_mut().filter(|s| s.name == spot.surface) {
                *surface = turned_surface(surface, spot.side);
            }
        }
        let key = format!("{kind_name} {:?}", kind.surfaces);
        let copy = copies.entry(key).or_insert_with(|| {
            let copy = free_name(kinds, &kind_name);
            kinds.insert(copy.clone(), kind);
            let source = manifest.source.iter().find(|s| s.of == kind_name).cloned();
            manifest.source.extend(source.map(|mut source| {
                source.of.clone_from(&copy);
                source
            }));
            copy
        });
        home.piece[index].kind.clone_from(copy);
    }
    // Kinds of which every piece became a copy.
    let copied: Vec<String> = copies.keys().filter_map(|key| first_word(key)).collect();
    let is_used = |kind: &str| home.piece.iter().any(|piece| piece.kind == kind);
    let is_left = |kind: &str| copied.iter().any(|copied| copied == kind) && !is_used(kind);
    kinds.retain(|kind, _| !is_left(kind));
    manifest.source.retain(|source| !is_left(&source.of));
}

fn first_word(key: &str) -> Option<String> {
    key.split(' ').next().map(str::to_owned)
}

/// A name that no kind has.
fn free_name(kinds: &BTreeMap<String, KindFile>, kind: &str) -> String {
    let base: String = kind.chars().take(LONGEST).collect();
    let mut number = 2;
    loop {
        let name = format!("{base}_{number}");
        if !kinds.contains_key(&name) {
            return name;
        }
        number += 1;
    }
}

/// The surface with another of its edges as approach edge.
fn turned_surface(surface: &SurfaceEntry, quarters: usize) -> SurfaceEntry {
    let direction = |degrees: f64| {
        let (sin, cos) = exact::sin_cos(degrees.to_radians());
        [cos, sin]
    };
    let from = direction(surface.inwards_deg);
    let turned = surface.inwards_deg + 90.0 * quarters as f64;
    let inwards_deg = match turned > 180.0 {
        true => turned - 360.0,
        false => turned,
    };
    let to = direction(inwards_deg);
    let (depth, width) = match quarters % 2 {
        0 => (surface.depth, surface.width),
        _ => (surface.width, surface.depth),
    };
    let at = |i: usize| {
        let edge = surface.edge[i] + from[i] * surface.depth / 2.0 - to[i] * depth / 2.0;
        // A tenth of a millimetre, as the import rounds; negative zero becomes zero.
        (edge * 1e4).round() / 1e4 + 0.0
    };
    SurfaceEntry {
        name: surface.name.clone(),
        edge: [at(0), at(1), surface.edge[2]],
        inwards_deg,
        depth,
        width,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turned_surface_covers_the_same_rectangle() {
        let surface = SurfaceEntry {
            name: "level_1".into(),
            edge: [0.4, 0.1, 0.74],
            inwards_deg: 180.0,
            depth: 0.8,
            width: 1.2,
        };
        // The middle is at (0, 0.1).
        for (quarters, edge, inwards_deg, depth) in [
            (1, [0.0, 0.7, 0.74], -90.0, 1.2),
            (2, [-0.4, 0.1, 0.74], 0.0, 0.8),
            (3, [0.0, -0.5, 0.74], 90.0, 1.2),
        ] {
            let turned = turned_surface(&surface, quarters);
            assert_eq!((turned.edge, turned.inwards_deg), (edge, inwards_deg));
            assert_eq!((turned.depth, turned.depth + turned.width), (depth, 2.0));
        }
    }
    #[test]
    fn piece_that_shares_its_kind_gets_a_copy() {
        let pack = wheelarm_pack::Pack::open(std::path::Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../tests/data/flat"
        )))
        .unwrap();
        let mut home = pack.home().unwrap().clone();
        let mut other = home.piece[0].clone();
        other.name = "table_2".into();
        home.piece.push(other);
        let mut kinds = pack.kinds().clone();
        let mut manifest = pack.manifest().clone();
        manifest.source.push(wheelarm_pack::SourceEntry {
            of: "table".into(),
            author: "A".into(),
            license: "CC0-1.0".into(),
            origin: String::new(),
        });
        let surface = kinds["table"].surfaces[0].name.clone();
        let spot = |piece: &str| Spot {
            side: 2,
            ..Spot::test(piece, &surface)
        };
        turn(&mut home, &mut kinds, &mut manifest, &[spot("table_2")]);
        let kind_of = |home: &HomeFile, name: &str| {
            let piece = home.piece.iter().find(|piece| piece.name == name);
            piece.unwrap().kind.clone()
        };
        assert_eq!(kind_of(&home, "table_1"), "table");
        assert_eq!(kind_of(&home, "table_2"), "table_2");
        assert_eq!(kinds["table"], pack.kinds()["table"]);
        assert_ne!(kinds["table_2"].surfaces, kinds["table"].surfaces);
        let sources = manifest.source.iter().filter(|source| source.author == "A");
        assert_eq!(sources.count(), 2);
        // The other table too: no piece has the former kind.
        turn(&mut home, &mut kinds, &mut manifest, &[spot("table_1")]);
        assert!(!kinds.contains_key("table"));
        assert!(manifest.source.iter().all(|source| source.of != "table"));
    }
}
