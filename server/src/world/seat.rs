//! The person in the chair: mass on the chair's body, capsules that collide with
//! everything but the chair, and contact forces.
//!
//! The body is fixed to the chair except for head and jaw. During a control tick their
//! capsules are at the motion's pose at its end: the engine recomputes the whole chair
//! whenever one of its shapes moves.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Isometry3;
use rapier3d::math::Pose;
use rapier3d::prelude::{
    Collider, ColliderBuilder, ColliderHandle, ContactPair, PhysicsWorld, RigidBodyHandle,
};
use wheelarm_proto::TICKS_PER_CONTROL;

use super::body::{RobotBody, person_groups};
use super::contact::{body_of, contacts_among, tag};
use super::convert::{mass_properties, pose};
use super::gap;
use super::mass::Mass;
use super::shape;
use super::tree::Place;
use crate::people::{BodyPart, HeadPose, Motion, PARTS, Person};
use crate::robot::ArmSettings;
use crate::snapshot::{BodyRef, Contact, PersonState, Touch};

/// Friction of clothes and skin, averaged with the other body's. [guess]
const FRICTION: f32 = 0.6;
/// Damping of the rotation of objects that touch the person, 1/s: flesh yields. On
/// rigid bodies a bar over both thighs would rock on two points for ever. [guess]
const FLESH: f32 = 100.0;
/// Distance to the mouth within which a contact with the face is one with the mouth,
/// metres.
const MOUTH: f64 = 0.035;

/// Whether objects may rest on a part; nothing stays on a head, a shank or a foot.
fn may_carry(part: BodyPart) -> bool {
    match part {
        BodyPart::Head | BodyPart::Face | BodyPart::Mouth | BodyPart::Legs => false,
        BodyPart::Torso | BodyPart::Arms | BodyPart::Hands | BodyPart::Lap => true,
    }
}

/// A person in the engine.
#[derive(Clone, Debug)]
pub(super) struct Seated {
    person: Arc<Person>,
    motion: Motion,
    body_from_chair: Isometry3<f64>,
    body: RigidBodyHandle,
    /// All capsules.
    colliders: Vec<ColliderHandle>,
    /// Capsules that move with the head: index, collider, and pose at the joint.
    moving: Vec<(usize, ColliderHandle, Pose)>,
    /// Objects that touched the person at the end of the last tick.
    cushioned: Vec<RigidBodyHandle>,
    /// Weights of the objects, N.
    weights: Vec<f64>,
    /// The present state.
    state: PersonState,
}

impl Seated {
    /// Seats a person on a robot; `None` when its root is not a body. `weights` are
    /// those of the objects, N.
    pub(super) fn insert(
        physics: &mut PhysicsWorld,
        robot: &RobotBody,
        arm: &ArmSettings,
        person: Arc<Person>,
        motion: Motion,
        weights: Vec<f64>,
    ) -> Option<Self> {
        let Place::InBody(index, body_from_chair) = *robot.tree.places.first()? else {
            return None;
        };
        let body = *robot.handles.get(index)?;
        let own = Mass {
            mass: person.mass,
            com: person.com,
            inertia: person.inertia,
        };
        let mass = robot.tree.bodies[index]
            .mass
            .plus(&own.transformed_by(&body_from_chair));
        physics.bodies[body].set_additional_mass_properties(mass_properties(&mass), true);
        let head = motion.head_pose(0);
        let (mut colliders, mut moving) = (Vec::new(), Vec::new());
        for (index, capsule) in person.capsules.iter().enumerate() {
            let [a, b] = &capsule.ends;
            // Capsules without size were rejected when the person was loaded.
            let solid = if may_carry(capsule.part) {
                shape::supporting_capsule(a, b, capsule.radius)
            } else {
                shape::capsule(a, b, capsule.radius)
            };
            let Ok((joint_from_shape, shape)) = solid else {
                continue;
            };
            let chair_from_joint = person.skeleton.joint(capsule.joint, &head);
            let collider = ColliderBuilder::new(shape)
                .position(pose(&(body_from_chair * chair_from_joint)) * joint_from_shape)
                .density(0.0)
                .friction(FRICTION)
                .collision_groups(person_groups(arm))
                .user_data(tag(BodyRef::Person(index)));
            let handle = physics.insert_collider(collider, Some(body));
            colliders.push(handle);
            if capsule.moves {
                moving.push((index, handle, joint_from_shape));
            }
        }
        Some(Self {
            person,
            motion,
            body_from_chair,
            body,
            colliders,
            moving,
            cushioned: Vec::new(),
            weights,
            state: PersonState {
                head,
                ..PersonState::default()
            },
        })
    }

