//! Plausibility checks of the state, with all thresholds.
//!
//! Two grades: a [`Fault`] breaks the state and stops the simulation; an [`Anomaly`] is
//! reported and the simulation continues. Thresholds of a fault are beyond all values
//! of sound runs: in 420 minutes of adversarial commands in the rigid home (physics
//! version 3) joints reached 19 rad/s, those of the arm 6, and contacts 25.5 kN.

use nalgebra::Vector3;
use rapier3d::geometry::PairContacts;
use rapier3d::prelude::{ContactPair, RigidBody, RigidBodyHandle};

use super::World;
use super::contact::body_of;
use super::convert::from_pose;
use crate::snapshot::{Anomaly, BodyRef, Fault, JointState};

/// Largest speed of an arm joint, in units of its limit.
pub const ARM_SPEED: f64 = 5.0;
/// Largest speed of any other joint of the robot, rad/s.
pub const JOINT_SPEED: f64 = 60.0;
/// Largest force between two bodies, N.
pub const CONTACT_FORCE: f64 = 30e3;
/// Largest speed of a node of a deformable, m/s.
pub const NODE_SPEED: f64 = 20.0;
/// Largest elastic and kinetic energy of a deformable, J.
pub const SOFT_ENERGY: f64 = 20.0;
/// Allowed height of the chair's frame relative to the floor, metres: higher it is
/// airborne, lower it has fallen off the floor.
pub const CHAIR_HEIGHT: [f64; 2] = [-0.5, 1.0];
/// Speed of a joint above which an anomaly is reported, in units of its limit.
pub const NOTED_SPEED: f64 = 2.0;

/// Largest distance of an object, metres. An object that fell off the floor reaches it
/// after seven minutes.
pub const FARTHEST: f64 = 1e6;
/// Largest speed of a body in a stored state, m/s and rad/s.
pub const STORED_SPEED: f64 = 1e4;
/// Largest angle of a joint in a stored state, rad.
pub const STORED_ANGLE: f64 = 1e4;
/// Largest deviation of the norm of a stored rotation from one.
pub const STORED_NORM: f64 = 1e-3;

/// Ticks between checks of the energy of deformables, which are expensive.
const ENERGY_TICKS: u64 = 4;

impl World {
    /// Why the state is broken; `None` when it is not.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.body_fault().or_else(|| self.fault_of_tick())
    }

    /// As [`World::fault`], between the ticks of a control tick, where the state is not
    /// visible: the check for finite numbers is left out, because they stay non-finite.
    /// A contact lasts no longer than its tick.
    #[must_use]
    pub fn fault_of_tick(&self) -> Option<Fault> {
        self.contact_fault()
            .or_else(|| self.joint_fault())
            .or_else(|| self.chair_fault())
            .or_else(|| self.soft_fault())
    }

    fn joint_fault(&self) -> Option<Fault> {
        self.robot
            .joint_velocities(&self.physics)
            .find_map(|(body, joint, speed)| {
                let most = if self.drives.moves_arm(body) {
                    ARM_SPEED * self.model.joints[joint].limits.velocity
                } else {
                    JOINT_SPEED
                };
                let speed = speed.abs();
                if speed <= most {
                    None
                } else if speed.is_finite() {
                    Some(Fault::JointSpeed { joint, speed, most })
                } else {
                    let link = self.model.joints[joint].child;
                    Some(Fault::NotFinite(BodyRef::Link(link)))
                }
            })
    }

    fn body_fault(&self) -> Option<Fault> {
        let bodies = self.physics.bodies.iter();
        let (handle, _) = bodies
            .filter(|(_, body)| !body.is_fixed() && !body.is_sleeping())
            .find(|(_, body)| !is_sound(body))?;
        Some(Fault::NotFinite(self.name_of(handle)))
    }

    fn chair_fault(&self) -> Option<Fault> {
        let root = self.physics.bodies.get(*self.robot.handles.first()?)?;
        let root_from_body = &self.robot.tree.root_from_body;
        let at = (from_pose(root.position()) * root_from_body.inverse())
            .translation
            .vector;
        (!self.scene_bodies.holds_chair(&at)).then_some(Fault::Outside { at })
    }

    fn contact_fault(&self) -> Option<Fault> {
        let dt = self.physics.integration_parameters.dt;
        let most = CONTACT_FORCE as f32 * dt;
        let mut pairs = self.physics.narrow_phase.contact_pairs();
        let hard = pairs.find(|pair| {
            let impulse = impulse(pair);
            impulse.is_nan() || impulse > most
        });
        if let Some(pair) = hard {
            let body = |collider| {
                let collider = self.physics.colliders.get(collider);
                collider.map_or(BodyRef::Furniture(0), |c| body_of(c.user_data))
            };
            return Some(Fault::Contact {
                first: body(pair.collider1),
                second: body(pair.collider2),
                force: f64::from(impulse(pair) / dt),
            });
        }
        let mut soft = self.soft.iter().flat_map(|soft| soft.contacts());
        soft.find_map(|contact| {
            let force = contact.force.norm();
            (force.is_nan() || force > CONTACT_FORCE).then_some(Fault::Contact {
                first: contact.first,
                second: contact.second,
                force,
            })
        })
    }

    fn soft_fault(&self) -> Option<Fault> {
        self.soft.iter().find_map(|soft| {
            let object = soft.object;
            if soft.is_broken() {
                return Some(Fault::NotFinite(BodyRef::Object(object)));
            }
            let speed = soft.fastest_node();
            if speed.is_nan() || speed > NODE_SPEED {
                return Some(Fault::NodeSpeed { object, speed });
            }
            if !self.tick.is_multiple_of(ENERGY_TICKS) || soft.is_asleep() {
                return None;
            }
            let energy = soft.energy();
            (energy.is_nan() || energy > SOFT_ENERGY).then_some(Fault::Energy { object, energy })
        })
    }

    /// The body of an engine body.
    pub(super) fn name_of(&self, handle: RigidBodyHandle) -> BodyRef {
        if let Some(body) = self.robot.handles.iter().position(|h| *h == handle) {
            return BodyRef::Link(self.robot.tree.bodies[body].link);
        }
        if let Some(object) = self.scene_bodies.objects.iter().position(|h| *h == handle) {
            return BodyRef::Object(object);
        }
        let body = self.physics.bodies.get(handle);
        let collider = body.and_then(|body| self.physics.colliders.get(*body.colliders().first()?));
        collider.map_or(BodyRef::Furniture(0), |c| body_of(c.user_data))
    }

    /// Sets the velocity of a robot joint, rad/s, for tests.
    #[cfg(test)]
    pub(crate) fn spin(&mut self, joint: usize, speed: f64) {
        if let Some(body) = self.robot.tree.body_moved_by(joint) {
            self.robot.set_velocity(&mut self.physics, body, speed);
        }
    }

    /// Disables an object, as the engine does with non-finite ones, for tests.
    #[cfg(test)]
    pub(crate) fn put_aside(&mut self, object: usize) {
        let handle = self.scene_bodies.objects[object];
        if let Some(body) = self.physics.bodies.get_mut(handle) {
            body.set_enabled(false);
        }
    }

    /// Joints beyond their speed limits, for states in the order of
    /// `RobotModel::joints`.
    pub(super) fn fast_joints(&self, joints: &[JointState]) -> impl Iterator<Item = Anomaly> {
        let all = self.model.joints.iter().zip(joints).enumerate();
        all.filter(|(_, (joint, state))| {
            joint.limits.velocity > 0.0
                && joint.mimic.is_none()
                && state.velocity.abs() > NOTED_SPEED * joint.limits.velocity
        })
        .map(|(index, _)| Anomaly::Fast(index))
    }
}

