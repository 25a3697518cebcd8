//! The arm joints that move each link.

use crate::robot::{ARM_JOINTS, RobotModel};
use crate::snapshot::BodyRef;

/// The arm joints that move each link.
#[derive(Clone, Debug)]
pub(super) struct Carriers {
    /// Number of arm joints that move a link, by link.
    pub depths: Vec<usize>,
    /// Links that can touch the person.
    pub links: Vec<BodyRef>,
    /// Whether the gripper's joints move a link, by link.
    pub fingers: Vec<bool>,
}

impl Carriers {
    pub(super) fn new(model: &RobotModel) -> Self {
        let roles = &model.roles;
        let chain = |link: usize| model.chain(roles.arm_base, link).unwrap_or_default();
        let moved_by_arm = |link: usize| {
            let joints = chain(link).into_iter();
            joints.filter(|j| roles.arm_index(*j).is_some()).count()
        };
        let depths: Vec<usize> = (0..model.links.len()).map(moved_by_arm).collect();
        let beyond_hand = |link: usize| link != roles.end_effector && depths[link] == ARM_JOINTS;
        let moves_alone = |link: usize| {
            let hand = model
                .chain(roles.arm_base, roles.end_effector)
                .map_or(0, |c| c.len());
            beyond_hand(link) && chain(link).len() > hand
        };
        Self {
            links: (0..depths.len())
                .filter(|link| depths[*link] >= 2)
                .map(BodyRef::Link)
                .collect(),
            fingers: (0..depths.len()).map(moves_alone).collect(),
            depths,
        }
    }
}
