//! Conversions of commands, robot state and arm problems.

use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::geometry::{isometry, pose, twist, vector};
use wheelarm_proto::v1;

use crate::robot::control::{
    ArmIntent, ArmProblem, BaseIntent, ControlInput, GripperIntent, GripperMap, IntentFrame,
};
use crate::robot::kinematics;
use crate::sensors::frames::RelativeState;
use crate::snapshot::BodyState;

/// One recorded frame as a message.
pub fn frame_pose(state: &RelativeState) -> v1::FramePose {
    v1::FramePose {
        pose: Some(pose(&state.pose)),
        twist: Some(twist(&state.linear, &state.angular)),
    }
}

/// Velocity of a body as a message.
pub fn body_twist(state: &BodyState) -> v1::Twist {
    twist(&state.linear, &state.angular)
}

fn frame_from(value: i32) -> IntentFrame {
    match v1::CommandFrame::try_from(value) {
        Ok(v1::CommandFrame::EndEffector) => IntentFrame::EndEffector,
        Ok(v1::CommandFrame::Wheelchair) => IntentFrame::Wheelchair,
        Ok(v1::CommandFrame::House) => IntentFrame::House,
        _ => IntentFrame::ArmBase,
    }
}

fn frame_to(frame: IntentFrame) -> i32 {
    let frame = match frame {
        IntentFrame::ArmBase => v1::CommandFrame::BaseLink,
        IntentFrame::EndEffector => v1::CommandFrame::EndEffector,
        IntentFrame::Wheelchair => v1::CommandFrame::Wheelchair,
        IntentFrame::House => v1::CommandFrame::House,
    };
    frame as i32
}

/// Converts a command that has passed `check::command`, and checks its gripper values
/// against the robot's ranges.
///
/// # Errors
/// [`Invalid`] that names the field.
pub fn control_input(command: &v1::Command, map: &GripperMap) -> Result<ControlInput, Invalid> {
    Ok(ControlInput {
        arm: command.arm.as_ref().map(arm_intent).transpose()?,
        base: command.base.as_ref().map(|b| BaseIntent {
            linear: b.linear,
            angular: b.angular,
        }),
        gripper: command
            .gripper
            .as_ref()
            .map(|g| gripper_intent(g, map))
            .transpose()?,
    })
}

fn arm_intent(arm: &v1::ArmCommand) -> Result<ArmIntent, Invalid> {
    use v1::arm_command::Target;
    Ok(
        match arm.target.as_ref().ok_or(Invalid::Missing("arm target"))? {
            Target::Joints(j) => {
                ArmIntent::Joints(check::list("arm joint position", &j.positions)?)
            }
            Target::Pose(p) => ArmIntent::Pose {
                frame: frame_from(p.frame),
                pose: isometry("arm pose", p.pose.as_ref())?,
            },
            Target::Twist(t) => {
                let twist = t.twist.as_ref().ok_or(Invalid::Missing("arm twist"))?;
                ArmIntent::Twist {
                    frame: frame_from(t.frame),
                    linear: check::vector("arm linear velocity", twist.linear.as_ref())?.into(),
                    angular: check::vector("arm angular velocity", twist.angular.as_ref())?.into(),
                }
            }
            Target::Step(s) => ArmIntent::Step {
                frame: frame_from(s.frame),
                translation: check::vector("arm step translation", s.translation.as_ref())?.into(),
                rotation: check::vector("arm step rotation", s.rotation.as_ref())?.into(),
            },
            Target::Hold(_) => ArmIntent::Hold,
        },
    )
}

fn gripper_intent(
    command: &v1::GripperCommand,
    map: &GripperMap,
) -> Result<GripperIntent, Invalid> {
    use v1::gripper_command::Target;
    let target = command
        .target
        .as_ref()
        .ok_or(Invalid::Missing("gripper target"))?;
    let most = map.max_knuckle();
    let knuckle = match target {
        // The linkage may open slightly less than the allowed stroke, and close
        // slightly beyond the knuckle's range.
        Target::Opening(metres) => {
            let metres = check::within("gripper opening", *metres, 0.0, map.stroke())?;
            map.knuckle(metres).clamp(0.0, most)
        }
        Target::Knuckle(radians) => check::within("gripper knuckle angle", *radians, 0.0, most)?,
    };
    if let Some(cap) = command.max_force {
        check::within("gripper force", cap, 0.0, map.max_force())?;
    }
    Ok(GripperIntent {
        knuckle,
        max_force: command.max_force,
    })
}

/// The input of a control tick as the groups of a command, as a replay sends them.
pub fn applied_groups(
    input: &ControlInput,
) -> (
    Option<v1::ArmCommand>,
    Option<v1::BaseCommand>,
    Option<v1::GripperCommand>,
) {
    let base = input.base.map(|b| v1::BaseCommand {
        linear: b.linear,
        angular: b.angular,
    });
    let gripper = input.gripper.map(|g| v1::GripperCommand {
        target: Some(v1::gripper_command::Target::Knuckle(g.knuckle)),
        max_force: g.max_force,
    });
    (input.arm.as_ref().map(arm_command), base, gripper)
}

fn arm_command(intent: &ArmIntent) -> v1::ArmCommand {
    use v1::arm_command::Target;
    let target = match intent {
        ArmIntent::Joints(q) => Target::Joints(v1::JointTarget {
            positions: q.to_vec(),
        }),
        ArmIntent::Pose { frame, pose: p } => Target::Pose(v1::CartesianTarget {
            frame: frame_to(*frame),
            pose: Some(pose(p)),
        }),
        ArmIntent::Twist {
            frame,
            linear,
            angular,
        } => Target::Twist(v1::CartesianTwist {
            frame: frame_to(*frame),
            twist: Some(twist(linear, angular)),
        }),
        ArmIntent::Step {
            frame,
            translation,
            rotation,
        } => Target::Step(v1::CartesianStep {
            frame: frame_to(*frame),
            translation: Some(vector(translation)),
            rotation: Some(vector(rotation)),
        }),
        ArmIntent::Hold => Target::Hold(true),
    };
    v1::ArmCommand {
        target: Some(target),
    }
}

/// Why the arm does not follow, as an enum of the contract.
pub fn arm_problem(problem: Option<ArmProblem>) -> v1::ArmProblem {
    match problem {
        None => v1::ArmProblem::None,
        Some(ArmProblem::Unreachable) => v1::ArmProblem::Unreachable,
        Some(ArmProblem::JointLimit) => v1::ArmProblem::JointLimit,
        Some(ArmProblem::Stalled) => v1::ArmProblem::Stalled,
        Some(ArmProblem::Hindered) => v1::ArmProblem::Hindered,
    }
}

/// Why a pose is not reachable, as an enum of the contract.
pub fn reach_problem(reason: kinematics::Reason) -> v1::ReachProblem {
    use kinematics::Reason;
    match reason {
        Reason::TooFar { .. } => v1::ReachProblem::TooFar,
        Reason::Limits(_) => v1::ReachProblem::JointLimits,
        Reason::NoSolution => v1::ReachProblem::NoSolution,
        Reason::Jump(..) => v1::ReachProblem::Jump,
    }
}
