//! The physics: bodies, joints, contacts. `apply`, `step`, `snapshot`.
//!
//! Only this module uses rapier. A world is created once from validated types and then
//! cannot fail: anomalies are reported in the snapshot. It reads no clock and samples
//! no random numbers; the same calls give the same bits, also across `save` and
//! `restore`.

mod body;
mod contact;
mod convert;
mod drive;
mod friction;
mod furniture_joint;
mod gap;
pub mod health;
mod libm_overrides;
mod mass;
mod pad_friction;
mod scan;
mod scene_bodies;
mod seat;
mod shape;
mod signals;
mod soft;
mod state;
mod state_validation;
mod tree;
mod wheels;

#[cfg(test)]
mod laws;

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use rapier3d::dynamics::{FrictionModel, SpringCoefficients};
use rapier3d::parry::bounding_volume::BoundingVolume;
use rapier3d::parry::query;
use rapier3d::prelude::{IntegrationParameters, PhysicsWorld, RigidBodyHandle};
use thiserror::Error;
use wheelarm_proto::PHYSICS_HZ;

use crate::people::{Motion, Person};
use crate::robot::RobotModel;
use crate::robot::control::Targets;
use crate::scene::{Placement, Scene};
use crate::snapshot::{Anomaly, BodyRef, BodyState, JointState, Snapshot};
use body::RobotBody;
use contact::body_of;
use drive::Drives;
pub use gap::Gap;
use pad_friction::GripFriction;
use scene_bodies::SceneBodies;
use seat::Seated;
use signals::Signals;
use soft::SoftObject;
pub use soft::WorstValues as WorstOfSoft;
use tree::Place;
use wheels::Wheels;

/// Gravity along -z, m/s².
pub const GRAVITY: f64 = 9.81;

/// Limit of targets, rad, rad/s or N.
const WILD: f64 = 1e4;

/// Why a world cannot be created or restored.
#[derive(Debug, Error)]
pub enum WorldError {
    /// A joint of the drives that does not exist.
    #[error("joint {joint} moves no body of its own; make it a turning joint in the URDF")]
    MissingJoint {
        /// Name.
        joint: String,
    },
    /// A joint at the wrong place in the model.
    #[error("joint {joint} must follow the joint of its parent link, and its parent must move")]
    JointOrder {
        /// Name.
        joint: String,
    },
    /// A joint type that is not supported.
    #[error("joint {joint} to link {link} slides; the world knows fixed and turning joints")]
    JointKind {
        /// Joint.
        joint: String,
        /// Its child link.
        link: String,
    },
    /// A moving body with invalid mass properties.
    #[error("body {body} has mass {mass} kg; a moving body needs a positive mass and inertia")]
    Mass {
        /// Link or object.
        body: String,
        /// kg.
        mass: f64,
    },
    /// An unsupported collision shape.
    #[error("collision shape of {body}: {problem}")]
    Shape {
        /// Link, object or piece of furniture.
        body: String,
        /// What is wrong.
        problem: String,
    },
    /// Placements and objects do not match.
    #[error("scene {scene} has {objects} objects but {placements} placements were given")]
    Placements {
        /// Scene.
        scene: String,
        /// Objects of the scene.
        objects: usize,
        /// Placements given.
        placements: usize,
    },
    /// An unreadable saved state.
    #[error("saved world state cannot be read: {0}; it is damaged, take it from its source again")]
    State(#[from] postcard::Error),
    /// A saved state of another version of the physics.
    #[error(
        "saved state is of physics version {found}, this program has version {}; restore it with a program of version {found}",
        wheelarm_proto::PHYSICS_VERSION
    )]
    OtherPhysics {
        /// Version in the state.
        found: u32,
    },
    /// Deformables took too long to settle.
    #[error(
        "letting soft objects sink takes longer than this server allows a reset; start a server with \
         this scenario (it has no limit then), on a less loaded host and as a release build"
    )]
    Settling,
    /// A saved state belongs to another world.
    #[error(
        "saved state is of world {found:016x}, this one is {expected:016x}; make it from the same scenario"
    )]
    OtherWorld {
        /// Fingerprint of this world.
        expected: u64,
        /// Fingerprint in the state.
        found: u64,
    },
    /// An invalid saved state.
    #[error("saved state is damaged: {problem}; take another copy of it")]
    Damaged {
        /// What is wrong with it.
        problem: String,
    },
}

