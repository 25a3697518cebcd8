//! The arm of a robot that pushes a door of furniture.

use nalgebra::{Isometry3, Vector3};
use wheelarm_planning::closed_hand::{Ball, ClosedHand};
use wheelarm_planning::footprint_check::wrap;
use wheelarm_planning::leaf_push::{ARM_STEPS, sampled_lines};

use crate::robot::RobotModel;
use crate::robot::kinematics::ArmKinematics;

/// Radius of closed fingers, metres.
const FINGERS: f64 = 0.024;
/// Largest change of a joint that the search for its position makes, radians.
const NEAR_CHANGE: f64 = 1.2;

/// The arm of a robot that pushes.
#[derive(Clone, Debug)]
pub(super) struct PushingArm {
    kinematics: ArmKinematics,
    /// Positions of its joints at home, radians.
    home: [f64; 6],
    /// chair_from_base.
    pub mount: Isometry3<f64>,
    /// With closed fingers.
    pub hand: ClosedHand,
}

impl PushingArm {
    /// The arm of a robot.
    pub(super) fn new(model: &RobotModel) -> Self {
        let gripper = &model.settings.gripper;
        let balls = gripper.hand_balls.iter().map(|&[x, y, z, radius]| Ball {
            centre: Vector3::new(x, y, z),
            radius,
        });
        let tip = model.settings.tool_length + gripper.corridor.tip;
        Self {
            kinematics: ArmKinematics::new(model),
            home: model.settings.home,
            mount: model.arm_mount(),
            hand: ClosedHand::with_fingers(balls.collect(), FINGERS, tip),
        }
    }

    /// Whether the arm, from home, reaches poses in its base one after another on straight
    /// lines.
    pub(super) fn follows(&self, poses: &[Isometry3<f64>]) -> bool {
        let [spacing, change] = ARM_STEPS;
        let start = self.kinematics.forward(&self.home);
        let mut joints = self.home;
        sampled_lines(&start, poses, spacing).iter().all(|pose| {
            let found = self.kinematics.solve_local(pose, &joints, NEAR_CHANGE);
            found.is_ok_and(|next| {
                let turns = joints.iter().zip(&next.joints);
                let follows = turns.into_iter().all(|(a, b)| wrap(a - b).abs() <= change);
                joints = next.joints;
                follows
            })
        })
    }
}
