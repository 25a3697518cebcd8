//! The robot in the engine: one multibody of chair, driven wheels, arm and
//! gripper, with couplings for the gripper's linkage.
//!
//! Measured at rest: with wheels on impulse joints the chair shivered by 10 mm/s and
//! crept 10 mm in 10 s; in the multibody it moves by 0.05 mm. Front wheels as bodies
//! would make a tick half as long again.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rapier3d::dynamics::{Multibody, MultibodyDofCoupling, MultibodyIndex, MultibodyLink};
use rapier3d::math::Pose;
use rapier3d::prelude::{
    ActiveHooks, CoefficientCombineRule, ColliderBuilder, ColliderHandle, GenericJoint,
    GenericJointBuilder, Group, InteractionGroups, InteractionTestMode, JointAxesMask, JointAxis,
    PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};

use super::WorldError;
use super::contact::tag;
use super::convert::{from_pose, mass_properties, pose, real, vector};
use super::shape::solids;
use super::tree::{Parallel, Tree, TreeJoint, TreePart};
use crate::geometry::Shape;
use crate::robot::{ArmSettings, JointKind, RobotModel, Settings};
use crate::snapshot::BodyRef;

/// Collision group of the floor.
pub(super) const FLOOR_GROUP: Group = Group::GROUP_31;
/// Collision group of all other bodies except the robot.
pub(super) const SCENE_GROUP: Group = Group::GROUP_32;
/// Collision group of the chair; the arm's groups follow by depth.
const CHAIR_BIT: u32 = 1;

/// Radius of the rims of the robot's cylinders, metres, smaller for thin ones (see
/// `shape::solids`). [choice: contacts at rest are less than 1 mm deep]
const RIM: f64 = 0.01;

/// Largest error in the pose of an inner knuckle's shape, metres.
const STILL: f32 = 1e-5;

/// Surface of a collider of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Surface {
    /// Plain shell.
    Shell,
    /// Driven wheel.
    Tyre,
    /// Front wheel.
    Roller,
    /// Silicone pad of a finger: uses the coefficient of the other body, because an
    /// object's coefficient is defined against the pads.
    Pad,
}

impl Surface {
    /// Wheels touch the floor in one point, under their middle: a cylinder's line of
    /// contact scrubs in a turn and changes the effective track.
    fn rolls(self) -> bool {
        matches!(self, Self::Tyre | Self::Roller)
    }

    /// The collider with this surface of a robot, without mass.
    fn coat(self, collider: ColliderBuilder, settings: &Settings) -> ColliderBuilder {
        let (friction, rule) = match self {
            Self::Shell => (settings.shell_friction, CoefficientCombineRule::Average),
            Self::Tyre => (settings.drive.tyre_friction, CoefficientCombineRule::Max),
            Self::Roller => (settings.drive.caster_friction, CoefficientCombineRule::Min),
            Self::Pad => (1.0, CoefficientCombineRule::Multiply),
        };
        let collider = collider
            .density(0.0)
            .friction(real(friction))
            .friction_combine_rule(rule);
        if self == Self::Pad {
            collider.active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS)
        } else {
            collider
        }
    }
}

/// The robot's bodies and joints in the engine.
#[derive(Clone, Debug)]
pub(super) struct RobotBody {
    /// The folded model.
    pub tree: Tree,
    /// Engine bodies, in the order of `tree.bodies`.
    pub handles: Vec<RigidBodyHandle>,
    /// Link of the multibody, for each body.
    links: Vec<usize>,
    multibody: Option<MultibodyIndex>,
    /// Shapes of the inner knuckles.
    moving: Vec<MovingShape>,
}

/// A collider that moves in the frame of its body.
#[derive(Clone, Debug)]
struct MovingShape {
    collider: ColliderHandle,
    parallel: Parallel,
    link_from_shape: Pose,
}

