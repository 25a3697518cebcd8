//! Furniture on a joint: a body that slides or turns with dry and viscous friction.
//!
//! The joint's motor holds with at most the dry friction; the viscous part is the
//! body's own damping. Limits are hard stops.

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};
use rapier3d::dynamics::MotorModel;
use rapier3d::prelude::{
    GenericJointBuilder, JointAxesMask, JointAxis, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};
use wheelarm_proto::exact;
use wheelarm_proto::furniture::JointMotion;

use super::convert::{from_pose, from_vector, mass_properties, pose, real};
use super::mass::Mass;
use crate::scene::{Body, FurnitureJoint, MassProperties};
use crate::snapshot::JointState;

/// Force per speed at which dry friction sets in, N·s/m: fully developed from 1.6 mm/s
/// on at the 8 N of a stiff drawer.
const STICTION: f64 = 5000.0;
/// The same of a hinge, N·m·s: at 1 N·m fully developed from 5 mrad/s on, 2 mm/s at the
/// handle of a cabinet door.
const TURN_STICTION: f64 = 200.0;

/// Initial pose of the body: at position 0 with the exact bits of its rest pose.
fn started(joint: &FurnitureJoint, rest: &Isometry3<f64>) -> Isometry3<f64> {
    if joint.start == 0.0 {
        return *rest;
    }
    joint.pose(rest, joint.start)
}

/// Moment of inertia about an axis through the origin of the body, kg·m²; `axis` is in
/// the body's frame.
fn inertia_about(axis: &Vector3<f64>, mass: &MassProperties) -> f64 {
    let com = mass.com.coords;
    let arm = com - axis * com.dot(axis);
    axis.dot(&(mass.inertia * axis)) + mass.mass * arm.norm_squared()
}

/// One piece of furniture on its joint.
#[derive(Clone, Debug)]
pub(super) struct MovingFurniture {
    /// Engine body.
    pub handle: RigidBodyHandle,
    /// world_from_body at joint position 0.
    rest: Isometry3<f64>,
    motion: JointMotion,
    axis: Unit<Vector3<f64>>,
}

impl MovingFurniture {
    /// The moving body, not yet joined.
    pub(super) fn body(joint: &FurnitureJoint, body: &Body) -> RigidBodyBuilder {
        let mass = Mass {
            mass: joint.mass.mass,
            com: joint.mass.com,
            inertia: joint.mass.inertia,
        };
        let builder = RigidBodyBuilder::dynamic()
            .pose(pose(&started(joint, &body.pose)))
            .can_sleep(true)
            .additional_mass_properties(mass_properties(&mass));
        match joint.motion {
            JointMotion::Slides => {
                builder.linear_damping(real(joint.resistance.damping / joint.mass.mass))
            }
            // Both dampings with one rate brake the turn about the hinge with that rate.
            JointMotion::Turns => {
                let axis = body.pose.rotation.inverse() * joint.axis.into_inner();
                let rate = real(joint.resistance.damping / inertia_about(&axis, &joint.mass));
                builder.linear_damping(rate).angular_damping(rate)
            }
        }
    }

    /// Joins the body to its carrier.
    pub(super) fn insert(
        physics: &mut PhysicsWorld,
        joint: &FurnitureJoint,
        (carrier, carrier_pose): (RigidBodyHandle, &Isometry3<f64>),
        (handle, rest): (RigidBodyHandle, &Isometry3<f64>),
    ) -> Self {
        let along =
            UnitQuaternion::rotation_between(&Vector3::x(), &joint.axis).unwrap_or_else(|| {
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI)
            });
        let body_from_frame = Isometry3::from_parts(
            nalgebra::Translation3::identity(),
            rest.rotation.inverse() * along,
        );
        let (locked, free, stiction) = match joint.motion {
            JointMotion::Slides => (
                JointAxesMask::LOCKED_PRISMATIC_AXES,
                JointAxis::LinX,
                STICTION,
            ),
            JointMotion::Turns => (
                JointAxesMask::LOCKED_REVOLUTE_AXES,
                JointAxis::AngX,
                TURN_STICTION,
            ),
        };
        let data = GenericJointBuilder::new(locked)
            .local_frame1(pose(&(carrier_pose.inverse() * rest * body_from_frame)))
            .local_frame2(pose(&body_from_frame))
            .limits(free, [0.0, real(joint.travel)])
            .motor_model(free, MotorModel::ForceBased)
            .motor_velocity(free, 0.0, real(stiction))
            .motor_max_force(free, real(joint.resistance.friction))
            .contacts_enabled(false);
        physics.insert_impulse_joint(carrier, handle, data.build());
        Self {
            handle,
            rest: *rest,
            motion: joint.motion,
            axis: joint.axis,
        }
    }

    /// Joint position and velocity, metres and m/s, or radians and rad/s.
    pub(super) fn state(&self, physics: &PhysicsWorld) -> JointState {
        let body = &physics.bodies[self.handle];
        let now = from_pose(body.position());
        let (position, velocity) = match self.motion {
            JointMotion::Slides => {
                let moved = now.translation.vector - self.rest.translation.vector;
                (
                    moved.dot(&self.axis),
                    from_vector(body.linvel()).dot(&self.axis),
                )
            }
            JointMotion::Turns => {
                let turn = now.rotation * self.rest.rotation.inverse();
                let half = exact::atan2(turn.imag().dot(&self.axis), turn.scalar());
                // A quaternion and its negative are the same turn.
                let angle = match 2.0 * half {
                    angle if angle > std::f64::consts::PI => angle - std::f64::consts::TAU,
                    angle if angle < -std::f64::consts::PI => angle + std::f64::consts::TAU,
                    angle => angle,
                };
                (angle, from_vector(body.angvel()).dot(&self.axis))
            }
        };
        JointState {
            position,
            velocity,
            effort: 0.0,
        }
    }
}
