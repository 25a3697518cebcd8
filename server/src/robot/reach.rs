//! The reach map of a robot: `wheelarm_planning::reach_map`, computed from its kinematics and
//! read from the file beside its `robot.toml`.

use std::io::Read;
use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use wheelarm_planning::reach_map::{Arm, FILE_BYTES, ReachMap, compute};
use wheelarm_proto::digest::Digest;

use super::kinematics::ArmKinematics;
use super::{ARM_JOINTS, JointKind, RobotError, RobotModel};

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
    /// Computes the reach map, which takes seconds.
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

    /// Reads the reach map of the robot's folder, `reach.bin`; `None` without that file.
    ///
    /// # Errors
    /// [`RobotError`] when the file is not a reach map of this robot.
    pub fn read_reach_map(&self, assets: &Path) -> Result<Option<ReachMap>, RobotError> {
        let path = assets.join("robots").join(&self.name).join("reach.bin");
        if !path.is_file() {
            return Ok(None);
        }
        let read = || {
            let mut bytes = Vec::new();
            // One byte more shows that a file is too large.
            let most = FILE_BYTES as u64 + 1;
            std::fs::File::open(&path)?
                .take(most)
                .read_to_end(&mut bytes)?;
            Ok::<_, std::io::Error>(bytes)
        };
        let bytes = read().map_err(|source| RobotError::Read {
            path: path.clone(),
            source,
        })?;
        let invalid = |found: String| RobotError::Invalid {
            path: path.clone(),
            object: "reach map".to_owned(),
            found,
            expected: "that of robot.urdf and robot.toml; \
                       `cargo run --release -p wheelarm-tests --example reach_map` writes it"
                .to_owned(),
        };
        let map = ReachMap::from_bytes(&bytes).map_err(|error| invalid(error.to_string()))?;
        match *map.source() == self.reach_source() {
            true => Ok(Some(map)),
            false => Err(invalid("of another URDF or tool length".to_owned())),
        }
    }

    /// Digest of what the reach map is computed from.
    #[must_use]
    pub fn reach_source(&self) -> Digest {
        ReachMap::source_of(&self.urdf_text, self.settings.tool_length)
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use wheelarm_planning::reach_map::{Entry, hand_pose};

    use super::*;

    fn assets() -> PathBuf {
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../assets")
    }

    /// Every robot of the assets with its file.
    fn robots() -> Vec<(RobotModel, ReachMap)> {
        let folders = std::fs::read_dir(assets().join("robots")).expect("robots");
        let folders = folders.flatten().filter(|entry| entry.path().is_dir());
        let read = |entry: std::fs::DirEntry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let bytes = std::fs::read(entry.path().join("reach.bin")).expect("reach.bin");
            let map = ReachMap::from_bytes(&bytes).expect("a reach map");
            (RobotModel::load(&assets(), &name).expect("a robot"), map)
        };
        folders.map(read).collect()
    }

    #[test]
    fn every_robot_has_the_reach_map_that_its_kinematics_gives() {
        let robots = robots();
        assert!(robots.len() >= 2);
        for (model, map) in robots {
            assert_eq!(map.source(), &model.reach_source(), "{}", model.name);
            let computed = model.reach_map().expect("a reach map");
            assert!(
                computed.to_bytes() == map.to_bytes(),
                "{}: run `cargo run --release -p wheelarm-tests --example reach_map`",
                model.name
            );
        }
    }

    #[test]
    fn reached_entries_are_solved_and_few_solved_ones_are_missed() {
        for (model, map) in robots() {
            let kinematics = ArmKinematics::new(&model);
            let (mut reached, mut missed) = (0, 0);
            for entry in (0..Entry::COUNT).step_by(1013).map(Entry::numbered) {
                let pose = hand_pose(&entry.place(), model.settings.tool_length);
                let is_solved = kinematics.solve(&pose, &model.settings.home).is_ok();
                assert!(
                    is_solved || !map.contains(entry),
                    "{}: {entry:?}",
                    model.name
                );
                reached += usize::from(map.contains(entry));
                missed += usize::from(is_solved && !map.contains(entry));
            }
            assert!(reached > 100, "{}: {reached}", model.name);
            assert!(
                50 * missed <= reached,
                "{}: {missed} of {reached}",
                model.name
            );
        }
    }

    #[test]
    fn an_arm_with_a_limited_last_joint_has_no_reach_map() {
        let mut model = RobotModel::load(&assets(), "wheelarm").expect("a robot");
        let last = model.roles.arm[ARM_JOINTS - 1];
        model.joints[last].kind = JointKind::Revolute;
        let error = model.reach_map().expect_err("an error");
        assert!(error.to_string().contains("continuous"), "{error}");
    }
}