impl RobotBody {
    /// Inserts a robot into the engine with its root at `start` and the joint positions
    /// `q(joint)`.
    ///
    /// `surface(link)` returns the surface of a link.
    pub(super) fn insert(
        physics: &mut PhysicsWorld,
        model: &RobotModel,
        start: &Isometry3<f64>,
        q: impl Fn(usize) -> f64,
        surface: impl Fn(usize) -> Surface,
    ) -> Result<Self, WorldError> {
        let tree = Tree::new(model)?;
        let settings = &model.settings;
        let depths = arm_depths(model);
        let mut frames: Vec<Isometry3<f64>> = Vec::new();
        let mut handles = Vec::new();
        let mut moving = Vec::new();
        for body in &tree.bodies {
            let frame = match &body.joint {
                None => start * tree.root_from_body,
                Some(j) => {
                    let joint = &model.joints[j.joint];
                    let turn = joint.origin.inverse() * joint.transform(q(j.joint));
                    frames[j.parent] * j.origin * turn
                }
            };
            frames.push(frame);
            let handle = physics.insert_body(
                RigidBodyBuilder::dynamic()
                    .pose(pose(&frame))
                    .can_sleep(false)
                    .additional_mass_properties(mass_properties(&body.mass)),
            );
            handles.push(handle);
            for TreePart {
                link,
                part,
                pad,
                parallel,
            } in &body.parts
            {
                let solids = solids(part, RIM).map_err(|problem| WorldError::Shape {
                    body: model.links[*link].name.clone(),
                    problem,
                })?;
                let surface = if *pad { Surface::Pad } else { surface(*link) };
                let depth = match parallel {
                    Some(_) => depths[body.link],
                    None => depths[*link],
                };
                let mut touching = groups(depth, &settings.arm);
                if let (true, Shape::Cylinder { radius, .. }) = (surface.rolls(), &part.shape) {
                    let on_floor = InteractionGroups {
                        filter: FLOOR_GROUP,
                        ..touching
                    };
                    touching.filter -= FLOOR_GROUP;
                    let ball = ColliderBuilder::ball(real(*radius))
                        .translation(vector(&part.pose.translation.vector))
                        .collision_groups(on_floor)
                        .user_data(tag(BodyRef::Link(*link)));
                    physics.insert_collider(surface.coat(ball, settings), Some(handle));
                }
                let body_from_link =
                    parallel.map(|p| pose(&p.crank_from_link(model, q(p.hinge.joint))));
                for (link_from_shape, shape) in solids {
                    let place = body_from_link.map_or(link_from_shape, |b| b * link_from_shape);
                    let collider = ColliderBuilder::new(shape)
                        .position(place)
                        .collision_groups(touching)
                        .user_data(tag(BodyRef::Link(*link)));
                    let collider =
                        physics.insert_collider(surface.coat(collider, settings), Some(handle));
                    moving.extend(parallel.map(|parallel| MovingShape {
                        collider,
                        parallel,
                        link_from_shape,
                    }));
                }
            }
        }

        let mut links = vec![0; tree.bodies.len()];
        let mut multibody = None;
        for (index, body) in tree.bodies.iter().enumerate() {
            let Some(joint) = &body.joint else { continue };
            let (parent, child) = (handles[joint.parent], handles[index]);
            physics.insert_multibody_joint(parent, child, joint_data(model, joint));
            if let Some(link) = physics.multibody_joints.rigid_body_link(child) {
                links[index] = link.id;
                multibody = Some(link.multibody);
            }
        }
        let mut robot = Self {
            tree,
            handles,
            links,
            multibody,
            moving,
        };
        robot.set_positions(physics, &q);
        robot.couple(physics, model);
        Ok(robot)
    }

    /// Sets the joint positions of the multibody and removes its damping.
    fn set_positions(&mut self, physics: &mut PhysicsWorld, q: &impl Fn(usize) -> f64) {
        let Some(multibody) = self
            .multibody
            .and_then(|index| physics.multibody_joints.get_multibody_mut(index))
        else {
            return;
        };
        multibody.forward_kinematics(&physics.bodies, true);
        let mut displacement = vec![0.0; multibody.ndofs()];
        for (body, link) in self.tree.bodies.iter().zip(&self.links) {
            if let (Some(joint), Some(link)) = (&body.joint, multibody.link(*link)) {
                displacement[link.assembly_id()] = real(q(joint.joint));
            }
        }
        multibody.apply_displacements(&displacement);
        multibody.forward_kinematics(&physics.bodies, false);
        multibody.update_rigid_bodies(&mut physics.bodies, true);
        multibody.damping_mut().fill(0.0);
    }

