//! The motors: convert `Targets` to torques.
//!
//! Every motor is a spring and a damper. The spring pulls towards a reference that
//! moves during the tick, evaluated at the tick's middle. With a fixed reference per
//! tick, four substeps would see a sawtooth force, and light joints would shiver at 240
//! Hz by a tenth of their speed. Gravity is compensated by a torque at each arm joint
//! for the arm and the gripper, not for a held object.
//!
//! The arm's dampers are part of the multibody's dynamics, which are solved exactly,
//! and the rest of a motor's torque is constant over a tick. The engine's constraint
//! iterations would leave an error of 0.2 N·m in joints with nearly parallel axes.
//! Wheels and cranks, which drive against contacts up to a cap, are solved with the
//! contacts.
//!
//! Friction of joints, gears and tyres is also a damper of the dynamics: dry friction
//! is its torque divided by the speed at the start of the tick, so it is solved exactly
//! at any speed and never reverses a joint. Below `friction::CREEP` it decreases
//! linearly.
//!
//! Efforts of the arm are the torque that the gear passes on to the link, without
//! friction. That is the torque of inverse dynamics, and of a torque sensor behind the
//! gear (assumption for the Gen3, whose actuators have torque sensors). Wheels and
//! gripper have no such sensor: their effort is the motor's torque, including friction.

use nalgebra::Vector3;
use rapier3d::dynamics::MotorModel;
use rapier3d::prelude::{JointAxis, PhysicsWorld};
use wheelarm_proto::exact;

use super::WorldError;
use super::body::{RobotBody, Surface};
use super::convert::{from_vector, real, vector};
use super::friction::Friction;
use super::health;
use super::wheels::Wheels;
use crate::robot::control::Targets;
use crate::robot::{ARM_JOINTS, RobotModel};

/// Body and strength of each motor.
#[derive(Clone, Debug)]
pub(super) struct Drives {
    wheels: [usize; 2],
    wheel_gains: Gains,
    arm: [usize; 6],
    arm_gains: [Gains; 6],
    arm_friction: [Friction; 6],
    /// Gains of each crank; the pads' force caps its torque.
    crank_gains: [f64; 2],
    crank_friction: Friction,
    /// Speed limit of the joint that moves each body, rad/s; infinite for wheels.
    limits: Vec<f64>,
    /// Bodies that each arm joint carries.
    carried: [Vec<usize>; 6],
    /// Left and right crank and finger tip, with the sign of their angle.
    cranks: [Crank; 2],
    hand: usize,
    max_pad_force: f64,
}

#[derive(Clone, Copy, Debug)]
struct Gains {
    stiffness: f64,
    damping: f64,
    torque: f64,
    /// Largest speed that the motor itself commands, rad/s, however large its error is,
    /// for example after a blocked hand slips free.
    fastest: f64,
}

#[derive(Clone, Copy, Debug)]
struct Crank {
    body: usize,
    tip: usize,
    sign: f64,
}

/// Set point of a joint for the coming tick.
#[derive(Clone, Copy, Debug)]
struct Aim {
    /// Position at the end of the tick, rad.
    position: f64,
    /// Speed until then, rad/s.
    speed: f64,
    /// Feed-forward torque, N·m.
    torque: f64,
}

/// Surface of a model's wheels, for `RobotBody::insert`.
pub(super) fn surface(model: &RobotModel, link: usize) -> Surface {
    let Some(joint) = link.checked_sub(1) else {
        return Surface::Shell;
    };
    if model.roles.wheels.contains(&joint) {
        Surface::Tyre
    } else if model.roles.casters.contains(&joint) {
        Surface::Roller
    } else {
        Surface::Shell
    }
}

