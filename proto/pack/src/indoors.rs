//! The inside of a home on the floor plan: its rooms without terraces and the like, and the
//! passages through walls. A chair that starts inside does not drive outside.

use wheelarm_proto::exact;

use crate::polygon::contains;
use crate::tables::home::{HomeFile, OpeningEntry, RoomEntry};

/// Words of rooms that are outside.
const OUTDOORS: [&str; 8] = [
    "terrace", "balcony", "garage", "garden", "roof", "attic", "patio", "outside",
];
/// Outlines of rooms may leave gaps of this width between them, metres.
const NEAR: f64 = 0.1;
/// A chair drives over a lower sill, metres.
const STEP: f64 = 0.2;
/// Least height of a passage, metres.
const HEAD: f64 = 1.6;

/// Whether a room with this kind and name is outside.
#[must_use]
pub fn is_outdoors(kind: &str, name: &str) -> bool {
    let words = [kind.to_lowercase(), name.to_lowercase()];
    let is_one = |word: &&str| words.iter().any(|text| text.contains(*word));
    OUTDOORS.iter().any(is_one)
}

/// Whether a chair could drive through an opening between two heights, metres.
#[must_use]
pub fn is_passage([low, high]: [f64; 2]) -> bool {
    low < STEP && high - low > HEAD
}

/// A passage through a wall, on the floor plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doorway {
    /// Middle, metres.
    pub centre: [f64; 2],
    /// Unit vector along the wall.
    pub along: [f64; 2],
    /// Metres.
    pub width: f64,
    /// Thickness of the wall, metres.
    pub thickness: f64,
}

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Indoors {
    rooms: Vec<Vec<[f64; 2]>>,
    doorways: Vec<Doorway>,
}

impl RoomEntry {
    /// Whether it is outside.
    #[must_use]
    pub fn is_outdoors(&self) -> bool {
        is_outdoors(&self.kind, &self.name)
    }
}

impl OpeningEntry {
    /// Its place in a home; `None` without its wall.
    #[must_use]
    pub fn doorway(&self, home: &HomeFile) -> Option<Doorway> {
        let wall = home.wall.get(self.wall)?;
        let way = [wall.to[0] - wall.from[0], wall.to[1] - wall.from[1]];
        let length = exact::hypot(way[0], way[1]).max(1e-9);
        let along = way.map(|part| part / length);
        Some(Doorway {
            centre: [0, 1].map(|i| wall.from[i] + along[i] * self.at),
            along,
            width: self.width,
            thickness: wall.thickness,
        })
    }
}

impl Indoors {
    /// The inside of rooms with these outlines, and passages; `None` without rooms.
    #[must_use]
    pub fn new(rooms: Vec<Vec<[f64; 2]>>, doorways: Vec<Doorway>) -> Option<Self> {
        (!rooms.is_empty()).then_some(Self { rooms, doorways })
    }

    /// The inside of a home; `None` where no room is inside.
    #[must_use]
    pub fn of(home: &HomeFile) -> Option<Self> {
        let rooms = home.room.iter().filter(|room| !room.is_outdoors());
        let passages = home.opening.iter();
        let passages = passages.filter(|o| is_passage([o.sill, o.sill + o.height]));
        Self::new(
            rooms.map(|room| room.outline.clone()).collect(),
            passages.filter_map(|entry| entry.doorway(home)).collect(),
        )
    }

    /// Whether a point is in one of the rooms, beside one, or in a passage.
    #[must_use]
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        const SIDES: [[f64; 2]; 5] = [
            [0.0, 0.0],
            [NEAR, 0.0],
            [-NEAR, 0.0],
            [0.0, NEAR],
            [0.0, -NEAR],
        ];
        let is_in =
            |room: &Vec<[f64; 2]>| SIDES.iter().any(|s| contains(room, [x + s[0], y + s[1]]));
        let is_passed = |doorway: &Doorway| {
            let [dx, dy] = [x - doorway.centre[0], y - doorway.centre[1]];
            let [c, s] = doorway.along;
            let (along, across) = ((dx * c + dy * s).abs(), (dy * c - dx * s).abs());
            along <= doorway.width / 2.0 && across <= doorway.thickness / 2.0 + NEAR
        };
        self.rooms.iter().any(is_in) || self.doorways.iter().any(is_passed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passages_and_gaps_between_rooms_are_inside() {
        let room = |x: f64| vec![[x, 0.0], [x + 3.0, 0.0], [x + 3.0, 3.0], [x, 3.0]];
        let doorway = Doorway {
            centre: [3.2, 1.0],
            along: [0.0, 1.0],
            width: 0.9,
            thickness: 0.4,
        };
        let inside = Indoors::new(vec![room(0.0), room(3.4)], vec![doorway]).unwrap();
        assert!(inside.contains([1.0, 1.0]) && inside.contains([3.05, 2.0]));
        assert!(inside.contains([3.2, 1.4]) && !inside.contains([3.2, 1.6]));
        assert!(!inside.contains([-0.2, 1.0]));
        assert_eq!(Indoors::new(Vec::new(), vec![doorway]), None);
        assert!(is_outdoors("terrace", "room_3") && is_outdoors("", "Balcony_2"));
        assert!(!is_outdoors("kitchen", "room_1"));
        assert!(is_passage([0.0, 2.1]) && !is_passage([0.9, 2.1]) && !is_passage([0.0, 1.2]));
    }
}
