//! The arm approximated by spheres, to test its distance to the person in the chair.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::geometry::bounds;
use crate::people::{HeadPose, Person};
use crate::robot::{ARM_JOINTS, RobotModel};

/// Minimum distance of the arm to the capsules of the person, metres. [choice: clothes
/// extend this far beyond them]
const ROOM: f64 = 0.015;
/// Additional distance to parts that move with the head.
const HEAD_ROOM: f64 = 0.03;
/// The arm as spheres on its links.
#[derive(Clone, Debug)]
pub(super) struct ArmBalls {
    /// Link, centre in its frame, radius.
    balls: Vec<(usize, Point3<f64>, f64)>,
}

impl ArmBalls {
    /// Covers the links from the second joint of the arm on.
    pub(super) fn new(model: &RobotModel) -> Self {
        let second = model.roles.arm[1];
        let mut balls = Vec::new();
        for (index, link) in model.links.iter().enumerate() {
            let chain = model.chain(model.roles.arm_base, index);
            if !chain.is_some_and(|joints| joints.contains(&second)) {
                continue;
            }
            for part in link.collision.iter().map(|c| &c.part) {
                let Some((centre, half)) = bounds(&part.shape) else {
                    continue;
                };
                let long = half.imax();
                let radius = (0..3)
                    .filter(|i| *i != long)
                    .map(|i| half[i])
                    .fold(0.0, f64::max);
                let way = (half[long] - radius).max(0.0);
                let count = (way / radius.max(1e-3)).ceil() as i32;
                for k in -count..=count {
                    let mut at = centre;
                    at[long] += way * f64::from(k) / f64::from(count.max(1));
                    balls.push((index, part.pose * Point3::from(at), radius));
                }
            }
        }
        Self { balls }
    }

    /// Whether the arm is clear of `person` with its joints at these positions, rad,
    /// and the gripper open.
    pub(super) fn is_clear(
        &self,
        person: &Person,
        model: &RobotModel,
        arm: &[f64; ARM_JOINTS],
    ) -> bool {
        let mut positions = vec![0.0; model.joints.len()];
        for (&joint, &position) in model.roles.arm.iter().zip(arm) {
            positions[joint] = position;
        }
        self.meets(person, &model.link_poses(&positions)).is_none()
    }

    /// Name of the first capsule that the arm is too close to, with the links at these
    /// poses in the frame of the chair.
    pub(super) fn meets<'a>(
        &self,
        person: &'a Person,
        poses: &[Isometry3<f64>],
    ) -> Option<&'a str> {
        let straight = HeadPose::default();
        let capsules = person.capsules.iter();
        let placed: Vec<_> = capsules.map(|c| (c, person.ends(c, &straight))).collect();
        self.balls.iter().find_map(|(link, at, radius)| {
            let at = poses[*link] * at;
            let near = placed.iter().find(|(capsule, ends)| {
                let room = if capsule.moves {
                    ROOM + HEAD_ROOM
                } else {
                    ROOM
                };
                distance(&at, ends) < capsule.radius + radius + room
            });
            near.map(|(capsule, _)| capsule.name.as_str())
        })
    }
}

/// Distance of a point to a line segment, metres.
pub(super) fn distance(at: &Point3<f64>, [a, b]: &[Point3<f64>; 2]) -> f64 {
    let along: Vector3<f64> = b - a;
    let length = along.norm_squared();
    let part = if length > 0.0 {
        (at - a).dot(&along) / length
    } else {
        0.0
    };
    (at - (a + along * part.clamp(0.0, 1.0))).norm()
}
