//! Conversions that reject invalid input of a simulation: NaN, infinities, quaternions
//! that are not of unit length, missing parts.

use std::fmt;

use crate::v1;

/// A number in a message for people: few digits, or scientific notation.
#[derive(Clone, Copy, Debug)]
pub struct Number(pub f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || !size.is_finite() || (1e-4..1e7).contains(&size) {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}

/// The beginning of a received text, for a message that quotes it.
#[must_use]
pub fn beginning(text: &str) -> String {
    const MOST: usize = 64;
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}… ({} bytes)", &text[..end], text.len()),
        None => text.to_owned(),
    }
}

/// Why a message is invalid.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum Invalid {
    /// A required part is absent.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// A part of a field is absent.
    #[error("{what} has no {part}")]
    MissingPart {
        /// The field.
        what: &'static str,
        /// The part.
        part: &'static str,
    },
    /// An error in a list entry.
    #[error("{place}: {source}")]
    In {
        /// Which entry, for example `object "mustard"`.
        place: String,
        /// What is wrong with it.
        source: Box<Invalid>,
    },
    /// A number is NaN or infinite.
    #[error("{what} is {value}, expected a finite number")]
    NotFinite {
        /// The field.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// A quaternion is not of unit length.
    #[error("{what} has norm {}, expected a unit quaternion (1 ± 0.001)", Number(*.norm))]
    NotUnit {
        /// The field.
        what: &'static str,
        /// Its norm.
        norm: f64,
    },
    /// A number is outside its range.
    #[error("{what} is {}, expected {} to {}", Number(*.value), Number(*.low), Number(*.high))]
    OutOfRange {
        /// The field.
        what: &'static str,
        /// The number.
        value: f64,
        /// Least value.
        low: f64,
        /// Greatest value.
        high: f64,
    },
    /// A list has the wrong length.
    #[error("{what} has {got} values, expected {expected}")]
    Length {
        /// The field.
        what: &'static str,
        /// Number of values.
        got: usize,
        /// Expected number.
        expected: usize,
    },
    /// A list is too long.
    #[error("{what}: got {got}, at most {most} are accepted")]
    Many {
        /// The field.
        what: &'static str,
        /// Number of values.
        got: usize,
        /// Greatest number.
        most: usize,
    },
    /// A text is not one of the allowed values.
    #[error("{what} is {:?}: {expected}", beginning(.value))]
    Word {
        /// The field.
        what: &'static str,
        /// The word.
        value: String,
        /// Allowed values.
        expected: &'static str,
    },
}

/// Allowed deviation of a quaternion's norm from 1.
pub const UNIT_TOLERANCE: f64 = 1e-3;

/// Checks that a number is finite.
///
/// # Errors
/// [`Invalid::NotFinite`].
pub fn finite(what: &'static str, value: f64) -> Result<f64, Invalid> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Invalid::NotFinite { what, value })
    }
}

/// Checks that a number is finite and within `low..=high`.
///
/// # Errors
/// [`Invalid::NotFinite`] or [`Invalid::OutOfRange`].
pub fn within(what: &'static str, value: f64, low: f64, high: f64) -> Result<f64, Invalid> {
    finite(what, value)?;
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(Invalid::OutOfRange {
            what,
            value,
            low,
            high,
        })
    }
}

/// Reads a vector as `[x, y, z]`.
///
/// # Errors
/// [`Invalid`] when it is absent or not finite.
pub fn vector(what: &'static str, v: Option<&v1::Vector3>) -> Result<[f64; 3], Invalid> {
    let v = v.ok_or(Invalid::Missing(what))?;
    Ok([finite(what, v.x)?, finite(what, v.y)?, finite(what, v.z)?])
}

/// Reads a quaternion as `[x, y, z, w]`, normalised.
///
/// # Errors
/// [`Invalid`] when it is absent, not finite or not of unit length.
pub fn quaternion(what: &'static str, q: Option<&v1::Quaternion>) -> Result<[f64; 4], Invalid> {
    let q = q.ok_or(Invalid::Missing(what))?;
    let q = [
        finite(what, q.x)?,
        finite(what, q.y)?,
        finite(what, q.z)?,
        finite(what, q.w)?,
    ];
    let norm = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > UNIT_TOLERANCE {
        return Err(Invalid::NotUnit { what, norm });
    }
    // A quaternion that is already of unit length keeps its bits, so that a pose
    // survives a round trip through a message exactly.
    Ok(if (norm - 1.0).abs() < 1e-12 {
        q
    } else {
        q.map(|c| c / norm)
    })
}

