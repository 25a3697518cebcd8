//! The table itself: every stream, every dataset, unit and frame, and both ways
//! between a dataset and its message.

use wheelarm_proto::{StreamId, TopicId, v1};

use super::codec::{
    derived, derived_text, f64s, flag, flags, list, message, number, part, text, u64s, words,
};
use super::values::{self as take, put_each, to_pose, to_twist, to_vector};
use super::{Axis, Cell, Codec, ColumnInfo, Context, Kind, MAX_CONTACTS, Stream, Table, TextCodec};

const XYZ: Axis = Axis::Components(&["x", "y", "z"]);
const QUATERNION: Axis = Axis::Components(&["x", "y", "z", "w"]);
const POSE: Axis = Axis::Components(&["x", "y", "z", "qx", "qy", "qz", "qw"]);
const TWIST: Axis = Axis::Components(&["vx", "vy", "vz", "wx", "wy", "wz"]);
const ARM_VALUES: Axis = Axis::Components(&["0", "1", "2", "3", "4", "5", "6"]);
const BASE: Axis = Axis::Components(&["linear", "angular"]);
const GRIPPER: Axis = Axis::Components(&["opening", "knuckle", "max_force"]);
const WHEELS: Axis = Axis::Names(&["left", "right"]);
const PADS: Axis = Axis::Names(&["left", "right"]);
const HEAD_TURNS: Axis = Axis::Names(&["yaw", "pitch", "roll"]);
const BODY_PARTS: Axis = Axis::Names(&[
    "head", "face", "mouth", "torso", "arms", "hands", "lap", "legs",
]);

const POSE_UNIT: &str = "m (x y z), 1 (unit quaternion x y z w)";
const TWIST_UNIT: &str = "m/s (linear), rad/s (angular)";
const ARM_UNIT: &str = "rad (joints); m and 1 (pose); m/s and rad/s (twist); m and rad (step)";
const BASE_UNIT: &str = "m/s (linear), rad/s (angular, positive to the left)";
const GRIPPER_UNIT: &str =
    "m (opening), rad (knuckle), N (max_force; NaN takes the usual force of the robot)";
const FRAMES_FRAME: &str = "the chair in house, all others in base_link";

static JOINT_STATE: Table<v1::JointState> = Table {
    columns: &[
        f64s("position", "rad", "", &[Axis::Joints], list!(positions)),
        f64s("velocity", "rad/s", "", &[Axis::Joints], list!(velocities)),
        f64s("effort", "N.m", "", &[Axis::Joints], list!(efforts)),
        f64s(
            "opening",
            "m",
            "",
            &[],
            Codec {
                take: |m, _, o| o.push(m.opening.unwrap_or(f64::NAN)),
                put: |m, _, v| m.opening = v.first().copied().filter(|v| !v.is_nan()),
            },
        ),
    ],
};

static POSE_SET: Table<v1::PoseSet> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            FRAMES_FRAME,
            &[Axis::Frames, POSE],
            Codec {
                take: |m, _, o| m.frames.iter().for_each(|f| take::pose(f.pose.as_ref(), o)),
                put: |m, _, v| put_each(&mut m.frames, v, 7, |f, v| f.pose = to_pose(v)),
            },
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            FRAMES_FRAME,
            &[Axis::Frames, TWIST],
            Codec {
                take: |m, _, o| {
                    m.frames
                        .iter()
                        .for_each(|f| take::twist(f.twist.as_ref(), o))
                },
                put: |m, _, v| put_each(&mut m.frames, v, 6, |f, v| f.twist = to_twist(v)),
            },
        ),
    ],
};

static IMU: Table<v1::Imu> = Table {
    columns: &[
        f64s(
            "orientation",
            "1",
            "imu_link in house",
            &[QUATERNION],
            part!(orientation, take::quaternion, take::to_quaternion),
        ),
        f64s(
            "angular_velocity",
            "rad/s",
            "imu_link",
            &[XYZ],
            part!(angular_velocity, take::vector, to_vector),
        ),
        f64s(
            "linear_acceleration",
            "m/s^2",
            "imu_link",
            &[XYZ],
            part!(linear_acceleration, take::vector, to_vector),
        ),
    ],
};

static CLOCK: Table<v1::Clock> = Table {
    columns: &[f64s(
        "real_time_factor",
        "1 (simulated seconds per wall second)",
        "",
        &[],
        number!(real_time_factor),
    )],
};

