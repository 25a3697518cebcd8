//! The floor of a home for one robot: its map, and the part of it that the chair gets to.

use std::sync::Arc;

use wheelarm_planning::floor_map::{FloorMap, STOP_CLEARANCE};
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2};
use wheelarm_planning::reached::Reached;

use super::home::{Home, Opening, Room};
use super::robot::RobotFacts;

/// Outlines of rooms may leave gaps of this width between them, metres.
const NEAR: f64 = 0.1;

/// See the module.
#[derive(Debug)]
pub struct Floor {
    /// Poses where the chair may drive.
    pub driven: Reached,
    /// Poses where it may stop to use its arm.
    pub stops: FloorMap,
    /// The start of the home is in the driven part.
    pub is_start_driven: bool,
}

impl Floor {
    /// The floor of `home`. The chair gets to what is connected with the home's start, and
    /// without a free start to the largest connected part inside.
    #[must_use]
    pub fn new(home: &Home, robot: &RobotFacts) -> Self {
        let footprint = footprint(home, robot);
        let poses: Vec<Pose2> = home.start.into_iter().collect();
        let mut map = FloorMap::new(&footprint, robot.posture.clearance(), &poses);
        let rooms: Vec<&Room> = home.rooms.iter().filter(|r| !r.is_outdoors()).collect();
        if !rooms.is_empty() {
            let passages: Vec<&Opening> = home.openings.iter().filter(|o| o.is_passage()).collect();
            let is_in_passage = |at| passages.iter().any(|passage| is_in(passage, at));
            map.confine(&|at| is_inside(&rooms, at) || is_in_passage(at));
        }
        let map = Arc::new(map);
        let largest = Reached::largest(map.clone());
        let from_start = home.start.map(|start| Reached::from_start(map, &start));
        let is_start_driven = from_start.as_ref().is_some_and(|reached| {
            // A start in a niche says little of the home.
            2 * reached.len() >= largest.len() && !reached.is_empty()
        });
        let driven = from_start.filter(|_| is_start_driven).unwrap_or(largest);
        Self {
            driven,
            stops: FloorMap::new(&footprint, STOP_CLEARANCE, &poses),
            is_start_driven,
        }
    }
}

/// The chair among the solids of a home.
#[must_use]
pub fn footprint(home: &Home, robot: &RobotFacts) -> FootprintCheck {
    let mut footprint = FootprintCheck::from_outlines(robot.outlines.iter().copied());
    for solid in &home.solids {
        footprint.put(solid.outline, solid.heights);
    }
    footprint
}

/// Whether a point is in the passage through a wall.
fn is_in(passage: &Opening, at: [f64; 2]) -> bool {
    let [along, across] = passage.offset(at).map(f64::abs);
    along <= passage.width / 2.0 && across <= passage.thickness / 2.0 + NEAR
}

/// Whether a point is in one of the rooms, or beside one.
fn is_inside(rooms: &[&Room], [x, y]: [f64; 2]) -> bool {
    const SIDES: [[f64; 2]; 5] = [
        [0.0, 0.0],
        [NEAR, 0.0],
        [-NEAR, 0.0],
        [0.0, NEAR],
        [0.0, -NEAR],
    ];
    let any = |room: &&Room| SIDES.iter().any(|s| room.contains([x + s[0], y + s[1]]));
    rooms.iter().any(any)
}