impl Drives {
    /// Finds the joints by their roles.
    pub(super) fn new(model: &RobotModel, robot: &RobotBody) -> Result<Self, WorldError> {
        let roles = &model.roles;
        let body = |joint: usize| {
            robot
                .tree
                .body_moved_by(joint)
                .ok_or_else(|| WorldError::MissingJoint {
                    joint: model.joints[joint].name.clone(),
                })
        };
        let mut arm = [0; ARM_JOINTS];
        for (slot, joint) in arm.iter_mut().zip(roles.arm) {
            *slot = body(joint)?;
        }
        let arm_gains = std::array::from_fn(|i| {
            let joint = robot.tree.bodies[arm[i]].joint.map_or(0, |j| j.joint);
            Gains {
                stiffness: model.settings.arm.stiffness[i],
                damping: model.settings.arm.damping[i],
                torque: model.joints[joint].limits.effort,
                fastest: model.joints[joint].limits.velocity,
            }
        });
        let settings = &model.settings;
        let limit = |joint: usize| {
            let limit = model.joints[joint].limits.velocity;
            let rolls = roles.wheels.contains(&joint) || roles.casters.contains(&joint);
            if rolls || limit <= 0.0 {
                f64::INFINITY
            } else {
                limit
            }
        };
        let bodies = robot.tree.bodies.iter();
        let limits = bodies.map(|body| body.joint.map_or(f64::INFINITY, |j| limit(j.joint)));
        let carried = arm.map(|root| carried_by(robot, root));
        let [left, right] = roles.knuckles;
        let (left, right) = (body(left)?, body(right)?);
        let [left_tip, right_tip] = roles.finger_tips;
        Ok(Self {
            wheels: [body(roles.wheels[0])?, body(roles.wheels[1])?],
            wheel_gains: Gains {
                stiffness: settings.drive.wheel_stiffness,
                damping: settings.drive.wheel_damping,
                torque: settings.drive.wheel_torque,
                fastest: f64::INFINITY,
            },
            arm,
            arm_gains,
            arm_friction: std::array::from_fn(|i| Friction {
                dry: settings.arm.dry_friction[i],
                viscous: settings.arm.viscous_friction[i],
            }),
            crank_gains: [settings.gripper.stiffness, settings.gripper.damping],
            crank_friction: Friction {
                dry: 0.0,
                viscous: settings.gripper.viscous_friction,
            },
            limits: limits.collect(),
            carried,
            cranks: [
                Crank {
                    body: left,
                    tip: body(left_tip)?,
                    sign: 1.0,
                },
                Crank {
                    body: right,
                    tip: body(right_tip)?,
                    sign: -1.0,
                },
            ],
            hand: robot.tree.bodies[left].joint.map_or(0, |j| j.parent),
            max_pad_force: settings.gripper.max_force,
        })
    }

    /// Whether the joint of a body is one of the arm's.
    pub(super) fn moves_arm(&self, body: usize) -> bool {
        self.arm.contains(&body)
    }

    /// Sets all motors for the coming tick.
    pub(super) fn drive(
        &self,
        physics: &mut PhysicsWorld,
        robot: &RobotBody,
        wheels: &mut Wheels,
        targets: &Targets,
    ) {
        let gains = self.wheel_gains;
        let dt = f64::from(physics.integration_parameters.dt);
        let leads = wheels.lead(targets.wheel_velocity, dt, gains.torque / gains.stiffness);
        let friction = wheels.friction(physics);
        let wheels = self.wheels.into_iter().zip(leads).zip(friction);
        for (((wheel, lead), friction), speed) in wheels.zip(targets.wheel_velocity) {
            let (angle, velocity) = robot.joint_state(physics, wheel);
            robot.set_damping(physics, wheel, friction.damping(velocity));
            let aim = Aim {
                position: angle + lead,
                speed,
                torque: 0.0,
            };
            set_motor(physics, robot, wheel, aim, gains);
        }
        for i in 0..6 {
            let aim = Aim {
                position: targets.arm_position[i],
                speed: targets.arm_velocity[i],
                torque: self.gravity_torque(physics, robot, i),
            };
            let friction = self.arm_friction[i];
            set_push(
                physics,
                robot,
                self.arm[i],
                aim,
                self.arm_gains[i],
                friction,
            );
        }
        let force = exact::within(targets.pad_force, 0.0, self.max_pad_force);
        let [stiffness, damping] = self.crank_gains;
        for crank in self.cranks {
            let gains = Gains {
                stiffness,
                damping,
                torque: force * self.lever(physics, robot, crank),
                fastest: self.limits[crank.body],
            };
            let (_, velocity) = robot.joint_state(physics, crank.body);
            let friction = self.crank_friction.damping(velocity);
            robot.set_damping(physics, crank.body, friction);
            let aim = Aim {
                position: crank.sign * targets.knuckle_position,
                speed: crank.sign * targets.knuckle_velocity,
                torque: 0.0,
            };
            set_motor(physics, robot, crank.body, aim, gains);
        }
    }

