//! The reach map of a robot: `wheelarm_planning::reach_map`, computed from its kinematics and
//! read from the file beside its `robot.toml`.

use nalgebra::{Isometry3, Vector3};
use wheelarm_planning::reach_map::{Arm, ReachMap, compute};
use wheelarm_proto::digest::Digest;

use super::kinematics::ArmKinematics;
use super::{ARM_JOINTS, JointKind, RobotModel};

/// Tolerance of an upright axis, no unit.
const UPRIGHT: f64 = 1e-9;

/// Why a robot has no reach map.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoReachMap {
    /// A joint has limits.
    #[error(
        "no reach map for {0}: its first and last arm joint must be of type continuous, because the map leaves bearing and roll out"
    )]
    Limited(String),
    /// The first joint is tilted.
    #[error("no reach map for {0}: the axis of its first arm joint must be upright")]
    Tilted(String),
}

impl Arm for ArmKinematics {
    fn solve(&self, base_from_tool: &Isometry3<f64>, near: &[f64; 6]) -> Option<[f64; 6]> {
        let found = self.solve_local(base_from_tool, near, f64::INFINITY);
        found.ok().map(|solution| solution.joints)
    }

    fn start(&self, number: usize) -> [f64; 6] {
        self.start(number)
    }
}

impl RobotModel {
    /// Computes the reach map, which takes minutes.
    ///
    /// # Errors
    /// [`NoReachMap`] when the arm is not of the kind that the map describes.
    pub fn reach_map(&self) -> Result<ReachMap, NoReachMap> {
        let arm = &self.roles.arm;
        let is_free = |joint: usize| self.joints[joint].kind == JointKind::Continuous;
        if !is_free(arm[0]) || !is_free(arm[ARM_JOINTS - 1]) {
            return Err(NoReachMap::Limited(self.name.clone()));
        }
        let poses = self.link_poses(&vec![0.0; self.joints.len()]);
        let first = &self.joints[arm[0]];
        let axis = poses[first.child].rotation * first.axis.into_inner();
        let mount = self.arm_mount();
        let up = mount.rotation * Vector3::z();
        if 1.0 - axis.z.abs() > UPRIGHT || 1.0 - up.z > UPRIGHT {
            return Err(NoReachMap::Tilted(self.name.clone()));
        }
        let kinematics = ArmKinematics::new(self);
        let length = self.settings.tool_length;
        Ok(compute(&kinematics, mount, length, self.reach_source()))
    }

    /// Digest of what the reach map is computed from.
    #[must_use]
    pub fn reach_source(&self) -> Digest {
        ReachMap::source_of(&self.urdf_text, self.settings.tool_length)
    }
}