/// Largest overlap of placed objects, metres: sampled or settled objects overlap by
/// less.
const OVERLAP: f64 = 0.005;

/// Height at which an object is pushed, as a share of the height of its centre.
const PUSH_HEIGHT: f32 = 0.5;

/// The simulated home with the robot in it.
pub struct World {
    physics: PhysicsWorld,
    grip: GripFriction,
    scene_bodies: SceneBodies,
    soft: Vec<SoftObject>,
    model: RobotModel,
    robot: RobotBody,
    drives: Drives,
    targets: Targets,
    wheels: Wheels,
    signals: Signals,
    seated: Option<Seated>,
    /// Body and force of the push in the present control tick; not part of the state,
    /// since it is set before every one.
    push: Option<(RigidBodyHandle, Vector3<f64>)>,
    tick: u64,
    fingerprint: u64,
}

impl World {
    /// Inserts a robot with its root at `start` (world_from_root) and its arm at `arm`
    /// (rad), the gripper open, into a scene with its objects as placed. Targets hold
    /// that position until [`World::apply`].
    ///
    /// # Errors
    /// When a joint, a mass or a shape cannot be simulated; the error names it.
    pub fn new(
        model: &RobotModel,
        scene: &Scene,
        placements: &[Placement],
        start: &Isometry3<f64>,
        arm: &[f64; 6],
    ) -> Result<Self, WorldError> {
        Self::new_within(model, scene, placements, start, arm, 0.0, &|| false)
    }

    /// As [`World::new`] with the gripper's knuckle at an angle, rad; fails when
    /// deformables settle for longer than `late` allows.
    ///
    /// # Errors
    /// As [`World::new`], and [`WorldError::Settling`].
    pub fn new_within(
        model: &RobotModel,
        scene: &Scene,
        placements: &[Placement],
        start: &Isometry3<f64>,
        arm: &[f64; 6],
        knuckle: f64,
        late: &dyn Fn() -> bool,
    ) -> Result<Self, WorldError> {
        let mut physics = engine();
        let scene_bodies = SceneBodies::insert(&mut physics, scene, placements)?;
        let soft = scene.objects.iter().zip(placements).enumerate();
        let soft = soft
            .filter_map(|(i, (body, placement))| SoftObject::placed(i, body, placement))
            .collect();
        let leader = model.roles.knuckles[0];
        let at_start = |joint: usize| match model.roles.arm_index(joint) {
            Some(place) => arm[place],
            None if joint == leader => knuckle,
            // The rest of the gripper follows; independent joints are at 0.
            None => match model.joints[joint].mimic {
                Some((followed, by, offset)) if followed == leader && knuckle != 0.0 => {
                    by * knuckle + offset
                }
                _ => 0.0,
            },
        };
        let robot = RobotBody::insert(&mut physics, model, start, at_start, |link| {
            drive::surface(model, link)
        })?;
        let drives = Drives::new(model, &robot)?;
        let wheels = Wheels::new(model, &robot, &physics)?;
        let grip = GripFriction::new(physics.integration_parameters.dt);
        let mut world = Self {
            physics,
            grip,
            scene_bodies,
            soft,
            model: model.clone(),
            robot,
            drives,
            targets: Targets {
                arm_position: *arm,
                arm_velocity: [0.0; 6],
                wheel_velocity: [0.0; 2],
                knuckle_position: knuckle,
                knuckle_velocity: 0.0,
                pad_force: model.settings.gripper.force,
            },
            wheels,
            signals: Signals::default(),
            seated: None,
            push: None,
            tick: 0,
            fingerprint: 0,
        };
        world.settle_soft(late)?;
        world.drive();
        world.signals = Signals::at_rest(&world.physics, &world.robot);
        world.fingerprint = world.hash();
        Ok(world)
    }