    /// Moves the shapes of the inner knuckles to the present joint positions, before a
    /// tick. A shape with an error below [`STILL`] is not moved: the engine recomputes
    /// the mass of the whole body whenever one of its shapes moves.
    pub(super) fn place_shapes(&self, physics: &mut PhysicsWorld, model: &RobotModel) {
        for shape in &self.moving {
            let (angle, _) = self.joint_state(physics, shape.parallel.tip);
            let body_from_link = pose(&shape.parallel.crank_from_link(model, angle));
            let place = body_from_link * shape.link_from_shape;
            let Some(collider) = physics.colliders.get_mut(shape.collider) else {
                continue;
            };
            let now = collider.position_wrt_parent().map(|now| now.translation);
            if now.is_none_or(|now| (now - place.translation).length() > STILL) {
                collider.set_position_wrt_parent(place);
            }
        }
    }

    /// Whether the collider moves in its body.
    pub(super) fn moves(&self, collider: ColliderHandle) -> bool {
        self.moving.iter().any(|shape| shape.collider == collider)
    }

    /// Couples joints that follow another one. If the joint's parent follows the same
    /// joint, the coupling is to that parent: a finger tip follows its own crank. Adds
    /// the armature of cranks and tips. Without that of the tips, tip and crank chatter at
    /// 50 Hz and the grip force oscillates by half.
    fn couple(&mut self, physics: &mut PhysicsWorld, model: &RobotModel) {
        let gripper = &model.settings.gripper;
        let [crank_armature, tip_armature] =
            [gripper.knuckle_armature, gripper.tip_armature].map(real);
        let mut couplings = Vec::new();
        let mut armatures = Vec::new();
        for (body, &link) in self.tree.bodies.iter().zip(&self.links) {
            let Some(joint) = &body.joint else { continue };
            let Some((master, multiplier, offset)) = model.joints[joint.joint].mimic else {
                continue;
            };
            let parent_joint = self.tree.bodies[joint.parent].joint.map(|j| j.joint);
            let parent_mimic = parent_joint.and_then(|j| model.joints[j].mimic);
            let (leader, coeff, offset) = match (parent_joint, parent_mimic) {
                (Some(parent), Some((m, k, o))) if m == master && k != 0.0 => {
                    (parent, multiplier / k, offset - multiplier * o / k)
                }
                _ => (master, multiplier, offset),
            };
            let Some(leader_body) = self.tree.body_moved_by(leader) else {
                continue;
            };
            let leader_link = self.links[leader_body];
            if parent_joint == Some(leader) {
                armatures.push((link, tip_armature));
            } else {
                armatures.extend([(leader_link, crank_armature), (link, crank_armature)]);
            }
            couplings.push(MultibodyDofCoupling {
                link1: leader_link,
                dof1: 0,
                axis1: JointAxis::AngX as usize,
                link2: link,
                dof2: 0,
                axis2: JointAxis::AngX as usize,
                coeff: real(coeff),
                offset: real(offset),
            });
        }
        let Some(multibody) = self
            .multibody
            .and_then(|index| physics.multibody_joints.get_multibody_mut(index))
        else {
            return;
        };
        for (link, armature) in armatures {
            if let Some(dof) = multibody.link(link).map(MultibodyLink::assembly_id) {
                multibody.armature_mut()[dof] = armature;
            }
        }
        for coupling in couplings {
            multibody.add_dof_coupling(coupling);
        }
    }

