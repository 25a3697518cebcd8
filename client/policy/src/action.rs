//! Kinds of action rows, with the names and units of their numbers.

use std::str::FromStr;

use wheelarm_proto::robot::ARM_JOINTS;
use wheelarm_proto::v1;

use crate::state::SIX;

/// Kind of the numbers of an action.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ActionKind {
    /// Set points at the next image: pose of the hand in `base_link` (3, and 6
    /// of its rotation), knuckle, v and ω. 12 numbers.
    #[default]
    NextPose,
    /// The same with the arm's joints instead of the hand's pose. 9 numbers.
    NextJoints,
    /// Set points of the controllers at this image: joints, wheel speeds, knuckle. 9
    /// numbers. They nearly equal the present state, so a policy that learns them stays at
    /// rest.
    Applied,
}

/// A name of an unknown kind.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not a kind of action; use next-pose, next-joints or applied")]
pub struct NoKind(pub String);

impl FromStr for ActionKind {
    type Err = NoKind;

    fn from_str(word: &str) -> Result<Self, NoKind> {
        let mut all = Self::ALL.into_iter();
        let found = all.find(|kind| kind.name() == word);
        found.ok_or_else(|| NoKind(word.to_owned()))
    }
}

impl ActionKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::NextPose, Self::NextJoints, Self::Applied];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NextPose => "next-pose",
            Self::NextJoints => "next-joints",
            Self::Applied => "applied",
        }
    }

    /// Numbers of a row.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::NextPose => 12,
            Self::NextJoints | Self::Applied => 9,
        }
    }

    /// Names of the numbers.
    #[must_use]
    pub fn names(self, robot: &v1::RobotDescription) -> Vec<String> {
        let joints = robot.arm_joint_names().into_iter();
        let joints = joints.map(|joint| format!("{joint}.target"));
        let hand = ["x", "y", "z"].into_iter().chain(SIX);
        let hand = hand.map(|part| format!("hand.{part}"));
        let chair = ["knuckle.target", "chair.linear", "chair.angular"].map(String::from);
        let wheels = [
            "wheel_left.target_velocity",
            "wheel_right.target_velocity",
            "knuckle.target",
        ];
        match self {
            Self::NextPose => hand.chain(chair).collect(),
            Self::NextJoints => joints.chain(chair).collect(),
            Self::Applied => joints.chain(wheels.map(String::from)).collect(),
        }
    }

    /// Units of the numbers, in their order.
    pub fn units(self) -> impl Iterator<Item = &'static str> {
        let runs: [(&str, usize); 5] = match self {
            Self::NextPose => [("m", 3), ("1", 6), ("rad", 1), ("m/s", 1), ("rad/s", 1)],
            Self::NextJoints => [
                ("rad", ARM_JOINTS),
                ("rad", 1),
                ("m/s", 1),
                ("rad/s", 1),
                ("", 0),
            ],
            Self::Applied => [
                ("rad", ARM_JOINTS),
                ("rad/s", 2),
                ("rad", 1),
                ("", 0),
                ("", 0),
            ],
        };
        runs.into_iter()
            .flat_map(|(unit, count)| std::iter::repeat_n(unit, count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kind_survives_its_name_and_every_number_has_a_unit() {
        for kind in ActionKind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
            assert_eq!(kind.units().count(), kind.size());
        }
        let problem = "next".parse::<ActionKind>().unwrap_err().to_string();
        assert!(problem.contains("next-pose"), "{problem}");
    }
}
