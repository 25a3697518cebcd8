//! The floor of a home for one robot: its map, and the part of it that the chair gets to.

use std::sync::Arc;

use wheelarm_planning::floor_map::{CHANGE_CLEARANCE, DRIVE_CLEARANCE, FloorMap, STOP_CLEARANCE};
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2};
use wheelarm_planning::posture_routes::PostureRoutes;
use wheelarm_planning::postures::{self, PostureFloor, PostureReach, changing};
use wheelarm_planning::reached::Reached;

use super::home::Home;
use super::robot::{Posture, RobotFacts};

/// See the module.
#[derive(Debug)]
pub struct Floor {
    /// Poses where the chair may drive.
    pub driven: Reached,
    /// The same by the posture of the arm: it works from home.
    pub reach: PostureReach,
    /// Poses where the chair may stop to use its arm.
    pub stops: FloorMap,
    /// The start of the home is in the driven part.
    pub is_start_driven: bool,
    floor: PostureFloor,
    routes: PostureRoutes,
    posture: Posture,
}

impl Floor {
    /// The floor of `home`. The chair gets to what is connected with the home's start, and
    /// without a free start to the largest connected part inside.
    #[must_use]
    pub fn new(home: &Home, robot: &RobotFacts) -> Self {
        let poses: Vec<Pose2> = home.start.into_iter().collect();
        let indoors = home.indoors();
        let map = |footprint: &FootprintCheck, clearance| {
            let mut map = FloorMap::new(footprint, clearance, &poses);
            if let Some(indoors) = &indoors {
                map.confine(&|at| indoors.contains(at));
            }
            Arc::new(map)
        };
        let [at_home, driven] = [&robot.outlines_at_home, &robot.outlines].map(|outlines| {
            among(
                home,
                FootprintCheck::from_outlines(outlines.iter().copied()),
            )
        });
        let stowed = (robot.posture == Posture::Travel).then(|| {
            let mount = robot.reach.mount().translation;
            let change = changing(&robot.outlines_at_home, &robot.outlines, [mount.x, mount.y]);
            [driven, among(home, change)]
        });
        let maps = stowed.as_ref().map(|[driven, change]| {
            [
                map(driven, robot.posture.clearance()),
                map(change, CHANGE_CLEARANCE),
            ]
        });
        let floor = PostureFloor::new(map(&at_home, DRIVE_CLEARANCE), maps);
        let reach = floor.of_home(home.start.as_ref());
        let is_start_driven = home.start.is_some_and(|start| reach.home.contains(&start));
        Self {
            driven: in_posture(&reach, robot.posture),
            reach,
            stops: FloorMap::new(&at_home, STOP_CLEARANCE, &poses),
            is_start_driven,
            floor,
            routes: PostureRoutes {
                home: at_home,
                stowed,
            },
            posture: robot.posture,
        }
    }

    /// The same floor for a chair that may start anywhere on it.
    #[must_use]
    pub fn from_anywhere(self) -> Self {
        let reach = self.floor.all();
        Self {
            driven: in_posture(&reach, self.posture),
            reach,
            ..self
        }
    }

    /// Whether a chair with its arm at home gets from `from` to a stop.
    #[must_use]
    pub fn has_way(&self, from: &Pose2, stop: &Pose2) -> bool {
        self.floor.has_way(from, stop)
    }
}

impl Floor {
    /// Whether a chair with its arm at home has a path from `from` to one of these stops, as the
    /// scripted operator searches it.
    #[must_use]
    pub fn has_path(&self, from: &Pose2, stops: &[Pose2]) -> bool {
        let from = (from, postures::Posture::Home);
        self.routes.reaches(&self.floor, from, stops)
    }
}

/// Where the chair drives in a posture.
fn in_posture(reach: &PostureReach, posture: Posture) -> Reached {
    let part = match posture {
        Posture::Home => reach.part(postures::Posture::Home),
        Posture::Travel => reach.part(postures::Posture::Travel),
    };
    part.unwrap_or(&reach.home).clone()
}

/// The chair among the solids of a home.
#[must_use]
pub fn footprint(home: &Home, robot: &RobotFacts) -> FootprintCheck {
    among(
        home,
        FootprintCheck::from_outlines(robot.outlines.iter().copied()),
    )
}

fn among(home: &Home, mut footprint: FootprintCheck) -> FootprintCheck {
    for solid in &home.solids {
        footprint.put(solid.outline, solid.heights);
    }
    footprint
}
