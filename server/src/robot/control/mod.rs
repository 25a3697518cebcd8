//! Control laws: convert intents to joint targets.
//!
//! Open loop and deterministic: the targets depend on the intents only (and on the
//! chair's pose, for intents in the house frame). Near a seated person the [`Guard`]
//! limits them by the measured state. The complete state is one [`ControlState`], which
//! is saved with the world.

mod arm;
mod base;
mod gripper;
mod guard;
mod profile;

use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};
use wheelarm_proto::{PHYSICS_HZ, TICKS_PER_CONTROL};

use self::arm::ArmControl;
pub use self::arm::{ArmState, Motion, Velocity};
pub use self::base::{BaseState, DriveGeometry};
pub use self::gripper::{GripperMap, GripperState};
pub use self::guard::{ArmBound, ChairBound, FingerBound, Guard, PLANNED_BRAKING};
use super::{DriveSettings, GripperSettings, RobotModel};
use crate::snapshot::Snapshot;

/// Physics ticks of one control tick.
pub const TICKS: usize = TICKS_PER_CONTROL as usize;

/// Converts intents to targets.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotControl {
    arm: ArmControl,
    drive: DriveSettings,
    wheels: DriveGeometry,
    gripper: GripperSettings,
    /// Limits near a person. Not part of the state: set before every control tick.
    guard: Option<Guard>,
    state: ControlState,
}

/// Complete state of the control, bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControlState {
    /// Arm.
    pub arm: ArmState,
    /// Chair.
    pub base: BaseState,
    /// Gripper.
    pub gripper: GripperState,
}

impl RobotControl {
    /// At rest in the home position, the gripper open.
    #[must_use]
    pub fn new(model: &RobotModel) -> RobotControl {
        RobotControl::at_rest(model, &model.settings.home, 0.0)
    }

    /// At rest at given positions of the arm, from base to hand, and of the gripper's
    /// knuckle, rad.
    #[must_use]
    pub fn at_rest(model: &RobotModel, joints: &[f64; 6], knuckle: f64) -> RobotControl {
        let arm = ArmControl::new(model);
        let state = ControlState {
            arm: arm.at_rest(joints),
            base: BaseState::default(),
            gripper: GripperState::new(&model.settings.gripper, knuckle),
        };
        RobotControl {
            arm,
            drive: model.settings.drive,
            wheels: DriveGeometry::new(&model.settings),
            gripper: model.settings.gripper.clone(),
            guard: None,
            state,
        }
    }

    /// Sets the limits of the coming control tick; `None` without a guard.
    pub fn set_guard(&mut self, guard: Option<Guard>) {
        self.guard = guard;
    }

    /// One control tick: accepts new intents and returns the targets of the physics
    /// ticks up to the next one. Non-finite intents are ignored.
    pub fn update(&mut self, input: &ControlInput, snapshot: &Snapshot) -> [Targets; TICKS] {
        let ControlState { arm, base, gripper } = &mut self.state;
        let guard = self.guard.as_ref();
        if let Some(guard) = guard {
            self.arm.shorten_lead(arm, guard);
        }
        if let Some(intent) = input.arm.as_ref().filter(|intent| intent.is_finite()) {
            self.arm.take(arm, intent, snapshot);
        }
        if let Some(intent) = &input.base
            && intent.linear.is_finite()
            && intent.angular.is_finite()
        {
            base.take(intent, &self.drive);
        }
        if let Some(intent) = &input.gripper
            && intent.knuckle.is_finite()
            && intent.max_force.is_none_or(f64::is_finite)
        {
            gripper.take(intent, &self.gripper);
        }
        let dt = 1.0 / PHYSICS_HZ as f64;
        std::array::from_fn(|i| {
            self.arm.advance(arm, guard, dt);
            base.advance(&self.drive, guard, dt, TICKS - i);
            let fingers = guard.and_then(|guard| guard.fingers);
            gripper.advance(&self.gripper, fingers, dt);
            Targets {
                arm_position: arm.position,
                arm_velocity: arm.velocity,
                wheel_velocity: self.wheels.wheel_speeds(&base.now),
                knuckle_position: gripper.position,
                knuckle_velocity: gripper.velocity,
                pad_force: fingers.map_or(gripper.force, |bound| gripper.force.min(bound.force)),
            }
        })
    }

