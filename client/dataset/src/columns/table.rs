//! The table itself: every stream, every dataset, unit and frame.

use wheelarm_proto::{StreamId, TopicId, v1};

use super::values as take;
use super::{Axis, Cell, Column, ColumnInfo, Context, Kind, MAX_CONTACTS, Stream, Table, Values};

const XYZ: Axis = Axis::Components(&["x", "y", "z"]);
const QUATERNION: Axis = Axis::Components(&["x", "y", "z", "w"]);
const POSE: Axis = Axis::Components(&["x", "y", "z", "qx", "qy", "qz", "qw"]);
const TWIST: Axis = Axis::Components(&["vx", "vy", "vz", "wx", "wy", "wz"]);
const ARM_VALUES: Axis = Axis::Components(&["0", "1", "2", "3", "4", "5", "6"]);
const BASE: Axis = Axis::Components(&["linear", "angular"]);
const GRIPPER: Axis = Axis::Components(&["opening", "knuckle", "max_force"]);
const WHEELS: Axis = Axis::Names(&["left", "right"]);
const PADS: Axis = Axis::Names(&["left", "right"]);

const POSE_UNIT: &str = "m (x y z), 1 (unit quaternion x y z w)";
const TWIST_UNIT: &str = "m/s (linear), rad/s (angular)";
const ARM_UNIT: &str = "rad (joints); m and 1 (pose); m/s and rad/s (twist); m and rad (step)";
const BASE_UNIT: &str = "m/s (linear), rad/s (angular, positive to the left)";
const GRIPPER_UNIT: &str =
    "m (opening), rad (knuckle), N (max_force; NaN takes the usual force of the robot)";
const FRAMES_FRAME: &str = "the chair in house, all others in base_link";

const fn f64s<M>(
    name: &'static str,
    unit: &'static str,
    frame: &'static str,
    axes: &'static [Axis],
    get: fn(&M, &Context, &mut Vec<f64>),
) -> Column<M> {
    Column {
        name,
        unit,
        frame,
        axes,
        values: Values::F64(get),
    }
}

const fn u64s<M>(
    name: &'static str,
    unit: &'static str,
    get: fn(&M, &Context, &mut Vec<u64>),
) -> Column<M> {
    Column {
        name,
        unit,
        frame: "",
        axes: &[],
        values: Values::U64(get),
    }
}

const fn flags<M>(
    name: &'static str,
    axes: &'static [Axis],
    get: fn(&M, &Context, &mut Vec<u8>),
) -> Column<M> {
    Column {
        name,
        unit: "1",
        frame: "",
        axes,
        values: Values::Flag(get),
    }
}

const fn text<M>(name: &'static str, get: fn(&M) -> String) -> Column<M> {
    Column {
        name,
        unit: "1",
        frame: "",
        axes: &[],
        values: Values::Text(get),
    }
}

const fn message<M>() -> Column<M> {
    Column {
        name: "message",
        unit: "protobuf bytes of package wheelarm.v1",
        frame: "",
        axes: &[],
        values: Values::Message,
    }
}

static JOINT_STATE: Table<v1::JointState> = Table {
    columns: &[
        f64s("position", "rad", "", &[Axis::Joints], |m, _, o| {
            o.extend(&m.positions)
        }),
        f64s("velocity", "rad/s", "", &[Axis::Joints], |m, _, o| {
            o.extend(&m.velocities)
        }),
        f64s("effort", "N.m", "", &[Axis::Joints], |m, _, o| {
            o.extend(&m.efforts)
        }),
        f64s("opening", "m", "", &[], |m, _, o| {
            o.push(m.opening.unwrap_or(f64::NAN));
        }),
    ],
};

static POSE_SET: Table<v1::PoseSet> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            FRAMES_FRAME,
            &[Axis::Frames, POSE],
            |m, _, o| {
                m.frames.iter().for_each(|f| take::pose(f.pose.as_ref(), o));
            },
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            FRAMES_FRAME,
            &[Axis::Frames, TWIST],
            |m, _, o| {
                m.frames
                    .iter()
                    .for_each(|f| take::twist(f.twist.as_ref(), o));
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
            |m, _, o| {
                take::quaternion(m.orientation.as_ref(), o);
            },
        ),
        f64s(
            "angular_velocity",
            "rad/s",
            "imu_link",
            &[XYZ],
            |m, _, o| {
                take::vector(m.angular_velocity.as_ref(), o);
            },
        ),
        f64s(
            "linear_acceleration",
            "m/s^2",
            "imu_link",
            &[XYZ],
            |m, _, o| {
                take::vector(m.linear_acceleration.as_ref(), o);
            },
        ),
    ],
};

