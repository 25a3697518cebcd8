//! Poses of objects at rest other than upright: lying, on top of another, leaning
//! against another, or behind another. Poses are exact contacts, so that the object is
//! at rest when the simulation begins.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use wheelarm_proto::exact;

use super::area::{Range, RestShares};
use super::random::{fraction, index, number};
use crate::geometry::Shape;
use crate::scene::{Body, Bounds};

/// Kind of rest pose of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rest {
    Upright,
    Lying,
    Stacked,
    Leaning,
    Hidden,
}

impl Rest {
    /// Samples by the probabilities of an object.
    pub(super) fn sample(shares: &RestShares, random: &mut ChaCha8Rng) -> Self {
        let mut left = fraction(random);
        for (share, rest) in [
            (shares.lies, Self::Lying),
            (shares.stacks, Self::Stacked),
            (shares.leans, Self::Leaning),
            (shares.hides, Self::Hidden),
        ] {
            left -= share;
            if left < 0.0 {
                return rest;
            }
        }
        Self::Upright
    }
}

/// A vertical face or round side that can support a leaning object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Support {
    /// Middle of the top in `house`.
    pub top: Isometry3<f64>,
    /// Height above its support, metres.
    pub height: f64,
    /// Distance from the middle to the face, metres.
    pub reach: f64,
    /// Direction from the middle to the face in the frame of `top`, radians; `None` for
    /// a round support.
    pub facing: Option<f64>,
}

/// Smallest height of a support for leaning, and smallest width for stacking, metres.
const LEAST_HEIGHT: f64 = 0.1;
const LEAST_HALF: f64 = 0.03;
/// Additional lean beyond the angle at which the object would fall back, rad.
const BEYOND: Range = Range {
    min: 0.07,
    max: 0.16,
};
/// Initial gap to the support: contact begins in the first step, metres.
const GAP: f64 = 2e-4;

impl Support {
    /// The top of `body` at `pose`, if it is one flat shape: a box on any of its sides
    /// or an upright cylinder.
    pub(super) fn top_of(body: &Body, pose: &Isometry3<f64>) -> Option<Self> {
        let [part] = &body.collision[..] else {
            return None;
        };
        let at = pose * part.pose;
        let up = (at.rotation * Vector3::z()).z.abs() > 0.999;
        let bounds = body.collision_bounds(pose)?;
        let (reach, facing, half) = match part.shape {
            Shape::Cylinder { radius, .. } if up => (radius, None, radius),
            Shape::Cuboid { half } if up => match half[0] < half[1] {
                true => (half[0], Some(0.0), half[0]),
                false => (half[1], Some(FRAC_PI_2), half[1]),
            },
            // On its side it can carry, but is too low to lean against.
            Shape::Cuboid { .. } => (0.0, None, LEAST_HALF),
            _ => return None,
        };
        let heading = heading(&at);
        let middle = at.translation.vector.xy();
        let top = Isometry3::new(
            Vector3::new(middle.x, middle.y, bounds.max.z),
            Vector3::z() * heading,
        );
        let height = bounds.size().z;
        let carries = half >= LEAST_HALF;
        let holds = reach > 0.0 && height >= LEAST_HEIGHT;
        (carries || holds).then_some(Self {
            top,
            height,
            reach: if holds { reach } else { 0.0 },
            facing,
        })
    }

    /// Whether another object can be placed on it.
    pub(super) fn carries(body: &Body, pose: &Isometry3<f64>) -> bool {
        let size = body.collision_bounds(pose).map(|bounds| bounds.size());
        size.is_some_and(|size| size.x.min(size.y) >= 2.0 * LEAST_HALF)
    }

    /// Whether another object can lean against it.
    pub(super) fn can_support(&self) -> bool {
        self.reach > 0.0
    }
}

/// Rotation of a pose about the vertical, radians; for a lying object that of its level
/// axis.
pub(super) fn heading(pose: &Isometry3<f64>) -> f64 {
    let [x, y] = [Vector3::x(), Vector3::y()].map(|axis| pose.rotation * axis);
    match x.xy().norm() > 0.5 {
        true => exact::atan2(x.y, x.x),
        false => exact::atan2(y.y, y.x) - FRAC_PI_2,
    }
}

