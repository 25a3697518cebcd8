//! Start of the chair for a task: free floor in the room, 1.5 to 3 m before the spot.

use std::f64::consts::FRAC_PI_6;

use wheelarm_planning::floor_map::DRIVE_CLEARANCE;
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2, wrap};
use wheelarm_proto::exact;

use super::spot::{Spot, Start, rounded};
use crate::home_report::Home;
use crate::home_report::floor::Floor;

/// Least and greatest distance of the chair from the spot, metres.
const DISTANCES: [f64; 2] = [1.5, 3.0];
/// The best distance, metres.
const BEST: f64 = 2.2;
/// Half of the ranges of a start: along x and y, metres, and of the heading, degrees.
const SPREADS: [(f64, f64); 3] = [(0.1, 15.0), (0.05, 5.0), (0.0, 0.0)];

/// Starts whose path to a spot is searched.
const PATHS: usize = 4;

/// The start for a spot; `None` where no floor in its room is free and has a path.
pub(super) fn near(home: &Home, floors: &Floors<'_>, spot: &Spot) -> Option<Start> {
    before(home, floors, spot.at, spot.stop)
}

/// The same for a point of the floor plan, with the stop of the chair for it.
pub(super) fn before(
    home: &Home,
    floors: &Floors<'_>,
    target: [f64; 2],
    [x, y, heading]: [f64; 3],
) -> Option<Start> {
    let stop = Pose2 { x, y, heading };
    let room = home.room_at([x, y]);
    let far = |at: [f64; 2]| exact::hypot(at[0] - target[0], at[1] - target[1]);
    let mut places = floors.driven.reach.home.places();
    places.retain(|place| {
        let distance = far(place.at);
        (DISTANCES[0]..=DISTANCES[1]).contains(&distance) && home.room_at(place.at) == room
    });
    let off = |at| (far(at) - BEST).abs();
    places.sort_by(|a, b| off(a.at).total_cmp(&off(b.at)));
    let mut searched = 0;
    for spread in SPREADS {
        for turn in turns() {
            for place in &places {
                let [dx, dy] = [0, 1].map(|i| target[i] - place.at[i]);
                let heading = wrap(exact::atan2(dy, dx) + turn);
                let start = ranges(place.at, heading, spread);
                if !floors.are_free(&start, &stop) {
                    continue;
                }
                if has_path(floors.driven, &start, spot) {
                    return Some(start);
                }
                searched += 1;
                if searched == PATHS {
                    return None;
                }
            }
        }
    }
    None
}

/// The start of the home, or `driven` where the chair does not get far from that.
pub(super) fn of_home(home: &Home, floor: &Floor, driven: Option<[f64; 3]>) -> Option<Start> {
    let own = home.start.filter(|_| floor.is_start_driven);
    let own = own.map(|start| [start.x, start.y, start.heading]);
    let [x, y, heading] = own.or(driven)?;
    Some(ranges([x, y], heading, (0.0, 0.0)))
}

/// Whether the chair has a path from the middle of a start to a spot.
pub(super) fn has_path(floor: &Floor, start: &Start, spot: &Spot) -> bool {
    let middle = |[low, high]: [f64; 2]| f64::midpoint(low, high);
    let heading = wrap(middle(start.yaw_deg).to_radians());
    let pose = Pose2 {
        x: middle(start.x),
        y: middle(start.y),
        heading,
    };
    let stops = spot
        .stops
        .iter()
        .map(|&[x, y, heading]| Pose2 { x, y, heading });
    floor.has_path(&pose, &stops.collect::<Vec<_>>())
}

/// Angles from 0 to both sides, radians.
fn turns() -> impl Iterator<Item = f64> {
    (0..12).map(|i| {
        let sign = if i % 2 == 0 { -1.0 } else { 1.0 };
        sign * f64::from((i + 1) / 2) * FRAC_PI_6
    })
}

fn ranges(at: [f64; 2], heading: f64, (away, turned): (f64, f64)) -> Start {
    let around = |value: f64, by: f64| [rounded(value - by), rounded(value + by)];
    Start {
        x: around(at[0], away),
        y: around(at[1], away),
        yaw_deg: around(wrap(heading).to_degrees(), turned),
    }
}

/// The floors of the two postures of a task.
pub(super) struct Floors<'a> {
    /// With the arm as it drives.
    pub driven: &'a Floor,
    /// The chair with the arm as an episode starts.
    pub parked: &'a FootprintCheck,
}

impl Floors<'_> {
    /// Whether the chair is free at all ends of the ranges and gets from there to `stop`.
    fn are_free(&self, start: &Start, stop: &Pose2) -> bool {
        start.x.iter().all(|&x| {
            start.y.iter().all(|&y| {
                start.yaw_deg.iter().all(|yaw| {
                    let heading = wrap(yaw.to_radians());
                    let pose = Pose2 { x, y, heading };
                    self.parked.is_free(&pose, DRIVE_CLEARANCE)
                        && self.driven.reach.home.contains(&pose)
                        && self.driven.has_way(&pose, stop)
                })
            })
        })
    }
}