    /// Speed limit of the joint that moves each body, rad/s.
    pub(super) fn limits(&self) -> &[f64] {
        &self.limits
    }

    /// Brakes joints that are driven beyond their speed limits, after the engine's
    /// tick. The drives closer to the base absorb the braking torque. A speed that
    /// breaks the state is left for `health` to detect.
    pub(super) fn brake(&self, physics: &mut PhysicsWorld, robot: &RobotBody) {
        for (body, &limit) in self.limits.iter().enumerate() {
            let (_, velocity) = robot.joint_state(physics, body);
            let broken = match self.moves_arm(body) {
                true => health::ARM_SPEED * limit,
                false => health::JOINT_SPEED,
            };
            if velocity.abs() > limit && velocity.abs() <= broken {
                robot.set_velocity(physics, body, limit.copysign(velocity));
            }
        }
    }

    /// Torque that holds an arm joint against the weight of the robot parts that it
    /// carries, N·m.
    fn gravity_torque(&self, physics: &PhysicsWorld, robot: &RobotBody, joint: usize) -> f64 {
        let body = self.arm[joint];
        let Some(data) = robot.joint(physics, body) else {
            return 0.0;
        };
        let engine_body = &physics.bodies[robot.handles[body]];
        let pivot = from_vector(
            engine_body
                .position()
                .transform_point(data.local_frame2.translation),
        );
        let axis = engine_body.rotation() * data.local_frame2.rotation * rapier3d::math::Vector::X;
        let axis = from_vector(axis);
        let gravity = from_vector(physics.gravity);
        let moment: Vector3<f64> = self.carried[joint]
            .iter()
            .map(|&b| {
                // The engine's centre of mass exists from the first tick on.
                let mass = &robot.tree.bodies[b].mass;
                let com = (robot.frame(physics, b) * mass.com).coords;
                (com - pivot).cross(&(gravity * mass.mass))
            })
            .sum();
        -axis.dot(&moment)
    }

    /// How far a pad closes per radian of its crank, metres: the height of the finger
    /// tip's pivot above the crank's, along the hand.
    fn lever(&self, physics: &PhysicsWorld, robot: &RobotBody, crank: Crank) -> f64 {
        let hand = &physics.bodies[robot.handles[self.hand]];
        let approach = hand.rotation() * self.approach(robot);
        let rise = physics.bodies[robot.handles[crank.tip]].translation()
            - physics.bodies[robot.handles[crank.body]].translation();
        f64::from(rise.dot(approach)).abs()
    }

    /// Direction of the hand in its body's frame.
    fn approach(&self, robot: &RobotBody) -> rapier3d::math::Vector {
        let turn = robot.tree.bodies[self.cranks[0].body]
            .joint
            .map_or_else(nalgebra::UnitQuaternion::identity, |j| j.origin.rotation);
        vector(&(turn * Vector3::z()))
    }
}

/// Bodies from `root` outwards.
fn carried_by(robot: &RobotBody, root: usize) -> Vec<usize> {
    let mut bodies = vec![root];
    for (index, body) in robot.tree.bodies.iter().enumerate().skip(root + 1) {
        if body.joint.is_some_and(|j| bodies.contains(&j.parent)) {
            bodies.push(index);
        }
    }
    bodies
}

impl Aim {
    /// Control law over the coming tick of a joint at `now`, rad, as a torque at
    /// velocity 0, N·m, and a damping, N·m·s/rad. Averaged over the tick, the
    /// torque is
    /// stiffness · (reference - position) + damping · (speed - velocity) + torque,
    /// where the reference reaches the aim's position at the end of the tick.
    ///
    /// With e the initial distance to the reference and v the velocity, the spring's mean
    /// is stiffness · (e + (speed - v) · dt / 2): a constant and a damping part. Their sum
    /// is limited to the gains' fastest speed against a friction, N·m·s/rad.
    fn law(&self, now: f64, gains: Gains, friction: f64, dt: f64) -> (f64, f64) {
        let behind = self.position - self.speed * dt - now;
        let damping = gains.effective_damping(dt);
        let most = (damping + friction) * gains.fastest;
        let drive = gains.stiffness * behind + damping * self.speed;
        (exact::within(drive, -most, most) + self.torque, damping)
    }
}