    fn multibody<'a>(&self, physics: &'a PhysicsWorld) -> Option<&'a Multibody> {
        physics.multibody_joints.get_multibody(self.multibody?)
    }

    /// Data of the joint that moves a body.
    pub(super) fn joint<'a>(
        &self,
        physics: &'a PhysicsWorld,
        body: usize,
    ) -> Option<&'a GenericJoint> {
        let link = self.multibody(physics)?.link(self.links[body])?;
        Some(&link.joint().data)
    }

    /// Data of the joint that moves a body, to set its motor.
    pub(super) fn joint_mut<'a>(
        &self,
        physics: &'a mut PhysicsWorld,
        body: usize,
    ) -> Option<&'a mut GenericJoint> {
        let multibody = physics
            .multibody_joints
            .get_multibody_mut(self.multibody?)?;
        Some(&mut multibody.link_mut(self.links[body])?.joint.data)
    }

    /// Damping in the dynamics of the joint that moves a body, N·m·s/rad.
    pub(super) fn damping(&self, physics: &PhysicsWorld, body: usize) -> f64 {
        self.multibody(physics)
            .and_then(|multibody| {
                let dof = multibody.link(self.links[body])?.assembly_id();
                multibody.damping().get(dof)
            })
            .map_or(0.0, |damping| f64::from(*damping))
    }

    /// Sets [`RobotBody::damping`].
    pub(super) fn set_damping(&self, physics: &mut PhysicsWorld, body: usize, damping: f64) {
        let Some(multibody) = self
            .multibody
            .and_then(|index| physics.multibody_joints.get_multibody_mut(index))
        else {
            return;
        };
        if let Some(dof) = multibody
            .link(self.links[body])
            .map(MultibodyLink::assembly_id)
        {
            multibody.damping_mut()[dof] = real(damping);
        }
    }

    /// Position (rad) and velocity (rad/s) of the joint that moves a body.
    pub(super) fn joint_state(&self, physics: &PhysicsWorld, body: usize) -> (f64, f64) {
        self.multibody(physics)
            .and_then(|multibody| {
                let link = multibody.link(self.links[body])?;
                let position = link.joint().coords()[JointAxis::AngX as usize];
                let velocity = multibody.joint_velocity(link)[0];
                Some((f64::from(position), f64::from(velocity)))
            })
            .unwrap_or_default()
    }

    /// Body, joint of the model and velocity (rad/s) of every joint that moves.
    pub(super) fn joint_velocities<'a>(
        &'a self,
        physics: &'a PhysicsWorld,
    ) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
        let multibody = self.multibody(physics);
        let bodies = self.tree.bodies.iter().zip(&self.links).enumerate();
        bodies.filter_map(move |(body, (tree_body, link))| {
            let joint = tree_body.joint.as_ref()?.joint;
            let multibody = multibody?;
            let link = multibody.link(*link)?;
            Some((body, joint, f64::from(multibody.joint_velocity(link)[0])))
        })
    }

    /// Sets the velocity of the joint that moves a body, rad/s.
    pub(super) fn set_velocity(&self, physics: &mut PhysicsWorld, body: usize, speed: f64) {
        let multibody = self
            .multibody
            .and_then(|index| physics.multibody_joints.get_multibody_mut(index));
        if let Some(multibody) = multibody
            && let Some(dof) = multibody
                .link(self.links[body])
                .map(MultibodyLink::assembly_id)
        {
            multibody.generalized_velocity_mut()[dof] = real(speed);
        }
    }

    /// Velocity of the root's frame in `house`: linear, m/s, and angular, rad/s.
    pub(super) fn root_velocity(&self, physics: &PhysicsWorld) -> (Vector3<f64>, Vector3<f64>) {
        let root = self.multibody(physics).and_then(|multibody| {
            let velocity = multibody.joint_velocity(multibody.root());
            let part = |i: usize| Some(f64::from(*velocity.get(i)?));
            let linear = Vector3::new(part(0)?, part(1)?, part(2)?);
            let angular = Vector3::new(part(3)?, part(4)?, part(5)?);
            Some((linear, angular))
        });
        root.unwrap_or_else(|| (Vector3::zeros(), Vector3::zeros()))
    }

    /// Removes whole turns from a joint without limits, so that single precision
    /// remains accurate over any rolled distance.
    pub(super) fn take_turns_out(&self, physics: &mut PhysicsWorld, body: usize) {
        let (position, _) = self.joint_state(physics, body);
        let turns = (position / TAU).round();
        let link = self
            .multibody
            .and_then(|index| physics.multibody_joints.get_multibody_mut(index))
            .and_then(|multibody| multibody.link_mut(self.links[body]));
        if let (Some(link), true) = (link, turns != 0.0) {
            link.joint.apply_displacement(&[real(-turns * TAU)]);
        }
    }

    /// Pose of a body's frame in `house`.
    pub(super) fn frame(&self, physics: &PhysicsWorld, body: usize) -> Isometry3<f64> {
        from_pose(physics.bodies[self.handles[body]].position())
    }

    /// Normalises the rotation of the free root, which the engine never does.
    pub(super) fn normalise_root(&self, physics: &mut PhysicsWorld) {
        let Some(root) = physics.bodies.get_mut(self.handles[0]) else {
            return;
        };
        let rotation = root.rotation().normalize();
        root.set_rotation(rotation, false);
    }
}

