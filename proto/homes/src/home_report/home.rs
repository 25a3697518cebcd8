//! The home that a report is about: rooms, openings, solids and surfaces in `house`, metres.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use wheelarm_pack::indoors::{self, Doorway, Indoors};
use wheelarm_planning::footprint_check::{Pose2, Rectangle};
use wheelarm_planning::obb::Obb;
use wheelarm_proto::exact;
use wheelarm_proto::furniture::JointMotion;

/// Categories of pieces that are not moved.
const FIXED: [&str; 17] = [
    "bath",
    "cabinet",
    "column",
    "cooker",
    "dishwasher",
    "door",
    "fireplace",
    "hood",
    "kitchen",
    "oven",
    "radiator",
    "shower",
    "sink",
    "stair",
    "toilet",
    "washbasin",
    "window",
];

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Home {
    /// Name.
    pub name: String,
    /// Rooms.
    pub rooms: Vec<Room>,
    /// Openings in walls.
    pub openings: Vec<Opening>,
    /// Furniture.
    pub pieces: Vec<Piece>,
    /// What a chair or an arm collides with.
    pub solids: Vec<Solid>,
    /// Surfaces that carry objects.
    pub surfaces: Vec<Surface>,
    /// Doors and drawers of furniture.
    pub leaves: Vec<Leaf>,
    /// Start of the robot.
    pub start: Option<Pose2>,
}

/// A room.
#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// Name, unique in the home.
    pub name: String,
    /// Kind, one word.
    pub kind: String,
    /// Corners.
    pub outline: Vec<[f64; 2]>,
}

/// Kind of an opening.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpeningKind {
    /// A door, also a French window.
    Door,
    /// An opening without a door.
    Frame,
    /// A window.
    Window,
}

/// An opening in a wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Opening {
    /// Kind.
    pub kind: OpeningKind,
    /// Middle on the floor plan.
    pub centre: [f64; 2],
    /// Unit vector along the wall.
    pub along: [f64; 2],
    /// Width.
    pub width: f64,
    /// Lower and upper end.
    pub heights: [f64; 2],
    /// Thickness of the wall.
    pub thickness: f64,
    /// Whether a leaf closes it: doors to the outside.
    pub closed: bool,
}

/// A piece of furniture.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Name, unique in the home.
    pub name: String,
    /// Category, one word; empty when unknown.
    pub category: String,
}

/// Owner of a solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Owner {
    /// A wall, or another part of the building.
    Building,
    /// The piece with this index.
    Piece(usize),
}

/// A box around something that collides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid {
    /// Owner.
    pub owner: Owner,
    /// Outline on the floor plan.
    pub outline: Rectangle,
    /// Lower and upper end.
    pub heights: [f64; 2],
}

/// A level rectangle that carries objects.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Index of its piece.
    pub piece: usize,
    /// Name, unique on the piece.
    pub name: String,
    /// Middle on the floor plan.
    pub centre: [f64; 2],
    /// Height.
    pub height: f64,
    /// Direction of its first side, radians.
    pub yaw: f64,
    /// Length of the first side, and of the other one.
    pub size: [f64; 2],
}

/// Furniture on a joint: a door of a cabinet, the lid of a piano, a drawer.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf {
    /// Index of its piece.
    pub piece: usize,
    /// Index of the piece on which it moves.
    pub carrier: Option<usize>,
    /// Pose in `house` when it is closed.
    pub rest: Isometry3<f64>,
    /// Whether it turns or slides.
    pub motion: JointMotion,
    /// Axis in `house`: of positive angles through the origin of `rest`, or the direction in
    /// which it slides open.
    pub axis: Unit<Vector3<f64>>,
    /// Largest angle, radians, or largest distance, metres.
    pub travel: f64,
    /// Hand at the grasps of its handle in `house` when it is closed: z approaches.
    pub grasps: Vec<Isometry3<f64>>,
    /// Boxes around it in `house` when it is closed.
    pub boxes: Vec<Obb>,
}

impl Room {
    /// Whether it is outside.
    #[must_use]
    pub fn is_outdoors(&self) -> bool {
        indoors::is_outdoors(&self.kind, &self.name)
    }

    /// Whether a point is in it.
    #[must_use]
    pub fn contains(&self, at: [f64; 2]) -> bool {
        wheelarm_pack::contains(&self.outline, at)
    }

    /// Area, m².
    #[must_use]
    pub fn area(&self) -> f64 {
        wheelarm_pack::area(&self.outline).abs()
    }

    /// Mean of its corners.
    #[must_use]
    pub fn middle(&self) -> [f64; 2] {
        let count = self.outline.len().max(1) as f64;
        [0, 1].map(|i| self.outline.iter().map(|corner| corner[i]).sum::<f64>() / count)
    }
}

impl Piece {
    /// Whether it can be moved to another place.
    #[must_use]
    pub fn is_movable(&self) -> bool {
        // A kitchen chair is a chair.
        let word = match self.category.is_empty() {
            true => self.name.to_lowercase(),
            false => self.category.to_lowercase(),
        };
        !FIXED.iter().any(|fixed| word.contains(fixed))
    }
}

