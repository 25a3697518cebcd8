//! Who sits in the chair: bodies, postures and clothes of `assets/people`, drawn by a
//! seed, posed, with what physics, pictures and clients need to know of them.
//!
//! Names neither rapier nor wgpu. A [`Person`] never changes; what moves (head and
//! jaw) follows from a seed and the tick alone (`motion`). All places are in the
//! frame of the chair, `wheelchair_root`, unless they say otherwise.

mod draw;
mod file;
mod folder;
mod load;
mod mesh;
mod motion;
mod part;
mod random;
mod setting;
mod skeleton;

use nalgebra::{Matrix3, Point3};

pub use folder::files;
pub use mesh::{SkinnedMesh, Surface};
pub use motion::{HeadLimits, HeadPose, Motion};
pub use part::{BodyPart, CAPSULES, PARTS, person_part};
pub use setting::{DrawnPerson, PersonSetting};
pub use skeleton::Skeleton;

/// A person who sits.
#[derive(Clone, Debug)]
pub struct Person {
    /// Who, how, and in what.
    pub drawn: DrawnPerson,
    /// The body in words.
    pub words: String,
    /// Sole to crown, metres.
    pub stature: f64,
    /// kg.
    pub mass: f64,
    /// Centre of mass.
    pub com: Point3<f64>,
    /// Inertia about the centre of mass, kg·m².
    pub inertia: Matrix3<f64>,
    /// Seat over the foot plate, metres.
    pub seat_height: f64,
    /// How much thicker the seat is than the chair's own, metres.
    pub cushion: f64,
    /// For contact, in the order of [`CAPSULES`].
    pub capsules: Vec<Capsule>,
    /// How far the mesh may stand out of the capsules, metres.
    pub margin: f64,
    /// Where a thing may lie in the lap.
    pub lap: Lap,
    /// Between the lips.
    pub mouth: Landmark,
    /// Joints in the posture.
    pub skeleton: Skeleton,
    /// What is drawn.
    pub mesh: SkinnedMesh,
    /// Range of head and jaw.
    pub limits: HeadLimits,
}

/// A capsule on a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Capsule {
    /// Its name, for example `left_forearm`.
    pub name: String,
    /// Part of the body that it belongs to.
    pub part: BodyPart,
    /// Joint that carries it, index into the skeleton.
    pub joint: usize,
    /// Its ends, in the frame of the joint.
    pub ends: [Point3<f64>; 2],
    /// Metres.
    pub radius: f64,
    /// It moves with the head.
    pub moves: bool,
}

/// A point on a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    /// Index into the skeleton.
    pub joint: usize,
    /// In the frame of the joint.
    pub at: Point3<f64>,
}

/// A mouth with what moves it.
#[derive(Clone, Debug, PartialEq)]
pub struct Mouth {
    skeleton: Skeleton,
    at: Landmark,
}

/// Where a thing may lie in the lap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lap {
    /// Middle of the upper side.
    pub at: Point3<f64>,
    /// Along x and y, metres.
    pub size: [f64; 2],
}

impl Person {
    /// Ends of a capsule with the head as told.
    #[must_use]
    pub fn ends(&self, capsule: &Capsule, head: &HeadPose) -> [Point3<f64>; 2] {
        let pose = self.skeleton.joint(capsule.joint, head);
        capsule.ends.map(|end| pose * end)
    }

    /// Frame of the mouth with the head as told: origin between the lips, x out of
    /// the mouth, z up.
    #[must_use]
    pub fn mouth(&self, head: &HeadPose) -> nalgebra::Isometry3<f64> {
        self.mouth.on(&self.skeleton, head)
    }

    /// The mouth with what moves it, without the rest of the body.
    #[must_use]
    pub fn own_mouth(&self) -> Mouth {
        Mouth {
            skeleton: self.skeleton.clone(),
            at: self.mouth,
        }
    }
}

impl Landmark {
    /// Frame of the landmark, turned as its joint is, with the head as told.
    fn on(&self, skeleton: &Skeleton, head: &HeadPose) -> nalgebra::Isometry3<f64> {
        skeleton.joint(self.joint, head) * nalgebra::Translation3::from(self.at.coords)
    }
}

impl Mouth {
    /// Frame of the mouth with the head as told, see [`Person::mouth`].
    #[must_use]
    pub fn with(&self, head: &HeadPose) -> nalgebra::Isometry3<f64> {
        self.at.on(&self.skeleton, head)
    }
}

#[cfg(test)]
mod tests;
