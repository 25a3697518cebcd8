//! Merges the robot's links into the bodies that actually move.
//!
//! Links joined by fixed joints are one body: masses are composed exactly, collision
//! parts are attached. Two kinds of links are posed by forward kinematics only:
//!
//! - The front omni wheels roll forward and slip sideways without friction: they are
//!   fixed to the chassis and rotate by the travelled distance.
//! - The inner knuckles of the gripper are the closing link of a parallelogram. Their
//!   mass is part of the hand. Their collision parts are attached to the crank, which
//!   rotates alike, and are moved before each tick.

use nalgebra::Isometry3;

use super::WorldError;
use super::mass::Mass;
use crate::geometry::Part;
use crate::robot::{Joint, JointKind, PAD, RobotModel};

/// The bodies of a robot; index 0 is the root. Parents precede children.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    /// Bodies.
    pub bodies: Vec<TreeBody>,
    /// Where each link of the model is.
    pub places: Vec<Place>,
    /// Frame of body 0 in the root link.
    pub root_from_body: Isometry3<f64>,
}

/// One body.
#[derive(Clone, Debug)]
pub(super) struct TreeBody {
    /// Link whose frame is the body's frame; the root body's frame is at its centre of
    /// mass.
    pub link: usize,
    /// Mass of all links in it.
    pub mass: Mass,
    /// Collision parts in the body's frame.
    pub parts: Vec<TreePart>,
    /// Joint to its parent; `None` for the root.
    pub joint: Option<TreeJoint>,
}

/// A collision part of a body.
#[derive(Clone, Debug)]
pub(super) struct TreePart {
    /// Link that it belongs to.
    pub link: usize,
    /// Pose and shape in the body's frame.
    pub part: Part,
    /// Whether it is the pad of a finger.
    pub pad: bool,
    /// Its motion in the body; `None` when it is fixed.
    pub parallel: Option<Parallel>,
}

/// The motion of an inner knuckle in the frame of its crank. The knuckle is attached to
/// a pin of the finger tip, which turns on the crank.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parallel {
    /// Body of the finger tip.
    pub tip: usize,
    /// Joint between the finger tip and the crank.
    pub hinge: TreeJoint,
    /// Joint of the model at the pin.
    pub pin: usize,
    /// Angle of the pin divided by that of the finger tip's joint.
    pub ratio: f64,
}

impl Parallel {
    /// Pose of the inner knuckle in its crank, for an angle of the finger tip's joint,
    /// rad.
    pub(super) fn crank_from_link(&self, model: &RobotModel, angle: f64) -> Isometry3<f64> {
        let joint = &model.joints[self.hinge.joint];
        let turn = joint.origin.inverse() * joint.transform(angle);
        self.hinge.origin * turn * model.joints[self.pin].transform(self.ratio * angle)
    }
}

/// The joint between a body and its parent.
#[derive(Clone, Copy, Debug)]
pub(super) struct TreeJoint {
    /// Index into `RobotModel::joints`.
    pub joint: usize,
    /// Index of the parent body.
    pub parent: usize,
    /// parent_from_joint at zero.
    pub origin: Isometry3<f64>,
}

/// Location of a link.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place {
    /// Fixed in a body: `(body, body_from_link)`.
    InBody(usize, Isometry3<f64>),
    /// Front wheel: posed by this joint relative to its parent link.
    Rolling(usize),
    /// Inner knuckle: posed by this joint relative to its parent link.
    Parallel(usize),
}

impl Tree {
    /// Merges the links of a model.
    pub(super) fn new(model: &RobotModel) -> Result<Self, WorldError> {
        let root = TreeBody {
            link: 0,
            mass: Mass::none(),
            parts: Vec::new(),
            joint: None,
        };
        let mut tree = Self {
            bodies: vec![root],
            places: vec![Place::InBody(0, Isometry3::identity())],
            root_from_body: Isometry3::identity(),
        };
        for (index, joint) in model.joints.iter().enumerate() {
            let place = tree.place(model, index, joint)?;
            tree.places.push(place);
        }
        let at_zero = model.link_poses(&vec![0.0; model.joints.len()]);
        let carrier = model.roles.end_effector;
        let frame_in = |tree: &Self, carrier: usize, index: usize| {
            let body = tree.body_of(carrier).unwrap_or(0);
            let frame = at_zero[tree.bodies[body].link];
            (body, frame.inv_mul(&at_zero[index]))
        };
        for (index, link) in model.links.iter().enumerate() {
            let (body, body_from_link) = match tree.places[index] {
                Place::InBody(body, body_from_link) => (body, body_from_link),
                Place::Rolling(joint) => frame_in(&tree, model.joints[joint].parent, index),
                Place::Parallel(_) => frame_in(&tree, carrier, index),
            };
            if let Some(inertial) = &link.inertial {
                let own = Mass {
                    mass: inertial.mass,
                    com: inertial.com,
                    inertia: inertial.inertia,
                };
                let body = &mut tree.bodies[body];
                body.mass = body.mass.plus(&own.transformed_by(&body_from_link));
            }
            let (body, parallel) = match tree.places[index] {
                Place::Parallel(joint) => {
                    let (crank, parallel) = tree.crank_of(model, joint)?;
                    (crank, Some(parallel))
                }
                _ => (body, None),
            };
            // The pose of a part that moves in its body follows from the joints.
            let body_from_link = match parallel {
                Some(_) => Isometry3::identity(),
                None => body_from_link,
            };
            let parts = link.collision.iter().map(|collider| TreePart {
                link: index,
                part: Part {
                    pose: body_from_link * collider.part.pose,
                    shape: collider.part.shape.clone(),
                },
                pad: collider.name == PAD,
                parallel,
            });
            tree.bodies[body].parts.extend(parts);
        }
        for body in &tree.bodies {
            if !body.mass.is_physical() {
                return Err(WorldError::Mass {
                    body: model.links[body.link].name.clone(),
                    mass: body.mass.mass,
                });
            }
        }
        tree.centre_root();
        Ok(tree)
    }

