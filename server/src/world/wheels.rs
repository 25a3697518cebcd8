//! Angles of the wheels, counted in double precision over any distance, and their
//! rolling resistance.
//!
//! Rolling resistance is a coefficient times the load of the last tick. For a driven
//! wheel it acts in the joint, with the friction of its gear. A front wheel is not a
//! body: the floor brakes the chair at its contact point, opposite to the motion in any
//! direction, because the rollers of an omni wheel have the same resistance.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Vector3};
use rapier3d::prelude::{ColliderHandle, PhysicsWorld};
use wheelarm_proto::exact;

use super::WorldError;
use super::body::RobotBody;
use super::contact::tag;
use super::convert::vector;
use super::friction::Friction;
use super::health;
use crate::robot::RobotModel;
use crate::snapshot::{BodyRef, JointState};

/// Speed below which the rolling resistance of front wheels decreases linearly, m/s.
/// [choice: 1 % of the chair's speed; stiff enough to hold it and stable at 240 Hz]
const CREEP: f64 = 0.005;

/// The four wheels: two driven, two rolling, each left before right.
#[derive(Clone, Debug)]
pub(super) struct Wheels {
    /// Unwrapped angles, rad.
    pub angles: [f64; 4],
    /// Reference angles of the driven wheels, rad.
    pub led: [f64; 2],
    /// Rates of the front wheels, rad/s.
    pub rolling: [f64; 2],
    joints: [usize; 4],
    /// Bodies of the driven wheels.
    driven: [usize; 2],
    /// Frames of the front wheels in the root body, and their axes there.
    front: [(Isometry3<f64>, Vector3<f64>); 2],
    radius: f64,
    /// Spheres on which the wheels roll.
    balls: [Option<ColliderHandle>; 4],
    /// Dry friction of a driven wheel, N·m, and rolling resistance of tyres and front
    /// wheels, N/N.
    wheel_friction: f64,
    tyre_resistance: f64,
    front_resistance: f64,
}

impl Wheels {
    /// Finds the wheels by their roles.
    pub(super) fn new(
        model: &RobotModel,
        robot: &RobotBody,
        physics: &PhysicsWorld,
    ) -> Result<Self, WorldError> {
        let body = |joint: usize| {
            let body = robot.tree.body_moved_by(joint);
            body.ok_or_else(|| WorldError::MissingJoint {
                joint: model.joints[joint].name.clone(),
            })
        };
        let frames = model.link_poses(&vec![0.0; model.joints.len()]);
        let front = |joint: usize| {
            let joint = &model.joints[joint];
            let frame = robot.tree.root_from_body.inv_mul(&frames[joint.child]);
            (frame, frame * joint.axis.into_inner())
        };
        let ([left, right], casters) = (model.roles.wheels, model.roles.casters);
        let ball = |joint: usize| {
            let link = tag(BodyRef::Link(model.joints[joint].child));
            let all = physics.colliders.iter();
            let mut balls =
                all.filter(|(_, c)| c.user_data == link && c.shape().as_ball().is_some());
            balls.next().map(|(handle, _)| handle)
        };
        let drive = &model.settings.drive;
        Ok(Self {
            balls: [left, right, casters[0], casters[1]].map(ball),
            wheel_friction: drive.wheel_friction,
            tyre_resistance: drive.tyre_rolling_resistance,
            front_resistance: drive.caster_rolling_resistance,
            angles: [0.0; 4],
            led: [0.0; 2],
            rolling: [0.0; 2],
            joints: [left, right, casters[0], casters[1]],
            driven: [body(left)?, body(right)?],
            front: casters.map(front),
            radius: drive.wheel_radius,
        })
    }

    /// Advances the reference of the driven wheels by a tick at the commanded rates,
    /// rad/s, at most `leash` rad ahead of their angle. Returns the lead, rad: a wheel
    /// commanded to stop is held in place like with a brake.
    pub(super) fn lead(&mut self, rates: [f64; 2], dt: f64, leash: f64) -> [f64; 2] {
        std::array::from_fn(|i| {
            let lead = self.led[i] + rates[i] * dt - self.angles[i];
            let lead = exact::within(lead, -leash, leash);
            self.led[i] = self.angles[i] + lead;
            lead
        })
    }

