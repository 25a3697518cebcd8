//! The floor of a home for one robot: its map, and the part of it that the chair gets to.

use std::sync::Arc;

use wheelarm_planning::floor_map::{FloorMap, STOP_CLEARANCE};
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2};
use wheelarm_planning::reached::Reached;

use super::home::Home;
use super::robot::RobotFacts;

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
        if let Some(indoors) = home.indoors() {
            map.confine(&|at| indoors.contains(at));
        }
        let map = Arc::new(map);
        let driven = Reached::of_home(&map, home.start.as_ref());
        let is_start_driven = home.start.is_some_and(|start| driven.contains(&start));
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
