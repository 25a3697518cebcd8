//! Converts an action row to the command that executes it.

use wheelarm_proto::robot::ARM_JOINTS;
use wheelarm_proto::{CONTROL_HZ, v1};

use crate::action::ActionKind;
use crate::rotation::from_six;

/// Turns rows into commands, one for all control ticks until the next image;
/// the server interpolates linearly from the current set points to the row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Player {
    /// Kind of the numbers of a row.
    pub kind: ActionKind,
    /// Control ticks of a row.
    pub over_ticks: u32,
    /// Force limit at each pad, N, of every row; the robot's default when absent.
    pub max_force: Option<f64>,
    /// Device label of the commands.
    pub device: v1::Device,
    /// Wheel radius and distance between the wheels, m.
    drive: [f64; 2],
    /// Least and greatest forward speed, m/s, and greatest turn rate, rad/s, either
    /// way.
    speeds: [f64; 3],
    /// Greatest angle of the knuckle, rad.
    closed: f64,
}

/// Limit of the values of a row, SI units; larger ones are errors.
const ABSURD: f64 = 100.0;

/// A row without a valid command.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RowError {
    /// Too few or too many numbers.
    #[error("a row of {kind} has {expected} numbers, this one has {found}")]
    Length {
        /// Kind of action.
        kind: &'static str,
        /// Numbers of its rows.
        expected: usize,
        /// Numbers here.
        found: usize,
    },
    /// NaN or infinite.
    #[error("number {index} of the row is {value}, which is not finite")]
    NotFinite {
        /// Place in the row, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// Too large for a pose, an angle or a speed of the robot.
    #[error(
        "number {index} of the row is {value}; allowed is less than {ABSURD} (m, rad, m/s, rad/s)"
    )]
    Absurd {
        /// Place in the row, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// The six numbers do not define a rotation.
    #[error("the rotation of the hand {0:?} spans no plane: its two columns are parallel or zero")]
    Rotation([f64; 6]),
}

impl Player {
    /// For rows of `kind` at a rate of `rate_hz`.
    #[must_use]
    pub fn new(kind: ActionKind, robot: &v1::RobotDescription, rate_hz: f64) -> Self {
        let drive = robot.drive.unwrap_or_default();
        let ticks = (CONTROL_HZ as f64 / rate_hz).round().max(1.0);
        let or_none = |limit: f64| if limit > 0.0 { limit } else { f64::INFINITY };
        let knuckle = robot.gripper_or_default().max_knuckle;
        Self {
            kind,
            over_ticks: ticks as u32,
            max_force: None,
            device: v1::Device::Policy,
            drive: [drive.wheel_radius, drive.track],
            speeds: [
                -or_none(drive.backward_speed),
                or_none(drive.forward_speed),
                or_none(drive.turn_rate),
            ],
            closed: or_none(knuckle),
        }
    }

    /// The command of a row. Speeds and the knuckle are clamped to the limits of
    /// the robot, which the output of a network may exceed slightly.
    ///
    /// # Errors
    /// [`RowError`].
    pub fn command(&self, row: &[f64]) -> Result<v1::Command, RowError> {
        if row.len() != self.kind.size() {
            return Err(RowError::Length {
                kind: self.kind.name(),
                expected: self.kind.size(),
                found: row.len(),
            });
        }
        if let Some(index) = row.iter().position(|value| !value.is_finite()) {
            let value = row[index];
            return Err(RowError::NotFinite { index, value });
        }
        if let Some(index) = row.iter().position(|value| value.abs() >= ABSURD) {
            let value = row[index];
            return Err(RowError::Absurd { index, value });
        }
        let joints = || {
            let positions = row[..ARM_JOINTS].to_vec();
            v1::arm_command::Target::Joints(v1::JointTarget { positions })
        };
        let (arm, [knuckle, linear, angular]) = match self.kind {
            ActionKind::NextPose => (hand(row)?, [row[9], row[10], row[11]]),
            ActionKind::NextJoints => (joints(), [row[6], row[7], row[8]]),
            ActionKind::Applied => {
                let [radius, track] = self.drive;
                let motion = [
                    (row[7] + row[6]) / 2.0 * radius,
                    (row[7] - row[6]) / track * radius,
                ];
                (joints(), [row[8], motion[0], motion[1]])
            }
        };
        let [least, most, turn] = self.speeds;
        let linear = linear.max(least).min(most);
        let angular = angular.max(-turn).min(turn);
        let knuckle = knuckle.max(0.0).min(self.closed);
        Ok(v1::Command {
            arm: Some(v1::ArmCommand { target: Some(arm) }),
            base: Some(v1::BaseCommand { linear, angular }),
            gripper: Some(v1::GripperCommand {
                target: Some(v1::gripper_command::Target::Knuckle(knuckle)),
                max_force: self.max_force,
            }),
            over_ticks: self.over_ticks,
            device: self.device.into(),
            mode: v1::InputMode::Stream.into(),
            ..v1::Command::default()
        })
    }
}