/// Reads a pose as position and quaternion `([x, y, z], [x, y, z, w])`.
///
/// # Errors
/// [`Invalid`] when a part is absent, not finite or not of unit length.
pub fn pose(what: &'static str, p: Option<&v1::Pose>) -> Result<([f64; 3], [f64; 4]), Invalid> {
    let p = p.ok_or(Invalid::Missing(what))?;
    let part = |part| Invalid::MissingPart { what, part };
    let position = p.position.as_ref().ok_or_else(|| part("position"))?;
    let orientation = p.orientation.as_ref().ok_or_else(|| part("orientation"))?;
    Ok((
        vector(what, Some(position))?,
        quaternion(what, Some(orientation))?,
    ))
}

/// Largest distance of a pose in a scenario from the origin of `house`, metres.
pub const FAR: f64 = 50.0;

/// Allowed heights of a pose in a scenario, metres.
pub const HEIGHTS: (f64, f64) = (-1.0, 5.0);

/// Checks that a pose is in or around a home: x and y within [`FAR`], z within
/// [`HEIGHTS`].
///
/// # Errors
/// [`Invalid`] as [`pose`], or [`Invalid::OutOfRange`].
pub fn place(what: &'static str, p: Option<&v1::Pose>) -> Result<([f64; 3], [f64; 4]), Invalid> {
    let (position, rotation) = pose(what, p)?;
    for across in &position[..2] {
        within(what, *across, -FAR, FAR)?;
    }
    within(what, position[2], HEIGHTS.0, HEIGHTS.1)?;
    Ok((position, rotation))
}

/// Checks that a list has no more than `most` entries.
///
/// # Errors
/// [`Invalid::Many`].
pub fn few<T>(what: &'static str, list: &[T], most: usize) -> Result<(), Invalid> {
    if list.len() <= most {
        return Ok(());
    }
    Err(Invalid::Many {
        what,
        got: list.len(),
        most,
    })
}

/// Checks the name of an asset: 1 to 64 letters, digits, `-`, `_`.
///
/// # Errors
/// [`Invalid::Word`].
pub fn name(what: &'static str, text: &str) -> Result<(), Invalid> {
    crate::keys::check_name(text).map_err(|_| Invalid::Word {
        what,
        value: text.to_owned(),
        expected: "1 to 64 letters, digits, `-` or `_`",
    })
}

/// Checks a list of finite numbers of a given length.
///
/// # Errors
/// [`Invalid::Length`] or [`Invalid::NotFinite`].
pub fn list<const N: usize>(what: &'static str, values: &[f64]) -> Result<[f64; N], Invalid> {
    let list: [f64; N] = values.try_into().map_err(|_| Invalid::Length {
        what,
        got: values.len(),
        expected: N,
    })?;
    for v in list {
        finite(what, v)?;
    }
    Ok(list)
}

/// Largest number of control ticks covered by one command: 1 s.
pub const MAX_OVER_TICKS: u32 = 60;

/// Checks every number of a command: finite, sensible ranges, unit quaternions. Ranges
/// are wide and apply to any robot: the command gate checks the gripper's, all other
/// limits saturate.
///
/// # Errors
/// [`Invalid`] that names the field.
pub fn command(c: &v1::Command) -> Result<(), Invalid> {
    use v1::arm_command::Target;
    if let Some(arm) = &c.arm {
        match arm.target.as_ref().ok_or(Invalid::Missing("arm target"))? {
            Target::Joints(j) => {
                for v in list::<6>("arm joint position", &j.positions)? {
                    within("arm joint position", v, -100.0, 100.0)?;
                }
            }
            Target::Pose(p) => {
                frame(p.frame)?;
                pose("arm pose", p.pose.as_ref())?;
            }
            Target::Twist(t) => {
                frame(t.frame)?;
                let twist = t.twist.as_ref().ok_or(Invalid::Missing("arm twist"))?;
                for v in vector("arm linear velocity", twist.linear.as_ref())? {
                    within("arm linear velocity", v, -10.0, 10.0)?;
                }
                for v in vector("arm angular velocity", twist.angular.as_ref())? {
                    within("arm angular velocity", v, -20.0, 20.0)?;
                }
            }
            Target::Step(s) => {
                frame(s.frame)?;
                for v in vector("arm step translation", s.translation.as_ref())? {
                    within("arm step translation", v, -1.0, 1.0)?;
                }
                for v in vector("arm step rotation", s.rotation.as_ref())? {
                    within("arm step rotation", v, -3.2, 3.2)?;
                }
            }
            Target::Hold(_) => {}
        }
    }
    if let Some(base) = &c.base {
        within("base linear speed", base.linear, -5.0, 5.0)?;
        within("base turn rate", base.angular, -10.0, 10.0)?;
    }
    if let Some(gripper) = &c.gripper {
        use v1::gripper_command::Target;
        match gripper
            .target
            .as_ref()
            .ok_or(Invalid::Missing("gripper target"))?
        {
            Target::Opening(m) => within("gripper opening", *m, 0.0, 1.0)?,
            Target::Knuckle(q) => within("gripper knuckle angle", *q, -10.0, 10.0)?,
        };
        if let Some(cap) = gripper.max_force {
            within("gripper force", cap, 0.0, 1e4)?;
        }
    }
    if c.over_ticks > MAX_OVER_TICKS {
        return Err(Invalid::OutOfRange {
            what: "over_ticks",
            value: f64::from(c.over_ticks),
            low: 0.0,
            high: f64::from(MAX_OVER_TICKS),
        });
    }
    let in_tool = matches!(
        c.arm.as_ref().and_then(|arm| arm.target.as_ref()),
        Some(Target::Pose(p)) if p.frame() == v1::CommandFrame::EndEffector
    );
    if c.over_ticks > 1 && in_tool {
        return Err(Invalid::Word {
            what: "command frame",
            value: "the end effector".to_owned(),
            expected: "with over_ticks `base_link`, `wheelchair_root` or `house`: a pose in a \
                       frame that moves with the arm leads nowhere",
        });
    }
    v1::Phase::try_from(c.phase).map_err(|_| Invalid::Word {
        what: "phase",
        value: c.phase.to_string(),
        expected: "a value of wheelarm.v1.Phase",
    })?;
    Ok(())
}