    /// Seats a person, before the first tick.
    pub fn seat(&mut self, person: &Arc<Person>, motion: Motion) {
        let masses = self.scene_bodies.masses.iter();
        let mut weights: Vec<f64> = masses.map(|mass| mass * GRAVITY).collect();
        for soft in &self.soft {
            weights[soft.object] = soft.mass() * GRAVITY;
        }
        let person = Arc::clone(person);
        let arm = &self.model.settings.arm;
        self.seated = Seated::insert(&mut self.physics, &self.robot, arm, person, motion, weights);
        self.fingerprint = self.hash();
    }

    /// Sets the targets of the drives from the next tick on. A target that is not
    /// finite or beyond its limit is ignored: its group keeps the former one.
    pub fn apply(&mut self, targets: &Targets) {
        let finite = |values: &[f64]| values.iter().all(|v| v.abs() < WILD);
        if finite(&targets.arm_position) && finite(&targets.arm_velocity) {
            self.targets.arm_position = targets.arm_position;
            self.targets.arm_velocity = targets.arm_velocity;
        }
        if finite(&targets.wheel_velocity) {
            self.targets.wheel_velocity = targets.wheel_velocity;
        }
        if finite(&[
            targets.knuckle_position,
            targets.knuckle_velocity,
            targets.pad_force,
        ]) {
            self.targets.knuckle_position = targets.knuckle_position;
            self.targets.knuckle_velocity = targets.knuckle_velocity;
            self.targets.pad_force = targets.pad_force;
        }
    }

    /// One tick of 1/240 s.
    pub fn step(&mut self) {
        if self.tick.is_multiple_of(PHYSICS_HZ) {
            self.robot.normalise_root(&mut self.physics);
            self.wheels.take_turns_out(&mut self.physics, &self.robot);
        }
        self.drive();
        self.step_soft();
        self.begin_push();
        self.wheels.begin_tick(&mut self.physics, &self.robot);
        if let Some(seated) = &mut self.seated {
            seated.begin_tick(&mut self.physics, self.tick);
        }
        self.robot.place_shapes(&mut self.physics, &self.model);
        self.grip.begin_tick();
        self.signals.begin_tick(&self.physics, &self.robot);
        self.physics.step_with_events(&self.grip, &());
        self.end_push();
        self.wheels.end_tick(&mut self.physics, &self.robot);
        self.drives.brake(&mut self.physics, &self.robot);
        let limits = self.drives.limits();
        self.signals.end_tick(&self.physics, &self.robot, limits);
        self.wheels.roll(&self.physics, &self.robot);
        if let Some(seated) = &mut self.seated {
            let soft = self.soft.iter().flat_map(|soft| soft.contacts());
            seated.end_tick(&mut self.physics, soft);
        }
        self.tick += 1;
    }

    /// Pushes a body with a force in `house`, N, in every tick until the next call.
    pub fn push(&mut self, push: Option<(BodyRef, Vector3<f64>)>) {
        self.push = push.and_then(|(body, force)| Some((self.handle(body)?, force)));
    }

    /// The engine's body of a link or an object.
    fn handle(&self, body: BodyRef) -> Option<RigidBodyHandle> {
        match body {
            BodyRef::Link(link) => match *self.robot.tree.places.get(link)? {
                Place::InBody(body, _) => self.robot.handles.get(body).copied(),
                Place::Rolling(_) | Place::Parallel(_) => None,
            },
            BodyRef::Object(object) => self.scene_bodies.objects.get(object).copied(),
            BodyRef::Furniture(_) | BodyRef::Person(_) => None,
        }
    }

    /// An object is pushed below its centre, as by a body that slides against it; the
    /// robot at the centre of the link.
    fn begin_push(&mut self) {
        let Some((handle, force)) = self.push else {
            return;
        };
        let body = &self.physics.bodies[handle];
        let mut point = body.center_of_mass();
        if self.scene_bodies.objects.contains(&handle) {
            let colliders = body.colliders().iter();
            let lowest = colliders.map(|&c| self.physics.colliders[c].compute_aabb().mins.z);
            let lowest = lowest.fold(point.z, f32::min);
            point.z = lowest + (point.z - lowest) * PUSH_HEIGHT;
        }
        let body = &mut self.physics.bodies[handle];
        body.add_force_at_point(convert::vector(&force), point, true);
    }