fn hand(row: &[f64]) -> Result<v1::arm_command::Target, RowError> {
    let six = std::array::from_fn(|k| row[3 + k]);
    let [x, y, z, w] = from_six(&six).ok_or(RowError::Rotation(six))?;
    Ok(v1::arm_command::Target::Pose(v1::CartesianTarget {
        frame: v1::CommandFrame::BaseLink.into(),
        pose: Some(v1::Pose {
            position: Some(v1::Vector3 {
                x: row[0],
                y: row[1],
                z: row[2],
            }),
            orientation: Some(v1::Quaternion { x, y, z, w }),
        }),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> v1::RobotDescription {
        v1::RobotDescription {
            drive: Some(v1::DriveDescription {
                wheel_radius: 0.2,
                track: 0.5,
                ..Default::default()
            }),
            ..Default::default()
        }
    }

    #[test]
    fn every_kind_gives_one_command_until_the_next_image() {
        let base = |kind, row: &[f64]| {
            let command = Player::new(kind, &robot(), 10.0).command(row).unwrap();
            assert_eq!(command.over_ticks, 6);
            (command.base.unwrap(), command.arm.unwrap().target.unwrap())
        };
        let (motion, arm) = base(
            ActionKind::NextPose,
            &[0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.4, 0.5, 0.6],
        );
        assert_eq!((motion.linear, motion.angular), (0.5, 0.6));
        let v1::arm_command::Target::Pose(target) = arm else {
            panic!("no pose")
        };
        assert_eq!(target.pose.unwrap().orientation.unwrap().w, 1.0);
        let nine = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.4, 0.5, 0.6];
        let (motion, arm) = base(ActionKind::NextJoints, &nine);
        assert_eq!((motion.linear, motion.angular), (0.5, 0.6));
        let v1::arm_command::Target::Joints(target) = arm else {
            panic!("no joints")
        };
        assert_eq!(target.positions, nine[..6]);
        let (motion, _) = base(ActionKind::Applied, &nine);
        assert!((motion.linear - 0.09).abs() < 1e-12 && (motion.angular - 0.04).abs() < 1e-12);
    }

    #[test]
    fn values_slightly_beyond_the_limits_are_clamped() {
        let mut robot = robot();
        robot.gripper = Some(v1::GripperDescription {
            max_knuckle: 0.8,
            ..Default::default()
        });
        let drive = robot.drive.as_mut().unwrap();
        (drive.forward_speed, drive.backward_speed, drive.turn_rate) = (1.0, 0.5, 2.0);
        let player = Player::new(ActionKind::NextJoints, &robot, 10.0);
        let cut = |knuckle: f64, linear: f64, angular: f64| {
            let row = [[0.0; 6].as_slice(), &[knuckle, linear, angular]].concat();
            let command = player.command(&row).unwrap();
            let base = command.base.unwrap();
            let target = command.gripper.unwrap().target.unwrap();
            let v1::gripper_command::Target::Knuckle(knuckle) = target else {
                panic!("no knuckle")
            };
            [knuckle, base.linear, base.angular]
        };
        assert_eq!(cut(-0.01, 1.1, -2.1), [0.0, 1.0, -2.0]);
        assert_eq!(cut(0.81, -0.6, 2.1), [0.8, -0.5, 2.0]);
        assert_eq!(cut(0.4, 0.3, 0.2), [0.4, 0.3, 0.2]);
    }

    #[test]
    fn hostile_row_is_an_error() {
        let player = Player::new(ActionKind::NextPose, &robot(), 10.0);
        let mut row = [0.0; 12];
        assert!(matches!(player.command(&row), Err(RowError::Rotation(_))));
        row[11] = f64::INFINITY;
        let problem = player.command(&row).unwrap_err();
        assert!(matches!(problem, RowError::NotFinite { index: 11, .. }));
        row[11] = 1e9;
        let problem = player.command(&row).unwrap_err();
        assert!(matches!(problem, RowError::Absurd { index: 11, .. }));
        let problem = player.command(&row[..9]).unwrap_err().to_string();
        assert!(problem.contains("12") && problem.contains('9'), "{problem}");
    }
}