fn joint_data(model: &RobotModel, tree_joint: &TreeJoint) -> GenericJoint {
    let joint = &model.joints[tree_joint.joint];
    let joint_from_x = UnitQuaternion::rotation_between_axis(&Vector3::x_axis(), &joint.axis)
        .unwrap_or_else(|| {
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI)
        });
    let joint_from_x = Isometry3::from_parts(nalgebra::Translation3::identity(), joint_from_x);
    let mut data = GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
        .local_frame1(pose(&(tree_joint.origin * joint_from_x)))
        .local_frame2(pose(&joint_from_x))
        .contacts_enabled(false);
    if joint.kind == JointKind::Revolute && joint.mimic.is_none() {
        data = data.limits(
            JointAxis::AngX,
            [real(joint.limits.lower), real(joint.limits.upper)],
        );
    }
    data.build()
}

/// Collision groups of the person: those of the chair, which does not collide with the
/// person.
pub(super) fn person_groups(arm: &ArmSettings) -> InteractionGroups {
    groups(None, arm)
}

/// Number of moving joints between the arm's base and each link; `None` on the chair.
fn arm_depths(model: &RobotModel) -> Vec<Option<u32>> {
    let mut depths = vec![None; model.links.len()];
    for (index, link) in model.links.iter().enumerate() {
        if link.name == model.settings.arm_base_link {
            depths[index] = Some(0);
        } else if let Some(joint) = index.checked_sub(1).map(|j| &model.joints[j]) {
            let moves = u32::from(joint.kind != JointKind::Fixed);
            depths[index] = depths[joint.parent].map(|d: u32| d + moves);
        }
    }
    depths
}

/// Collision groups of a link: the whole scene, and those parts of the robot that it
/// can reach.
fn groups(depth: Option<u32>, arm: &ArmSettings) -> InteractionGroups {
    const DEEPEST: u32 = 15;
    let arm_bit = |d: u32| CHAIR_BIT << (1 + d.min(DEEPEST));
    let (own, others) = match depth {
        None => (
            CHAIR_BIT,
            (arm.chair_contact_joints..=DEEPEST)
                .map(arm_bit)
                .fold(0, |a, b| a | b),
        ),
        Some(depth) => {
            let touches_chair = depth >= arm.chair_contact_joints;
            let chair = if touches_chair { CHAIR_BIT } else { 0 };
            let links = (0..=DEEPEST)
                .filter(|d| d.abs_diff(depth) >= arm.self_contact_joints)
                .map(arm_bit)
                .fold(0, |a, b| a | b);
            (arm_bit(depth), chair | links)
        }
    };
    InteractionGroups::new(
        Group::from_bits_truncate(own),
        Group::from_bits_truncate(others) | SCENE_GROUP | FLOOR_GROUP,
        InteractionTestMode::And,
    )
}
