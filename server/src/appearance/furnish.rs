//! Decoration of a home from a world pack: wall images on free stretches of walls, a rug in the
//! middle of each room, and lamps below the ceilings.

use wheelarm_pack::{HomeFile, RoomEntry, WallEntry, contains};
use wheelarm_proto::exact;

use super::file::{Kind, Spot};
use super::irradiance::MOST_LAMPS;
use crate::scene::{Bounds, Scene};

/// Width and height of a lamp, metres.
const LAMP: [f64; 2] = [0.3, 0.4];
/// Largest number of wall images and of rugs of a home.
const MOST_WALL_IMAGES: usize = 16;
const MOST_RUGS: usize = 8;
/// Shortest free stretch of a wall with a wall image, and its distance from openings, metres.
const STRETCH: f64 = 0.9;
const BESIDE: f64 = 0.15;
/// Height of the middle of a wall image, its sizes and its distance from the wall, metres.
const HEIGHT: f64 = 1.55;
const WALL_IMAGES: [[f64; 2]; 3] = [[0.8, 0.6], [0.5, 0.7], [1.1, 0.8]];
const OFF: f64 = 0.012;
/// Space before a wall image that furniture leaves free, metres.
const BEFORE: f64 = 0.1;
/// Least height of a wall with a wall image, metres.
const LEAST_WALL: f64 = 2.1;
/// Sides of rugs as a share of those of the room, and their bounds, metres.
const RUG_SHARE: f64 = 0.5;
const RUG: [f64; 2] = [0.8, 2.8];

/// The places of decoration in a home; `rooms` are its rooms, the largest first.
pub(super) fn spots(home: &HomeFile, rooms: &[&RoomEntry], scene: &Scene) -> Vec<Spot> {
    let lamps = rooms.iter().filter(|room| room.ceiling);
    let lamps = lamps.filter_map(|room| lamp(room)).take(MOST_LAMPS);
    let rugs = rooms.iter().filter_map(|room| rug(room)).take(MOST_RUGS);
    let pieces: Vec<Bounds> = scene
        .furniture
        .iter()
        .filter(|body| home.piece.iter().any(|piece| piece.name == body.name))
        .filter_map(|body| body.collision_bounds(&body.pose))
        .collect();
    let wall_images = wall_images(home, rooms, &pieces);
    let wall_images = wall_images.into_iter().take(MOST_WALL_IMAGES);
    lamps.chain(rugs).chain(wall_images).collect()
}

/// Lowest and highest corner of a room on the floor plan.
pub(super) fn bounds(room: &RoomEntry) -> [[f64; 2]; 2] {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in &room.outline {
        for i in 0..2 {
            low[i] = low[i].min(point[i]);
            high[i] = high[i].max(point[i]);
        }
    }
    [low, high]
}

fn middle(room: &RoomEntry) -> Option<[f64; 2]> {
    let [low, high] = bounds(room);
    let at = [0, 1].map(|i| (low[i] + high[i]) / 2.0);
    contains(&room.outline, at).then_some(at)
}

fn lamp(room: &RoomEntry) -> Option<Spot> {
    let [x, y] = middle(room)?;
    Some(Spot {
        kind: Kind::Lamp,
        at: [x, y, room.height],
        along_deg: 0.0,
        size: LAMP,
    })
}

/// A rug whose corners are in the room.
fn rug(room: &RoomEntry) -> Option<Spot> {
    let [x, y] = middle(room)?;
    let [low, high] = bounds(room);
    let size = [0, 1].map(|i| ((high[i] - low[i]) * RUG_SHARE).min(RUG[1]));
    let corner = |sign: [f64; 2]| [x + sign[0] * size[0] / 2.0, y + sign[1] * size[1] / 2.0];
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner);
    let fits = size.iter().all(|side| *side >= RUG[0])
        && corners.iter().all(|at| contains(&room.outline, *at));
    fits.then_some(Spot {
        kind: Kind::Rug,
        at: [x, y, 0.0],
        along_deg: 0.0,
        size,
    })
}

/// At most one wall image on each side of each wall, those of large rooms first.
fn wall_images(home: &HomeFile, rooms: &[&RoomEntry], pieces: &[Bounds]) -> Vec<Spot> {
    let mut found: Vec<(usize, Spot)> = Vec::new();
    for (index, wall) in home.wall.iter().enumerate() {
        let top = wall.height.min(wall.end_height.unwrap_or(wall.height));
        if top < LEAST_WALL || wall.base > 0.5 {
            continue;
        }
        for left in [true, false] {
            let size = WALL_IMAGES[(2 * index + usize::from(left)) % WALL_IMAGES.len()];
            let spot = wall_image(home, (index, wall), left, size, rooms, pieces);
            found.extend(spot);
        }
    }
    found.sort_by_key(|(room, _)| *room);
    found.into_iter().map(|(_, spot)| spot).collect()
}

