//! MCAP for Foxglove: its well-known messages where there is one, ours for the
//! rest, every recorded sample at its own time, nothing resampled.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::Context;
use jpeg_encoder::{ColorType, Encoder};
use mcap::records::MessageHeader;
use prost::Message;
use prost_types::Timestamp;
use wheelarm_proto::{names, v1};

use super::batch::parallel;
use super::{Format, PendingFile, Recording, Written};
use crate::read::{Camera, Episode, Values};
use crate::sheet::mount_pose;

/// Foxglove's messages.
#[allow(clippy::doc_markdown, reason = "generated from the .proto file")]
mod foxglove {
    include!(concat!(env!("OUT_DIR"), "/foxglove.rs"));
}

const FOXGLOVE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/foxglove.bin"));
const OURS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/wheelarm.bin"));
const JPEG_QUALITY: u8 = 90;
/// Messages that are encoded together: about half a second.
const BLOCK: usize = 512;

/// Writes `LABEL.mcap` per episode.
#[derive(Clone, Debug)]
pub struct McapLog {
    /// Folder of the files.
    pub out: PathBuf,
    /// Threads that compress pictures.
    pub threads: usize,
}

impl Format for McapLog {
    fn wants(&self, _: &str) -> bool {
        false
    }

    fn add(&self, recording: &Recording, tick: &(dyn Fn() + Sync)) -> anyhow::Result<Written> {
        let name = format!("{}.mcap", recording.summary.label);
        let pending = PendingFile::new(&self.out.join(name))?;
        let samples = write(pending.path(), recording, self.threads, tick)?;
        Ok(Written {
            path: pending.commit()?,
            samples,
            notes: Vec::new(),
        })
    }
}