    /// A push lasts one tick.
    fn end_push(&mut self) {
        let Some((handle, _)) = self.push else {
            return;
        };
        let body = &mut self.physics.bodies[handle];
        body.reset_forces(false);
        body.reset_torques(false);
    }

    /// Sets all motors for the coming tick.
    fn drive(&mut self) {
        self.drives.drive(
            &mut self.physics,
            &self.robot,
            &mut self.wheels,
            &self.targets,
        );
    }

    /// Deformables are stepped first; their pushes on solids last one tick.
    fn step_soft(&mut self) {
        if self.soft.is_empty() {
            return;
        }
        for (_, body) in self.physics.bodies.iter_mut() {
            body.reset_forces(false);
            body.reset_torques(false);
        }
        let h = 1.0 / PHYSICS_HZ as f64;
        for soft in &mut self.soft {
            soft.step(&mut self.physics, GRAVITY, h);
        }
    }

    /// Lets deformables settle on their supports, before the first tick.
    fn settle_soft(&mut self, late: &dyn Fn() -> bool) -> Result<(), WorldError> {
        const TICKS: usize = 300;
        const KEEP: f64 = 0.97;
        for _ in 0..TICKS {
            if !self.soft.is_empty() && late() {
                return Err(WorldError::Settling);
            }
            self.step_soft();
            for soft in &mut self.soft {
                soft.damp(KEEP);
            }
        }
        for soft in &mut self.soft {
            soft.damp(0.0);
        }
        Ok(())
    }

    /// The worst audit of each deformable since the start: violations of its contact
    /// and energy laws.
    #[must_use]
    pub fn worst_of_soft(&self) -> Vec<WorstOfSoft> {
        self.soft.iter().map(SoftObject::worst).collect()
    }

    /// Two objects that overlap by more than `OVERLAP`, one of them selected by
    /// `checked`, and their overlap, metres. Deformables are skipped: they settle.
    #[must_use]
    pub fn overlap(&self, checked: &[bool]) -> Option<(usize, usize, f64)> {
        let parts = |object: usize| {
            let body = &self.physics.bodies[self.scene_bodies.objects[object]];
            let colliders = body.colliders().iter();
            colliders.map(|&handle| &self.physics.colliders[handle])
        };
        let count = self.scene_bodies.objects.len();
        let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
        let is_checked = |object: usize| checked.get(object).copied().unwrap_or_default();
        pairs
            .filter(|&(a, b)| is_checked(a) || is_checked(b))
            .find_map(|(a, b)| {
                let depths = parts(a).flat_map(|one| {
                    parts(b).filter_map(move |other| {
                        let (at, there) = (one.position(), other.position());
                        let contact = query::contact(at, one.shape(), there, other.shape(), 0.0);
                        Some(f64::from(-contact.ok()??.dist))
                    })
                });
                let depth = depths.fold(0.0, f64::max);
                (depth > OVERLAP).then_some((a, b, depth))
            })
    }

    /// The robot link that penetrates furniture, an object or the person deepest, by
    /// more than `OVERLAP`: link, the other body, depth in metres. The floor and
    /// deformables are excluded.
    #[must_use]
    pub fn robot_overlap(&self) -> Option<(BodyRef, BodyRef, f64)> {
        let colliders = || self.physics.colliders.iter().map(|(_, collider)| collider);
        let robot = colliders().filter(|c| matches!(body_of(c.user_data), BodyRef::Link(_)));
        let mut deepest: Option<(BodyRef, BodyRef, f64)> = None;
        for link in robot {
            let bounds = link.compute_aabb();
            for other in colliders() {
                let body = body_of(other.user_data);
                let counts = !matches!(body, BodyRef::Link(_) | BodyRef::Furniture(0))
                    && link.collision_groups().test(other.collision_groups())
                    && bounds.intersects(&other.compute_aabb());
                if !counts {
                    continue;
                }
                let (at, there) = (link.position(), other.position());
                let contact = query::contact(at, link.shape(), there, other.shape(), 0.0);
                let depth = contact.ok().flatten().map_or(0.0, |c| f64::from(-c.dist));
                if depth > deepest.map_or(OVERLAP, |(.., most)| most) {
                    deepest = Some((body_of(link.user_data), body, depth));
                }
            }
        }
        deepest
    }

