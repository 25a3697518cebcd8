//! The motors: what turns `Targets` into torques.
//!
//! Every motor is a spring and a damper. The spring pulls towards a reference
//! that moves on during the tick, and is taken at the tick's middle: towards a
//! point that stands still for a tick and then jumps, four substeps would feel
//! a saw tooth of force, and light joints shiver at 240 Hz by a tenth of their
//! speed. Gravity is compensated by a torque at each arm joint; the
//! compensation knows the arm and the gripper, not what it holds.
//!
//! Of the arm, the dampers are part of the multibody's dynamics, which are
//! solved exactly, and the rest of a motor's torque is constant over a tick: the
//! engine's iterations over constraints would leave a fifth of a newton metre
//! of joints whose axes are nearly parallel. Wheels and cranks, which drive
//! against contacts up to a cap, are solved with the contacts.

use nalgebra::Vector3;
use rapier3d::dynamics::MotorModel;
use rapier3d::prelude::{JointAxis, PhysicsWorld};
use wheelarm_proto::exact;

use super::WorldError;
use super::body::{RobotBody, Surface};
use super::convert::{from_vector, real, vector};
use super::wheels::Wheels;
use crate::robot::control::Targets;
use crate::robot::{ARM_JOINTS, RobotModel};

/// Gains of a driven wheel, N·m/rad and N·m·s/rad: the cap of 30 N·m is
/// reached 4 mm behind the led position or at an error of 0.04 m/s.
const WHEEL_STIFFNESS: f64 = 1000.0;
const WHEEL_DAMPING: f64 = 100.0;
/// Speed that a motor of the arm makes at the most, in units of its limit: the
/// servo asks for no more however far its joint is behind, as after a hand that
/// was held up slips off.
const ARM_OVERSPEED: f64 = 1.25;
/// Gains of each crank of the gripper, N·m/rad and N·m·s/rad: the cap of 60 N
/// is reached 0.02 rad behind the target; near critical damping with the armature.
const CRANK_STIFFNESS: f64 = 200.0;
const CRANK_DAMPING: f64 = 3.0;

/// Which body each motor moves, and how strongly.
#[derive(Clone, Debug)]
pub(super) struct Drives {
    wheels: [usize; 2],
    wheel_torque: f64,
    arm: [usize; 6],
    arm_gains: [Gains; 6],
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
    /// Speed that the motor itself makes at the most, rad/s.
    fastest: f64,
}

#[derive(Clone, Copy, Debug)]
struct Crank {
    body: usize,
    tip: usize,
    sign: f64,
}

/// What a joint is to do in the coming tick.
#[derive(Clone, Copy, Debug)]
struct Aim {
    /// Where it should be at the end of the tick, rad.
    position: f64,
    /// How fast it should move until then, rad/s.
    speed: f64,
    /// Torque that is there in any case, N·m.
    torque: f64,
}

/// What the wheels of a model are made of, for `RobotBody::insert`.
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
                fastest: ARM_OVERSPEED * model.joints[joint].limits.velocity,
            }
        });
        let carried = arm.map(|root| carried_by(robot, root));
        let [left, right] = roles.knuckles;
        let (left, right) = (body(left)?, body(right)?);
        let [left_tip, right_tip] = roles.finger_tips;
        Ok(Self {
            wheels: [body(roles.wheels[0])?, body(roles.wheels[1])?],
            wheel_torque: model.settings.drive.wheel_torque,
            arm,
            arm_gains,
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
            max_pad_force: model.settings.gripper.max_force,
        })
    }

    /// Whether the joint of a body is one of the arm's.
    pub(super) fn moves_arm(&self, body: usize) -> bool {
        self.arm.contains(&body)
    }

    /// Puts the dampers of the arm into the dynamics, once.
    pub(super) fn insert_dampers(&self, physics: &mut PhysicsWorld, robot: &RobotBody) {
        let dt = f64::from(physics.integration_parameters.dt);
        for (&body, gains) in self.arm.iter().zip(&self.arm_gains) {
            robot.set_damping(physics, body, gains.effective_damping(dt));
        }
    }

    /// Sets all motors for the coming tick.
    pub(super) fn drive(
        &self,
        physics: &mut PhysicsWorld,
        robot: &RobotBody,
        wheels: &mut Wheels,
        targets: &Targets,
    ) {
        let gains = Gains {
            stiffness: WHEEL_STIFFNESS,
            damping: WHEEL_DAMPING,
            torque: self.wheel_torque,
            fastest: f64::INFINITY,
        };
        let dt = f64::from(physics.integration_parameters.dt);
        let leads = wheels.lead(targets.wheel_velocity, dt, gains.torque / gains.stiffness);
        let wheels = self.wheels.into_iter().zip(leads);
        for ((wheel, lead), speed) in wheels.zip(targets.wheel_velocity) {
            let (angle, _) = robot.joint_state(physics, wheel);
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
            set_push(physics, robot, self.arm[i], aim, self.arm_gains[i]);
        }
        let force = exact::within(targets.pad_force, 0.0, self.max_pad_force);
        for crank in self.cranks {
            let gains = Gains {
                stiffness: CRANK_STIFFNESS,
                damping: CRANK_DAMPING,
                torque: force * self.lever(physics, robot, crank),
                fastest: f64::INFINITY,
            };
            let aim = Aim {
                position: crank.sign * targets.knuckle_position,
                speed: crank.sign * targets.knuckle_velocity,
                torque: 0.0,
            };
            set_motor(physics, robot, crank.body, aim, gains);
        }
    }

    /// Torque that holds an arm joint against the weight of what it carries of the robot, N·m.
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
                // The engine's own centre of mass is there from the first tick on.
                let mass = &robot.tree.bodies[b].mass;
                let com = (robot.frame(physics, b) * mass.com).coords;
                (com - pivot).cross(&(gravity * mass.mass))
            })
            .sum();
        -axis.dot(&moment)
    }

    /// How far a pad closes per radian of its crank, metres: the height of the
    /// finger tip's pivot above the crank's, along the hand.
    fn lever(&self, physics: &PhysicsWorld, robot: &RobotBody, crank: Crank) -> f64 {
        let hand = &physics.bodies[robot.handles[self.hand]];
        let approach = hand.rotation() * self.approach(robot);
        let rise = physics.bodies[robot.handles[crank.tip]].translation()
            - physics.bodies[robot.handles[crank.body]].translation();
        f64::from(rise.dot(approach)).abs()
    }

    /// Direction in which the hand points, in its body's frame.
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
    /// The motor's law over the coming tick of a joint at `now`, rad, as a torque
    /// at velocity 0, N·m, and a damping, N·m·s/rad. Averaged over the tick, the
    /// torque is
    /// stiffness · (reference - position) + damping · (speed - velocity) + torque,
    /// where the reference arrives at the aim's position with the tick's end.
    ///
    /// With e the distance to the reference at the begin and v the velocity, the
    /// spring's mean is stiffness · (e + (speed - v) · dt / 2): a constant and a
    /// part that damps. The two are never worth more than the gains' fastest speed.
    fn law(&self, now: f64, gains: Gains, dt: f64) -> (f64, f64) {
        let behind = self.position - self.speed * dt - now;
        let damping = gains.effective_damping(dt);
        let most = damping * gains.fastest;
        let drive = gains.stiffness * behind + damping * self.speed;
        (exact::within(drive, -most, most) + self.torque, damping)
    }
}

