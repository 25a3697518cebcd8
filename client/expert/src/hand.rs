//! The hand as balls: the wrist, the palm and the two fingers at any opening. All sizes
//! are read from the gripper's description.

use nalgebra::Vector3;
pub use wheelarm_planning::closed_hand::Ball;
use wheelarm_planning::closed_hand::ClosedHand;
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::v1;

/// Plans count lengths of the linkage in steps of this many to a metre, 10 µm:
/// finer than any hand is made.
const STEPS: f64 = 1e5;
/// So much less than closed and there is nothing between the pads, radians.
const NOTHING: f64 = 0.006_9;
/// So far from the open end the fingers are open, radians.
const NEARLY: f64 = 0.05;

/// A gripper with two fingers that stay parallel.
#[derive(Clone, Debug, PartialEq)]
pub struct Hand {
    /// A fully opened gripper, metres between the pads.
    pub stroke: f64,
    /// Largest force cap at each pad that the gripper accepts, N.
    pub max_force: f64,
    closed: f64,
    linkage: v1::GripperLinkage,
    /// Fixed parts: wrist, camera, palm.
    body: Vec<Ball>,
    /// From the left knuckle's axis, at angle 0.
    crank: Vec<Ball>,
    /// From the left finger tip's axis.
    tip: Vec<Ball>,
}

impl Hand {
    /// Reads a gripper's description.
    ///
    /// # Errors
    /// [`Invalid`] that names the field.
    pub fn read(description: &v1::GripperDescription) -> Result<Self, Invalid> {
        let linkage = description
            .linkage
            .ok_or(Invalid::Missing("gripper linkage"))?;
        let length = |length: f64| {
            let length = check::within("length of the gripper's linkage", length, -1.0, 1.0)?;
            Ok((length * STEPS).round() / STEPS)
        };
        Ok(Self {
            stroke: check::within("gripper stroke", description.stroke, 0.0, 1.0)?,
            max_force: check::within("largest gripper force", description.max_force, 0.0, 1e4)?,
            closed: check::within("closed angle of the gripper", description.closed, 0.0, 3.2)?,
            linkage: v1::GripperLinkage {
                pin_x: length(linkage.pin_x)?,
                pin_z: length(linkage.pin_z)?,
                crank_x: length(linkage.crank_x)?,
                crank_z: length(linkage.crank_z)?,
                pad_x: length(linkage.pad_x)?,
                pad_z: length(linkage.pad_z)?,
                pad_half: length(linkage.pad_half)?,
            },
            body: read_balls(&description.hand_balls)?,
            crank: read_balls(&description.crank_balls)?,
            tip: read_balls(&description.tip_balls)?,
        })
    }

    /// The knuckle's angle at an opening, radians.
    fn knuckle(&self, opening: f64) -> f64 {
        self.linkage.knuckle(opening.clamp(0.0, self.stroke))
    }

    /// Distance from the end effector's frame to the middle of the pads at an
    /// opening, metres. The pads move along the hand while the fingers close.
    #[must_use]
    pub fn pads(&self, opening: f64) -> f64 {
        self.linkage.tip(self.knuckle(opening))[1] + self.linkage.pad_z
    }

    /// Whether the fingers, at a knuckle angle in radians, have closed on nothing.
    #[must_use]
    pub fn is_empty(&self, knuckle: f64) -> bool {
        knuckle > self.closed - NOTHING
    }

    /// Whether the fingers, at a knuckle angle in radians, are open.
    #[must_use]
    pub fn is_open(&self, knuckle: f64) -> bool {
        knuckle <= NEARLY
    }

    /// Nothing of the hand is further from the end effector than this, metres.
    #[must_use]
    pub fn reach(&self) -> f64 {
        let balls = self.balls(0.0).into_iter().chain(self.balls(self.stroke));
        reach(&balls.collect::<Vec<_>>())
    }

    /// The hand with this distance between the pads, metres.
    #[must_use]
    pub fn balls(&self, opening: f64) -> Vec<Ball> {
        let angle = self.knuckle(opening);
        let tip = self.linkage.tip(angle);
        let crank = self.crank.iter().map(|ball| {
            let [x, z] = self.linkage.turned([ball.centre.x, ball.centre.z], angle);
            (Vector3::new(x, ball.centre.y, z), ball.radius)
        });
        let ends = self.tip.iter().map(|ball| {
            let middle = Vector3::new(
                tip[0] + ball.centre.x,
                ball.centre.y,
                tip[1] + ball.centre.z,
            );
            (middle, ball.radius)
        });
        let left: Vec<_> = crank.chain(ends).collect();
        let fingers = [1.0, -1.0].into_iter().flat_map(|side| {
            left.iter().map(move |&(middle, radius)| Ball {
                centre: Vector3::new(side * middle.x, middle.y, middle.z),
                radius,
            })
        });
        self.body.iter().copied().chain(fingers).collect()
    }

