//! Whether a home is ready: the chair enters every room, and the arm reaches its surfaces.

use wheelarm_pack::HomeFile;
use wheelarm_planning::floor_map::DRIVE_CLEARANCE;
use wheelarm_planning::footprint_check::{Pose2, wrap};
use wheelarm_proto::exact;

use super::rejected::Rejected;
use super::shape::rounded;
use crate::home_places::PlaceRobot;
use crate::home_report::floor::{Floor, footprint};
use crate::home_report::{Home, rooms, surfaces};

/// Share of the surfaces that the arm must reach.
pub const REACHED: f64 = 0.9;
/// Headings of a start.
const HEADINGS: i32 = 12;

/// The check of a home that is ready.
#[derive(Clone, Debug, PartialEq)]
pub struct Ready {
    /// Number of rooms; all are entered.
    pub rooms: usize,
    /// Number of surfaces that the arm reaches.
    pub reached: usize,
    /// Number of surfaces.
    pub surfaces: usize,
    /// Start of the chair: x, y, metres, and heading, degrees.
    pub start: [f64; 3],
}

/// Checks a home by the report, whose start is not used: the chair starts in the largest
/// connected part of the floor.
///
/// # Errors
/// [`Rejected`] with what is not reached.
pub fn check(mut home: Home, robot: PlaceRobot<'_>) -> Result<Ready, Rejected> {
    home.start = None;
    let floor = Floor::new(&home, robot.drives);
    let found = rooms::test(&home, &floor);
    let missed: Vec<&str> = found
        .iter()
        .filter(|room| !room.entered)
        .map(|room| room.name.as_str())
        .collect();
    if !missed.is_empty() {
        return Err(Rejected::NotEntered {
            rooms: missed.join(", "),
        });
    }
    let reports = home.surfaces.iter();
    let reports = reports.map(|surface| surfaces::test(&home, &floor, robot.drives, surface));
    let missed: Vec<String> = reports
        .filter(|report| report.strip.is_none())
        .map(|report| report.piece)
        .collect();
    let surfaces = home.surfaces.len();
    let reached = surfaces - missed.len();
    if (reached as f64) < REACHED * surfaces as f64 {
        return Err(Rejected::NotReached {
            reached,
            surfaces,
            missed: missed.join(", "),
        });
    }
    let start = start(&home, &floor, robot).ok_or(Rejected::Start)?;
    Ok(Ready {
        rooms: found.len(),
        reached,
        surfaces,
        start,
    })
}

/// A pose near the middle of the largest room where the chair is free with the arm as an
/// episode starts.
fn start(home: &Home, floor: &Floor, robot: PlaceRobot<'_>) -> Option<[f64; 3]> {
    let parked = footprint(home, robot.starts);
    let largest = home
        .rooms
        .iter()
        .max_by(|a, b| a.area().total_cmp(&b.area()));
    let middle = largest.map_or([0.0; 2], |room| room.middle());
    let far = |at: [f64; 2]| exact::hypot(at[0] - middle[0], at[1] - middle[1]);
    let mut places = floor.driven.places();
    places.sort_by(|a, b| far(a.at).total_cmp(&far(b.at)));
    for place in places {
        for turn in 0..HEADINGS {
            let heading = wrap(f64::from(turn) * std::f64::consts::TAU / f64::from(HEADINGS));
            let [x, y] = place.at.map(rounded);
            let pose = Pose2 { x, y, heading };
            let is_free = parked.is_free(&pose, DRIVE_CLEARANCE) && floor.driven.contains(&pose);
            if is_free {
                return Some([x, y, rounded(heading.to_degrees())]);
            }
        }
    }
    None
}

/// Writes the start into the home.
pub fn put_start(home: &mut HomeFile, ready: &Ready) {
    let [x, y, yaw_deg] = ready.start;
    home.start = wheelarm_pack::StartEntry {
        at: [x, y],
        yaw_deg,
    };
}
