//! The hand as balls: the wrist, the palm and the two fingers of the 2F-85 at
//! any opening. Sizes are those of the robot's collision shapes.

use nalgebra::Vector3;
use wheelarm_proto::exact;

/// One ball, in the end effector's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Middle, metres.
    pub centre: Vector3<f64>,
    /// Radius, metres.
    pub radius: f64,
}

/// A fully opened gripper, metres between the pads.
pub const OPEN: f64 = 0.085;

/// The knuckle's axis beside and along the hand's axis, metres (URDF).
const KNUCKLE: [f64; 2] = [0.030_60, 0.054_90];
/// From the knuckle to the finger, at a knuckle angle of 0, metres (URDF).
const FINGER: [f64; 2] = [0.031_53, -0.003_76];
/// From the knuckle to the finger tip's joint, at a knuckle angle of 0, metres (URDF).
const TIP: [f64; 2] = [0.037_16, 0.043_42];
/// From the tip's joint inwards to the pad's face, metres (URDF).
const PAD: f64 = 0.025_26;
/// Along the hand from the tip's joint to the middle and the end of the pad, metres (URDF).
const PAD_MIDDLE: f64 = 0.032;
const PAD_END: f64 = 0.051;

/// What does not move: wrist, camera, palm.
const BODY: [([f64; 3], f64); 14] = [
    ([0.0, 0.0, -0.165], 0.037),
    ([0.0, 0.0, -0.11], 0.0385),
    ([0.0, 0.0, -0.06], 0.0395),
    ([0.0, 0.0, -0.02], 0.0395),
    ([0.0, 0.056, -0.012], 0.022),
    ([0.032, 0.056, -0.012], 0.020),
    ([-0.032, 0.056, -0.012], 0.020),
    ([0.0, 0.0, 0.01], 0.0385),
    ([0.0, 0.0, 0.03], 0.0385),
    ([0.028, 0.0, 0.055], 0.021),
    ([-0.028, 0.0, 0.055], 0.021),
    ([0.028, 0.0, 0.073], 0.020),
    ([0.0, 0.0, 0.072], 0.020),
    ([-0.028, 0.0, 0.073], 0.020),
];

/// The knuckle's angle at an opening, radians.
fn knuckle(opening: f64) -> f64 {
    let length = exact::hypot(TIP[0], TIP[1]);
    let across = (opening.clamp(0.0, OPEN) / 2.0 + PAD - KNUCKLE[0]) / length;
    exact::atan2(TIP[0], TIP[1]) - exact::asin(across.clamp(-1.0, 1.0))
}

/// A point that turns with the knuckle: beside and along the hand's axis, metres.
fn turned(point: [f64; 2], angle: f64) -> [f64; 2] {
    let (sin, cos) = exact::sin_cos(angle);
    [
        KNUCKLE[0] + point[0] * cos - point[1] * sin,
        KNUCKLE[1] + point[0] * sin + point[1] * cos,
    ]
}

/// Distance from the end effector's frame to the middle of the pads at an
/// opening, metres. The pads move outwards when the fingers close.
#[must_use]
pub fn pads(opening: f64) -> f64 {
    turned(TIP, knuckle(opening))[1] + PAD_MIDDLE
}

/// The hand with this distance between the pads, metres.
#[must_use]
pub fn balls(opening: f64) -> Vec<Ball> {
    let angle = knuckle(opening);
    let (root, tip) = (turned(FINGER, angle), turned(TIP, angle));
    let middle = [
        f64::midpoint(root[0], tip[0]),
        f64::midpoint(root[1], tip[1]),
    ];
    let inner = tip[0] - 0.0148;
    let mut balls: Vec<Ball> = BODY
        .iter()
        .map(|(centre, radius)| Ball {
            centre: (*centre).into(),
            radius: *radius,
        })
        .collect();
    for side in [1.0, -1.0] {
        let mut add = |x: f64, y: f64, z: f64, radius: f64| {
            balls.push(Ball {
                centre: Vector3::new(side * x, y, z),
                radius,
            });
        };
        for [x, z] in [root, middle, tip] {
            add(x, 0.0, z, 0.015);
        }
        add(inner, 0.0, tip[1] + 0.013, 0.0125);
        add(inner, 0.0, tip[1] + 0.028, 0.0125);
        for y in [-0.006, 0.006] {
            add(inner, y, tip[1] + PAD_END - 0.008, 0.008);
        }
    }
    balls
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pads_are_as_far_apart_as_asked_and_move_outwards() {
        for opening in [0.0, 0.03, 0.06, OPEN] {
            let face = turned(TIP, knuckle(opening))[0] - PAD;
            assert!((2.0 * face - opening).abs() < 1e-4, "{opening}: {face}");
        }
        // Forward kinematics of the URDF: 0.130 m open, 0.144 m closed.
        assert!((pads(OPEN) - 0.130).abs() < 1e-3, "{}", pads(OPEN));
        assert!((pads(0.0) - 0.144).abs() < 1e-3, "{}", pads(0.0));
    }
}
