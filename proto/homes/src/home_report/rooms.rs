//! Rooms that the chair enters, and where it turns.

use serde::Serialize;
use wheelarm_planning::floor_space::free_squares;
use wheelarm_proto::exact;

use super::doors;
use super::floor::Floor;
use super::home::{Home, Room};

/// Side of the square in which a wheelchair turns by DIN 18040-2, metres.
pub const DIN_TURNING: f64 = 1.5;
/// A room is entered when the chair drives on this much of it, m².
const ENTERED: f64 = 0.05;

/// A room in the report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RoomReport {
    /// Name.
    pub name: String,
    /// Kind, one word.
    pub kind: String,
    /// Outside rooms are not counted.
    pub outdoors: bool,
    /// m².
    pub area: f64,
    /// Whether the chair gets into it.
    pub entered: bool,
    /// Share of its floor on which the chair's middle axle can be.
    pub driven: f64,
    /// Whether the chair turns on the spot in it.
    pub turns: bool,
    /// Middles of free squares of 1.5 m, at least half a side apart, metres.
    pub turning_squares: Vec<[f64; 2]>,
}

/// Tests every room.
#[must_use]
pub fn test(home: &Home, floor: &Floor) -> Vec<RoomReport> {
    let places = floor.driven.places();
    let cell = floor.driven.side() * floor.driven.side();
    let solids = home.solids.iter().filter(|solid| doors::counts(solid));
    let outlines: Vec<_> = solids.map(|solid| solid.outline).collect();
    let report = |room: &Room| {
        let area = room.area();
        let inside = places.iter().filter(|place| room.contains(place.at));
        let driven = inside.clone().count() as f64 * cell;
        let start = [
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ];
        let bounds = room.outline.iter().fold(start, |b, [x, y]| {
            [b[0].min(*x), b[1].max(*x), b[2].min(*y), b[3].max(*y)]
        });
        let has_bounds = bounds.iter().all(|side| side.is_finite());
        let contains = |at: [f64; 2]| room.contains(at);
        RoomReport {
            name: room.name.clone(),
            kind: room.kind.clone(),
            outdoors: room.is_outdoors(),
            area,
            entered: driven >= ENTERED && !room.is_outdoors(),
            driven: (driven / area.max(1e-9)).min(1.0),
            turns: inside.clone().any(|place| place.turns),
            turning_squares: match has_bounds {
                true => free_squares(&outlines, bounds, DIN_TURNING, &contains),
                false => Vec::new(),
            },
        }
    };
    home.rooms.iter().map(report).collect()
}

/// Middle of the free floor where the chair turns on the spot, or of any floor it gets to, with
/// the arm at home where it can: x, y, metres, and heading, radians. Nearest to the middle of
/// the largest entered room.
#[must_use]
pub fn start(home: &Home, floor: &Floor, rooms: &[RoomReport]) -> Option<[f64; 3]> {
    let mut places = floor.reach.home.places();
    if places.is_empty() {
        places = floor.driven.places();
    }
    let indoors = home.rooms.iter().zip(rooms);
    let entered = indoors.filter(|(_, report)| report.entered && !report.outdoors);
    let largest = entered.max_by(|a, b| a.0.area().total_cmp(&b.0.area()));
    let middle = largest.map_or([0.0; 2], |(room, _)| room.middle());
    let far = |at: [f64; 2]| exact::hypot(at[0] - middle[0], at[1] - middle[1]);
    let best = places.iter().min_by(|a, b| {
        let order = (!a.turns).cmp(&!b.turns);
        order.then(far(a.at).total_cmp(&far(b.at)))
    });
    best.map(|place| [place.at[0], place.at[1], place.heading])
}