impl Gains {
    /// Mean damping over a tick of `dt` seconds, N·m·s/rad.
    fn effective_damping(&self, dt: f64) -> f64 {
        self.damping + self.stiffness * dt / 2.0
    }
}

/// Sets a motor that is solved with the contacts, within its cap.
fn set_motor(physics: &mut PhysicsWorld, robot: &RobotBody, body: usize, aim: Aim, gains: Gains) {
    let dt = f64::from(physics.integration_parameters.dt);
    let (now, _) = robot.joint_state(physics, body);
    let free = Gains {
        fastest: f64::INFINITY,
        ..gains
    };
    let (torque, damping) = aim.law(now, free, 0.0, dt);
    // With a large error the motor uses its full torque, limited by its fastest speed.
    let damping = damping.max(torque.abs() / gains.fastest);
    let Some(joint) = robot.joint_mut(physics, body) else {
        return;
    };
    joint.set_motor_model(JointAxis::AngX, MotorModel::ForceBased);
    joint.set_motor(
        JointAxis::AngX,
        0.0,
        real(torque / damping),
        0.0,
        real(damping),
    );
    joint.set_motor_max_force(JointAxis::AngX, real(gains.torque));
}

/// Sets a motor whose damper is part of the dynamics. Its torque at the start of the tick,
/// with the damper, is within the cap. A joint driven faster than the motor's own speed is
/// braked beyond the cap, in proportion to the excess, like a motor whose induced voltage
/// exceeds its supply.
///
/// In the engine, a torque that does not depend on velocity is a motor whose target speed
/// is far above what its force allows; its damping then has no effect. The damping is used
/// for the joint's additional resistance over the whole tick, for soft contact.
fn set_push(
    physics: &mut PhysicsWorld,
    robot: &RobotBody,
    body: usize,
    aim: Aim,
    gains: Gains,
    friction: Friction,
) {
    const OTHER_SUBSTEPS: f64 = 0.75;
    let dt = f64::from(physics.integration_parameters.dt);
    let (now, velocity) = robot.joint_state(physics, body);
    let friction = friction.damping(velocity);
    let (torque, damping) = aim.law(now, gains, friction, dt);
    let resisted = damping * velocity;
    let cap = gains.torque;
    let brake = damping * (velocity.abs() - gains.fastest).max(0.0);
    let (least, most) = if velocity > 0.0 {
        (-cap - brake, cap)
    } else {
        (-cap, cap + brake)
    };
    let push = resisted + exact::within(torque - resisted, least, most);
    robot.set_damping(physics, body, damping + friction);
    let Some(joint) = robot.joint_mut(physics, body) else {
        return;
    };
    joint.set_motor_model(JointAxis::AngX, MotorModel::ForceBased);
    let speed = FAR_FASTER.copysign(push);
    let rest = OTHER_SUBSTEPS * (damping + friction);
    joint.set_motor(JointAxis::AngX, 0.0, real(speed), 0.0, real(rest));
    joint.set_motor_max_force(JointAxis::AngX, real(push.abs()));
}

/// Speed command of an arm motor, rad/s: only its torque limit has an effect.
const FAR_FASTER: f64 = 1e4;

/// Mean torque, N·m, of the drive of the joint that moves a body, over a tick with a mean
/// velocity of `velocity`, rad/s; 0 without a drive. For the arm, friction is subtracted
/// (see the module). The engine does not report it; this is the control law.
pub(super) fn torque(physics: &PhysicsWorld, robot: &RobotBody, body: usize, velocity: f64) -> f64 {
    let Some(motor) = robot
        .joint(physics, body)
        .and_then(|data| data.motor(JointAxis::AngX))
    else {
        return 0.0;
    };
    let cap = f64::from(motor.max_force);
    let torque = if f64::from(motor.target_vel).abs() == FAR_FASTER {
        let damping = robot.damping(physics, body);
        cap.copysign(f64::from(motor.target_vel)) - damping * velocity
    } else {
        let pull = f64::from(motor.damping) * (f64::from(motor.target_vel) - velocity);
        exact::within(pull, -cap, cap)
    };
    if torque.is_finite() { torque } else { 0.0 }
}