fn frame(value: i32) -> Result<v1::CommandFrame, Invalid> {
    v1::CommandFrame::try_from(value).map_err(|_| Invalid::Word {
        what: "command frame",
        value: value.to_string(),
        expected: "a value of wheelarm.v1.CommandFrame",
    })
}

/// Whether a command drives the chair or sends a twist to the arm. Such motion
/// continues until stopped, so the command must be fresh.
#[must_use]
pub fn drives(c: &v1::Command) -> bool {
    use v1::arm_command::Target;
    let some = |v: Option<&v1::Vector3>| v.is_some_and(|v| [v.x, v.y, v.z] != [0.0; 3]);
    let base = c.base.is_some_and(|b| b.linear != 0.0 || b.angular != 0.0);
    let twist = match c.arm.as_ref().and_then(|arm| arm.target.as_ref()) {
        Some(Target::Twist(t)) => t
            .twist
            .as_ref()
            .is_some_and(|t| some(t.linear.as_ref()) || some(t.angular.as_ref())),
        _ => false,
    };
    base || twist
}

/// Whether a command only stops motion: a chair at rest, an arm that holds or has a
/// zero twist, and nothing else.
#[must_use]
pub fn stops(c: &v1::Command) -> bool {
    use v1::arm_command::Target;
    let target = c.arm.as_ref().map(|arm| arm.target.as_ref());
    let arm = matches!(
        target,
        None | Some(Some(Target::Hold(_) | Target::Twist(_)))
    );
    arm && !drives(c) && c.gripper.is_none() && (c.arm.is_some() || c.base.is_some())
}

/// Checks the label of an episode: it becomes a file name.
///
/// # Errors
/// [`Invalid::Word`].
pub fn label(text: &str) -> Result<(), Invalid> {
    let fits = (1..=crate::label::LONGEST).contains(&text.len())
        && !text.starts_with('.')
        && text
            .bytes()
            .all(|b| b.is_ascii_alphanumeric() || matches!(b, b'-' | b'_' | b'.'));
    if fits {
        Ok(())
    } else {
        Err(Invalid::Word {
            what: "label",
            value: text.to_owned(),
            expected: "1 to 100 letters, digits, `-`, `_` or `.`, not starting with `.`, because it names the file",
        })
    }
}

/// Longest time limit of a task, simulated seconds: more than a day. Used when people
/// drive, who have no time limit.
pub const MAX_TIME_LIMIT: f64 = 1e5;

/// Most bytes of an instruction sentence.
pub const MAX_INSTRUCTION: usize = 64 << 10;

