//! Whether the arm stays within the robot's outlines.

use nalgebra::{Point3, Translation3, Vector3};

use super::{ARM_JOINTS, OutlineSettings, RobotModel};
use crate::geometry::bounds;

/// Corners of bounding boxes extend beyond round shapes by about this much, metres.
const SLACK: f64 = 0.02;

impl RobotModel {
    /// Whether the robot with its arm at these positions, rad, is within its outlines,
    /// which were measured with the arm at home. If so, it can drive wherever it can
    /// with the arm at home.
    #[must_use]
    pub fn is_within_outlines(&self, arm: &[f64; ARM_JOINTS]) -> bool {
        self.is_within(&self.settings.outlines, arm)
    }

    /// Whether the robot with its arm at these positions, rad, is within `outlines`.
    #[must_use]
    pub fn is_within(&self, outlines: &[OutlineSettings], arm: &[f64; ARM_JOINTS]) -> bool {
        let mut positions = vec![0.0; self.joints.len()];
        for (&joint, &position) in self.roles.arm.iter().zip(arm) {
            positions[joint] = position;
        }
        let poses = self.link_poses(&positions);
        let moves = |link: usize| {
            let chain = self.chain(self.roles.arm_base, link);
            chain.is_some_and(|joints| joints.contains(&self.roles.arm[0]))
        };
        (0..self.links.len())
            .filter(|link| moves(*link))
            .all(|link| {
                let parts = self.links[link].collision.iter().map(|c| &c.part);
                parts
                    .filter_map(|part| {
                        let (centre, half) = bounds(&part.shape)?;
                        Some((poses[link] * part.pose * Translation3::from(centre), half))
                    })
                    .all(|(pose, half)| {
                        (0..8).all(|i| {
                            let sign = |bit: usize| if i & bit == 0 { -1.0 } else { 1.0 };
                            let corner = Vector3::new(sign(1), sign(2), sign(4));
                            let corner = pose * Point3::from(corner.component_mul(&half));
                            is_point_within(outlines, &corner)
                        })
                    })
            })
    }
}

/// Whether a point in the root frame is within the outline at its height.
fn is_point_within(outlines: &[OutlineSettings], point: &Point3<f64>) -> bool {
    let mut outlines = outlines.iter();
    let outline = outlines.find(|outline| point.z <= outline.top);
    outline.is_some_and(|outline| {
        let [back, front, right, left] = outline.footprint;
        (back - SLACK..=front + SLACK).contains(&point.x)
            && (right - SLACK..=left + SLACK).contains(&point.y)
    })
}