static ODOMETRY: Table<v1::Odometry> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            "wheelchair_root where the odometry started",
            &[POSE],
            part!(pose, take::pose, to_pose),
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            "wheelchair_root",
            &[TWIST],
            part!(twist, take::twist, to_twist),
        ),
    ],
};

static SENSED_JOINT: Table<v1::SensedJoints> = Table {
    columns: &[
        f64s("position", "rad", "", &[Axis::ArmJoints], list!(positions)),
        f64s(
            "velocity",
            "rad/s",
            "",
            &[Axis::ArmJoints],
            list!(velocities),
        ),
        f64s("effort", "N.m", "", &[Axis::ArmJoints], list!(efforts)),
        f64s("opening", "m", "", &[], number!(opening)),
    ],
};

static SENSED_ODOMETRY: Table<v1::SensedOdometry> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            "wheelchair_root where the episode began",
            &[POSE],
            part!(pose, take::pose, to_pose),
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            "wheelchair_root",
            &[TWIST],
            part!(twist, take::twist, to_twist),
        ),
    ],
};

static SENSED_IMU: Table<v1::SensedImu> = Table {
    columns: &[
        f64s(
            "angular_velocity",
            "rad/s",
            "imu_link",
            &[XYZ],
            part!(angular_velocity, take::vector, to_vector),
        ),
        f64s(
            "linear_acceleration",
            "m/s^2",
            "imu_link",
            &[XYZ],
            part!(linear_acceleration, take::vector, to_vector),
        ),
    ],
};

static COMMAND: Table<v1::CommandLog> = Table {
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
            "ticks of 1/240 s (age of the state that was answered; NaN: not told)",
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

static APPLIED: Table<v1::Applied> = Table {
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

static OBJECT_POSE: Table<v1::ObjectPoses> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            "house",
            &[Axis::Objects, POSE],
            Codec {
                take: |m, _, o| m.poses.iter().for_each(|p| take::pose(Some(p), o)),
                put: |m, _, v| {
                    put_each(&mut m.poses, v, 7, |p, v| {
                        *p = to_pose(v).unwrap_or_default()
                    })
                },
            },
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            "house",
            &[Axis::Objects, TWIST],
            Codec {
                take: |m, _, o| m.twists.iter().for_each(|t| take::twist(Some(t), o)),
                put: |m, _, v| {
                    put_each(&mut m.twists, v, 6, |t, v| {
                        *t = to_twist(v).unwrap_or_default()
                    })
                },
            },
        ),
    ],
};

static FURNITURE_JOINT: Table<v1::FurnitureJoints> = Table {
    columns: &[
        f64s(
            "position",
            "m or rad",
            "",
            &[Axis::FurnitureJoints],
            list!(positions),
        ),
        f64s(
            "velocity",
            "m/s or rad/s",
            "",
            &[Axis::FurnitureJoints],
            list!(velocities),
        ),
    ],
};

static DEFORMABLE: Table<v1::Deformable> = Table {
    columns: &[
        text("object", words!(object)),
        f64s(
            "vertex",
            "m",
            "house",
            &[Axis::Vertices, XYZ],
            Codec {
                take: |m, _, o| o.extend(m.vertices.iter().map(|x| f64::from(*x))),
                // Narrowing is exact: they were float32 when they were published.
                put: |m, _, v| m.vertices = v.iter().map(|&x| x as f32).collect(),
            },
        ),
        f64s("elastic_energy", "J", "", &[], number!(elastic_energy)),
        f64s("kinetic_energy", "J", "", &[], number!(kinetic_energy)),
    ],
};

static DISTURBANCE: Table<v1::Disturbance> = Table {
    columns: &[
        f64s(
            "joint_offset",
            "rad",
            "",
            &[Axis::ArmJoints],
            list!(joint_offsets),
        ),
        f64s("wheel_factor", "1", "", &[WHEELS], list!(wheel_factors)),
        text("pushed", words!(pushed)),
        f64s(
            "push_force",
            "N (NaN where nothing is pushed)",
            "house",
            &[XYZ],
            part!(push_force, take::vector, to_vector),
        ),
        f64s("grip_factor", "1", "", &[], number!(grip_factor)),
    ],
};