/// Whether all numbers of a body are finite and the engine has not disabled it.
fn is_sound(body: &RigidBody) -> bool {
    is_finite(body) && body.is_enabled()
}

fn is_finite(body: &RigidBody) -> bool {
    let (t, r) = (body.translation(), body.rotation());
    let (v, w) = (body.linvel(), body.angvel());
    // A number times zero is zero, unless it is not finite.
    let sum = (t.x + t.y + t.z) * 0.0
        + (r.x + r.y + r.z + r.w) * 0.0
        + (v.x + v.y + v.z) * 0.0
        + (w.x + w.y + w.z) * 0.0;
    sum == 0.0
}

/// Sum of the normal impulses of a pair in the last tick, N·s.
pub(super) fn impulse(pair: &ContactPair) -> f32 {
    // Plain loops: hundreds of pairs are close in every tick, and most do not touch.
    let PairContacts::Rigid(rigid) = &pair.contacts else {
        return 0.0;
    };
    let mut sum = 0.0;
    for manifold in rigid.solver_manifolds() {
        if !manifold.data.solver_contacts.is_empty() {
            for point in &manifold.points {
                sum += point.data.impulse;
            }
        }
    }
    sum
}

/// Checks that all numbers are finite and at most `most` in magnitude.
///
/// # Errors
/// With the first invalid number.
pub(super) fn within<'a>(
    what: &str,
    numbers: impl IntoIterator<Item = &'a f64>,
    most: f64,
) -> Result<(), String> {
    match numbers.into_iter().find(|x| x.is_nan() || x.abs() > most) {
        None => Ok(()),
        Some(x) => Err(format!("{what} is {x:e}, the limit is {most:e}")),
    }
}

/// Additional checks of a body in a stored state.
pub(super) fn stored_problem(body: &RigidBody, place: &Vector3<f64>) -> Option<String> {
    let rotation = f64::from(body.rotation().length());
    let speed = f64::from(body.linvel().length()).max(f64::from(body.angvel().length()));
    if !is_finite(body) {
        Some("is not finite".to_owned())
    } else if (rotation - 1.0).abs() > STORED_NORM {
        Some(format!("has a rotation of norm {rotation:.4}, not 1"))
    } else if place.norm() > FARTHEST {
        Some(format!("is {:.3e} m away", place.norm()))
    } else if speed > STORED_SPEED {
        Some(format!("moves at {speed:.3e} m/s or rad/s"))
    } else {
        None
    }
}
