//! Joint sensors: velocity and effort at the end of a tick.
//!
//! The engine's velocity after a tick is that of its last substep or, for a joint that
//! follows its reference stiffly, that of the whole tick: it is up to half a tick old.
//! The travel in the last two ticks gives the velocity at the end of the tick in either
//! case, but with the rounding of the positions. So the engine's velocity is
//! extrapolated by the smoothed difference. The velocities then integrate to the
//! travel, and the change of momentum equals the effort.
//! change by is the effort.

use rapier3d::prelude::PhysicsWorld;
use serde::{Deserialize, Serialize};
use wheelarm_proto::exact;

use super::body::RobotBody;
use super::drive;
use crate::snapshot::JointState;

/// Share of a new difference that is used in a tick.
const SHARE: f64 = 0.7;
/// Largest acceleration by a drive, rad/s²: a larger one is an impact, after which the
/// engine's velocity is used.
const BLOW: f64 = 25.0;

/// One joint's sensors.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Signal {
    /// At the end of the tick, rad/s.
    velocity: f64,
    /// Mean over the tick, rad/s.
    mean: f64,
    /// Extrapolation of the engine's velocity, rad/s.
    ahead: f64,
    /// Torque of the drive, N·m.
    effort: f64,
}

/// The sensors of all joints, in the order of the robot's bodies.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Signals {
    joints: Vec<Signal>,
    /// Positions at the start of the tick, rad.
    #[serde(skip)]
    before: Vec<f64>,
}

impl Signals {
    /// At rest, with the drives' present torques.
    pub(super) fn at_rest(physics: &PhysicsWorld, robot: &RobotBody) -> Self {
        let joints = (0..robot.handles.len()).map(|body| Signal {
            effort: drive::torque(physics, robot, body, 0.0),
            ..Signal::default()
        });
        Self {
            joints: joints.collect(),
            before: Vec::new(),
        }
    }

    /// All numbers, for validation.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        let joints = self.joints.iter();
        joints.flat_map(|s| [s.velocity, s.mean, s.ahead, s.effort])
    }

    /// Number of bodies.
    pub(super) fn len(&self) -> usize {
        self.joints.len()
    }

    /// Call before the engine's tick.
    pub(super) fn begin_tick(&mut self, physics: &PhysicsWorld, robot: &RobotBody) {
        self.before.clear();
        let bodies = 0..robot.handles.len();
        self.before
            .extend(bodies.map(|body| robot.joint_state(physics, body).0));
    }

    /// Call after the engine's tick. The velocity estimate is not extrapolated beyond
    /// the joint's limit, from `limits` in rad/s by body.
    pub(super) fn end_tick(&mut self, physics: &PhysicsWorld, robot: &RobotBody, limits: &[f64]) {
        let dt = f64::from(physics.integration_parameters.dt);
        let blow = BLOW * dt / 2.0;
        let signals = self.joints.iter_mut().zip(&self.before).zip(limits);
        for (body, ((signal, before), limit)) in signals.enumerate() {
            let (position, last) = robot.joint_state(physics, body);
            let mean = (position - before) / dt;
            let ahead = mean + (mean - signal.mean) / 2.0 - last;
            signal.ahead += SHARE * (exact::within(ahead, -blow, blow) - signal.ahead);
            let most = limit.max(last.abs());
            signal.velocity = exact::within(last + signal.ahead, -most, most);
            signal.effort = drive::torque(physics, robot, body, mean);
            signal.mean = mean;
        }
    }

    /// State of the joint that moves a body.
    pub(super) fn state(
        &self,
        physics: &PhysicsWorld,
        robot: &RobotBody,
        body: usize,
    ) -> JointState {
        let signal = self.joints.get(body).copied().unwrap_or_default();
        JointState {
            position: robot.joint_state(physics, body).0,
            velocity: signal.velocity,
            effort: signal.effort,
        }
    }
}
