//! Static data of a task's world, and measurements for predicates.

use nalgebra::{Isometry3, Point3, Vector3};
use wheelarm_proto::furniture::JointMotion;

use crate::people::{Lap, Mouth};
use crate::scene::{Body, Surface};
use crate::snapshot::{BodyRef, BodyState, Contact, Snapshot};

/// Object name that means the sampled target.
pub(super) const TARGET: &str = "target";

/// Static data of a task's world.
#[derive(Clone, Debug)]
pub(super) struct Context {
    /// Objects of the scene.
    pub bodies: Vec<Body>,
    /// Poses in the first snapshot.
    pub starts: Vec<Isometry3<f64>>,
    /// First surface of furniture, by its name.
    pub surfaces: Vec<(String, Surface)>,
    /// Joints of furniture.
    pub joints: Vec<(String, JointMotion)>,
    /// Furniture on these joints, by its index.
    pub sliding: Vec<usize>,
    /// Links that carry the pads, left and right.
    pub pads: [usize; 2],
    /// Links that roll on the floor.
    pub wheels: Vec<usize>,
    /// The target, when it is an object.
    pub target: Option<usize>,
    /// Joint of the target, when it is furniture on a joint.
    pub target_joint: Option<usize>,
    /// The lap of the person in the chair.
    pub lap: Option<Lap>,
    /// The mouth of the person in the chair.
    pub mouth: Option<Mouth>,
    /// Other possible targets.
    pub decoys: Vec<usize>,
}

impl Context {
    /// Index of an object by its name or role.
    fn object(&self, name: &str) -> Option<usize> {
        if name == TARGET {
            return self.target;
        }
        self.bodies.iter().position(|body| body.name == name)
    }