static CLOCK: Table<v1::Clock> = Table {
    columns: &[f64s(
        "real_time_factor",
        "1 (simulated seconds per wall second)",
        "",
        &[],
        |m, _, o| o.push(m.real_time_factor),
    )],
};

static ODOMETRY: Table<v1::Odometry> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            "wheelchair_root where the odometry started",
            &[POSE],
            |m, _, o| {
                take::pose(m.pose.as_ref(), o);
            },
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            "wheelchair_root",
            &[TWIST],
            |m, _, o| {
                take::twist(m.twist.as_ref(), o);
            },
        ),
    ],
};

static COMMAND: Table<v1::CommandLog> = Table {
    columns: &[
        text("commander", |m| {
            m.command
                .as_ref()
                .map_or_else(String::new, |c| c.commander.clone())
        }),
        u64s(
            "command_sequence",
            "1 (the commander's own sequence number)",
            |m, _, o| {
                let header = m.command.as_ref().and_then(|c| c.header.as_ref());
                o.push(header.map_or(0, |h| h.sequence));
            },
        ),
        u64s("answers_tick", "ticks of 1/240 s", |m, _, o| {
            o.push(m.command.as_ref().map_or(0, |c| c.answers_tick()));
        }),
        text("arm_kind", |m| {
            take::arm_kind(m.command.as_ref().and_then(|c| c.arm.as_ref()))
        }),
        text("arm_frame", |m| {
            take::arm_frame(m.command.as_ref().and_then(|c| c.arm.as_ref()))
        }),
        f64s(
            "arm",
            ARM_UNIT,
            "named by arm_frame",
            &[ARM_VALUES],
            |m, _, o| {
                take::arm_values(m.command.as_ref().and_then(|c| c.arm.as_ref()), o);
            },
        ),
        f64s("base", BASE_UNIT, "wheelchair_root", &[BASE], |m, _, o| {
            take::base(m.command.as_ref().and_then(|c| c.base.as_ref()), o);
        }),
        f64s("gripper", GRIPPER_UNIT, "", &[GRIPPER], |m, _, o| {
            take::gripper(m.command.as_ref().and_then(|c| c.gripper.as_ref()), o);
        }),
        text("device", |m| take::device(m.command.as_ref())),
        text("mode", |m| take::mode(m.command.as_ref())),
        text("assistance", |m| take::assistance(m.command.as_ref())),
        u64s("over_ticks", "control ticks of 1/60 s", |m, _, o| {
            o.push(m.command.as_ref().map_or(0, |c| u64::from(c.over_ticks)));
        }),
        f64s(
            "loop_age",
            "ticks of 1/240 s (age of the state that was answered; NaN: not told)",
            "",
            &[],
            |m, _, o| o.push(m.loop_age_ticks.map_or(f64::NAN, |age| age as f64)),
        ),
        text("phase", |m| {
            take::phase(m.command.as_ref().map_or(0, |c| c.phase))
        }),
        text("phase_name", |m| {
            m.command
                .as_ref()
                .map_or_else(String::new, |c| c.phase_name.clone())
        }),
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
            |m, _, o| o.extend(&m.joint_positions),
        ),
        f64s(
            "joint_velocity",
            "rad/s",
            "",
            &[Axis::ArmJoints],
            |m, _, o| o.extend(&m.joint_velocities),
        ),
        f64s("wheel_velocity", "rad/s", "", &[WHEELS], |m, _, o| {
            o.extend(&m.wheel_velocities)
        }),
        f64s("knuckle", "rad", "", &[], |m, _, o| o.push(m.knuckle)),
        f64s(
            "desired_pose",
            POSE_UNIT,
            "base_link",
            &[POSE],
            |m, _, o| {
                take::pose(m.desired_pose.as_ref(), o);
            },
        ),
        flags("stale", &[], |m, _, o| o.push(u8::from(m.stale))),
        text("arm_problem", |m| m.arm_problem.clone()),
        text("arm_kind", |m| take::arm_kind(m.arm.as_ref())),
        text("arm_frame", |m| take::arm_frame(m.arm.as_ref())),
        f64s(
            "arm",
            ARM_UNIT,
            "named by arm_frame",
            &[ARM_VALUES],
            |m, _, o| {
                take::arm_values(m.arm.as_ref(), o);
            },
        ),
        f64s("base", BASE_UNIT, "wheelchair_root", &[BASE], |m, _, o| {
            take::base(m.base.as_ref(), o);
        }),
        f64s("gripper", GRIPPER_UNIT, "", &[GRIPPER], |m, _, o| {
            take::gripper(m.gripper.as_ref(), o);
        }),
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
            |m, _, o| {
                m.poses.iter().for_each(|p| take::pose(Some(p), o));
            },
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            "house",
            &[Axis::Objects, TWIST],
            |m, _, o| {
                m.twists.iter().for_each(|t| take::twist(Some(t), o));
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
            |m, _, o| o.extend(&m.positions),
        ),
        f64s(
            "velocity",
            "m/s or rad/s",
            "",
            &[Axis::FurnitureJoints],
            |m, _, o| o.extend(&m.velocities),
        ),
    ],
};

