//! The table itself: every stream, every dataset, unit and frame, and both ways
//! between a dataset and its message. One file per kind of stream; this module maps
//! streams to tables.

mod command;
mod progress;
mod robot;
mod scene;
mod units;

use wheelarm_proto::{StreamId, TopicId};

use self::command::{APPLIED, COMMAND};
use self::progress::{CLOCK, EVALUATION, PHASE, STATE_HASH};
use self::robot::{
    IMU, JOINT_STATE, ODOMETRY, POSE_SET, SCAN, SENSED_IMU, SENSED_JOINT, SENSED_ODOMETRY,
    SENSED_SCAN,
};
use self::scene::{CONTACT, DEFORMABLE, DISTURBANCE, FURNITURE_JOINT, OBJECT_POSE, PERSON};
use super::{Cell, ColumnInfo, Kind, Stream};

/// The columns of a state stream; `None` for streams without columns.
#[must_use]
pub fn for_stream(stream: &StreamId) -> Option<&'static dyn Stream> {
    Some(match stream.topic()? {
        TopicId::JointState => &JOINT_STATE,
        TopicId::Pose => &POSE_SET,
        TopicId::Imu => &IMU,
        TopicId::Scan => &SCAN,
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
        TopicId::SensedScan => &SENSED_SCAN,
        TopicId::Event
        | TopicId::Camera
        | TopicId::CompressedCamera
        | TopicId::Sensor
        | TopicId::Preview
        | TopicId::EpisodeStart
        | TopicId::EpisodeStop
        | TopicId::SentCommand
        | TopicId::Refusal
        | TopicId::Recorder => return None,
    })
}

/// Every state stream of a file, in the order of the table of topics.
pub fn streams() -> impl Iterator<Item = &'static dyn Stream> {
    let states = TopicId::STATES.into_iter().map(StreamId::State);
    states.filter_map(|stream| for_stream(&stream))
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
