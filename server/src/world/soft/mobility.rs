//! Mobility of the engine's bodies: velocity change per impulse.

use nalgebra::{DMatrix, Matrix6, SMatrix, Vector3};
use rapier3d::dynamics::Multibody;
use rapier3d::prelude::{JointAxis, PhysicsWorld, RigidBody, RigidBodyHandle};
use rapier3d::utils::AngularInertiaOps as _;

use super::super::convert::from_vector;
use super::contact_force::Mobility;

/// Computes the mobility of bodies, each once per tick.
pub(super) struct Mobilities<'a> {
    physics: &'a PhysicsWorld,
    found: Vec<Option<RigidBodyHandle>>,
    /// Inverse of the mass matrix of the single multibody.
    articulated: Option<Option<DMatrix<f64>>>,
}

impl<'a> Mobilities<'a> {
    pub(super) fn new(physics: &'a PhysicsWorld) -> Self {
        Self {
            physics,
            found: Vec::new(),
            articulated: None,
        }
    }

    /// Index of a body among the touched ones; a new one gets its mobility.
    pub(super) fn number(
        &mut self,
        body: Option<RigidBodyHandle>,
        solids: &mut Vec<Mobility>,
    ) -> usize {
        if let Some(number) = self.found.iter().position(|found| *found == body) {
            return number;
        }
        self.found.push(body);
        solids.push(self.mobility(body));
        self.found.len() - 1
    }

    fn mobility(&mut self, handle: Option<RigidBodyHandle>) -> Mobility {
        let body = handle.and_then(|handle| self.physics.bodies.get(handle));
        let centre = body.map_or_else(Vector3::zeros, |b| from_vector(b.center_of_mass()));
        let inverse = match (handle, body) {
            (Some(handle), Some(body)) if body.is_dynamic() => {
                match self.physics.multibody_joints.rigid_body_link(handle) {
                    Some(link) => self
                        .physics
                        .multibody_joints
                        .get_multibody(link.multibody)
                        .and_then(|multibody| self.of_link(multibody, link.id)),
                    None => Some(of_free(body)),
                }
            }
            _ => None,
        };
        Mobility { centre, inverse }
    }

    /// `J A⁻¹ Jᵀ` with the Jacobian of the link's centre of mass.
    fn of_link(&mut self, multibody: &Multibody, link: usize) -> Option<Matrix6<f64>> {
        let dt = f64::from(self.physics.integration_parameters.dt);
        let inverse = self
            .articulated
            .get_or_insert_with(|| inverse_mass(multibody, dt))
            .as_ref()?;
        let jacobian = multibody.body_jacobian(link).map(f64::from);
        if jacobian.ncols() != inverse.nrows() {
            return None;
        }
        let moved = &jacobian * inverse * jacobian.transpose();
        Some(moved.fixed_view::<6, 6>(0, 0).into_owned())
    }
}

/// Inverse of the mass matrix with armatures and the motors' resistance over a tick of
/// `dt` seconds; `None` before the engine's first tick.
fn inverse_mass(multibody: &Multibody, dt: f64) -> Option<DMatrix<f64>> {
    let mut mass = multibody.augmented_mass()?.map(f64::from);
    if mass.nrows() == 0 {
        return None;
    }
    for link in multibody.links() {
        let dof = link.assembly_id();
        if let Some(motor) = link.joint().data.motor(JointAxis::AngX)
            && link.joint().ndofs() == 1
        {
            let (stiffness, damping) = (f64::from(motor.stiffness), f64::from(motor.damping));
            mass[(dof, dof)] += dt * (damping + dt * stiffness);
        }
    }
    mass.try_inverse()
}

fn of_free(body: &RigidBody) -> Matrix6<f64> {
    let properties = body.mass_properties();
    let mut inverse: SMatrix<f64, 6, 6> = Matrix6::zeros();
    let linear = from_vector(properties.effective_inv_mass);
    let angular = properties.effective_world_inv_inertia.into_matrix();
    for i in 0..3 {
        inverse[(i, i)] = linear[i];
        for j in 0..3 {
            inverse[(3 + i, 3 + j)] = f64::from(angular.col(j)[i]);
        }
    }
    inverse
}