    /// The hand with closed fingers.
    #[must_use]
    pub fn closed(&self) -> ClosedHand {
        ClosedHand::new(self.balls(0.0))
    }
}

/// No ball reaches further from the origin than this, metres.
#[must_use]
pub fn reach(balls: &[Ball]) -> f64 {
    let reaches = balls.iter().map(|ball| ball.centre.norm() + ball.radius);
    reaches.fold(0.0, f64::max)
}

fn read_balls(balls: &[v1::Ball]) -> Result<Vec<Ball>, Invalid> {
    balls
        .iter()
        .map(|ball| {
            Ok(Ball {
                centre: check::vector("ball of the gripper", ball.centre.as_ref())?.into(),
                radius: check::within("radius of a ball", ball.radius, 0.0, 1.0)?,
            })
        })
        .collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The gripper of the tests: sizes of a Robotiq 2F-85.
    pub(crate) fn gripper() -> v1::GripperDescription {
        let ball = |&[x, y, z, radius]: &[f64; 4]| v1::Ball {
            centre: Some(v1::Vector3 { x, y, z }),
            radius,
        };
        let balls = |balls: &[[f64; 4]]| balls.iter().map(ball).collect();
        v1::GripperDescription {
            stroke: 0.085,
            closed: 0.7929,
            max_knuckle: 0.8,
            max_velocity: 0.5,
            usual_force: 60.0,
            max_force: 235.0,
            linkage: Some(v1::GripperLinkage {
                pin_x: 0.030_601_14,
                pin_z: 0.054_904_52,
                crank_x: 0.037_157_5,
                crank_z: 0.043_421_68,
                pad_x: 0.025_26,
                pad_z: 0.032,
                pad_half: 0.019,
            }),
            hand_balls: balls(&[
                [0.0, 0.0, -0.165, 0.037],
                [0.0, 0.0, -0.06, 0.0395],
                [0.0, 0.0, -0.02, 0.0395],
                [0.0, 0.056, -0.012, 0.022],
                [0.0, 0.0, 0.03, 0.0385],
                [0.028, 0.0, 0.073, 0.020],
                [-0.028, 0.0, 0.073, 0.020],
            ]),
            crank_balls: balls(&[
                [0.03153, 0.0, -0.00376, 0.015],
                [0.03716, 0.0, 0.04342, 0.015],
            ]),
            tip_balls: balls(&[
                [-0.0148, 0.0, 0.013, 0.0125],
                [-0.0148, 0.0, 0.028, 0.0125],
                [-0.0148, 0.0, 0.043, 0.008],
            ]),
        }
    }

    /// The hand of the tests.
    pub(crate) fn hand() -> Hand {
        Hand::read(&gripper()).unwrap()
    }

    #[test]
    fn pads_are_apart_by_the_opening_and_move_outwards() {
        let hand = hand();
        for opening in [0.0, 0.03, 0.06, hand.stroke] {
            let tip = hand.linkage.tip(hand.knuckle(opening));
            let face = tip[0] - hand.linkage.pad_x;
            assert!((2.0 * face - opening).abs() < 1e-4, "{opening}: {face}");
        }
        // Forward kinematics of the URDF: 0.130 m open, 0.144 m closed.
        assert!((hand.pads(hand.stroke) - 0.130).abs() < 1e-3);
        assert!((hand.pads(0.0) - 0.144).abs() < 1e-3);
    }

    #[test]
    fn fingers_are_mirror_images_within_the_reach() {
        let hand = hand();
        for opening in [0.0, 0.04, hand.stroke] {
            let balls = hand.balls(opening);
            let (left, right) = balls[hand.body.len()..].split_at(5);
            for (left, right) in left.iter().zip(right) {
                assert_eq!(
                    (left.centre.x, left.centre.z),
                    (-right.centre.x, right.centre.z)
                );
            }
            assert!(reach(&balls) <= hand.reach());
        }
        assert!(hand.is_empty(0.79) && !hand.is_empty(0.78));
        assert!(hand.is_open(0.04) && !hand.is_open(0.06));
    }

    #[test]
    fn description_without_a_linkage_is_rejected() {
        let mut without = gripper();
        without.linkage = None;
        assert_eq!(
            Hand::read(&without),
            Err(Invalid::Missing("gripper linkage"))
        );
    }
}