    /// The crank beside an inner knuckle, which is attached to the finger tip by the
    /// joint `pin`, and the knuckle's motion in the crank's frame.
    fn crank_of(&self, model: &RobotModel, pin: usize) -> Result<(usize, Parallel), WorldError> {
        let ratio = |joint: usize| model.joints[joint].mimic.map(|(_, by, _)| by);
        let tip = self.body_of(model.joints[pin].parent);
        let hinge = tip.and_then(|tip| self.bodies[tip].joint);
        let found = tip.zip(hinge).and_then(|(tip, hinge)| {
            let ratio = ratio(pin)? / ratio(hinge.joint)?;
            let parallel = Parallel {
                tip,
                hinge,
                pin,
                ratio,
            };
            ratio.is_finite().then_some((hinge.parent, parallel))
        });
        found.ok_or_else(|| WorldError::JointOrder {
            joint: model.joints[pin].name.clone(),
        })
    }

    /// Moves the frame of the root body to its centre of mass. The engine integrates
    /// the free root as if its origin were its centre of mass; otherwise a turning
    /// chair would slide sideways.
    fn centre_root(&mut self) {
        let root_from_body =
            Isometry3::from(nalgebra::Translation3::from(self.bodies[0].mass.com.coords));
        let body_from_root = root_from_body.inverse();
        let root = &mut self.bodies[0];
        root.mass = root.mass.transformed_by(&body_from_root);
        for part in &mut root.parts {
            part.part.pose = body_from_root * part.part.pose;
        }
        for body in &mut self.bodies {
            if let Some(joint) = body.joint.as_mut().filter(|j| j.parent == 0) {
                joint.origin = body_from_root * joint.origin;
            }
        }
        for place in &mut self.places {
            if let Place::InBody(0, body_from_link) = place {
                *body_from_link = body_from_root * *body_from_link;
            }
        }
        self.root_from_body = root_from_body;
    }

    fn place(
        &mut self,
        model: &RobotModel,
        index: usize,
        joint: &Joint,
    ) -> Result<Place, WorldError> {
        if joint.child != index + 1 || joint.parent > index {
            return Err(WorldError::JointOrder {
                joint: joint.name.clone(),
            });
        }
        if model.roles.casters.contains(&index) {
            return Ok(Place::Rolling(index));
        }
        if model.roles.inner_knuckles.contains(&index) {
            return Ok(Place::Parallel(index));
        }
        let Place::InBody(parent, body_from_parent) = self.places[joint.parent] else {
            return Err(WorldError::JointOrder {
                joint: joint.name.clone(),
            });
        };
        let origin = body_from_parent * joint.origin;
        match joint.kind {
            JointKind::Fixed => Ok(Place::InBody(parent, origin)),
            JointKind::Revolute | JointKind::Continuous => {
                self.bodies.push(TreeBody {
                    link: joint.child,
                    mass: Mass::none(),
                    parts: Vec::new(),
                    joint: Some(TreeJoint {
                        joint: index,
                        parent,
                        origin,
                    }),
                });
                Ok(Place::InBody(self.bodies.len() - 1, Isometry3::identity()))
            }
            JointKind::Prismatic => Err(WorldError::JointKind {
                joint: joint.name.clone(),
                link: model.links[joint.child].name.clone(),
            }),
        }
    }

    /// Body that contains a link; posed links have none.
    pub(super) fn body_of(&self, link: usize) -> Option<usize> {
        match self.places[link] {
            Place::InBody(body, _) => Some(body),
            Place::Rolling(_) | Place::Parallel(_) => None,
        }
    }

    /// Body moved by a joint of the model, if any.
    pub(super) fn body_moved_by(&self, joint: usize) -> Option<usize> {
        self.bodies
            .iter()
            .position(|b| b.joint.is_some_and(|j| j.joint == joint))
    }
}