    /// Moves head and jaw at the start of a control tick to their poses at its end.
    pub(super) fn begin_tick(&mut self, physics: &mut PhysicsWorld, tick: u64) {
        if tick.is_multiple_of(TICKS_PER_CONTROL) {
            self.state.forces = [0.0; PARTS.len()];
            self.state.robot_force = 0.0;
            self.state.touches.clear();
            self.move_head(physics, self.motion.head_pose(tick + TICKS_PER_CONTROL));
        }
        self.damp(physics, FLESH);
    }

    fn move_head(&mut self, physics: &mut PhysicsWorld, head: HeadPose) {
        if head == self.state.head {
            return;
        }
        self.state.head = head;
        for (index, handle, joint_from_shape) in &self.moving {
            let capsule = &self.person.capsules[*index];
            let chair_from_joint = self.person.skeleton.joint(capsule.joint, &head);
            let place = pose(&(self.body_from_chair * chair_from_joint)) * *joint_from_shape;
            if let Some(collider) = physics.colliders.get_mut(*handle) {
                collider.set_position_wrt_parent(place);
            }
        }
    }

    /// Adds the contacts of a tick, including those of deformables; of each force the
    /// largest since the start of the control tick is kept.
    pub(super) fn end_tick<'a>(
        &mut self,
        physics: &mut PhysicsWorld,
        soft: impl Iterator<Item = &'a Contact>,
    ) {
        // Reset, so that saved states do not contain it.
        self.damp(physics, 0.0);
        let touching = touching(physics, &self.colliders);
        self.cushioned = objects_in(physics, &touching);
        let mut contacts = contacts_among(physics, touching.into_iter(), |_, _| true);
        contacts.extend(soft.filter(|c| matches!(c.second, BodyRef::Person(_))));
        if contacts.is_empty() {
            return;
        }
        let root = super::convert::from_pose(physics.bodies[self.body].position());
        let mouth = root * self.body_from_chair * self.person.mouth(&self.state.head);
        let mut sums: BTreeMap<(BodyPart, BodyRef), f64> = BTreeMap::new();
        for contact in contacts {
            let BodyRef::Person(index) = contact.second else {
                continue;
            };
            let force = contact.force.norm();
            let part = self.person.capsules[index].part;
            *sums.entry((part, contact.first)).or_default() += force;
            let near = (contact.point - mouth.translation.vector).norm() < MOUTH;
            if part == BodyPart::Face && near {
                *sums.entry((BodyPart::Mouth, contact.first)).or_default() += force;
            }
        }
        let mut forces = [0.0; PARTS.len()];
        let mut robot = 0.0;
        for (&(part, partner), &force) in &sums {
            forces[part.index()] += force;
            // The mouth is a part of the face, which counts already.
            if matches!(partner, BodyRef::Link(_)) && part != BodyPart::Mouth {
                robot += force;
            }
        }
        for (most, force) in self.state.forces.iter_mut().zip(forces) {
            *most = most.max(force);
        }
        self.state.robot_force = self.state.robot_force.max(robot);
        for (&(part, partner), &force) in &sums {
            self.touch(part, partner, force);
        }
    }

    /// Adds the force of a body on a part in one tick. For an object the mean over the
    /// control tick is used, for all others the largest force. The engine's bodies are
    /// rigid and end an impact within one tick of 4 ms; soft tissue of 2 N/mm spreads
    /// that of an object of 0.1 kg over pi sqrt(m / k) = 20 ms.
    fn touch(&mut self, part: BodyPart, partner: BodyRef, force: f64) {
        let touches = &mut self.state.touches;
        let is_object = matches!(partner, BodyRef::Object(_));
        let force = if is_object {
            force / TICKS_PER_CONTROL as f64
        } else {
            force
        };
        match touches.binary_search_by_key(&(part, partner), |t| (t.part, t.partner)) {
            Ok(known) if is_object => touches[known].force += force,
            Ok(known) => touches[known].force = touches[known].force.max(force),
            Err(place) => {
                let weight = match partner {
                    BodyRef::Object(object) => self.weights.get(object).copied(),
                    _ => None,
                };
                let weight = weight.unwrap_or_default();
                let touch = Touch {
                    part,
                    partner,
                    force,
                    weight,
                };
                touches.insert(place, touch);
            }
        }
    }

    /// Damps the rotation of objects that touch the person, 1/s.
    fn damp(&self, physics: &mut PhysicsWorld, rate: f32) {
        for handle in &self.cushioned {
            if let Some(body) = physics.bodies.get_mut(*handle) {
                body.set_angular_damping(rate);
            }
        }
    }

    /// All capsules with their index and pose at a tick, for the present pose of the
    /// chair.
    pub(super) fn capsules<'a>(
        &self,
        physics: &'a PhysicsWorld,
        tick: u64,
    ) -> Vec<(usize, &'a Collider, Pose)> {
        let head = self.motion.head_pose(tick);
        let body = physics.bodies[self.body].position();
        let mut capsules = Vec::with_capacity(self.colliders.len());
        for handle in &self.colliders {
            let Some(collider) = physics.colliders.get(*handle) else {
                continue;
            };
            let BodyRef::Person(index) = body_of(collider.user_data) else {
                continue;
            };
            let moving = self.moving.iter().find(|(_, moving, _)| moving == handle);
            let place = match moving {
                Some((_, _, joint_from_shape)) if head != self.state.head => {
                    let joint = self.person.capsules[index].joint;
                    let chair_from_joint = self.person.skeleton.joint(joint, &head);
                    let body_from_joint = pose(&(self.body_from_chair * chair_from_joint));
                    *body * body_from_joint * *joint_from_shape
                }
                _ => gap::place(physics, collider),
            };
            capsules.push((index, collider, place));
        }
        capsules
    }

    /// The present state.
    pub(super) fn state(&self) -> PersonState {
        self.state.clone()
    }

    /// Restores a saved state at a tick, together with the engine's state.
    pub(super) fn restore(&mut self, physics: &PhysicsWorld, state: PersonState, tick: u64) {
        self.cushioned = objects_in(physics, &touching(physics, &self.colliders));
        self.state = PersonState {
            // The colliders are part of the engine's state; the motion provides the
            // rest.
            head: self
                .motion
                .head_pose(tick.next_multiple_of(TICKS_PER_CONTROL)),
            ..state
        };
    }

    /// Whether the collider is moved by the motion.
    pub(super) fn moves(&self, collider: ColliderHandle) -> bool {
        self.moving.iter().any(|(_, handle, _)| *handle == collider)
    }

    /// Numbers that identify this person, and those included in the state hash.
    pub(super) fn bits(&self) -> impl Iterator<Item = u64> + '_ {
        let HeadPose {
            yaw,
            pitch,
            roll,
            jaw,
        } = self.state.head;
        let drawn = &self.person.drawn;
        let names = drawn
            .body
            .bytes()
            .chain(drawn.posture.bytes())
            .map(u64::from);
        let numbers = [yaw, pitch, roll, jaw, self.state.robot_force];
        let touches = self.state.touches.iter().map(|touch| touch.force);
        let numbers = numbers.into_iter().chain(self.state.forces).chain(touches);
        // Zero has two signs.
        numbers.map(|x| (x + 0.0).to_bits()).chain(names)
    }
}

/// The engine's contact pairs of the person's colliders.
fn touching<'a>(physics: &'a PhysicsWorld, person: &[ColliderHandle]) -> Vec<&'a ContactPair> {
    let mut touching = Vec::new();
    for own in person {
        let pairs = physics.narrow_phase.contact_pairs_with(*own);
        touching.extend(pairs.filter(|pair| pair.has_any_active_contact()));
    }
    touching
}

/// The objects in such pairs.
fn objects_in(physics: &PhysicsWorld, touching: &[&ContactPair]) -> Vec<RigidBodyHandle> {
    let ends = touching.iter().flat_map(|p| [p.collider1, p.collider2]);
    let colliders = ends.filter_map(|end| physics.colliders.get(end));
    colliders
        .filter(|collider| matches!(body_of(collider.user_data), BodyRef::Object(_)))
        .filter_map(|collider| collider.parent())
        .collect()
}
