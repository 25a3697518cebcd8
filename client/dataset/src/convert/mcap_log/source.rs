//! What becomes of each stream: the messages, and how they are encoded.

use anyhow::Context;
use jpeg_encoder::{ColorType, Encoder};
use prost::Message;
use prost_types::Timestamp;
use wheelarm_proto::v1;

use super::columns::Columns;
use super::foxglove;
use crate::calibration::PIXEL_CENTRE;
use crate::pose::Pose;
use crate::read::{Camera, Episode};
use crate::urdf::Joint;

const JPEG_QUALITY: u8 = 90;

/// How the messages of a channel are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    /// Foxglove's messages, protobuf.
    Foxglove,
    /// Our own messages, protobuf.
    Own,
    /// ROS 2's text message, CDR: what viewers take a robot description from.
    RosText,
}

/// A source of messages, one per sample.
pub(super) enum Source<'a> {
    Colour(&'a Camera),
    Depth(&'a Camera),
    Ids(&'a Camera),
    Calibration(&'a Camera),
    Joints(Columns),
    /// The recorded frames, of a recording without a robot description.
    /// With parent and link of each.
    Frames(Columns, Vec<(String, String)>),
    /// With its place among the frames and its link.
    Chair(Columns, usize, String),
    /// Links below joints that move, and which entry of a sample each is.
    Links(Columns, Vec<(usize, Joint)>),
    /// Links that never move: one message.
    Fixed(Vec<(String, String, Pose)>),
    Description(String),
    Contacts(Columns, Vec<String>),
    Objects(Columns),
    CameraFrame(&'a Camera),
    /// With its place among the frames and the frame of its pose.
    Effector(Columns, usize, String),
    Imu(Columns),
    Odometry(Columns),
    Evaluation(Box<Evaluation>),
    Phase(Vec<u64>, Vec<String>),
    Applied(Vec<v1::Applied>),
    Command(Vec<v1::CommandLog>),
    Log(Vec<String>, Vec<String>),
}

pub(super) struct Evaluation {
    pub columns: Columns,
    pub success: Vec<bool>,
    pub done: Vec<bool>,
    pub holds: Vec<bool>,
    pub required: Vec<bool>,
    pub failure: Vec<String>,
}

fn timestamp(nanos: u64) -> Option<Timestamp> {
    Some(Timestamp {
        seconds: (nanos / 1_000_000_000) as i64,
        nanos: (nanos % 1_000_000_000) as i32,
    })
}

fn at(values: &[f64], i: usize) -> f64 {
    values.get(i).copied().unwrap_or(f64::NAN)
}

fn transform(stamp: u64, parent: &str, child: &str, p: &[f64]) -> foxglove::FrameTransform {
    foxglove::FrameTransform {
        timestamp: timestamp(stamp),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(foxglove::Vector3 {
            x: at(p, 0),
            y: at(p, 1),
            z: at(p, 2),
        }),
        rotation: Some(foxglove::Quaternion {
            x: at(p, 3),
            y: at(p, 4),
            z: at(p, 5),
            w: at(p, 6),
        }),
    }
}

fn vector(v: &[f64]) -> Option<v1::Vector3> {
    Some(v1::Vector3 {
        x: at(v, 0),
        y: at(v, 1),
        z: at(v, 2),
    })
}

fn quaternion(v: &[f64]) -> Option<v1::Quaternion> {
    Some(v1::Quaternion {
        x: at(v, 0),
        y: at(v, 1),
        z: at(v, 2),
        w: at(v, 3),
    })
}

impl Source<'_> {
    /// Name of the message type.
    pub fn schema(&self) -> &'static str {
        match self {
            Self::Colour(_) => "foxglove.CompressedImage",
            Self::Depth(_) | Self::Ids(_) => "foxglove.RawImage",
            Self::Calibration(_) => "foxglove.CameraCalibration",
            Self::Joints(_) => "foxglove.JointStates",
            Self::Frames(..)
            | Self::Chair(..)
            | Self::Links(..)
            | Self::Fixed(_)
            | Self::Objects(_)
            | Self::CameraFrame(_) => "foxglove.FrameTransforms",
            Self::Description(_) => "std_msgs/msg/String",
            Self::Contacts(..) => "wheelarm.v1.Contacts",
            Self::Effector(..) => "foxglove.PoseInFrame",
            Self::Log(..) => "foxglove.Log",
            Self::Imu(_) => "wheelarm.v1.Imu",
            Self::Odometry(_) => "wheelarm.v1.Odometry",
            Self::Evaluation(_) => "wheelarm.v1.Evaluation",
            Self::Phase(..) => "wheelarm.v1.PhaseSample",
            Self::Applied(_) => "wheelarm.v1.Applied",
            Self::Command(_) => "wheelarm.v1.CommandLog",
        }
    }

    /// How its messages are written.
    pub fn coding(&self) -> Coding {
        match self.schema().split('.').next() {
            Some("foxglove") => Coding::Foxglove,
            Some("wheelarm") => Coding::Own,
            _ => Coding::RosText,
        }
    }

    /// The encoded message of a sample.
    pub fn message(&self, episode: &Episode, i: usize, stamp: u64) -> anyhow::Result<Vec<u8>> {
        Ok(match self {
            Self::Colour(camera) => {
                let (width, height) = camera.size().context("a size")?;
                let mut data = Vec::new();
                Encoder::new(&mut data, JPEG_QUALITY).encode(
                    &camera.rgb(episode, i)?,
                    u16::try_from(width)?,
                    u16::try_from(height)?,
                    ColorType::Rgb,
                )?;
                foxglove::CompressedImage {
                    timestamp: timestamp(stamp),
                    frame_id: camera.stream().to_owned(),
                    data,
                    format: "jpeg".into(),
                }
                .encode_to_vec()
            }
            Self::Depth(camera) => {
                let (width, height) = camera.size().context("a size")?;
                let depth = camera.depth(episode, i)?;
                let data = depth
                    .iter()
                    .flat_map(|&m| crate::depth::millimetres(m).to_le_bytes());
                foxglove::RawImage {
                    timestamp: timestamp(stamp),
                    frame_id: camera.stream().to_owned(),
                    width: u32::try_from(width)?,
                    height: u32::try_from(height)?,
                    encoding: "16UC1".into(),
                    step: u32::try_from(2 * width)?,
                    data: data.collect(),
                }
                .encode_to_vec()
            }
            Self::Ids(camera) => {
                let (width, height) = camera.size().context("a size")?;
                foxglove::RawImage {
                    timestamp: timestamp(stamp),
                    frame_id: camera.stream().to_owned(),
                    width: u32::try_from(width)?,
                    height: u32::try_from(height)?,
                    encoding: match camera.id_bytes() {
                        2 => "16UC1".into(),
                        _ => "8UC1".into(),
                    },
                    step: u32::try_from(camera.id_bytes() * width)?,
                    data: crate::ids::write(&camera.ids(episode, i)?, camera.id_bytes()),
                }
                .encode_to_vec()
            }
            Self::Calibration(camera) => {
                let [width, height, fx, fy, cx, cy] = camera.intrinsics(i);
                // Readers of this message count from the centre of the first
                // pixel, recordings from the picture's edge.
                let (cx, cy) = (cx - PIXEL_CENTRE, cy - PIXEL_CENTRE);
                foxglove::CameraCalibration {
                    timestamp: timestamp(stamp),
                    frame_id: camera.stream().to_owned(),
                    width: width as u32,
                    height: height as u32,
                    k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
                    r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
                    p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
                    ..Default::default()
                }
                .encode_to_vec()
            }
            Self::Joints(c) => {
                let joints = c
                    .names
                    .iter()
                    .enumerate()
                    .map(|(k, name)| foxglove::JointState {
                        name: name.clone(),
                        position: c.row("position", i).get(k).copied(),
                        velocity: c.row("velocity", i).get(k).copied(),
                        acceleration: None,
                        effort: c.row("effort", i).get(k).copied(),
                    });
                foxglove::JointStates {
                    timestamp: timestamp(stamp),
                    joints: joints.collect(),
                }
                .encode_to_vec()
            }
            Self::Frames(c, links) => {
                let poses = c.row("pose", i).chunks_exact(7);
                let frames = links.iter().zip(poses);
                let each = frames.map(|((parent, link), p)| transform(stamp, parent, link, p));
                foxglove::FrameTransforms {
                    transforms: each.collect(),
                }
                .encode_to_vec()
            }
            Self::Chair(c, place, link) => {
                let at = 7 * place;
                let pose = c.row("pose", i).get(at..at + 7).unwrap_or(&[]);
                foxglove::FrameTransforms {
                    transforms: vec![transform(stamp, "house", link, pose)],
                }
                .encode_to_vec()
            }
            Self::Links(c, joints) => {
                let positions = c.row("position", i);
                let each = joints.iter().map(|(k, joint)| {
                    let pose = joint.pose(at(positions, *k));
                    transform(stamp, &joint.parent, &joint.child, &pose)
                });
                foxglove::FrameTransforms {
                    transforms: each.collect(),
                }
                .encode_to_vec()
            }
            Self::Fixed(links) => foxglove::FrameTransforms {
                transforms: links
                    .iter()
                    .map(|(parent, child, pose)| transform(stamp, parent, child, pose))
                    .collect(),
            }
            .encode_to_vec(),
            Self::Description(text) => ros_text(text)?,
            Self::Contacts(c, pairs) => contacts(c, pairs, i)?.encode_to_vec(),
            Self::Objects(c) => {
                let poses = c.row("pose", i).chunks_exact(7);
                let each = c
                    .names
                    .iter()
                    .zip(poses)
                    .map(|(n, p)| transform(stamp, "house", n, p));
                foxglove::FrameTransforms {
                    transforms: each.collect(),
                }
                .encode_to_vec()
            }
            Self::CameraFrame(camera) => foxglove::FrameTransforms {
                transforms: vec![transform(stamp, "house", camera.stream(), &camera.pose(i))],
            }
            .encode_to_vec(),
            Self::Effector(c, last, frame) => {
                let row = c.row("pose", i);
                let p = row.get(7 * last..7 * last + 7).unwrap_or(&[]);
                foxglove::PoseInFrame {
                    timestamp: timestamp(stamp),
                    frame_id: frame.clone(),
                    pose: Some(foxglove::Pose {
                        position: Some(foxglove::Vector3 {
                            x: at(p, 0),
                            y: at(p, 1),
                            z: at(p, 2),
                        }),
                        orientation: Some(foxglove::Quaternion {
                            x: at(p, 3),
                            y: at(p, 4),
                            z: at(p, 5),
                            w: at(p, 6),
                        }),
                    }),
                }
                .encode_to_vec()
            }
            Self::Imu(c) => v1::Imu {
                header: c.headers.header(i),
                orientation: quaternion(c.row("orientation", i)),
                angular_velocity: vector(c.row("angular_velocity", i)),
                linear_acceleration: vector(c.row("linear_acceleration", i)),
            }
            .encode_to_vec(),
            Self::Odometry(c) => {
                let (p, t) = (c.row("pose", i), c.row("twist", i));
                v1::Odometry {
                    header: c.headers.header(i),
                    pose: Some(v1::Pose {
                        position: vector(p),
                        orientation: quaternion(p.get(3..).unwrap_or(&[])),
                    }),
                    twist: Some(v1::Twist {
                        linear: vector(t),
                        angular: vector(t.get(3..).unwrap_or(&[])),
                    }),
                }
                .encode_to_vec()
            }
            Self::Evaluation(e) => {
                let n = e.columns.names.len();
                let flag = |list: &[bool], k: usize| list.get(i * n + k).copied().unwrap_or(false);
                let each = e
                    .columns
                    .names
                    .iter()
                    .enumerate()
                    .map(|(k, name)| v1::Condition {
                        name: name.clone(),
                        holds: flag(&e.holds, k),
                        value: at(e.columns.row("condition_value", i), k),
                        required: flag(&e.required, k),
                        predicate: name.split('(').next().unwrap_or_default().to_owned(),
                    });
                v1::Evaluation {
                    header: e.columns.headers.header(i),
                    success: e.success.get(i).copied().unwrap_or(false),
                    done: e.done.get(i).copied().unwrap_or(false),
                    failure: e.failure.get(i).cloned().unwrap_or_default(),
                    // Files hold the words alone.
                    failure_reason: v1::FailureReason::Unspecified.into(),
                    conditions: each.collect(),
                    elapsed_seconds: at(e.columns.row("elapsed", i), 0),
                }
                .encode_to_vec()
            }
            Self::Phase(labels, words) => v1::PhaseSample {
                header: Some(v1::Header {
                    stamp_nanos: stamp,
                    ..Default::default()
                }),
                phase: i32::try_from(labels[i]).unwrap_or(0),
                name: words.get(i).cloned().unwrap_or_default(),
            }
            .encode_to_vec(),
            Self::Applied(all) => all[i].encode_to_vec(),
            Self::Command(all) => all[i].encode_to_vec(),
            Self::Log(kinds, texts) => {
                let kind = v1::EventKind::from_word(&kinds[i]);
                let level = if kind.is_serious() {
                    foxglove::log::Level::Warning
                } else {
                    foxglove::log::Level::Info
                };
                foxglove::Log {
                    timestamp: timestamp(stamp),
                    level: level.into(),
                    message: texts.get(i).cloned().unwrap_or_default(),
                    name: kinds[i].clone(),
                    ..Default::default()
                }
                .encode_to_vec()
            }
        })
    }
}

/// A text as ROS 2 encodes it: little-endian CDR, length with the final NUL.
fn ros_text(text: &str) -> anyhow::Result<Vec<u8>> {
    let mut out = vec![0, 1, 0, 0];
    out.extend(u32::try_from(text.len() + 1)?.to_le_bytes());
    out.extend_from_slice(text.as_bytes());
    out.push(0);
    Ok(out)
}

/// The message of a sample of contacts, which the file holds as columns.
fn contacts(c: &Columns, pairs: &[String], i: usize) -> anyhow::Result<v1::Contacts> {
    let pairs = pairs.get(i).map_or("[]", String::as_str);
    let pairs: Vec<[String; 2]> = serde_json::from_str(pairs).context("pairs of contacts")?;
    let (points, forces) = (c.row("point", i), c.row("force", i));
    let three = |all: &[f64], k: usize| vector(all.get(3 * k..3 * k + 3).unwrap_or(&[]));
    let each = pairs.into_iter().enumerate();
    let each = each.map(|(k, [first, second])| v1::Contact {
        first,
        second,
        point: three(points, k),
        force: three(forces, k),
    });
    Ok(v1::Contacts {
        header: c.headers.header(i),
        pad_forces: c.row("pad_force", i).to_vec(),
        contacts: each.collect(),
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_text_is_encoded_as_ros_does() {
        let bytes = super::ros_text("hi").unwrap();
        assert_eq!(bytes, [0, 1, 0, 0, 3, 0, 0, 0, b'h', b'i', 0]);
    }
}