/// A source of messages, one per sample.
enum Source<'a> {
    Colour(&'a Camera),
    Depth(&'a Camera),
    Calibration(&'a Camera),
    Joints(Columns),
    Transforms(Columns, Option<[f64; 7]>),
    Objects(Columns),
    CameraFrame(&'a Camera),
    Effector(Columns),
    Imu(Columns),
    Odometry(Columns),
    Evaluation(Box<Evaluation>),
    Phase(Vec<u64>, Vec<String>),
    Applied(Vec<v1::Applied>),
    Command(Vec<v1::CommandLog>),
    Log(Vec<String>, Vec<String>),
}

/// Numeric columns of one stream by name: width and values.
#[derive(Default)]
struct Columns {
    all: BTreeMap<String, (usize, Vec<f64>)>,
    names: Vec<String>,
    headers: Headers,
}

#[derive(Clone, Default)]
struct Headers {
    stamps: Vec<u64>,
    sequence: Vec<u64>,
    tick: Vec<u64>,
}

struct Evaluation {
    columns: Columns,
    success: Vec<bool>,
    done: Vec<bool>,
    holds: Vec<bool>,
    required: Vec<bool>,
    failure: Vec<String>,
}

impl Headers {
    fn of(episode: &Episode, stream: &str) -> anyhow::Result<Self> {
        Ok(Self {
            stamps: episode.stamps(stream)?,
            sequence: episode.u64s(stream, "sequence")?,
            tick: episode.u64s(stream, "tick")?,
        })
    }

    fn header(&self, i: usize) -> Option<v1::Header> {
        Some(v1::Header {
            stamp_nanos: self.stamps[i],
            sequence: self.sequence.get(i).copied().unwrap_or(0),
            tick: self.tick.get(i).copied().unwrap_or(0),
            ..Default::default()
        })
    }
}

impl Columns {
    fn of(episode: &Episode, stream: &str) -> anyhow::Result<Self> {
        let mut out = Self {
            headers: Headers::of(episode, stream)?,
            ..Self::default()
        };
        for meta in episode.columns(stream)? {
            if meta.kind == crate::read::ElementKind::F64
                && let Values::F64(values) = episode.values(&meta)?
            {
                if out.names.is_empty() {
                    out.names.clone_from(&meta.names);
                }
                out.all.insert(meta.name.clone(), (meta.width(), values));
            }
        }
        Ok(out)
    }

    fn row(&self, column: &str, i: usize) -> &[f64] {
        match self.all.get(column) {
            Some((width, values)) => values.get(i * width..(i + 1) * width).unwrap_or(&[]),
            None => &[],
        }
    }
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
    fn schema(&self) -> &'static str {
        match self {
            Self::Colour(_) => "foxglove.CompressedImage",
            Self::Depth(_) => "foxglove.RawImage",
            Self::Calibration(_) => "foxglove.CameraCalibration",
            Self::Joints(_) => "foxglove.JointStates",
            Self::Transforms(..) | Self::Objects(_) | Self::CameraFrame(_) => {
                "foxglove.FrameTransforms"
            }
            Self::Effector(_) => "foxglove.PoseInFrame",
            Self::Log(..) => "foxglove.Log",
            Self::Imu(_) => "wheelarm.v1.Imu",
            Self::Odometry(_) => "wheelarm.v1.Odometry",
            Self::Evaluation(_) => "wheelarm.v1.Evaluation",
            Self::Phase(..) => "wheelarm.v1.PhaseSample",
            Self::Applied(_) => "wheelarm.v1.Applied",
            Self::Command(_) => "wheelarm.v1.CommandLog",
        }
    }

    /// The encoded message of a sample.
    fn message(&self, episode: &Episode, i: usize, stamp: u64) -> anyhow::Result<Vec<u8>> {
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
            Self::Calibration(camera) => {
                let [width, height, fx, fy, cx, cy] = camera.intrinsics(i);
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
            Self::Transforms(c, mount) => {
                let poses = c.row("pose", i).chunks_exact(7);
                let mut transforms: Vec<_> = names::FRAMES
                    .iter()
                    .zip(poses)
                    .map(|(f, p)| transform(stamp, f.parent, f.link, p))
                    .collect();
                if let Some(mount) = mount {
                    transforms.push(transform(stamp, "wheelchair_root", "base_link", mount));
                }
                foxglove::FrameTransforms { transforms }.encode_to_vec()
            }
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
            Self::Effector(c) => {
                let last = names::FRAMES
                    .iter()
                    .position(|f| f.name == "end_effector")
                    .unwrap_or(0);
                let row = c.row("pose", i);
                let p = row.get(7 * last..7 * last + 7).unwrap_or(&[]);
                foxglove::PoseInFrame {
                    timestamp: timestamp(stamp),
                    frame_id: "base_link".into(),
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
                    });
                v1::Evaluation {
                    header: e.columns.headers.header(i),
                    success: e.success.get(i).copied().unwrap_or(false),
                    done: e.done.get(i).copied().unwrap_or(false),
                    failure: e.failure.get(i).cloned().unwrap_or_default(),
                    conditions: each.collect(),
                    elapsed: at(e.columns.row("elapsed", i), 0),
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
                let serious = matches!(kinds[i].as_str(), "refused" | "collision" | "anomaly");
                let level = if serious {
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

fn sources(recording: &Recording) -> anyhow::Result<Vec<(String, Vec<u64>, Source<'_>)>> {
    let e = &recording.episode;
    let mut out = Vec::new();
    for (name, camera) in &recording.cameras {
        let stamps = camera.stamps().to_vec();
        out.push((
            format!("/camera/{name}/rgb"),
            stamps.clone(),
            Source::Colour(camera),
        ));
        out.push((
            format!("/camera/{name}/depth"),
            stamps.clone(),
            Source::Depth(camera),
        ));
        out.push((
            format!("/camera/{name}/calibration"),
            stamps.clone(),
            Source::Calibration(camera),
        ));
        out.push((format!("/tf/{name}"), stamps, Source::CameraFrame(camera)));
    }
    let mut add =
        |topic: &str, stream: &str, make: &dyn Fn(Columns) -> anyhow::Result<Source<'static>>| {
            if e.has(stream) {
                let columns = Columns::of(e, stream)?;
                out.push((
                    topic.to_owned(),
                    columns.headers.stamps.clone(),
                    make(columns)?,
                ));
            }
            anyhow::Ok(())
        };
    let mount = e.snapshot().ok().and_then(|s| mount_pose(&s.assets));
    add("/joint_states", "joint_state", &|c| Ok(Source::Joints(c)))?;
    add("/tf", "pose", &|c| Ok(Source::Transforms(c, mount)))?;
    add("/end_effector", "pose", &|c| Ok(Source::Effector(c)))?;
    add("/tf/objects", "object_pose", &|c| Ok(Source::Objects(c)))?;
    add("/imu", "imu", &|c| Ok(Source::Imu(c)))?;
    add("/odometry", "odometry", &|c| Ok(Source::Odometry(c)))?;
    add("/evaluation", "evaluation", &|columns| {
        Ok(Source::Evaluation(Box::new(Evaluation {
            success: e.flags("evaluation", "success")?,
            done: e.flags("evaluation", "done")?,
            holds: e.flags("evaluation", "condition_holds")?,
            required: e.flags("evaluation", "condition_required")?,
            failure: e.texts("evaluation", "failure")?,
            columns,
        })))
    })?;
    add("/phase", "phase", &|_| {
        Ok(Source::Phase(
            e.u64s("phase", "label")?,
            e.texts("phase", "name")?,
        ))
    })?;
    add("/applied", "applied", &|_| {
        Ok(Source::Applied(e.applied()?))
    })?;
    add("/command", "command", &|_| {
        Ok(Source::Command(e.commands()?))
    })?;
    let events = names::EVENT_STREAM;
    if let Ok(stamps) = e.stamps(events) {
        let source = Source::Log(e.texts(events, "kind")?, e.texts(events, "text")?);
        out.push(("/events".to_owned(), stamps, source));
    }
    Ok(out)
}

fn write(
    path: &Path,
    recording: &Recording,
    threads: usize,
    tick: &dyn Fn(),
) -> anyhow::Result<usize> {
    let sources = sources(recording)?;
    let mut writer = mcap::WriteOptions::new()
        .compression(Some(mcap::Compression::Lz4))
        .chunk_size(Some(4 << 20))
        .library(format!("wheelarm-dataset {}", env!("CARGO_PKG_VERSION")))
        .create(BufWriter::new(File::create_new(path)?))?;
    let mut channels = Vec::new();
    for (topic, _, source) in &sources {
        let name = source.schema();
        let set = if name.starts_with("foxglove.") {
            FOXGLOVE
        } else {
            OURS
        };
        let schema = writer.add_schema(name, "protobuf", set)?;
        channels.push(writer.add_channel(schema, topic, "protobuf", &BTreeMap::new())?);
    }
    let s = &recording.summary;
    let words = [
        ("label", s.label.clone()),
        ("instruction", s.instruction.clone()),
        ("task", s.task[0].clone()),
        ("seed", s.seed.to_string()),
        ("success", s.success.to_string()),
        ("complete", s.complete.to_string()),
    ];
    writer.write_metadata(&mcap::records::Metadata {
        name: "episode".into(),
        metadata: words.map(|(k, v)| (k.to_owned(), v)).into_iter().collect(),
    })?;
    // Every sample of every source in the order of time.
    let mut order: Vec<(u64, usize, usize)> = sources
        .iter()
        .enumerate()
        .flat_map(|(k, (_, stamps, _))| stamps.iter().enumerate().map(move |(i, &t)| (t, k, i)))
        .collect();
    order.sort_unstable();
    let reference = format!("/camera/{}/rgb", recording.aligned.reference);
    for block in order.chunks(BLOCK) {
        let messages = parallel(block.len(), threads, |at| {
            let (stamp, k, i) = block[at];
            sources[k].2.message(&recording.episode, i, stamp)
        })?;
        for (&(stamp, k, i), message) in block.iter().zip(&messages) {
            let header = MessageHeader {
                channel_id: channels[k],
                sequence: i as u32,
                log_time: stamp,
                publish_time: stamp,
            };
            writer.write_to_known_channel(&header, message)?;
            if sources[k].0 == reference {
                tick();
            }
        }
    }
    writer.finish()?;
    Ok(order.len())
}