/// Checks an instruction sentence: it is stored exactly, in any script.
///
/// # Errors
/// [`Invalid::Word`].
pub fn instruction(text: &str) -> Result<(), Invalid> {
    if text.len() <= MAX_INSTRUCTION && !text.contains('\0') {
        return Ok(());
    }
    Err(Invalid::Word {
        what: "instruction",
        value: text.chars().take(40).collect(),
        expected: "at most 65536 bytes of UTF-8 without NUL characters, which files cannot store",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose_of(q: [f64; 4]) -> v1::Pose {
        v1::Pose {
            position: Some(v1::Vector3 {
                x: 1.0,
                y: 2.0,
                z: 3.0,
            }),
            orientation: Some(v1::Quaternion {
                x: q[0],
                y: q[1],
                z: q[2],
                w: q[3],
            }),
        }
    }

    #[test]
    fn a_pose_survives_a_round_trip_exactly() {
        let q = [0.5, -0.5, 0.5, 0.5];
        assert_eq!(pose("p", Some(&pose_of(q))), Ok(([1.0, 2.0, 3.0], q)));
    }

    #[test]
    fn quaternions_that_are_not_of_unit_length_are_refused() {
        for q in [[0.0; 4], [0.0, 0.0, 0.0, 1.1], [f64::NAN, 0.0, 0.0, 1.0]] {
            assert!(pose("p", Some(&pose_of(q))).is_err(), "{q:?} was accepted");
        }
    }

    #[test]
    fn commands_with_nan_or_wrong_lengths_are_refused() {
        let joints = |position| v1::Command {
            arm: Some(v1::ArmCommand {
                target: Some(v1::arm_command::Target::Joints(v1::JointTarget {
                    positions: position,
                })),
            }),
            ..Default::default()
        };
        assert!(command(&joints(vec![0.0; 6])).is_ok());
        assert!(command(&joints(vec![0.0; 5])).is_err());
        assert!(command(&joints(vec![f64::NAN; 6])).is_err());
        let base = v1::Command {
            base: Some(v1::BaseCommand {
                linear: f64::INFINITY,
                angular: 0.0,
            }),
            ..Default::default()
        };
        assert!(command(&base).is_err());
    }

    #[test]
    fn instructions_of_any_script_pass_unless_they_cannot_be_stored() {
        let long = "Фляга 🍾 ".repeat(1250);
        assert!(instruction("").is_ok() && instruction(&long).is_ok());
        assert!(instruction("a\0b").is_err());
        assert!(instruction(&"x".repeat(MAX_INSTRUCTION + 1)).is_err());
    }

    #[test]
    fn quoted_numbers_and_texts_are_short() {
        for (number, text) in [
            (0.0, "0"),
            (-12.5, "-12.5"),
            (0.001, "0.001"),
            (1e-300, "1e-300"),
            (-1e300, "-1e300"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(Number(number).to_string(), text);
        }
        let message = within("mass", 1e-300, 0.05, 2.0).unwrap_err().to_string();
        assert_eq!(message, "mass is 1e-300, expected 0.05 to 2");
        let message = label(&"ж".repeat(1 << 20)).unwrap_err().to_string();
        assert!(message.len() < 400, "{} bytes", message.len());
        assert!(message.contains("2097152 bytes"), "{message}");
    }

    #[test]
    fn poses_must_be_in_or_around_a_home() {
        let at = |x, y, z| {
            let mut pose = pose_of([0.0, 0.0, 0.0, 1.0]);
            pose.position = Some(v1::Vector3 { x, y, z });
            place("start", Some(&pose))
        };
        assert!(at(-50.0, 50.0, 5.0).is_ok());
        for far in [
            at(1e30, 0.0, 0.0),
            at(0.0, -50.1, 0.0),
            at(0.0, 0.0, -1.1),
            at(0.0, 0.0, 5.1),
            at(f64::NAN, 0.0, 0.0),
        ] {
            assert!(far.unwrap_err().to_string().starts_with("start is"));
        }
    }

    #[test]
    fn driving_and_stopping_commands_are_distinguished() {
        use v1::arm_command::Target;
        let base = |linear| v1::Command {
            base: Some(v1::BaseCommand {
                linear,
                angular: 0.0,
            }),
            ..v1::Command::default()
        };
        let arm = |target| v1::Command {
            arm: Some(v1::ArmCommand {
                target: Some(target),
            }),
            ..v1::Command::default()
        };
        let twist = |x| {
            let linear = v1::Vector3 { x, y: 0.0, z: 0.0 };
            arm(Target::Twist(v1::CartesianTwist {
                twist: Some(v1::Twist {
                    linear: Some(linear),
                    angular: None,
                }),
                ..v1::CartesianTwist::default()
            }))
        };
        let joints = arm(Target::Joints(v1::JointTarget {
            positions: vec![0.0; 6],
        }));
        for (command, is_driving, is_stopping) in [
            (base(0.3), true, false),
            (base(0.0), false, true),
            (twist(0.1), true, false),
            (twist(0.0), false, true),
            (arm(Target::Hold(true)), false, true),
            (joints, false, false),
            (v1::Command::default(), false, false),
        ] {
            assert_eq!(drives(&command), is_driving, "{command:?}");
            assert_eq!(stops(&command), is_stopping, "{command:?}");
        }
        let mut both = base(0.0);
        both.gripper = Some(v1::GripperCommand::default());
        assert!(!stops(&both), "a gripper command is not a stop");
    }

    #[test]
    fn labels_cannot_leave_the_folder() {
        assert!(label("pick_mustard-01").is_ok());
        for bad in ["", "../x", "a/b", ".hidden", "ä", &"x".repeat(101)] {
            assert!(label(bad).is_err(), "{bad:?} was accepted");
        }
    }
}