impl Piece {
    /// Whether it is a door or a window, with its frame.
    #[must_use]
    pub fn is_of_opening(&self) -> bool {
        let word = self.category.to_lowercase();
        ["door", "window"].iter().any(|part| word.contains(part))
    }
}

impl Opening {
    /// Whether a chair could drive through it.
    #[must_use]
    pub fn is_passage(&self) -> bool {
        indoors::is_passage(self.heights)
    }
}

impl Opening {
    /// A point from the middle of the opening: along the wall and across it, metres.
    #[must_use]
    pub fn offset(&self, at: [f64; 2]) -> [f64; 2] {
        let [x, y] = [0, 1].map(|i| at[i] - self.centre[i]);
        let [c, s] = self.along;
        [x * c + y * s, y * c - x * s]
    }
}

impl Surface {
    /// A point from the middle along both sides, on the floor plan.
    #[must_use]
    pub fn point(&self, [first, second]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = exact::sin_cos(self.yaw);
        [
            self.centre[0] + first * cos - second * sin,
            self.centre[1] + first * sin + second * cos,
        ]
    }

    /// Its corners on the floor plan.
    #[must_use]
    pub fn corners(&self) -> [[f64; 2]; 4] {
        let [a, b] = self.size.map(|side| side / 2.0);
        [[-a, -b], [a, -b], [a, b], [-a, b]].map(|at| self.point(at))
    }
}

impl Solid {
    /// The solid of a box in `house`.
    #[must_use]
    pub fn from_box(owner: Owner, obb: &Obb) -> Self {
        Self {
            owner,
            outline: obb.rectangle(),
            heights: obb.heights(),
        }
    }
}

/// A box with its middle at `at` in a body at `pose`, turned about z by `yaw` radians.
#[must_use]
pub fn box_in(pose: &Isometry3<f64>, at: [f64; 3], yaw: f64, half: [f64; 3]) -> Obb {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    Obb {
        pose: pose * Isometry3::from_parts(Translation3::from(at), turn),
        half: half.into(),
        round: false,
    }
}

impl Home {
    /// Index of the room that contains a point.
    #[must_use]
    pub fn room_at(&self, at: [f64; 2]) -> Option<usize> {
        self.rooms.iter().position(|room| room.contains(at))
    }

    /// Its inside; `None` where no room is inside.
    #[must_use]
    pub fn indoors(&self) -> Option<Indoors> {
        let rooms = self.rooms.iter().filter(|room| !room.is_outdoors());
        let passages = self.openings.iter().filter(|opening| opening.is_passage());
        let doorway = |opening: &Opening| Doorway {
            centre: opening.centre,
            along: opening.along,
            width: opening.width,
            thickness: opening.thickness,
        };
        Indoors::new(
            rooms.map(|room| room.outline.clone()).collect(),
            passages.map(doorway).collect(),
        )
    }

    /// Name of an owner.
    #[must_use]
    pub fn owner_name(&self, owner: Owner) -> &str {
        match owner {
            Owner::Building => "wall",
            Owner::Piece(index) => self.pieces.get(index).map_or("", |piece| &piece.name),
        }
    }

    /// The home without some of its pieces. Their indices stay the same.
    #[must_use]
    pub fn without(&self, removed: &[usize]) -> Self {
        let mut home = self.clone();
        let is_removed =
            |owner: Owner| matches!(owner, Owner::Piece(index) if removed.contains(&index));
        home.solids.retain(|solid| !is_removed(solid.owner));
        home.surfaces
            .retain(|surface| !removed.contains(&surface.piece));
        home.leaves.retain(|leaf| !removed.contains(&leaf.piece));
        home
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_contains_what_its_corners_enclose() {
        let room = Room {
            name: "hall".to_owned(),
            kind: "hall".to_owned(),
            outline: vec![
                [0.0, 0.0],
                [4.0, 0.0],
                [4.0, 1.0],
                [1.0, 1.0],
                [1.0, 3.0],
                [0.0, 3.0],
            ],
        };
        assert!(room.contains([3.0, 0.5]) && room.contains([0.5, 2.5]));
        assert!(!room.contains([3.0, 2.0]) && !room.contains([-0.1, 0.5]));
        assert!((room.area() - 6.0).abs() < 1e-12);
        assert!(!room.is_outdoors());
        let terrace = Room {
            name: "Terrace_2".to_owned(),
            ..room
        };
        assert!(terrace.is_outdoors());
    }

    #[test]
    fn fixed_pieces_are_not_moved() {
        let piece = |category: &str| Piece {
            name: "piece_1".to_owned(),
            category: category.to_owned(),
        };
        assert!(piece("chair").is_movable() && piece("").is_movable());
        assert!(!piece("kitchen_cabinet").is_movable() && !piece("toilet").is_movable());
    }
}
