//! The map of a home for its robot: occupied floor, where the chair gets to, rooms and doors.

use std::sync::Arc;

use nalgebra::Isometry3;
use wheelarm_pack::indoors::is_passage;
use wheelarm_pack::{HomeFile, Indoors, OpeningEntry, OpeningKind, Pack, RoomEntry, contains};
use wheelarm_planning::floor_map::{DRIVE_CLEARANCE, FloorMap};
use wheelarm_planning::floor_space::Passage;
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2, Rectangle};
use wheelarm_planning::obb::Obb;
use wheelarm_planning::occupancy::Cells;

use super::floor::{among, chair_outlines, collision_boxes, on_floor};
use crate::people::Person;
use crate::robot::RobotModel;
use crate::scene::Scene;

/// Lower objects fit under the chair's plates, metres.
const UNDER: f64 = 0.03;

/// Distance from a wall at which the room of a door is looked for, metres.
const BESIDE: f64 = 0.3;

/// A map.
#[derive(Clone, Debug, PartialEq)]
pub struct HomeMap {
    /// Occupied cells, up to the height of the robot.
    pub occupied: Cells,
    /// Cells in which the chair can be, from where it is.
    pub free: Cells,
    /// Whether each cell is inside, in the order of the cells.
    pub inside: Vec<bool>,
    /// Rooms inside.
    pub rooms: Vec<Room>,
    /// Doors and passages.
    pub doors: Vec<Door>,
}

/// A room.
#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// Unique name.
    pub name: String,
    /// Kind in one word; may be empty.
    pub kind: String,
    /// Corners, metres.
    pub outline: Vec<[f64; 2]>,
}

/// A door or a passage through a wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Door {
    /// Middle, metres.
    pub centre: [f64; 2],
    /// Unit vector along the wall.
    pub along: [f64; 2],
    /// Width of the opening, metres.
    pub width: f64,
    /// Free width, metres; 0 for a closed door.
    pub clear_width: f64,
    /// Whether it has a leaf.
    pub has_leaf: bool,
    /// Rooms on its two sides; empty for outside.
    pub rooms: [String; 2],
}

/// Input of a map, to be made on another thread.
#[derive(Clone, Debug)]
pub struct MapSource {
    check: FootprintCheck,
    /// Outlines of what is on the floor.
    solids: Vec<Rectangle>,
    pack: Option<Arc<Pack>>,
    at: Pose2,
}

impl MapSource {
    /// The floor of a scene for a robot at `chair` with a person in it; with the objects at
    /// these poses on it.
    #[must_use]
    pub fn new(
        (model, person): (&RobotModel, Option<&Person>),
        scene: &Scene,
        chair: &Isometry3<f64>,
        objects: &[Isometry3<f64>],
    ) -> Self {
        let outlines = chair_outlines(model, person);
        // As in sampling: homes of packs start with closed doors and drawers.
        let ajar = scene.pack.is_none();
        let mut check = among(FootprintCheck::from_outlines(outlines), scene, ajar);
        let furniture = scene.furniture.iter().flat_map(collision_boxes);
        let furniture: Vec<Obb> = furniture.collect();
        check.put_edges(furniture.iter().map(|obb| (obb.rectangle(), obb.heights())));
        let objects = scene.objects.iter().zip(objects);
        let objects = objects.flat_map(|(body, pose)| {
            body.collision_boxes()
                .map(move |(body_from_box, half)| Obb {
                    pose: pose * body_from_box,
                    half,
                    round: false,
                })
        });
        let objects: Vec<Obb> = objects.collect();
        for obb in &objects {
            check.put(obb.rectangle(), obb.heights());
        }
        let top = check.levels.iter().map(|level| level.top);
        let top = top.fold(0.0, f64::max);
        let counts = |obb: &&Obb| {
            let [low, high] = obb.heights();
            low < top && high > UNDER
        };
        let solids = furniture.iter().chain(&objects).filter(counts);
        Self {
            solids: solids.map(Obb::rectangle).collect(),
            check,
            pack: scene.pack.clone(),
            at: on_floor(chair),
        }
    }

    /// Makes the map.
    #[must_use]
    pub fn map(&self) -> HomeMap {
        let indoors = self.home().and_then(Indoors::of);
        let mut map = FloorMap::new(&self.check, DRIVE_CLEARANCE, &[self.at]);
        if let Some(indoors) = &indoors {
            map.confine(&|at| indoors.contains(at));
        }
        let occupied = Cells::covered(map.grid(), self.solids.iter().copied());
        let [along, across] = map.grid().count();
        let [x0, y0] = map.grid().corner().map(f64::from);
        let side = map.grid().side();
        let middles = (0..across).flat_map(|y| (0..along).map(move |x| [x, y]));
        let middles =
            middles.map(|[x, y]| [x0 + (x as f64 + 0.5) * side, y0 + (y as f64 + 0.5) * side]);
        let is_inside = |at: [f64; 2]| indoors.as_ref().is_none_or(|i| i.contains(at));
        HomeMap {
            free: Cells::connected(&map, &self.at),
            inside: middles.map(is_inside).collect(),
            occupied,
            rooms: self.rooms(),
            doors: self.doors(),
        }
    }

    fn home(&self) -> Option<&HomeFile> {
        self.pack.as_ref()?.home()
    }

    fn rooms(&self) -> Vec<Room> {
        let rooms = self.home().into_iter().flat_map(|home| &home.room);
        let rooms = rooms.filter(|room| !room.is_outdoors());
        let room = |room: &RoomEntry| Room {
            name: room.name.clone(),
            kind: room.kind.clone(),
            outline: room.outline.clone(),
        };
        rooms.map(room).collect()
    }

    fn doors(&self) -> Vec<Door> {
        let Some(home) = self.home() else {
            return Vec::new();
        };
        let passages = home
            .opening
            .iter()
            .filter(|opening| is_passage([opening.sill, opening.sill + opening.height]));
        let door = |opening: &OpeningEntry| {
            let doorway = opening.doorway(home)?;
            let passage = Passage {
                centre: doorway.centre,
                along: doorway.along,
                width: doorway.width,
                half_depth: doorway.thickness / 2.0,
            };
            let beside = |side: f64| {
                let [x, y] = doorway.along;
                let off = side * (doorway.thickness / 2.0 + BESIDE);
                let at = [doorway.centre[0] - y * off, doorway.centre[1] + x * off];
                let mut rooms = home.room.iter();
                let room = rooms.find(|room| !room.is_outdoors() && contains(&room.outline, at));
                room.map_or_else(String::new, |room| room.name.clone())
            };
            Some(Door {
                rooms: [1.0, -1.0].map(beside),
                centre: doorway.centre,
                along: doorway.along,
                width: doorway.width,
                clear_width: passage.gap(&self.solids).width,
                has_leaf: opening.kind == OpeningKind::Door,
            })
        };
        passages.filter_map(door).collect()
    }
}