    /// Load of each wheel on the floor in the last tick, N.
    pub(super) fn loads(&self, physics: &PhysicsWorld) -> [f64; 4] {
        let dt = f64::from(physics.integration_parameters.dt);
        self.balls.map(|ball| {
            let pairs = ball.into_iter();
            let pairs = pairs.flat_map(|ball| physics.narrow_phase.contact_pairs_with(ball));
            pairs
                .map(|pair| f64::from(health::impulse(pair)))
                .sum::<f64>()
                / dt
        })
    }

    /// Friction of the driven wheels under their loads.
    pub(super) fn friction(&self, physics: &PhysicsWorld) -> [Friction; 2] {
        let [left, right, ..] = self.loads(physics);
        [left, right].map(|load| Friction {
            dry: self.wheel_friction + self.tyre_resistance * load * self.radius,
            viscous: 0.0,
        })
    }

    /// Applies the rolling resistance of the front wheels for the coming tick.
    pub(super) fn begin_tick(&self, physics: &mut PhysicsWorld, robot: &RobotBody) {
        let [_, _, left, right] = self.loads(physics);
        let frame = robot.frame(physics, 0);
        let (linear, angular) = robot.root_velocity(physics);
        for ((root_from_wheel, _), load) in self.front.iter().zip([left, right]) {
            let arm = frame.rotation * root_from_wheel.translation.vector;
            let foot = arm - Vector3::z() * self.radius;
            let mut velocity = linear + angular.cross(&arm);
            velocity.z = 0.0;
            let pull = self.front_resistance * load / velocity.norm().max(CREEP);
            let point = frame.translation.vector + foot;
            let root = &mut physics.bodies[robot.handles[0]];
            root.add_force_at_point(vector(&(velocity * -pull)), vector(&point), true);
        }
    }

    /// The resistance lasts one tick.
    pub(super) fn end_tick(&self, physics: &mut PhysicsWorld, robot: &RobotBody) {
        let root = &mut physics.bodies[robot.handles[0]];
        root.reset_forces(false);
        root.reset_torques(false);
    }

    /// Counts the rotation of the wheels in the last tick.
    pub(super) fn roll(&mut self, physics: &PhysicsWorld, robot: &RobotBody) {
        for (angle, &body) in self.angles.iter_mut().zip(&self.driven) {
            let (now, _) = robot.joint_state(physics, body);
            *angle = now + ((*angle - now) / TAU).round() * TAU;
        }
        let dt = f64::from(physics.integration_parameters.dt);
        for i in 0..2 {
            let before = self.rolling[i];
            self.rolling[i] = self.front_speed(physics, robot, i);
            self.angles[2 + i] += (before + self.rolling[i]) / 2.0 * dt;
        }
    }

    /// Rate of a front wheel, rad/s: it rolls forward without slip.
    fn front_speed(&self, physics: &PhysicsWorld, robot: &RobotBody, i: usize) -> f64 {
        let (root_from_wheel, axis) = self.front[i];
        let turn = robot.frame(physics, 0).rotation;
        let (linear, angular) = robot.root_velocity(physics);
        let arm = turn * root_from_wheel.translation.vector;
        let forward = turn * axis.cross(&Vector3::z());
        (linear + angular.cross(&arm)).dot(&forward) / self.radius
    }

    /// Removes whole turns from the engine's angles of the driven wheels.
    pub(super) fn take_turns_out(&self, physics: &mut PhysicsWorld, robot: &RobotBody) {
        for &body in &self.driven {
            robot.take_turns_out(physics, body);
        }
    }

    /// Writes positions of all wheels and velocities of the front ones.
    pub(super) fn write(&self, states: &mut [JointState]) {
        for (i, &joint) in self.joints.iter().enumerate() {
            states[joint].position = self.angles[i];
            if i >= 2 {
                states[joint].velocity = self.rolling[i - 2];
            }
        }
    }
}