    /// The object of this name with its state, if it exists.
    pub(super) fn object_in<'a>(
        &self,
        name: &str,
        snapshot: &'a Snapshot,
    ) -> Option<(usize, &'a BodyState)> {
        let object = self.object(name)?;
        Some((object, snapshot.objects.get(object)?))
    }

    /// Motion and position, metres or radians, of the joint of this name, or of the
    /// target's.
    pub(super) fn joint_position(&self, name: &str, snapshot: &Snapshot) -> (JointMotion, f64) {
        let joint = match name {
            TARGET => self.target_joint,
            name => self.joints.iter().position(|(joint, _)| joint == name),
        };
        let motion = joint.and_then(|joint| self.joints.get(joint));
        let state = joint.and_then(|joint| snapshot.furniture_joints.get(joint));
        (
            motion.map_or(JointMotion::Slides, |(_, motion)| *motion),
            state.map_or(0.0, |state| state.position),
        )
    }

    /// Distance of the object's centre of mass from the middle of a surface on the
    /// floor plan, metres, and whether it is on the surface, its lowest point within
    /// `above` metres.
    pub(super) fn inside(
        &self,
        object: usize,
        state: &BodyState,
        on: &str,
        above: f64,
    ) -> Option<(f64, bool)> {
        let (_, surface) = self.surfaces.iter().find(|(name, _)| name == on)?;
        let body = self.bodies.get(object)?;
        let com = body.mass.map_or(Point3::origin(), |mass| mass.com);
        let com = state.pose * com;
        let distance = (com - Point3::from(surface.centre().translation.vector))
            .xy()
            .norm();
        let bottom = body.collision_bounds(&state.pose)?.min.z;
        let level = (bottom - surface.edge.translation.z).abs() <= above;
        Some((distance, level && surface.spans(&com)))
    }

    /// Distance of the object's centre of mass from the middle of the lap on the floor
    /// plan, metres, and whether it is in the lap, its lowest point within `above`
    /// metres.
    pub(super) fn in_lap(
        &self,
        object: usize,
        state: &BodyState,
        above: f64,
        snapshot: &Snapshot,
    ) -> Option<(f64, bool)> {
        let (lap, body) = (self.lap?, self.bodies.get(object)?);
        let chair = snapshot.links.first()?.pose;
        let com = body.mass.map_or(Point3::origin(), |mass| mass.com);
        let com = chair.inverse() * (state.pose * com) - lap.at;
        let top = (chair * lap.at).z;
        let level = (body.collision_bounds(&state.pose)?.min.z - top).abs() <= above;
        let within = (0..2).all(|i| com[i].abs() <= lap.size[i] / 2.0);
        Some((com.xy().norm(), level && within))
    }

    /// Distance of the object's tip from the middle of the lips, metres; `None` without
    /// a tip or a person.
    pub(super) fn tip_to_mouth(
        &self,
        object: usize,
        state: &BodyState,
        snapshot: &Snapshot,
    ) -> Option<f64> {
        let tip = state.pose * self.bodies.get(object)?.tip?;
        let head = &snapshot.person.as_ref()?.head;
        let chair = snapshot.links.first()?.pose;
        let lips = chair * self.mouth.as_ref()?.frame(head);
        Some((tip.coords - lips.translation.vector).norm())
    }

    /// Force of the robot on an object, N; `None` when they do not touch.
    pub(super) fn robot_force(&self, object: usize, snapshot: &Snapshot) -> Option<f64> {
        let object = BodyRef::Object(object);
        let mut touching = snapshot
            .contacts
            .iter()
            .filter(|c| match (c.first, c.second) {
                (BodyRef::Link(_), other) | (other, BodyRef::Link(_)) => other == object,
                _ => false,
            })
            .map(|c| c.force.norm())
            .peekable();
        touching.peek()?;
        Some(touching.sum())
    }

    /// Contacts between the robot and furniture that are neither rolling nor pulling.
    pub(super) fn collisions<'a>(
        &'a self,
        snapshot: &'a Snapshot,
    ) -> impl Iterator<Item = &'a Contact> {
        let hits = snapshot.contacts.iter();
        hits.filter(move |c| self.is_collision(c.first, c.second))
    }

    /// Largest force between the robot and furniture, N.
    pub(super) fn collision_force(&self, snapshot: &Snapshot) -> f64 {
        let forces = self.collisions(snapshot).map(|c| c.force.norm());
        forces.fold(0.0, f64::max)
    }

    /// Height of the object's lowest point over its start, metres.
    pub(super) fn rise(&self, object: usize, snapshot: &Snapshot) -> f64 {
        let (Some(body), Some(state), Some(start)) = (
            self.bodies.get(object),
            snapshot.objects.get(object),
            self.starts.get(object),
        ) else {
            return 0.0;
        };
        let bottom = |pose| {
            body.collision_bounds(pose)
                .map_or(0.0, |bounds| bounds.min.z)
        };
        bottom(&state.pose) - bottom(start)
    }

    /// Angle between the object's present and initial upright axis, rad.
    pub(super) fn lean(&self, object: usize, state: &BodyState) -> f64 {
        self.starts.get(object).map_or(0.0, |start| {
            let up = |pose: &nalgebra::Isometry3<f64>| pose.rotation * Vector3::z();
            up(start).angle(&up(&state.pose))
        })
    }

    /// Whether both pads press the object with at least `force` N.
    pub(super) fn is_held(&self, object: usize, force: f64, snapshot: &Snapshot) -> bool {
        self.pads.iter().all(|&pad| {
            let (pad, object) = (BodyRef::Link(pad), BodyRef::Object(object));
            snapshot
                .contacts
                .iter()
                .filter(|c| {
                    (c.first, c.second) == (pad, object) || (c.first, c.second) == (object, pad)
                })
                .map(|c| c.force.norm())
                .sum::<f64>()
                >= force
        })
    }

    /// Whether the pair is the robot and furniture, and neither a wheel on the floor
    /// nor a pad on furniture that is meant to be pulled.
    fn is_collision(&self, first: BodyRef, second: BodyRef) -> bool {
        match (first, second) {
            (BodyRef::Link(link), BodyRef::Furniture(furniture))
            | (BodyRef::Furniture(furniture), BodyRef::Link(link)) => {
                let rolls = furniture == 0 && self.wheels.contains(&link);
                let pulls = self.sliding.contains(&furniture) && self.pads.contains(&link);
                !rolls && !pulls
            }
            _ => false,
        }
    }
}