impl Gains {
    /// What damps in the mean over a tick of `dt` seconds, N·m·s/rad.
    fn effective_damping(&self, dt: f64) -> f64 {
        self.damping + self.stiffness * dt / 2.0
    }
}

/// Sets a motor that is solved with the contacts, within its cap.
fn set_motor(physics: &mut PhysicsWorld, robot: &RobotBody, body: usize, aim: Aim, gains: Gains) {
    let dt = f64::from(physics.integration_parameters.dt);
    let (now, _) = robot.joint_state(physics, body);
    let (torque, damping) = aim.law(now, gains, dt);
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

/// Sets a motor whose damper is part of the dynamics. Its torque at the begin of
/// the tick, with the damper, is within the cap; what drives the joint faster
/// than the motor itself can is braked beyond the cap, in proportion to the
/// excess, as a motor does whose induced voltage is above its supply's.
///
/// A torque that does not depend on velocity is, to the engine, a motor that
/// wants to be far faster than its force allows; then its damping does nothing.
/// It tells what is not in the dynamics of one substep: how much more the joint
/// resists over the whole tick, which soft contact goes by.
fn set_push(physics: &mut PhysicsWorld, robot: &RobotBody, body: usize, aim: Aim, gains: Gains) {
    const FAR_FASTER: f64 = 1e4;
    const OTHER_SUBSTEPS: f64 = 0.75;
    let dt = f64::from(physics.integration_parameters.dt);
    let (now, velocity) = robot.joint_state(physics, body);
    let (torque, damping) = aim.law(now, gains, dt);
    let resisted = damping * velocity;
    let cap = gains.torque;
    let brake = damping * (velocity.abs() - gains.fastest).max(0.0);
    let (least, most) = if velocity > 0.0 {
        (-cap - brake, cap)
    } else {
        (-cap, cap + brake)
    };
    let push = resisted + exact::within(torque - resisted, least, most);
    let Some(joint) = robot.joint_mut(physics, body) else {
        return;
    };
    joint.set_motor_model(JointAxis::AngX, MotorModel::ForceBased);
    let speed = FAR_FASTER.copysign(push);
    let rest = OTHER_SUBSTEPS * damping;
    joint.set_motor(JointAxis::AngX, 0.0, real(speed), 0.0, real(rest));
    joint.set_motor_max_force(JointAxis::AngX, real(push.abs()));
}

/// Mean torque, N·m, of the drive of the joint that moves a body, over a tick in
/// which the joint moved at a mean velocity, rad/s; 0 where there is no drive.
/// The engine does not report it; this is its law.
pub(super) fn torque(physics: &PhysicsWorld, robot: &RobotBody, body: usize, velocity: f64) -> f64 {
    let Some(motor) = robot
        .joint(physics, body)
        .and_then(|data| data.motor(JointAxis::AngX))
    else {
        return 0.0;
    };
    let cap = f64::from(motor.max_force);
    let damping = robot.damping(physics, body);
    let torque = if damping > 0.0 {
        cap.copysign(f64::from(motor.target_vel)) - damping * velocity
    } else {
        let pull = f64::from(motor.damping) * (f64::from(motor.target_vel) - velocity);
        exact::within(pull, -cap, cap)
    };
    if torque.is_finite() { torque } else { 0.0 }
}
