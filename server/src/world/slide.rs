//! Furniture that slides: a body on a prismatic joint with dry and viscous friction.
//!
//! The joint's motor holds with at most the dry friction; the viscous part is the
//! body's own damping. Limits are hard stops.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use rapier3d::dynamics::MotorModel;
use rapier3d::prelude::{
    GenericJointBuilder, JointAxesMask, JointAxis, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};

use super::convert::{from_pose, from_vector, mass_properties, pose, real};
use super::mass::Mass;
use crate::scene::{Body, FurnitureJoint};
use crate::snapshot::JointState;

/// Force per speed at which dry friction sets in, N·s/m: fully developed from 1.6 mm/s
/// on at the 8 N of a stiff drawer.
const STICTION: f64 = 5000.0;

/// Initial pose of the body: at position 0 with the exact bits of its rest pose.
fn started(joint: &FurnitureJoint, rest: &Isometry3<f64>) -> Isometry3<f64> {
    if joint.start == 0.0 {
        return *rest;
    }
    Translation3::from(joint.axis.scale(joint.start)) * rest
}

/// One piece of furniture on its joint.
#[derive(Clone, Debug)]
pub(super) struct Slide {
    /// Engine body.
    pub handle: RigidBodyHandle,
    /// world_from_body at joint position 0.
    rest: Isometry3<f64>,
    axis: Unit<Vector3<f64>>,
}

impl Slide {
    /// The moving body, not yet joined.
    pub(super) fn body(joint: &FurnitureJoint, body: &Body) -> RigidBodyBuilder {
        let mass = Mass {
            mass: joint.mass.mass,
            com: joint.mass.com,
            inertia: joint.mass.inertia,
        };
        RigidBodyBuilder::dynamic()
            .pose(pose(&started(joint, &body.pose)))
            .can_sleep(true)
            .linear_damping(real(joint.resistance.damping / joint.mass.mass))
            .additional_mass_properties(mass_properties(&mass))
    }

    /// Joins the body to its housing.
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
        let data = GenericJointBuilder::new(JointAxesMask::LOCKED_PRISMATIC_AXES)
            .local_frame1(pose(&(carrier_pose.inverse() * rest * body_from_frame)))
            .local_frame2(pose(&body_from_frame))
            .limits(JointAxis::LinX, [0.0, real(joint.travel)])
            .motor_model(JointAxis::LinX, MotorModel::ForceBased)
            .motor_velocity(JointAxis::LinX, 0.0, real(STICTION))
            .motor_max_force(JointAxis::LinX, real(joint.resistance.friction))
            .contacts_enabled(false);
        physics.insert_impulse_joint(carrier, handle, data.build());
        Self {
            handle,
            rest: *rest,
            axis: joint.axis,
        }
    }

    /// Joint position and velocity, metres and m/s.
    pub(super) fn state(&self, physics: &PhysicsWorld) -> JointState {
        let body = &physics.bodies[self.handle];
        let moved = from_pose(body.position()).translation.vector - self.rest.translation.vector;
        JointState {
            position: moved.dot(&self.axis),
            velocity: from_vector(body.linvel()).dot(&self.axis),
            effort: 0.0,
        }
    }
}
