//! Access of the arm to objects on surfaces from a parked chair: distances and angles that
//! count, the hand's lean, and the straight way from the arm's base. The report on a home,
//! the sampling of objects and the scripted operator use the same.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Vector3};
use wheelarm_proto::exact;

use super::footprint_check::{Rectangle, wrap};
use super::reach_map::{HandPlace, ReachMap};

/// Furthest distance from the arm's base to a point that counts, metres. Lifts from further
/// away fail more often.
pub const FURTHEST: f64 = 0.80;
/// Greatest angle between the heading of the chair and the direction to a point, and between
/// the heading and a level hand, radians.
pub const ASIDE: f64 = 0.61;
/// Steps of these angles to either side.
const TURNS: i32 = 3;
/// The hand starts from, and lifts to, this height above the grasp, metres.
pub const LIFT: f64 = 0.15;
/// Before a grasp, the hand is this far back, metres.
pub const STANDOFF: f64 = 0.12;
/// Solids count as in the way between these heights above the surface, metres. Without this
/// test shelves are reached through walls.
const WAY: [f64; 2] = [0.12, 0.4];
/// Length of the straight segment on which the chair arrives at a stop, metres.
pub const ARRIVAL: f64 = 0.08;

/// Pitches of a hand at a point of a surface, radians.
pub const PITCHES: [f64; 4] = [0.0, PI / 12.0, PI / 4.0, PI / 2.0];

/// An object lower than this is taken near by and with a steep hand: the arm reaches down to it
/// from its shoulder, metres over the floor.
pub const LOW: f64 = 0.35;
/// Furthest distance from the arm's base to such an object, metres.
const LOW_FURTHEST: f64 = 0.66;

/// Forward leans of a level hand, radians.
pub const LEVEL_LEANS: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// Leans of a hand from above, radians: the camera stays above.
const TOP_LEANS: [f64; 5] = [0.0, -0.25, -0.5, -0.7, -0.9];
/// Turns about the bar of a hand that closes upright, radians.
const UPRIGHT_LEANS: [f64; 3] = [0.0, 0.25, -0.25];

/// Angles by which a hand may lean about its closing axis at a grasp, one that is
/// only `from_above` or any.
#[must_use]
pub fn leans(house_from_grasp: &Isometry3<f64>, from_above: bool) -> &'static [f64] {
    let axis = |v: Vector3<f64>| (house_from_grasp.rotation * v).z;
    let (closing, up, forward) = (axis(Vector3::x()), axis(Vector3::y()), axis(Vector3::z()));
    if forward < -0.8 {
        &TOP_LEANS
    } else if from_above || forward > 0.3 {
        // Not from below.
        &[]
    } else if closing.abs() > 0.8 {
        &UPRIGHT_LEANS
    } else if up > 0.3 {
        &LEVEL_LEANS
    } else {
        // Not with the camera below the hand.
        &[]
    }
}

/// Angles from 0 to [`ASIDE`] on either side, radians, the smallest first.
pub fn aside() -> impl Iterator<Item = f64> {
    let step = ASIDE / f64::from(TURNS);
    (0..=2 * TURNS).map(move |i| {
        let sign = if i % 2 == 0 { -1.0 } else { 1.0 };
        sign * f64::from((i + 1) / 2) * step
    })
}

/// Furthest distance from the arm's base to a grasp point at this height above the floor,
/// where the arm reaches `furthest` elsewhere, metres.
#[must_use]
pub fn furthest_at(height: f64, furthest: f64) -> f64 {
    match height < LOW {
        true => furthest.min(LOW_FURTHEST),
        false => furthest,
    }
}

/// Whether the hand gets to a place, to the place before it, and straight up with an object.
#[must_use]
pub fn lifts(reach: &ReachMap, place: &HandPlace) -> bool {
    let above = HandPlace {
        height: place.height + LIFT,
        ..*place
    };
    reach.reaches(place) && reach.reaches(&above) && reach.reaches(&before(place))
}

/// The place of a hand [`STANDOFF`] behind another one.
fn before(place: &HandPlace) -> HandPlace {
    let (down, level) = exact::sin_cos(place.pitch);
    let (aside, ahead) = exact::sin_cos(place.direction);
    let x = place.distance - STANDOFF * level * ahead;
    let y = -STANDOFF * level * aside;
    HandPlace {
        distance: exact::hypot(x, y),
        height: place.height + STANDOFF * down,
        pitch: place.pitch,
        direction: wrap(place.direction - exact::atan2(y, x)),
    }
}

/// Whether a solid between two heights, metres, may be in the way of an arm to a surface at
/// `surface` metres.
#[must_use]
pub fn may_cover(heights: [f64; 2], surface: f64) -> bool {
    heights[1] > surface + WAY[0] && heights[0] < surface + WAY[1]
}

/// The straight way from the arm's base to a point on the floor plan: a rectangle without
/// width.
#[must_use]
pub fn way(base: [f64; 2], point: [f64; 2]) -> Rectangle {
    let way = [point[0] - base[0], point[1] - base[1]];
    let length = exact::hypot(way[0], way[1]).max(1e-9);
    Rectangle {
        centre: [0, 1].map(|i| f64::midpoint(base[i], point[i])),
        half: [length / 2.0, 0.0],
        along: way.map(|part| part / length),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_begin_straight_ahead_and_are_even() {
        let angles: Vec<f64> = aside().collect();
        assert_eq!(angles.len(), 7);
        assert_eq!(angles[0].abs(), 0.0);
        assert!((angles.iter().sum::<f64>()).abs() < 1e-12);
        assert!((angles[5].abs() - ASIDE).abs() < 1e-12);
    }

    #[test]
    fn hand_before_a_place_moves_back_along_itself() {
        let place = HandPlace {
            distance: 0.6,
            height: 0.1,
            pitch: 0.0,
            direction: 0.0,
        };
        let back = before(&place);
        assert!((back.distance - 0.48).abs() < 1e-12 && back.direction.abs() < 1e-12);
        // A hand across the way from the base moves aside.
        let across = HandPlace {
            direction: PI / 2.0,
            ..place
        };
        let back = before(&across);
        assert!((back.distance - exact::hypot(0.6, STANDOFF)).abs() < 1e-12);
        let bearing = exact::atan2(-STANDOFF, 0.6);
        assert!((back.direction - (PI / 2.0 - bearing)).abs() < 1e-12);
        let down = HandPlace {
            pitch: PI / 2.0,
            ..place
        };
        assert!((before(&down).height - 0.1 - STANDOFF).abs() < 1e-12);
    }

    #[test]
    fn way_ends_at_base_and_point() {
        let way = way([1.0, 2.0], [1.3, 2.4]);
        let end = [0, 1].map(|i| way.centre[i] + way.half[0] * way.along[i]);
        assert!((end[0] - 1.3).abs() < 1e-12 && (end[1] - 2.4).abs() < 1e-12);
        assert!(may_cover([0.0, 2.5], 0.75) && !may_cover([0.0, 0.8], 0.75));
        assert!(!may_cover([1.3, 2.0], 0.75));
    }
}