/// A wall image on one side of a wall, with the index of its room.
fn wall_image(
    home: &HomeFile,
    (index, wall): (usize, &WallEntry),
    left: bool,
    size: [f64; 2],
    rooms: &[&RoomEntry],
    pieces: &[Bounds],
) -> Option<(usize, Spot)> {
    let way = [wall.to[0] - wall.from[0], wall.to[1] - wall.from[1]];
    let length = exact::hypot(way[0], way[1]);
    if length < STRETCH {
        return None;
    }
    let along = way.map(|part| part / length);
    let sign = if left { 1.0 } else { -1.0 };
    let facing = [-along[1] * sign, along[0] * sign];
    let half = wall.thickness / 2.0;
    let at =
        |s: f64, off: f64| [0, 1].map(|i| wall.from[i] + along[i] * s + facing[i] * (half + off));
    let mut taken: Vec<[f64; 2]> = home
        .opening
        .iter()
        .filter(|opening| opening.wall == index)
        .map(|opening| {
            let half = opening.width / 2.0 + BESIDE;
            [opening.at - half, opening.at + half]
        })
        .collect();
    taken.push([length - BESIDE, f64::INFINITY]);
    taken.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut from = BESIDE;
    let mut best: Option<(f64, usize, f64)> = None;
    for [begin, end] in taken {
        let free = begin - from;
        let s = from + free / 2.0;
        let room = rooms
            .iter()
            .position(|r| contains(&r.outline, at(s, BEFORE)));
        let is_longer = best.is_none_or(|(most, ..)| free > most);
        if let Some(room) = room.filter(|_| free >= STRETCH.max(size[0] + 0.2) && is_longer)
            && !is_hidden(pieces, at(s, 0.0), along, facing, size)
        {
            best = Some((free, room, s));
        }
        from = from.max(end);
    }
    let (_, room, s) = best?;
    let [x, y] = at(s, OFF);
    let spot = Spot {
        kind: Kind::WallImage,
        at: [x, y, HEIGHT],
        along_deg: exact::atan2(facing[1], facing[0]).to_degrees(),
        size,
    };
    Some((room, spot))
}

/// Whether furniture is before a part of a wall.
fn is_hidden(
    pieces: &[Bounds],
    at: [f64; 2],
    along: [f64; 2],
    facing: [f64; 2],
    size: [f64; 2],
) -> bool {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for (aside, before) in [(-1.0, 0.0), (1.0, 0.0), (-1.0, BEFORE), (1.0, BEFORE)] {
        for i in 0..2 {
            let value = at[i] + along[i] * aside * size[0] / 2.0 + facing[i] * before;
            low[i] = low[i].min(value);
            high[i] = high[i].max(value);
        }
    }
    let heights = [HEIGHT - size[1] / 2.0, HEIGHT + size[1] / 2.0];
    pieces.iter().any(|piece| {
        (0..2).all(|i| piece.min[i] < high[i] && piece.max[i] > low[i])
            && piece.min.z < heights[1]
            && piece.max.z > heights[0]
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use wheelarm_pack::Pack;

    use super::*;

    #[test]
    fn decoration_hangs_on_free_walls_of_rooms() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let pack = Arc::new(Pack::open(&root.join("tests/data/flat")).unwrap());
        let scene = Scene::from_pack(&root.join("assets"), &pack).unwrap();
        let home = pack.home().unwrap();
        let rooms: Vec<&RoomEntry> = home.room.iter().collect();
        let spots = spots(home, &rooms, &scene);
        let of_kind = |kind: Kind| spots.iter().filter(move |spot| spot.kind == kind);
        // The hall is too narrow for a rug and has no ceiling.
        assert_eq!(of_kind(Kind::Lamp).count(), 1);
        assert!(of_kind(Kind::Rug).count() >= 1);
        assert!(of_kind(Kind::WallImage).count() >= 3);
        for spot in of_kind(Kind::WallImage) {
            let [x, y, z] = spot.at;
            assert!(z < 2.1);
            let (sin, cos) = exact::sin_cos(spot.along_deg.to_radians());
            let before = [x + 0.05 * cos, y + 0.05 * sin];
            let inside = rooms.iter().any(|room| contains(&room.outline, before));
            assert!(inside, "{spot:?} faces a room");
            // The window is in the south wall around x = 1.95, the door at y = 1.5.
            let half = spot.size[0] / 2.0;
            let on_south = y < 0.1;
            assert!(!on_south || (x - 1.95).abs() > half + 0.6, "{spot:?}");
            let on_inner = (x - 5.05).abs() < 0.1;
            assert!(!on_inner || (y - 1.5).abs() > half + 0.45, "{spot:?}");
            // The east wall ends at 1.5 m.
            assert!(x < 6.9, "{spot:?}");
        }
    }
}
