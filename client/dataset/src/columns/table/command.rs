//! Commands to the robot, and their results after the command gate.

use wheelarm_proto::v1;

use super::units::{POSE, POSE_UNIT, WHEELS};
use crate::columns::codec::{derived, derived_text, f64s, flags, message, text, u64s};
use crate::columns::values as take;
use crate::columns::{Axis, Table};

const ARM_VALUES: Axis = Axis::Components(&["0", "1", "2", "3", "4", "5", "6"]);
const BASE: Axis = Axis::Components(&["linear", "angular"]);
const GRIPPER: Axis = Axis::Components(&["opening", "knuckle", "max_force"]);

const ARM_UNIT: &str = "rad (joints); m and 1 (pose); m/s and rad/s (twist); m and rad (step)";
const BASE_UNIT: &str = "m/s (linear), rad/s (angular, positive to the left)";
const GRIPPER_UNIT: &str =
    "m (opening), rad (knuckle), N (max_force; NaN takes the usual force of the robot)";

pub(super) static COMMAND: Table<v1::CommandLog> = Table {
    columns: &[
        text(
            "commander",
            derived_text(|m| {
                m.command
                    .as_ref()
                    .map_or_else(String::new, |c| c.commander.clone())
            }),
        ),
        u64s(
            "command_sequence",
            "1 (the commander's own sequence number)",
            derived(|m, _, o| {
                let header = m.command.as_ref().and_then(|c| c.header.as_ref());
                o.push(header.map_or(0, |h| h.sequence));
            }),
        ),
        u64s(
            "answers_tick",
            "ticks of 1/240 s",
            derived(|m, _, o| {
                o.push(m.command.as_ref().map_or(0, |c| c.answers_tick()));
            }),
        ),
        text(
            "arm_kind",
            derived_text(|m| take::arm_kind(m.command.as_ref().and_then(|c| c.arm.as_ref()))),
        ),
        text(
            "arm_frame",
            derived_text(|m| take::arm_frame(m.command.as_ref().and_then(|c| c.arm.as_ref()))),
        ),
        f64s(
            "arm",
            ARM_UNIT,
            "named by arm_frame",
            &[ARM_VALUES],
            derived(|m, _, o| {
                take::arm_values(m.command.as_ref().and_then(|c| c.arm.as_ref()), o);
            }),
        ),
        f64s(
            "base",
            BASE_UNIT,
            "wheelchair_root",
            &[BASE],
            derived(|m, _, o| {
                take::base(m.command.as_ref().and_then(|c| c.base.as_ref()), o);
            }),
        ),
        f64s(
            "gripper",
            GRIPPER_UNIT,
            "",
            &[GRIPPER],
            derived(|m, _, o| {
                take::gripper(m.command.as_ref().and_then(|c| c.gripper.as_ref()), o);
            }),
        ),
        text("device", derived_text(|m| take::device(m.command.as_ref()))),
        text("mode", derived_text(|m| take::mode(m.command.as_ref()))),
        text(
            "assistance",
            derived_text(|m| take::assistance(m.command.as_ref())),
        ),
        text(
            "incident",
            derived_text(|m| {
                m.command
                    .as_ref()
                    .map_or_else(String::new, |c| c.incident().word())
            }),
        ),
        u64s(
            "over_ticks",
            "control ticks of 1/60 s",
            derived(|m, _, o| {
                o.push(m.command.as_ref().map_or(0, |c| u64::from(c.over_ticks)));
            }),
        ),
        f64s(
            "loop_age",
            "ticks of 1/240 s (age of the state that was answered; NaN: unknown)",
            "",
            &[],
            derived(|m, _, o| o.push(m.loop_age_ticks.map_or(f64::NAN, |age| age as f64))),
        ),
        text(
            "phase",
            derived_text(|m| take::phase(m.command.as_ref().map_or(0, |c| c.phase))),
        ),
        text(
            "phase_name",
            derived_text(|m| {
                m.command
                    .as_ref()
                    .map_or_else(String::new, |c| c.phase_name.clone())
            }),
        ),
        message(),
    ],
};

pub(super) static APPLIED: Table<v1::Applied> = Table {
    columns: &[
        f64s(
            "joint_position",
            "rad",
            "",
            &[Axis::ArmJoints],
            derived(|m, _, o| o.extend(&m.joint_positions)),
        ),
        f64s(
            "joint_velocity",
            "rad/s",
            "",
            &[Axis::ArmJoints],
            derived(|m, _, o| o.extend(&m.joint_velocities)),
        ),
        f64s(
            "wheel_velocity",
            "rad/s",
            "",
            &[WHEELS],
            derived(|m, _, o| o.extend(&m.wheel_velocities)),
        ),
        f64s(
            "knuckle",
            "rad",
            "",
            &[],
            derived(|m, _, o| o.push(m.knuckle)),
        ),
        f64s(
            "desired_pose",
            POSE_UNIT,
            "base_link",
            &[POSE],
            derived(|m, _, o| {
                take::pose(m.desired_pose.as_ref(), o);
            }),
        ),
        flags("stale", &[], derived(|m, _, o| o.push(u8::from(m.stale)))),
        text("arm_problem", derived_text(|m| m.arm_problem.clone())),
        text(
            "arm_problem_code",
            derived_text(|m| m.arm_problem_code().word()),
        ),
        text("arm_kind", derived_text(|m| take::arm_kind(m.arm.as_ref()))),
        text(
            "arm_frame",
            derived_text(|m| take::arm_frame(m.arm.as_ref())),
        ),
        f64s(
            "arm",
            ARM_UNIT,
            "named by arm_frame",
            &[ARM_VALUES],
            derived(|m, _, o| {
                take::arm_values(m.arm.as_ref(), o);
            }),
        ),
        f64s(
            "base",
            BASE_UNIT,
            "wheelchair_root",
            &[BASE],
            derived(|m, _, o| {
                take::base(m.base.as_ref(), o);
            }),
        ),
        f64s(
            "gripper",
            GRIPPER_UNIT,
            "",
            &[GRIPPER],
            derived(|m, _, o| {
                take::gripper(m.gripper.as_ref(), o);
            }),
        ),
        message(),
    ],
};
