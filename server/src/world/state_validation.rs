//! Validation of a saved state, body by body, before any part is used: input may be
//! untrusted or damaged.

use nalgebra::Vector3;
use rapier3d::dynamics::{GenericJoint, JointMotor};
use rapier3d::prelude::{Collider, ColliderSet, JointAxesMask, PhysicsWorld, RigidBody};

use super::health::{STORED_ANGLE, STORED_SPEED, stored_problem, within};
use super::state::DecodedState;
use super::{WILD, World};
use crate::snapshot::BodyRef;

/// Largest force on the person, N.
const STORED_FORCE: f64 = 1e6;
/// Largest number of contacts of the person.
const MOST_TOUCHES: usize = 1000;
/// Largest angle of a wheel, rad.
const MOST_TURNED: f64 = 1e9;

impl World {
    /// Validates a state that was decoded for this world.
    ///
    /// # Errors
    /// With a description of the problem.
    pub(super) fn examine(&self, read: &DecodedState) -> Result<(), String> {
        let t = &read.targets;
        let targets = t.arm_position.iter().chain(&t.arm_velocity);
        let targets = targets.chain(&t.wheel_velocity).chain([
            &t.knuckle_position,
            &t.knuckle_velocity,
            &t.pad_force,
        ]);
        within("a target of the drives", targets, WILD)?;
        let wheels = read.wheel_angles.iter().chain(&read.wheel_leads);
        within("the angle of a wheel", wheels, MOST_TURNED)?;
        let signals: Vec<f64> = read.signals.numbers().chain(read.wheel_rates).collect();
        within("the sensor of a joint", &signals, WILD)?;
        if let Some(person) = &read.person {
            let forces = person.forces.iter().chain([&person.robot_force]);
            let touches = person.touches.iter();
            let forces = forces.chain(touches.flat_map(|touch| [&touch.force, &touch.weight]));
            within("a force on the person", forces, STORED_FORCE)?;
            if person.touches.len() > MOST_TOUCHES {
                return Err(format!("more than {MOST_TOUCHES} bodies touch the person"));
            }
        }
        for (soft, saved) in self.soft.iter().zip(&read.soft) {
            soft.examine(saved)?;
        }
        let bits = |x: u32| f64::from(f32::from_bits(x));
        let bristles: Vec<f64> = read.bristles.bits().map(bits).collect();
        within("a bristle", &bristles, STORED_SPEED)?;
        self.examine_engine(&read.physics)
    }

    fn examine_engine(&self, read: &PhysicsWorld) -> Result<(), String> {
        let own = &self.physics;
        if read.gravity != own.gravity || read.integration_parameters != own.integration_parameters
        {
            return Err("the settings of the engine differ from this server's".to_owned());
        }
        for ((handle, ours), (_, theirs)) in own.bodies.iter().zip(read.bodies.iter()) {
            let name = || self.label(self.name_of(handle));
            if !same_kind(ours, theirs) {
                return Err(format!("{} has a different mass or type", name()));
            }
            let t = theirs.translation();
            let place = Vector3::new(t.x, t.y, t.z).cast();
            if let Some(problem) = stored_problem(theirs, &place) {
                return Err(format!("{} {problem}", name()));
            }
            if theirs.colliders() != ours.colliders() {
                return Err(format!("{} has different shapes", name()));
            }
        }
        for ((handle, ours), (_, theirs)) in own.colliders.iter().zip(read.colliders.iter()) {
            let person = self.seated.as_ref().is_some_and(|s| s.moves(handle));
            let moves = person || self.robot.moves(handle);
            if !same_shape(ours, theirs, moves) {
                let body = super::contact::body_of(ours.user_data);
                return Err(format!("a shape of {} is different", self.label(body)));
            }
        }
        let (ours, theirs) = (own.impulse_joints.iter(), read.impulse_joints.iter());
        let same = own.impulse_joints.len() == read.impulse_joints.len()
            && ours.zip(theirs).all(|((h1, a), (h2, b))| {
                h1 == h2
                    && (a.body1(), a.body2()) == (b.body1(), b.body2())
                    && still(&a.data) == still(&b.data)
            });
        if !same {
            return Err("a joint of the furniture is different".to_owned());
        }
        self.examine_robot(read)?;
        let pairs = read.narrow_phase.contact_pairs();
        let mut ends = pairs.flat_map(|pair| [pair.collider1, pair.collider2]);
        if ends.any(|collider| !collider_exists(&own.colliders, collider)) {
            return Err("a contact refers to an unknown shape".to_owned());
        }
        Ok(())
    }