    /// Ticks since the start.
    #[must_use]
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// The state after the last tick.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        let joints = self.joints();
        let links = self.links(&joints);
        let free_body = |handle: RigidBodyHandle| {
            let frame = convert::from_pose(self.physics.bodies[handle].position());
            self.body_state(handle, frame)
        };
        let objects = self.scene_bodies.objects.iter().map(|&h| free_body(h));
        let mut objects: Vec<BodyState> = objects.collect();
        for soft in &self.soft {
            objects[soft.object] = soft.frame();
        }
        let moving = &self.scene_bodies.moving;
        let robot = self
            .robot
            .handles
            .iter()
            .enumerate()
            .map(|(body, &handle)| {
                let link = self.robot.tree.bodies[body].link;
                (handle, BodyRef::Link(link), links[link].pose)
            });
        let free = self.scene_bodies.objects.iter().enumerate();
        let free = free.map(|(i, &handle)| (handle, BodyRef::Object(i), objects[i].pose));
        let anomalies = robot.chain(free).filter_map(|(handle, body, frame)| {
            self.scene_bodies
                .anomaly(&self.physics, handle, body, &frame)
        });
        let soft = self.soft.iter().filter(|soft| soft.is_broken());
        let soft = soft.map(|soft| Anomaly::NotFinite(BodyRef::Object(soft.object)));
        let fast = self.fast_joints(&joints);
        let anomalies = anomalies.chain(soft).chain(fast).collect();
        let mut contacts = contact::contacts(&self.physics);
        for soft in &self.soft {
            contacts.extend_from_slice(soft.contacts());
        }
        Snapshot {
            tick: self.tick,
            skins: self.soft.iter().map(SoftObject::skin).collect(),
            contacts,
            joints,
            links,
            objects,
            furniture_joints: moving.iter().map(|s| s.state(&self.physics)).collect(),
            sliding: moving.iter().map(|s| free_body(s.handle)).collect(),
            person: self.seated.as_ref().map(Seated::state),
            anomalies,
        }
    }

    fn joints(&self) -> Vec<JointState> {
        let mut states = vec![JointState::default(); self.model.joints.len()];
        for (body, tree_body) in self.robot.tree.bodies.iter().enumerate() {
            let Some(joint) = tree_body.joint.map(|j| j.joint) else {
                continue;
            };
            states[joint] = self.signals.state(&self.physics, &self.robot, body);
        }
        for place in &self.robot.tree.places {
            let Place::Parallel(joint) = *place else {
                continue;
            };
            if let Some((master, multiplier, offset)) = self.model.joints[joint].mimic {
                states[joint] = JointState {
                    position: states[master].position * multiplier + offset,
                    velocity: states[master].velocity * multiplier,
                    effort: 0.0,
                };
            }
        }
        self.wheels.write(&mut states);
        states
    }

    fn links(&self, joints: &[JointState]) -> Vec<BodyState> {
        let mut bodies: Vec<BodyState> = Vec::with_capacity(self.robot.handles.len());
        for body in 0..self.robot.handles.len() {
            let parent = self.robot.tree.bodies[body].joint.map(|j| bodies[j.parent]);
            bodies.push(self.robot_body(body, parent));
        }
        let mut links: Vec<BodyState> = Vec::with_capacity(self.model.links.len());
        for place in &self.robot.tree.places {
            let state = match *place {
                Place::InBody(body, body_from_link) => bodies[body].carrying(body_from_link),
                Place::Rolling(joint) | Place::Parallel(joint) => {
                    let parent = links[self.model.joints[joint].parent];
                    self.posed(joint, &parent, &joints[joint])
                }
            };
            links.push(state);
        }
        links
    }

    /// State of one link after the last tick, the same as in the snapshot and far
    /// cheaper; `None` when the link does not exist.
    #[must_use]
    pub fn link(&self, link: usize) -> Option<BodyState> {
        match *self.robot.tree.places.get(link)? {
            Place::InBody(0, body_from_link) => {
                Some(self.robot_body(0, None).carrying(body_from_link))
            }
            _ => self.links(&self.joints()).get(link).copied(),
        }
    }

    /// State of a body of the robot, from that of its parent and its joint. The
    /// engine's body has the velocity of an earlier substep.
    fn robot_body(&self, body: usize, parent: Option<BodyState>) -> BodyState {
        let pose = self.robot.frame(&self.physics, body);
        let joint = self.robot.tree.bodies[body].joint;
        match (parent, joint) {
            (Some(parent), Some(tree_joint)) => {
                let state = self.signals.state(&self.physics, &self.robot, body);
                self.turned(tree_joint.joint, &parent, pose, state.velocity)
            }
            _ => {
                let (linear, angular) = self.robot.root_velocity(&self.physics);
                BodyState {
                    pose,
                    linear,
                    angular,
                }
            }
        }
    }

    /// State of a frame that is fixed to an engine body.
    fn body_state(&self, handle: RigidBodyHandle, pose: Isometry3<f64>) -> BodyState {
        let body = &self.physics.bodies[handle];
        let angular = convert::from_vector(body.angvel());
        let com = convert::from_vector(body.center_of_mass());
        let linear = convert::from_vector(body.linvel());
        BodyState {
            pose,
            linear: linear + angular.cross(&(pose.translation.vector - com)),
            angular,
        }
    }

    /// State of a link that a joint poses from its parent.
    fn posed(&self, joint: usize, parent: &BodyState, state: &JointState) -> BodyState {
        let pose = parent.pose * self.model.joints[joint].transform(state.position);
        self.turned(joint, parent, pose, state.velocity)
    }

    /// State of a frame that a joint rotates at its origin.
    fn turned(
        &self,
        joint: usize,
        parent: &BodyState,
        pose: Isometry3<f64>,
        velocity: f64,
    ) -> BodyState {
        let axis = pose * self.model.joints[joint].axis.into_inner();
        BodyState {
            pose,
            linear: parent.velocity_at(&pose.translation.vector),
            angular: parent.angular + axis * velocity,
        }
    }
}

