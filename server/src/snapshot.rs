//! The state after a step, as plain data for sensors and tasks.

use nalgebra::{Isometry3, Point3, Vector3};
use wheelarm_proto::stamp_nanos;

use crate::people::{BodyPart, HeadPose, PARTS};

/// State of the simulation after one physics tick. Immutable.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Physics tick, 240 per second.
    pub tick: u64,
    /// Joints in the order of `RobotModel::joints` (all of them, mimic joints included).
    pub joints: Vec<JointState>,
    /// Links in the order of `RobotModel::links`.
    pub links: Vec<BodyState>,
    /// Objects in the order of `Scene::objects`.
    pub objects: Vec<BodyState>,
    /// Skins of the deformables, by object.
    pub skins: Vec<SoftSkin>,
    /// Joints of furniture in the order of `Scene::joints`: metres, m/s, and the
    /// force of their dry friction, N.
    pub furniture_joints: Vec<JointState>,
    /// The furniture on these joints.
    pub sliding: Vec<BodyState>,
    /// Touching pairs that involve the robot or an object, summed per pair.
    pub contacts: Vec<Contact>,
    /// The person in the chair; `None` for an empty chair.
    pub person: Option<PersonState>,
    /// Anomalies of this step; empty in the normal case.
    pub anomalies: Vec<Anomaly>,
}

impl Snapshot {
    /// Simulation time in nanoseconds.
    #[must_use]
    pub fn stamp_nanos(&self) -> u64 {
        stamp_nanos(self.tick)
    }
}

/// One joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointState {
    /// Radians (unwrapped) or metres.
    pub position: f64,
    /// rad/s or m/s.
    pub velocity: f64,
    /// Torque of the drive, N·m, or force, N.
    pub effort: f64,
}

/// One rigid body or frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyState {
    /// Pose of the body's frame in `house` (world_from_body).
    pub pose: Isometry3<f64>,
    /// Velocity of the frame's origin in `house`, m/s.
    pub linear: Vector3<f64>,
    /// Angular velocity in `house`, rad/s.
    pub angular: Vector3<f64>,
}

/// The shape of one deformable.
#[derive(Clone, Debug, PartialEq)]
pub struct SoftSkin {
    /// Index into `Scene::objects`.
    pub object: usize,
    /// Vertices in `house`, metres, in the order of `Soft::skin`.
    pub vertices: Vec<Point3<f32>>,
    /// Elastic energy, J.
    pub elastic_energy: f64,
    /// Kinetic energy, J.
    pub kinetic_energy: f64,
}

/// A person in the chair.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PersonState {
    /// Rotation of head and jaw relative to the posture.
    pub head: HeadPose,
    /// Force on each part of the body, in the order of `PARTS`: the largest of the
    /// control tick's physics ticks, N.
    pub forces: [f64; PARTS.len()],
    /// Force of the robot on the whole person, likewise, N.
    pub robot_force: f64,
    /// Each body that touched a part of the person in these physics ticks, sorted by part
    /// and body. A contact at the mouth is listed for mouth and face.
    pub touches: Vec<Touch>,
}

/// One body on one part of the person.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Touch {
    /// The touched part.
    pub part: BodyPart,
    /// The body that touches it.
    pub partner: BodyRef,
    /// Force on the part, N: the largest of the control tick's physics ticks, for an
    /// object their mean.
    pub force: f64,
    /// Weight of an object, N; 0 for robot and furniture.
    pub weight: f64,
}

impl BodyState {
    /// A body at rest.
    #[must_use]
    pub fn resting(pose: Isometry3<f64>) -> Self {
        Self {
            pose,
            linear: Vector3::zeros(),
            angular: Vector3::zeros(),
        }
    }

    /// State of a frame fixed to this one at `own_from_frame`.
    #[must_use]
    pub fn carrying(&self, own_from_frame: Isometry3<f64>) -> Self {
        let pose = self.pose * own_from_frame;
        Self {
            pose,
            linear: self.velocity_at(&pose.translation.vector),
            angular: self.angular,
        }
    }

    /// Velocity, m/s, of a point of `house` that is fixed to this frame.
    #[must_use]
    pub fn velocity_at(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(&(point - self.pose.translation.vector))
    }
}

/// A body that can touch another.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
pub enum BodyRef {
    /// Index into `RobotModel::links`.
    Link(usize),
    /// Index into `Scene::objects`.
    Object(usize),
    /// Index into `Scene::furniture`; 0 is the floor.
    Furniture(usize),
    /// Capsule of the person in the chair, index into `people::CAPSULES`.
    Person(usize),
}

/// A touching pair, summed over its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// First body.
    pub first: BodyRef,
    /// Second body.
    pub second: BodyRef,
    /// Mean contact point in `house`, metres.
    pub point: Vector3<f64>,
    /// Force on the second body in `house`, N, averaged over the last step.
    pub force: Vector3<f64>,
}

/// An anomaly with which the simulation continues: recorded and counted.
#[derive(Clone, Debug, PartialEq)]
pub enum Anomaly {
    /// A body's state is not finite.
    NotFinite(BodyRef),
    /// An object left the house.
    Escaped(BodyRef),
    /// A joint (index into `RobotModel::joints`) turns faster than twice its limit.
    Fast(usize),
}

/// Why a state is broken: later states are not valid.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// A body's state is not finite.
    NotFinite(BodyRef),
    /// A joint of the robot, index into `RobotModel::joints`, is too fast, rad/s.
    JointSpeed {
        /// The joint.
        joint: usize,
        /// Its speed, rad/s.
        speed: f64,
        /// Limit, rad/s.
        most: f64,
    },
    /// A contact force is too large.
    Contact {
        /// First body.
        first: BodyRef,
        /// Second body.
        second: BodyRef,
        /// Force, N.
        force: f64,
    },
    /// A node of a deformable is too fast, m/s.
    NodeSpeed {
        /// Index into `Scene::objects`.
        object: usize,
        /// Its speed, m/s.
        speed: f64,
    },
    /// A deformable has too much elastic and kinetic energy, J.
    Energy {
        /// Index into `Scene::objects`.
        object: usize,
        /// J.
        energy: f64,
    },
    /// The chair is outside the home, or far above or below the floor.
    Outside {
        /// Position of the chair in `house`, metres.
        at: Vector3<f64>,
    },
    /// The simulation panicked, with the panic message.
    Panic(String),
}
