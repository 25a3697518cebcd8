//! Floors and ceilings.

use crate::polygon::{area, contains};
use crate::{FurnitureEntry, HomeFile, OpeningEntry, PartEntry, PrismEntry, RoomEntry};

/// Thickness of the floor, metres.
const FLOOR: f64 = 0.10;
/// Thickness of a ceiling, metres.
const CEILING: f64 = 0.04;
/// Distance of the floor's colliding box beyond rooms and walls, metres.
const MARGIN: f64 = 0.5;
/// Depth of door sills and of the plate below everything under the floor: no two planes
/// coincide, metres.
const SILL: f64 = 0.001;
const PLATE: f64 = 0.003;
/// Coulomb coefficient of floors.
const FRICTION: f64 = 0.8;
/// Material of ceilings.
const CEILING_MATERIAL: &str = "ceiling";

/// The floor: the outline of every room, the sills of doors, and a plate below them. It
/// collides as one box.
pub(super) fn floor(home: &HomeFile) -> FurnitureEntry {
    let corners = home.room.iter().flat_map(|room| &room.outline);
    let ends = home.wall.iter().flat_map(|wall| [&wall.from, &wall.to]);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in corners.chain(ends) {
        for i in 0..2 {
            low[i] = low[i].min(point[i]);
            high[i] = high[i].max(point[i]);
        }
    }
    let size = [high[0] - low[0], high[1] - low[1]];
    let middle = [low[0] + size[0] / 2.0, low[1] + size[1] / 2.0];
    let largest = home
        .room
        .iter()
        .max_by(|a, b| area(&a.outline).abs().total_cmp(&area(&b.outline).abs()));
    let plate = PartEntry {
        cuboid: Some([size[0], size[1], FLOOR - PLATE]),
        at: Some([middle[0], middle[1], -(FLOOR + PLATE) / 2.0]),
        material: largest.map(|room| room.floor_material.clone()),
        ..PartEntry::default()
    };
    let rooms = home.room.iter().map(|room| PartEntry {
        prism: Some(PrismEntry {
            outline: room.outline.clone(),
            height: FLOOR,
        }),
        at: Some([0.0, 0.0, -FLOOR]),
        material: Some(room.floor_material.clone()),
        ..PartEntry::default()
    });
    let sills = home
        .opening
        .iter()
        .filter_map(|opening| sill(home, opening));
    FurnitureEntry {
        name: "floor".to_owned(),
        area: "floor".to_owned(),
        friction: Some(FRICTION),
        parts: std::iter::once(plate).chain(rooms).chain(sills).collect(),
        collision: Some(vec![PartEntry {
            cuboid: Some([size[0] + 2.0 * MARGIN, size[1] + 2.0 * MARGIN, FLOOR]),
            at: Some([middle[0], middle[1], -FLOOR / 2.0]),
            ..PartEntry::default()
        }]),
        ..FurnitureEntry::default()
    }
}

/// The floor in an opening that reaches down to it, with the material of a room beside it.
fn sill(home: &HomeFile, opening: &OpeningEntry) -> Option<PartEntry> {
    let wall = home.wall.get(opening.wall)?;
    let reaches_floor = opening.sill <= 0.0 && wall.base <= 0.0;
    let [dx, dy] = [wall.to[0] - wall.from[0], wall.to[1] - wall.from[1]];
    let length = (dx * dx + dy * dy).sqrt();
    if !reaches_floor || length <= 0.0 {
        return None;
    }
    let along = [dx / length, dy / length];
    let left = [-along[1], along[0]];
    let point = |x: f64, y: f64| {
        [
            wall.from[0] + along[0] * x + left[0] * y,
            wall.from[1] + along[1] * x + left[1] * y,
        ]
    };
    let half = wall.thickness / 2.0;
    let room_at = |y: f64| -> Option<&RoomEntry> {
        let beside = point(opening.at, y);
        home.room
            .iter()
            .find(|room| contains(&room.outline, beside))
    };
    let room = room_at(half + 0.05).or_else(|| room_at(-half - 0.05))?;
    let (start, end) = (
        opening.at - opening.width / 2.0,
        opening.at + opening.width / 2.0,
    );
    Some(PartEntry {
        prism: Some(PrismEntry {
            outline: vec![
                point(start, -half),
                point(end, -half),
                point(end, half),
                point(start, half),
            ],
            height: FLOOR - SILL,
        }),
        at: Some([0.0, 0.0, -FLOOR]),
        material: Some(room.floor_material.clone()),
        ..PartEntry::default()
    })
}

/// The ceilings of all rooms that have one; rendered only.
pub(super) fn ceiling(home: &HomeFile) -> Option<FurnitureEntry> {
    let parts: Vec<PartEntry> = home
        .room
        .iter()
        .filter(|room| room.ceiling)
        .map(|room| PartEntry {
            prism: Some(PrismEntry {
                outline: room.outline.clone(),
                height: CEILING,
            }),
            at: Some([0.0, 0.0, room.height]),
            material: room.ceiling_material.clone(),
            ..PartEntry::default()
        })
        .collect();
    (!parts.is_empty()).then(|| FurnitureEntry {
        name: "ceiling".to_owned(),
        material: Some(CEILING_MATERIAL.to_owned()),
        parts,
        collision: Some(Vec::new()),
        ..FurnitureEntry::default()
    })
}