/// An empty engine with these measured settings:
///
/// - 4 substeps of 1/960 s with 4 iterations each.
/// - Each tick starts with 0.9 of the last one's impulses. With all of them the four
///   wheels under a heavy person sustain each other's load and friction in a cycle, and
///   the chair creeps.
/// - No contact recycling, and friction in every pass; otherwise grasps creep.
/// - Contacts are stiff enough for a finger of 80 g. Those with fixed bodies are not
///   stiffer, or a chair that wedges itself in presses with 30 kN.
/// - Overlapping bodies separate with at most 0.5 m/s.
/// - One friction constraint per manifold: with one per point a sliding box has 9 %
///   less than its coefficient. Contacts of the robot have one per point in either
///   case.
fn engine() -> PhysicsWorld {
    let mut physics = PhysicsWorld::new();
    physics.gravity = convert::vector(&Vector3::new(0.0, 0.0, -GRAVITY));
    let dt = 1.0 / PHYSICS_HZ as f32;
    physics.integration_parameters = IntegrationParameters {
        dt,
        num_solver_iterations: 4,
        num_internal_pgs_iterations: 4,
        num_internal_stabilization_iterations: 1,
        warmstart_coefficient: 0.9,
        contact_recycling: false,
        friction_in_bias_pass: true,
        contact_softness: SpringCoefficients::new(120.0, 5.0),
        static_contact_softness: SpringCoefficients::new(120.0, 5.0),
        normalized_max_corrective_velocity: 0.5,
        friction_model: FrictionModel::Simplified,
        ..IntegrationParameters::default()
    };
    physics
}
