//! The robot of a recording, and the only built-in robot: the
//! first recordings did not contain theirs, and only one existed.

use prost::Message;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::v1;

use super::Episode;
use super::error::ReadError;

/// Description of the robot `wheelarm` as it was when recordings did not hold
/// one: an encoded `wheelarm.v1.RobotDescription`, as the server makes it.
const FIRST: &[u8] = include_bytes!("wheelarm.binpb");

impl Episode {
    /// The robot that was recorded. A file without a description is of the
    /// first version, which had only this robot.
    ///
    /// # Errors
    /// When the stored description cannot be read.
    pub fn robot(&self) -> Result<v1::RobotDescription, ReadError> {
        let path = "robot/message";
        if self.file.link_exists(path) {
            return self.message(path);
        }
        first_robot().map_err(|e| self.decode("the description of the first robot", e))
    }
}

impl Episode {
    /// The robot, and indices of its joints and frames in the streams.
    ///
    /// # Errors
    /// When the description cannot be read, or lacks a role.
    pub fn roles(&self) -> Result<(v1::RobotDescription, Roles), ReadError> {
        let robot = self.robot()?;
        let roles = Roles::find(&robot).map_err(|reason| ReadError::NoEpisode {
            path: self.path().to_owned(),
            reason: reason.to_string(),
        })?;
        Ok((robot, roles))
    }
}

impl Episode {
    /// The camera whose stamps are the rows of an alignment, unless another one is
    /// requested: a recorded camera that rides on the arm, as in WheelArm-Sim, or
    /// else the first one; `None` without cameras.
    ///
    /// # Errors
    /// When cameras or description cannot be read.
    pub fn reference(&self) -> Result<Option<String>, ReadError> {
        let recorded = self.cameras()?;
        let robot = self.robot()?;
        let on_arm = |name: &String| {
            let mut cameras = robot.cameras.iter();
            cameras.any(|c| c.name == *name && c.mount() == v1::CameraMount::Arm)
        };
        let found = recorded.iter().find(|name| on_arm(name));
        Ok(found.or(recorded.first()).cloned())
    }
}

/// The robot of recordings without a robot description.
///
/// # Errors
/// Never: the bytes are part of the program, and a test reads them.
pub fn first_robot() -> Result<v1::RobotDescription, prost::DecodeError> {
    v1::RobotDescription::decode(FIRST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_robot_has_every_role_where_the_first_files_have_it() {
        let robot = first_robot().unwrap();
        let roles = Roles::find(&robot).unwrap();
        assert_eq!((robot.joints.len(), robot.frames.len()), (16, 7));
        assert_eq!(roles.arm, [4, 5, 6, 7, 8, 9]);
        assert_eq!((roles.wheels, roles.knuckle), ([0, 1], 13));
        assert_eq!((roles.chair, roles.end_effector), (0, 6));
        assert!((robot.opening(0.0).unwrap() - 0.085).abs() < 1e-5);
    }
}