static PERSON: Table<v1::PersonState> = Table {
    columns: &[
        f64s(
            "head",
            "rad (to the left, down, to the right)",
            "",
            &[HEAD_TURNS],
            list!(head_angles),
        ),
        f64s("jaw", "rad", "", &[], number!(jaw)),
        f64s(
            "mouth",
            POSE_UNIT,
            "house",
            &[POSE],
            part!(mouth, take::pose, to_pose),
        ),
        f64s(
            "force",
            "N (greatest of the physics ticks)",
            "",
            &[BODY_PARTS],
            list!(forces),
        ),
        f64s("robot_force", "N", "", &[], number!(robot_force)),
    ],
};

static CONTACT: Table<v1::Contacts> = Table {
    columns: &[
        f64s(
            "pad_force",
            "N (normal force and friction)",
            "",
            &[PADS],
            list!(pad_forces),
        ),
        u64s(
            "count",
            "1 (touching pairs)",
            derived(|m: &v1::Contacts, _, o| o.push(m.contacts.len() as u64)),
        ),
        text(
            "pairs",
            TextCodec {
                take: take::pairs,
                put: |m, text| {
                    m.contacts = take::to_pairs(&text)?;
                    Ok(())
                },
            },
        ),
        f64s(
            "point",
            "m",
            "house",
            &[Axis::Contacts, XYZ],
            Codec {
                take: |m, _, o| of_contacts(m, o, |c| c.point.as_ref()),
                put: |m, _, v| to_contacts(m, v, |c, v| c.point = to_vector(v)),
            },
        ),
        f64s(
            "force",
            "N (on the second body)",
            "house",
            &[Axis::Contacts, XYZ],
            Codec {
                take: |m, _, o| of_contacts(m, o, |c| c.force.as_ref()),
                put: |m, _, v| to_contacts(m, v, |c, v| c.force = to_vector(v)),
            },
        ),
    ],
};

/// A vector of each of the strongest contacts; NaN where there are fewer.
fn of_contacts(
    m: &v1::Contacts,
    out: &mut Vec<f64>,
    of: impl Fn(&v1::Contact) -> Option<&v1::Vector3>,
) {
    let start = out.len();
    let strongest = m.contacts.iter().take(MAX_CONTACTS);
    strongest.for_each(|c| take::vector(of(c), out));
    out.resize(start + 3 * MAX_CONTACTS, f64::NAN);
}

/// Gives those contacts that there are their vectors.
fn to_contacts(m: &mut v1::Contacts, v: &[f64], put: impl Fn(&mut v1::Contact, &[f64])) {
    let contacts = m.contacts.iter_mut();
    contacts.zip(v.chunks_exact(3)).for_each(|(c, v)| put(c, v));
}

fn condition<'a>(m: &'a v1::Evaluation, name: &str) -> Option<&'a v1::Condition> {
    m.conditions.iter().find(|c| c.name == name)
}

/// Gives every condition of the task its value; the first of their columns
/// brings them in.
fn to_conditions<T: Copy>(
    m: &mut v1::Evaluation,
    context: &Context,
    values: &[T],
    put: impl Fn(&mut v1::Condition, T),
) {
    let known = m.conditions.len();
    let new = context.conditions.iter().skip(known);
    m.conditions.extend(new.map(|name| v1::Condition {
        name: name.clone(),
        predicate: name.split('(').next().unwrap_or_default().to_owned(),
        ..v1::Condition::default()
    }));
    let conditions = m.conditions.iter_mut();
    conditions.zip(values).for_each(|(c, &v)| put(c, v));
}

// What a condition lacks in a sample is stored as not held and not a number. Its
// predicate begins its name, as the contract has it.
static EVALUATION: Table<v1::Evaluation> = Table {
    columns: &[
        flags("success", &[], flag!(success)),
        flags("done", &[], flag!(done)),
        text("failure", words!(failure)),
        text(
            "failure_code",
            TextCodec {
                take: |m| m.failure_reason().word(),
                put: |m, text| {
                    m.set_failure_reason(v1::FailureReason::from_word(&text));
                    Ok(())
                },
            },
        ),
        f64s("elapsed", "s", "", &[], number!(elapsed_seconds)),
        flags(
            "condition_holds",
            &[Axis::Conditions],
            Codec {
                take: |m, c, o| {
                    let holds = |n: &String| u8::from(condition(m, n).is_some_and(|c| c.holds));
                    o.extend(c.conditions.iter().map(holds));
                },
                put: |m, c, v| to_conditions(m, c, v, |condition, v| condition.holds = v != 0),
            },
        ),
        f64s(
            "condition_value",
            "SI unit of the condition's threshold",
            "",
            &[Axis::Conditions],
            Codec {
                take: |m, c, o| {
                    let value = |n: &String| condition(m, n).map_or(f64::NAN, |c| c.value);
                    o.extend(c.conditions.iter().map(value));
                },
                put: |m, c, v| to_conditions(m, c, v, |condition, v| condition.value = v),
            },
        ),
        flags(
            "condition_required",
            &[Axis::Conditions],
            Codec {
                take: |m, c, o| {
                    let required =
                        |n: &String| u8::from(condition(m, n).is_some_and(|c| c.required));
                    o.extend(c.conditions.iter().map(required));
                },
                put: |m, c, v| to_conditions(m, c, v, |condition, v| condition.required = v != 0),
            },
        ),
    ],
};

