//! Start of the chair for a task: free floor in the room, 1.5 to 3 m before the spot.

use wheelarm_planning::footprint_check::{Pose2, wrap};
use wheelarm_proto::exact;

use super::spot::{Spot, rounded};
use crate::home_report::Home;
use crate::home_report::floor::Floor;

/// Least and greatest distance of the chair from the spot, metres.
const DISTANCES: [f64; 2] = [1.5, 3.0];
/// The best distance, metres.
const BEST: f64 = 2.2;
/// Half of the ranges of a start: along x and y, metres, and of the heading, degrees.
const SPREADS: [(f64, f64); 3] = [(0.1, 15.0), (0.05, 5.0), (0.0, 0.0)];

/// Ranges of the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    /// Metres.
    pub x: [f64; 2],
    /// Metres.
    pub y: [f64; 2],
    /// Degrees.
    pub yaw_deg: [f64; 2],
}

/// The start for a spot; `own`, that of the home, where no floor in the room is free.
pub(super) fn near(home: &Home, floor: &Floor, spot: &Spot, own: Option<[f64; 3]>) -> Start {
    let [x, y, _] = spot.stop;
    let room = home.room_at([x, y]);
    let far = |at: [f64; 2]| exact::hypot(at[0] - spot.at[0], at[1] - spot.at[1]);
    let mut places = floor.driven.places();
    places.retain(|place| {
        let distance = far(place.at);
        (DISTANCES[0]..=DISTANCES[1]).contains(&distance) && home.room_at(place.at) == room
    });
    places.sort_by(|a, b| {
        let order = (!a.turns).cmp(&!b.turns);
        let off = |at| (far(at) - BEST).abs();
        order.then(off(a.at).total_cmp(&off(b.at)))
    });
    for spread in SPREADS {
        for place in &places {
            let [dx, dy] = [0, 1].map(|i| spot.at[i] - place.at[i]);
            let heading = match place.turns {
                true => exact::atan2(dy, dx),
                false => place.heading,
            };
            let start = ranges(place.at, heading, spread);
            if is_free(floor, &start) {
                return start;
            }
        }
    }
    let [x, y, heading] = own.unwrap_or(spot.stop);
    ranges([x, y], heading, (0.0, 0.0))
}

/// The start of the home, or `driven` where the chair does not get far from that.
pub(super) fn fallback(home: &Home, floor: &Floor, driven: Option<[f64; 3]>) -> Option<[f64; 3]> {
    let own = home.start.filter(|_| floor.is_start_driven);
    own.map(|start| [start.x, start.y, start.heading])
        .or(driven)
}

fn ranges(at: [f64; 2], heading: f64, (away, turned): (f64, f64)) -> Start {
    let around = |value: f64, by: f64| [rounded(value - by), rounded(value + by)];
    Start {
        x: around(at[0], away),
        y: around(at[1], away),
        yaw_deg: around(wrap(heading).to_degrees(), turned),
    }
}

/// Whether the chair is on floor that it gets to at all ends of the ranges.
fn is_free(floor: &Floor, start: &Start) -> bool {
    start.x.iter().all(|&x| {
        start.y.iter().all(|&y| {
            start.yaw_deg.iter().all(|yaw| {
                let heading = wrap(yaw.to_radians());
                let pose = Pose2 { x, y, heading };
                floor.driven.map().is_free(&pose) && floor.driven.contains(&pose)
            })
        })
    })
}