/// Rotations that lay a body on one of its sides: with `for_hand` only those with a
/// grasp from above, otherwise those on the widest side.
pub(super) fn lying(body: &Body, for_hand: bool) -> Vec<UnitQuaternion<f64>> {
    let turns = [Vector3::x_axis(), Vector3::y_axis()]
        .into_iter()
        .flat_map(|axis| {
            [FRAC_PI_2, -FRAC_PI_2].map(|by| UnitQuaternion::from_axis_angle(&axis, by))
        });
    let turns: Vec<_> = turns.collect();
    if for_hand {
        let takes = |turn: &UnitQuaternion<f64>| {
            let mut grasps = body.grasps.iter();
            grasps.any(|grasp| (turn * grasp.pose.rotation * Vector3::z()).z < -0.99)
        };
        return turns.into_iter().filter(takes).collect();
    }
    let height = |turn: &UnitQuaternion<f64>| {
        let bounds = body.collision_bounds(&Isometry3::from_parts(Translation3::identity(), *turn));
        bounds.map_or(f64::INFINITY, |bounds| bounds.size().z)
    };
    let least = turns.iter().map(height).fold(f64::INFINITY, f64::min);
    turns
        .into_iter()
        .filter(|turn| height(turn) < least + 1e-6)
        .collect()
}

/// `body`, rotated by `turn`, with the middle of its outline at the origin and its
/// lowest point at height 0.
pub(super) fn grounded(body: &Body, turn: UnitQuaternion<f64>) -> Isometry3<f64> {
    let turned = Isometry3::from_parts(Translation3::identity(), turn);
    let bounds = body.collision_bounds(&turned).unwrap_or(Bounds {
        min: [0.0; 3].into(),
        max: [0.0; 3].into(),
    });
    let middle = bounds.min + bounds.size() / 2.0;
    Translation3::new(-middle.x, -middle.y, -bounds.min.z) * turned
}

/// A pose on top of a support, near its middle, upright or lying.
pub(super) fn stacked(
    random: &mut ChaCha8Rng,
    body: &Body,
    on: &Isometry3<f64>,
    may_lie: bool,
) -> Isometry3<f64> {
    const OFF: Range = Range {
        min: -0.008,
        max: 0.008,
    };
    let mut turns = vec![UnitQuaternion::identity()];
    if may_lie {
        turns.extend(lying(body, false));
    }
    let turn = turns[index(random, turns.len())];
    let (x, y) = (number(random, OFF), number(random, OFF));
    let yaw = number(random, Range { min: -PI, max: PI });
    let place = Isometry3::new(Vector3::new(x, y, 0.0), Vector3::z() * yaw);
    on * place * grounded(body, turn)
}

/// A pose leaning against a support: the lower front edge on the ground, the front face
/// on the rim of the support or its upper edge on the support's side.
pub(super) fn leaning(
    random: &mut ChaCha8Rng,
    body: &Body,
    against: &Support,
) -> Option<Isometry3<f64>> {
    let bounds = body.collision_bounds(&Isometry3::identity())?;
    let size = bounds.size();
    let thin_is_x = size.x < size.y;
    let thickness = size.x.min(size.y);
    let angle = exact::atan2(thickness, size.z) + number(random, BEYOND);
    let (sine, cosine) = (exact::sin(angle), exact::cos(angle));
    let away = match size.z * cosine <= against.height {
        true => size.z * sine,
        false => against.height * sine / cosine,
    };
    let side = match against.facing {
        None => number(random, Range { min: 0.0, max: TAU }),
        Some(facing) => facing + PI * index(random, 2) as f64,
    };
    // x points from the leaning object to the support.
    let towards = Isometry3::rotation(Vector3::z() * (side + PI));
    let from_support = -(against.reach + away + GAP);
    let turn = UnitQuaternion::from_axis_angle(&Unit::new_unchecked(Vector3::y()), angle);
    let own = match thin_is_x {
        true => UnitQuaternion::identity(),
        false => UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -FRAC_PI_2),
    };
    let edge = Vector3::new(thickness / 2.0, 0.0, bounds.min.z);
    let place = Vector3::new(from_support, 0.0, -against.height) - turn * edge;
    Some(against.top * towards * Isometry3::from_parts(place.into(), turn * own))
}
