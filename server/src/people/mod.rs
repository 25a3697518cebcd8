//! The person in the chair: bodies, postures and clothes of `assets/people`, sampled by
//! a seed and posed, as data for physics, images and clients.
//!
//! Uses neither rapier nor wgpu. A [`Person`] is immutable; motion (head and jaw)
//! depends only on a seed and the tick (`motion`). Positions are in the frame of the
//! chair, `wheelchair_root`, unless noted otherwise.

mod file;
mod folder;
mod load;
mod mesh;
mod motion;
mod part;
mod person_sampling;
mod random;
mod setting;
mod skeleton;

use nalgebra::{Matrix3, Point3};

pub use folder::files;
pub use mesh::{SkinnedMesh, Surface};
pub use motion::{HeadLimits, HeadPose, Motion};
pub use part::{BodyPart, CAPSULES, PARTS, person_part};
pub use setting::{PersonSetting, SampledPerson};
pub use skeleton::Skeleton;

/// A seated person.
#[derive(Clone, Debug)]
pub struct Person {
    /// Identity, posture and clothes.
    pub drawn: SampledPerson,
    /// Description of the body.
    pub words: String,
    /// Sole to crown, metres.
    pub stature: f64,
    /// kg.
    pub mass: f64,
    /// Centre of mass.
    pub com: Point3<f64>,
    /// Inertia about the centre of mass, kg·m².
    pub inertia: Matrix3<f64>,
    /// Height of the seat above the foot plate, metres.
    pub seat_height: f64,
    /// Additional thickness of the seat, metres.
    pub cushion: f64,
    /// Collision capsules, in the order of [`CAPSULES`].
    pub capsules: Vec<Capsule>,
    /// How far the mesh may extend beyond the capsules, metres.
    pub margin: f64,
    /// Area of the lap where an object may rest.
    pub lap: Lap,
    /// Between the lips.
    pub mouth: Landmark,
    /// Joints in the posture.
    pub skeleton: Skeleton,
    /// Rendered mesh.
    pub mesh: SkinnedMesh,
    /// Range of head and jaw.
    pub limits: HeadLimits,
}

/// A capsule on a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Capsule {
    /// Its name, for example `left_forearm`.
    pub name: String,
    /// Its body part.
    pub part: BodyPart,
    /// Its joint, index into the skeleton.
    pub joint: usize,
    /// Its ends, in the frame of the joint.
    pub ends: [Point3<f64>; 2],
    /// Metres.
    pub radius: f64,
    /// Whether it moves with the head.
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

/// A mouth with the joints that move it.
#[derive(Clone, Debug, PartialEq)]
pub struct Mouth {
    skeleton: Skeleton,
    at: Landmark,
}

/// Area of the lap where an object may rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lap {
    /// Middle of the upper side.
    pub at: Point3<f64>,
    /// Along x and y, metres.
    pub size: [f64; 2],
}

impl Person {
    /// Ends of a capsule for a pose of the head.
    #[must_use]
    pub fn ends(&self, capsule: &Capsule, head: &HeadPose) -> [Point3<f64>; 2] {
        let pose = self.skeleton.joint(capsule.joint, head);
        capsule.ends.map(|end| pose * end)
    }

    /// Frame of the mouth for a pose of the head: origin between the lips, x out of the
    /// mouth, z up.
    #[must_use]
    pub fn mouth(&self, head: &HeadPose) -> nalgebra::Isometry3<f64> {
        self.mouth.frame(&self.skeleton, head)
    }

    /// The mouth with the joints that move it, without the rest of the body.
    #[must_use]
    pub fn own_mouth(&self) -> Mouth {
        Mouth {
            skeleton: self.skeleton.clone(),
            at: self.mouth,
        }
    }
}

impl Landmark {
    /// Frame of the landmark, rotated like its joint, for a pose of the head.
    fn frame(&self, skeleton: &Skeleton, head: &HeadPose) -> nalgebra::Isometry3<f64> {
        skeleton.joint(self.joint, head) * nalgebra::Translation3::from(self.at.coords)
    }
}

impl Mouth {
    /// Frame of the mouth for a pose of the head, see [`Person::mouth`].
    #[must_use]
    pub fn frame(&self, head: &HeadPose) -> nalgebra::Isometry3<f64> {
        self.at.frame(&self.skeleton, head)
    }
}

#[cfg(test)]
mod tests;
