//! Whether the hand can reach an object between others: corridors of the open gripper
//! from each grasp back to the approach side, above low objects.
//!
//! Sizes are from the robot's folder (`gripper.corridor`). The scripted operator checks
//! every path against the robot's own description.

use nalgebra::{Isometry3, Point2, Rotation2, UnitComplex, Vector2, Vector3};
use wheelarm_proto::exact;

use super::placement_clearance::{Outline, PlacedOutline};
use crate::robot::CorridorSettings;
use crate::scene::{Body, Grasp, Surface};

/// Largest forward lean of a level hand, rad, to pass above low objects.
const LEAN: f64 = 0.25;
/// Directions to try for round objects, relative to straight inwards, degrees.
const ROUND: [f64; 9] = [0.0, 12.5, -12.5, 25.0, -25.0, 37.5, -37.5, 50.0, -50.0];
/// Smallest cosine between a level hand's direction and straight inwards.
const ASKEW: f64 = 0.6;
/// Smallest horizontal component of the direction of a level hand.
const LEVEL: f64 = 0.8;
/// A piece of the hand's path: objects in it higher than `bottom` block it.
struct Piece {
    outline: Outline,
    bottom: f64,
}

/// The largest clearance of all paths to grasp `body` at `pose`, metres; negative when
/// every path is blocked. An object without a grasp needs none.
pub(super) fn room(
    hand: &CorridorSettings,
    body: &Body,
    pose: &Isometry3<f64>,
    surface: &Surface,
    others: &[PlacedOutline],
) -> f64 {
    if body.grasps.is_empty() {
        return f64::INFINITY;
    }
    let inwards = (surface.edge.rotation * Vector3::x()).xy();
    let mut most = f64::NEG_INFINITY;
    // Objects are in their initial pose: grasps for fallen objects do not apply.
    for grasp in body.grasps.iter().filter(|grasp| !grasp.from_above) {
        for turn in turns(grasp) {
            let about = Isometry3::rotation(Vector3::z() * turn);
            let level = Isometry3::from_parts(
                pose.translation,
                match grasp.symmetric {
                    // Rotated to face inwards, whatever the object's own heading.
                    true => facing(grasp, &inwards),
                    false => pose.rotation,
                },
            );
            let house_from_grasp = level * about * grasp.pose;
            let Some(way) = way(hand, &house_from_grasp, &inwards) else {
                continue;
            };
            let least = way
                .iter()
                .flat_map(|piece| {
                    let high = others.iter().filter(|other| other.top > piece.bottom);
                    high.map(|other| piece.outline.distance(&other.outline))
                })
                .fold(f64::INFINITY, f64::min);
            most = most.max(least);
            if most >= 0.0 {
                return most;
            }
        }
    }
    most
}

/// Rotations about the vertical to try for a grasp, radians.
fn turns(grasp: &Grasp) -> impl Iterator<Item = f64> + use<> {
    let count = if grasp.symmetric { ROUND.len() } else { 1 };
    ROUND.into_iter().take(count).map(f64::to_radians)
}

/// The rotation of a round object at which a grasp's direction on the floor plan, or
/// the direction to the object's middle, is straight inwards.
fn facing(grasp: &Grasp, inwards: &Vector2<f64>) -> nalgebra::UnitQuaternion<f64> {
    let forward = (grasp.pose.rotation * Vector3::z()).xy();
    let own = exact::atan2(forward.y, forward.x);
    let wanted = exact::atan2(inwards.y, inwards.x);
    nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), wanted - own)
}

/// The path of the hand to a grasp; `None` when the hand cannot approach like that.
fn way(
    hand: &CorridorSettings,
    house_from_grasp: &Isometry3<f64>,
    inwards: &Vector2<f64>,
) -> Option<Vec<Piece>> {
    let CorridorSettings {
        fingers,
        wrist,
        tip,
        palm,
        back,
        ..
    } = *hand;
    let point = Point2::from(house_from_grasp.translation.vector.xy());
    let height = house_from_grasp.translation.z;
    let forward = (house_from_grasp.rotation * Vector3::z()).xy();
    let piece = |direction: Vector2<f64>, [from, to]: [f64; 2], half: f64, bottom: f64| Piece {
        outline: Outline {
            centre: point - direction * f64::midpoint(from, to),
            turn: UnitComplex::new(exact::atan2(direction.y, direction.x)),
            half: Vector2::new((to - from) / 2.0, half),
            radius: 0.0,
        },
        bottom,
    };
    if forward.norm() >= LEVEL {
        let direction = forward.normalize();
        if direction.dot(inwards) < ASKEW {
            return None;
        }
        // Behind the fingers the hand rises with its lean.
        return Some(vec![
            piece(
                direction,
                [-tip, palm],
                fingers,
                height - hand.fingers_height,
            ),
            piece(
                direction,
                [palm, back],
                wrist,
                height + palm * LEAN - hand.palm_height,
            ),
        ]);
    }
    // From above: the fingers beside the object, the wrist leaning back towards the
    // approach side, high above low objects.
    let closing = (house_from_grasp.rotation * Vector3::x()).xy();
    let closing = closing.try_normalize(1e-6)?;
    let across = Rotation2::new(std::f64::consts::FRAC_PI_2) * closing;
    let leaning = forward.norm();
    let tips = Piece {
        outline: Outline {
            centre: point - forward * 0.1,
            turn: UnitComplex::new(exact::atan2(across.y, across.x)),
            half: Vector2::new(wrist, fingers + 0.1 * leaning),
            radius: 0.0,
        },
        bottom: height - tip,
    };
    Some(vec![
        tips,
        piece(*inwards, [0.0, back], wrist, height + hand.above),
    ])
}

/// The clearance around a region, metres: no object may be within `gap` of it.
pub(super) fn region_room(surface: &Surface, gap: f64, others: &[PlacedOutline]) -> f64 {
    let centre = surface.centre();
    let inwards = centre.rotation * Vector3::x();
    let outline = Outline {
        centre: Point2::from(centre.translation.vector.xy()),
        turn: UnitComplex::new(exact::atan2(inwards.y, inwards.x)),
        half: Vector2::new(surface.depth / 2.0, surface.width / 2.0),
        radius: gap,
    };
    let high = others
        .iter()
        .filter(|other| other.top > centre.translation.z);
    let distances = high.map(|other| outline.distance(&other.outline));
    distances.fold(f64::INFINITY, f64::min)
}
