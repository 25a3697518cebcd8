//! Control laws: intent in, joint targets out.

use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

/// What is newly asked at one control tick. Absent groups stay as they are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ControlInput {
    /// Arm.
    pub arm: Option<ArmIntent>,
    /// Chair.
    pub base: Option<BaseIntent>,
    /// Gripper.
    pub gripper: Option<GripperIntent>,
}

/// Frame of a Cartesian intent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum IntentFrame {
    /// `base_link`, the arm's base.
    ArmBase,
    /// The end effector itself.
    EndEffector,
    /// `wheelchair_root`.
    Wheelchair,
    /// `house`.
    House,
}

/// What is asked of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum ArmIntent {
    /// joint_1 to joint_6, rad.
    Joints([f64; 6]),
    /// End effector pose in `frame`.
    Pose {
        frame: IntentFrame,
        pose: Isometry3<f64>,
    },
    /// End effector velocity in `frame`, m/s and rad/s; held until the next intent.
    Twist {
        frame: IntentFrame,
        linear: Vector3<f64>,
        angular: Vector3<f64>,
    },
    /// Step from the present target: translation in `frame`, m, and rotation
    /// vector about the tool's own axes, rad.
    Step {
        frame: IntentFrame,
        translation: Vector3<f64>,
        rotation: Vector3<f64>,
    },
    /// Stop and hold.
    Hold,
}

/// What is asked of the chair, in `wheelchair_root`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseIntent {
    /// Forward speed, m/s.
    pub linear: f64,
    /// Turn rate, rad/s, positive to the left.
    pub angular: f64,
}

/// What is asked of the gripper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GripperIntent {
    /// Knuckle angle, rad, 0 (open) to 0.8; openings in metres are mapped first.
    pub knuckle: f64,
    /// Force cap at each pad, N.
    pub max_force: f64,
}

/// What the drives follow during one physics tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Targets {
    /// joint_1 to joint_6, rad.
    pub arm_position: [f64; 6],
    /// joint_1 to joint_6, rad/s (feed-forward).
    pub arm_velocity: [f64; 6],
    /// Left and right rear wheel, rad/s.
    pub wheel_velocity: [f64; 2],
    /// Left knuckle, rad.
    pub knuckle_position: f64,
    /// Left knuckle, rad/s (feed-forward).
    pub knuckle_velocity: f64,
    /// Cap of the force at each pad, N.
    pub pad_force: f64,
}