static DEFORMABLE: Table<v1::Deformable> = Table {
    columns: &[
        text("object", |m| m.object.clone()),
        f64s("vertex", "m", "house", &[Axis::Vertices, XYZ], |m, _, o| {
            o.extend(m.vertices.iter().map(|x| f64::from(*x)));
        }),
        f64s("elastic_energy", "J", "", &[], |m, _, o| {
            o.push(m.elastic_energy);
        }),
        f64s("kinetic_energy", "J", "", &[], |m, _, o| {
            o.push(m.kinetic_energy);
        }),
    ],
};

static CONTACT: Table<v1::Contacts> = Table {
    columns: &[
        f64s(
            "pad_force",
            "N (normal force and friction)",
            "",
            &[PADS],
            |m, _, o| o.extend(&m.pad_forces),
        ),
        u64s("count", "1 (touching pairs)", |m, _, o| {
            o.push(m.contacts.len() as u64)
        }),
        text("pairs", take::pairs),
        f64s("point", "m", "house", &[Axis::Contacts, XYZ], |m, _, o| {
            let start = o.len();
            for c in m.contacts.iter().take(MAX_CONTACTS) {
                take::vector(c.point.as_ref(), o);
            }
            o.resize(start + 3 * MAX_CONTACTS, f64::NAN);
        }),
        f64s(
            "force",
            "N (on the second body)",
            "house",
            &[Axis::Contacts, XYZ],
            |m, _, o| {
                let start = o.len();
                for c in m.contacts.iter().take(MAX_CONTACTS) {
                    take::vector(c.force.as_ref(), o);
                }
                o.resize(start + 3 * MAX_CONTACTS, f64::NAN);
            },
        ),
    ],
};

fn condition<'a>(m: &'a v1::Evaluation, name: &str) -> Option<&'a v1::Condition> {
    m.conditions.iter().find(|c| c.name == name)
}

static EVALUATION: Table<v1::Evaluation> = Table {
    columns: &[
        flags("success", &[], |m, _, o| o.push(u8::from(m.success))),
        flags("done", &[], |m, _, o| o.push(u8::from(m.done))),
        text("failure", |m| m.failure.clone()),
        f64s("elapsed", "s", "", &[], |m, _, o| o.push(m.elapsed_seconds)),
        flags("condition_holds", &[Axis::Conditions], |m, c, o| {
            let holds = |n: &String| u8::from(condition(m, n).is_some_and(|c| c.holds));
            o.extend(c.conditions.iter().map(holds));
        }),
        f64s(
            "condition_value",
            "SI unit of the condition's threshold",
            "",
            &[Axis::Conditions],
            |m, c, o| {
                let value = |n: &String| condition(m, n).map_or(f64::NAN, |c| c.value);
                o.extend(c.conditions.iter().map(value));
            },
        ),
        flags("condition_required", &[Axis::Conditions], |m, c, o| {
            let required = |n: &String| u8::from(condition(m, n).is_some_and(|c| c.required));
            o.extend(c.conditions.iter().map(required));
        }),
    ],
};

static PHASE: Table<v1::PhaseSample> = Table {
    columns: &[
        u64s(
            "label",
            "1 (0 none, 1 navigating, 2 reaching, 3 grasping, 4 retracting)",
            |m, _, o| {
                o.push(u64::try_from(m.phase).unwrap_or(0));
            },
        ),
        text("phase", |m| take::phase(m.phase)),
        text("name", |m| m.name.clone()),
    ],
};

static STATE_HASH: Table<v1::StateHash> = Table {
    columns: &[u64s(
        "hash",
        "1 (64-bit hash of the whole state)",
        |m, _, o| o.push(m.hash),
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
        TopicId::Contact => &CONTACT,
        TopicId::Evaluation => &EVALUATION,
        TopicId::Phase => &PHASE,
        TopicId::StateHash => &STATE_HASH,
        TopicId::Event
        | TopicId::Camera
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