    /// base_from_end_effector at the arm's goal, in `base_link`.
    #[must_use]
    pub fn desired_pose(&self) -> Isometry3<f64> {
        self.state.arm.desired
    }

    /// Why the last arm intent is not followed, or only in part.
    #[must_use]
    pub fn arm_problem(&self) -> Option<&str> {
        self.state.arm.problem.as_deref()
    }

    /// The kind of problem in [`RobotControl::arm_problem`].
    #[must_use]
    pub fn arm_problem_kind(&self) -> Option<ArmProblem> {
        let arm = &self.state.arm;
        arm.problem.as_ref().map(|_| match arm.motion {
            // An unreachable goal is not started.
            Motion::Hold => ArmProblem::Unreachable,
            Motion::Joints { .. } => ArmProblem::JointLimit,
            Motion::Line { .. } => ArmProblem::Stalled,
            Motion::Twist { .. } => ArmProblem::Hindered,
        })
    }

    /// Present velocity command of the wheels.
    #[must_use]
    pub fn base_velocity_command(&self) -> BaseIntent {
        self.state.base.now
    }

    /// The complete state.
    #[must_use]
    pub fn state(&self) -> &ControlState {
        &self.state
    }

    /// Continues from the saved state of another run.
    pub fn restore(&mut self, state: ControlState) {
        self.state = state;
    }

    /// Kinematics of the arm, for queries.
    #[must_use]
    pub fn kinematics(&self) -> &super::kinematics::ArmKinematics {
        &self.arm.kinematics
    }
}

/// New intents of one control tick. Absent groups are unchanged.
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

/// Intent of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum ArmIntent {
    /// From base to hand, rad, absolute: continuous joints are not wrapped.
    Joints([f64; 6]),
    /// End effector pose in `frame`.
    Pose {
        /// Frame of the values.
        frame: IntentFrame,
        /// frame_from_tool.
        pose: Isometry3<f64>,
    },
    /// End effector velocity in `frame`, m/s and rad/s; held until the next intent.
    Twist {
        /// Frame of the values.
        frame: IntentFrame,
        /// m/s.
        linear: Vector3<f64>,
        /// rad/s.
        angular: Vector3<f64>,
    },
    /// Step from the present target: translation in `frame`, m, and rotation
    /// vector about the tool's own axes, rad.
    Step {
        /// Frame of the values.
        frame: IntentFrame,
        /// Metres.
        translation: Vector3<f64>,
        /// Rotation vector, rad.
        rotation: Vector3<f64>,
    },
    /// Stop and hold.
    Hold,
}

impl ArmIntent {
    fn is_finite(&self) -> bool {
        let vector = |vector: &Vector3<f64>| vector.iter().all(|part| part.is_finite());
        match self {
            ArmIntent::Joints(joints) => joints.iter().all(|joint| joint.is_finite()),
            ArmIntent::Pose { pose, .. } => {
                vector(&pose.translation.vector)
                    && pose.rotation.coords.iter().all(|part| part.is_finite())
            }
            ArmIntent::Twist {
                linear, angular, ..
            } => vector(linear) && vector(angular),
            ArmIntent::Step {
                translation,
                rotation,
                ..
            } => vector(translation) && vector(rotation),
            ArmIntent::Hold => true,
        }
    }
}

/// Why the arm does not follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmProblem {
    /// No joint positions reach the pose, or no straight line leads to it.
    Unreachable,
    /// A joint was commanded beyond its limit and moves to the limit.
    JointLimit,
    /// It makes no progress along its line.
    Stalled,
    /// A limit or a singular posture prevents it from following a twist.
    Hindered,
}

/// Intent of the chair, in `wheelchair_root`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BaseIntent {
    /// Forward speed, m/s.
    pub linear: f64,
    /// Turn rate, rad/s, positive to the left.
    pub angular: f64,
}

/// Intent of the gripper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GripperIntent {
    /// Knuckle angle, rad, from 0 (open); openings in metres are converted first, by
    /// [`GripperMap::knuckle`].
    pub knuckle: f64,
    /// Force cap at each pad, N; `None` is the default force of the robot.
    pub max_force: Option<f64>,
}

/// Set points of the drives for one physics tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Targets {
    /// From base to hand, rad.
    pub arm_position: [f64; 6],
    /// From base to hand, rad/s (feed-forward).
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

#[cfg(test)]
mod tests;