    fn examine_robot(&self, read: &PhysicsWorld) -> Result<(), String> {
        let own = self.physics.multibody_joints.multibodies();
        let own: Vec<_> = own.collect();
        let theirs: Vec<_> = read.multibody_joints.multibodies().collect();
        if own.len() != theirs.len() {
            return Err(format!("{} robots, expected {}", theirs.len(), own.len()));
        }
        for (ours, theirs) in own.into_iter().zip(theirs) {
            if (ours.num_links(), ours.ndofs()) != (theirs.num_links(), theirs.ndofs())
                || theirs.generalized_velocity().len() != ours.generalized_velocity().len()
            {
                return Err("the robot has different joints".to_owned());
            }
            let velocities = theirs.generalized_velocity();
            let velocities: Vec<f64> = velocities.iter().map(|v| f64::from(*v)).collect();
            within("a joint velocity", &velocities, STORED_SPEED)?;
            for (a, b) in ours.links().zip(theirs.links()) {
                if a.rigid_body_handle() != b.rigid_body_handle()
                    || a.parent_id() != b.parent_id()
                    || a.assembly_id() != b.assembly_id()
                    || a.joint().ndofs() != b.joint().ndofs()
                    || undriven(&a.joint().data) != undriven(&b.joint().data)
                {
                    return Err("a joint of the robot is different".to_owned());
                }
                let motors = b.joint().data.motors.iter();
                let motors = motors.flat_map(|m| {
                    [
                        m.target_pos,
                        m.target_vel,
                        m.stiffness,
                        m.damping,
                        m.max_force,
                    ]
                });
                let motors: Vec<f64> = motors.map(f64::from).collect();
                within("a motor", &motors, f64::from(f32::MAX))?;
                let coords = b.joint().coords();
                let coords: Vec<f64> = (0..6).map(|i| f64::from(coords[i])).collect();
                within("a joint position", &coords, STORED_ANGLE)?;
            }
        }
        Ok(())
    }

    /// Description of a body; the world has names only for the robot.
    fn label(&self, body: BodyRef) -> String {
        match body {
            BodyRef::Link(link) => self.model.links.get(link).map_or_else(
                || "a link of the robot".to_owned(),
                |link| format!("the link {:?}", link.name),
            ),
            BodyRef::Object(object) => format!("object number {}", object + 1),
            BodyRef::Furniture(body) => format!("piece of furniture number {}", body + 1),
            BodyRef::Person(_) => "the person".to_owned(),
        }
    }
}

fn same_kind(a: &RigidBody, b: &RigidBody) -> bool {
    a.body_type() == b.body_type()
        // The engine disables non-finite bodies: one of the present world may be
        // disabled, one of a good state never.
        && (b.is_enabled() || !a.is_enabled())
        // The total is computed in the first tick.
        && a.mass_properties().additional_local_mprops
            == b.mass_properties().additional_local_mprops
        && (0.0..=f32::MAX).contains(&b.mass())
        && a.linear_damping() == b.linear_damping()
        && a.angular_damping() == b.angular_damping()
        && a.gravity_scale() == b.gravity_scale()
        && a.locked_axes() == b.locked_axes()
        && a.dominance_group() == b.dominance_group()
        && a.is_ccd_enabled() == b.is_ccd_enabled()
        && a.additional_solver_iterations() == b.additional_solver_iterations()
}

/// Whether it is the same shape at the same pose, unless it `moves` on its body.
fn same_shape(a: &Collider, b: &Collider, moves: bool) -> bool {
    let (box_a, box_b) = (
        a.shape().compute_local_aabb(),
        b.shape().compute_local_aabb(),
    );
    a.parent() == b.parent()
        && a.user_data == b.user_data
        && a.collision_groups() == b.collision_groups()
        && (moves || a.position_wrt_parent() == b.position_wrt_parent())
        && b.position_wrt_parent()
            .is_none_or(|place| place.is_finite())
        && a.friction() == b.friction()
        && a.restitution() == b.restitution()
        && a.shape().shape_type() == b.shape().shape_type()
        && (box_a.mins, box_a.maxs) == (box_b.mins, box_b.maxs)
        && b.position().is_finite()
}

/// A joint without the impulses of the last tick.
fn still(joint: &GenericJoint) -> GenericJoint {
    let mut still = *joint;
    for limits in &mut still.limits {
        limits.impulse = 0.0;
    }
    for motor in &mut still.motors {
        motor.impulse = 0.0;
    }
    still
}

/// A joint without its motors, which every tick sets again.
fn undriven(joint: &GenericJoint) -> GenericJoint {
    GenericJoint {
        motors: [JointMotor::default(); 6],
        motor_axes: JointAxesMask::empty(),
        ..still(joint)
    }
}

fn collider_exists(colliders: &ColliderSet, handle: rapier3d::geometry::ColliderHandle) -> bool {
    colliders.get(handle).is_some()
}