static PHASE: Table<v1::PhaseSample> = Table {
    columns: &[
        u64s(
            "label",
            "1 (0 none, 1 navigating, 2 reaching, 3 grasping, 4 retracting)",
            Codec {
                take: |m, _, o| o.push(u64::try_from(m.phase).unwrap_or(0)),
                put: |m, _, v| {
                    let label = v.first().copied().unwrap_or_default();
                    m.phase = i32::try_from(label).unwrap_or_default();
                },
            },
        ),
        text(
            "phase",
            derived_text(|m: &v1::PhaseSample| take::phase(m.phase)),
        ),
        text("name", words!(name)),
    ],
};

static STATE_HASH: Table<v1::StateHash> = Table {
    columns: &[u64s(
        "hash",
        "1 (64-bit hash of the whole state)",
        number!(hash),
    )],
};

/// The columns of a state stream; nothing for what is not stored as columns.
#[must_use]
pub fn of(stream: &StreamId) -> Option<&'static dyn Stream> {
    Some(match stream.topic()? {
        TopicId::JointState => &JOINT_STATE,
        TopicId::Pose => &POSE_SET,
        TopicId::Imu => &IMU,
        TopicId::Odometry => &ODOMETRY,
        TopicId::Clock => &CLOCK,
        TopicId::Command => &COMMAND,
        TopicId::Applied => &APPLIED,
        TopicId::ObjectPose => &OBJECT_POSE,
        TopicId::FurnitureJoint => &FURNITURE_JOINT,
        TopicId::Deformable => &DEFORMABLE,
        TopicId::Disturbance => &DISTURBANCE,
        TopicId::Person => &PERSON,
        TopicId::Contact => &CONTACT,
        TopicId::Evaluation => &EVALUATION,
        TopicId::Phase => &PHASE,
        TopicId::StateHash => &STATE_HASH,
        TopicId::SensedJoint => &SENSED_JOINT,
        TopicId::SensedOdometry => &SENSED_ODOMETRY,
        TopicId::SensedImu => &SENSED_IMU,
        TopicId::Event
        | TopicId::Camera
        | TopicId::Sensor
        | TopicId::Preview
        | TopicId::EpisodeStart
        | TopicId::EpisodeStop
        | TopicId::SentCommand
        | TopicId::Refusal
        | TopicId::Recorder => return None,
    })
}

/// Every state stream that a file can hold, in the order of the table of topics.
pub fn streams() -> impl Iterator<Item = &'static dyn Stream> {
    let states = TopicId::STATES.into_iter().map(StreamId::State);
    states.filter_map(|stream| of(&stream))
}

const fn event(name: &'static str, unit: &'static str, kind: Kind) -> ColumnInfo {
    ColumnInfo {
        name,
        unit,
        frame: "",
        axes: &[],
        kind,
    }
}

/// Columns of `/events`, whose rows come from several sources.
pub const EVENT_COLUMNS: [ColumnInfo; 3] = [
    event(
        "source",
        "1 (`event`, `phase` or `episode`: the stream it came from)",
        Kind::Text,
    ),
    event("kind", "1", Kind::Text),
    event("text", "1", Kind::Text),
];

/// Cells of one row of `/events`.
#[must_use]
pub fn event_cells(source: &str, kind: &str, text: &str) -> Vec<Cell> {
    [source, kind, text]
        .map(|s| Cell::Text(s.to_owned()))
        .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_holds_every_stream_in_order_with_units() {
        let order: Vec<_> = streams().map(|s| s.name()).collect();
        assert_eq!(order, TopicId::STATES.map(TopicId::name));
        for stream in streams() {
            for column in stream.columns() {
                assert!(!column.unit.is_empty(), "{}/{}", stream.name(), column.name);
            }
        }
    }
}
