//! Joints of a seated body: the posture is fixed, head and jaw move.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::motion::HeadPose;

/// Joints in the frame of the chair.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    /// Parents precede children.
    parents: Vec<Option<usize>>,
    /// Rest positions.
    rest: Vec<Point3<f64>>,
    /// Rotations relative to the parents in the posture.
    turns: Vec<UnitQuaternion<f64>>,
    /// chair_from_joint in the posture.
    posed: Vec<Isometry3<f64>>,
    /// Joints that share the head's motion, with their shares.
    neck: [(usize, f64); 3],
    jaw: usize,
    /// Joints that move with head or jaw.
    moving: Vec<bool>,
}

impl Skeleton {
    /// Joints with their parents and rest positions, `turns` relative to the parents,
    /// and the position of the root.
    pub(super) fn new(
        parents: Vec<Option<usize>>,
        rest: Vec<Point3<f64>>,
        turns: Vec<UnitQuaternion<f64>>,
        root: Point3<f64>,
        neck: [(usize, f64); 3],
        jaw: usize,
    ) -> Self {
        let mut posed: Vec<Isometry3<f64>> = Vec::with_capacity(rest.len());
        let mut moving: Vec<bool> = Vec::with_capacity(rest.len());
        for (joint, parent) in parents.iter().enumerate() {
            posed.push(match parent {
                None => Isometry3::from_parts(Translation3::from(root.coords), turns[joint]),
                Some(parent) => {
                    let offset = rest[joint] - rest[*parent];
                    posed[*parent] * Isometry3::from_parts(offset.into(), turns[joint])
                }
            });
            let turned = joint == jaw || neck.iter().any(|(n, _)| *n == joint);
            moving.push(turned || parent.is_some_and(|p| moving[p]));
        }
        Self {
            parents,
            rest,
            turns,
            posed,
            neck,
            jaw,
            moving,
        }
    }

    /// Number of joints.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Whether the skeleton is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// Whether head or jaw move a joint.
    #[must_use]
    pub fn moves(&self, joint: usize) -> bool {
        self.moving.get(joint).copied().unwrap_or_default()
    }

    /// Rest position of a joint, in the frame of the body at rest.
    #[must_use]
    pub fn rest(&self, joint: usize) -> Point3<f64> {
        self.rest[joint]
    }

    /// chair_from_joint for a pose of the head.
    #[must_use]
    pub fn joint(&self, joint: usize, head: &HeadPose) -> Isometry3<f64> {
        if !self.moving[joint] {
            return self.posed[joint];
        }
        let own = self.turns[joint] * self.extra(joint, head);
        match self.parents[joint] {
            None => Isometry3::from_parts(self.posed[joint].translation, own),
            Some(parent) => {
                let offset = self.rest[joint] - self.rest[parent];
                self.joint(parent, head) * Isometry3::from_parts(offset.into(), own)
            }
        }
    }

    /// chair_from_joint of all joints.
    #[must_use]
    pub fn joints(&self, head: &HeadPose) -> Vec<Isometry3<f64>> {
        (0..self.len())
            .map(|joint| self.joint(joint, head))
            .collect()
    }

    /// Rotation of a joint by the motion.
    fn extra(&self, joint: usize, head: &HeadPose) -> UnitQuaternion<f64> {
        let about = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
        if joint == self.jaw {
            return about(Vector3::y(), head.jaw);
        }
        let share = self.neck.iter().find(|(n, _)| *n == joint);
        let Some((_, share)) = share else {
            return UnitQuaternion::identity();
        };
        about(Vector3::z(), head.yaw * share)
            * about(Vector3::y(), head.pitch * share)
            * about(Vector3::x(), head.roll * share)
    }
}
