//! The report on a home: what one robot reaches in it, why not the rest, and what to move.
//!
//! [`Finding::new`] computes it; the report is printed as text and JSON. It uses
//! the floor map, the clearances and the posture with which the scripted operator drives. A
//! home that the chair cannot enter has a report too.

pub mod doors;
pub mod floor;
mod from_pack;
pub mod home;
pub mod leaves;
pub mod moving;
pub mod robot;
pub mod rooms;
pub mod surfaces;
pub mod text;

#[cfg(test)]
mod tests;

use serde::Serialize;
use wheelarm_planning::floor_map::STOP_CLEARANCE;

pub use doors::DoorReport;
pub use from_pack::NoHome;
pub use home::Home;
pub use leaves::LeafReport;
pub use moving::MoveReport;
pub use robot::{Posture, RobotFacts, RobotFactsError};
pub use rooms::RoomReport;
pub use surfaces::{Reason, Strip, SurfaceReport};
pub use text::text;

use floor::Floor;

/// The robot of a report, and its needs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobotReport {
    /// Name.
    pub name: String,
    /// Posture of the arm while the chair drives.
    pub posture: &'static str,
    /// Width and length, metres.
    pub size: [f64; 2],
    /// Diameter of the circle of a turn on the spot, metres.
    pub turning_circle: f64,
    /// Least clearance while it drives, and clearance where it stops, metres.
    pub clearance: [f64; 2],
    /// Clear width of a door that it certainly passes straight, metres.
    pub door: f64,
}

/// Numbers of a report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Rooms inside.
    pub rooms: usize,
    /// Rooms inside that the chair enters.
    pub rooms_entered: usize,
    /// Doors, French windows and other passages.
    pub doors: usize,
    /// Of them, passed.
    pub doors_passed: usize,
    /// Further doors, which are closed: they lead outside.
    pub doors_closed: usize,
    /// Surfaces.
    pub surfaces: usize,
    /// Of them, reached.
    pub surfaces_reached: usize,
    /// Doors of furniture, and other furniture on hinges.
    pub leaves: usize,
    /// Of them, opened.
    pub leaves_opened: usize,
    /// Drawers.
    pub drawers: usize,
    /// Of them, opened.
    pub drawers_opened: usize,
    /// Further ones, with free floor before them to which the chair does not get: reached from
    /// a start in their room.
    pub surfaces_within: usize,
    /// Squares of 1.5 m in which a wheelchair turns.
    pub turning_squares: usize,
}

/// See the module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HomeReport {
    /// Name of the home.
    pub home: String,
    /// The robot.
    pub robot: RobotReport,
    /// Numbers.
    pub summary: Summary,
    /// A start of the chair on the floor that it gets to: x, y, metres, and heading,
    /// radians; `None` where it fits nowhere.
    pub start: Option<[f64; 3]>,
    /// The start of the home is on that floor.
    pub home_start_driven: bool,
    /// Rooms.
    pub rooms: Vec<RoomReport>,
    /// Doors, French windows and other passages.
    pub doors: Vec<DoorReport>,
    /// Surfaces.
    pub surfaces: Vec<SurfaceReport>,
    /// Doors and drawers of furniture.
    pub leaves: Vec<LeafReport>,
    /// Pieces whose removal gains most.
    pub to_move: Vec<MoveReport>,
}

/// A report with the floor that it was computed from, for the plan.
#[derive(Debug)]
pub struct Finding {
    /// The report.
    pub report: HomeReport,
    /// The floor.
    pub floor: Floor,
}

impl Finding {
    /// Computes the report on a home.
    #[must_use]
    pub fn new(home: &Home, robot: &RobotFacts) -> Self {
        let floor = Floor::new(home, robot);
        let rooms = rooms::test(home, &floor);
        let doors = doors::test(home, &floor);
        let surfaces: Vec<SurfaceReport> = home
            .surfaces
            .iter()
            .map(|surface| surfaces::test(home, &floor, robot, surface))
            .collect();
        let leaves: Vec<LeafReport> = home
            .leaves
            .iter()
            .map(|leaf| leaves::test(home, &floor, robot, leaf))
            .collect();
        let indoors = rooms.iter().filter(|room| !room.outdoors);
        let summary = Summary {
            rooms: indoors.clone().count(),
            rooms_entered: indoors.filter(|room| room.entered).count(),
            doors: doors.iter().filter(|door| !door.closed).count(),
            doors_passed: doors.iter().filter(|door| door.passed).count(),
            doors_closed: doors.iter().filter(|door| door.closed).count(),
            surfaces: surfaces.len(),
            surfaces_reached: surfaces.iter().filter(|s| s.strip.is_some()).count(),
            leaves: count(&leaves, |leaf| !leaf.slides),
            leaves_opened: count(&leaves, |leaf| !leaf.slides && leaf.stop.is_some()),
            drawers: count(&leaves, |leaf| leaf.slides),
            drawers_opened: count(&leaves, |leaf| leaf.slides && leaf.stop.is_some()),
            surfaces_within: surfaces
                .iter()
                .filter(|s| s.reason == Some(Reason::NotConnected))
                .count(),
            turning_squares: rooms.iter().map(|room| room.turning_squares.len()).sum(),
        };
        let mut report = HomeReport {
            home: home.name.clone(),
            robot: RobotReport {
                name: robot.name.clone(),
                posture: robot.posture.name(),
                size: [robot.width(), robot.length()],
                turning_circle: robot.turning_circle(),
                clearance: [robot.posture.clearance(), STOP_CLEARANCE],
                door: robot.width() + 2.0 * robot.posture.clearance(),
            },
            summary,
            start: rooms::start(home, &floor, &rooms),
            home_start_driven: floor.is_start_driven,
            rooms,
            doors,
            surfaces,
            leaves,
            to_move: Vec::new(),
        };
        report.to_move = moving::test(home, robot, &report);
        Self { report, floor }
    }
}

fn count(leaves: &[LeafReport], is_counted: impl Fn(&LeafReport) -> bool) -> usize {
    leaves.iter().filter(|leaf| is_counted(leaf)).count()
}
