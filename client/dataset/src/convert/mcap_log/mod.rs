//! MCAP for Foxglove: its well-known messages where there is one, ours for the
//! rest, every recorded sample at its own time, nothing resampled.

mod columns;
mod source;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use wheelarm_proto::{TopicId, v1};

use self::columns::Columns;
use self::source::{Coding, Evaluation, Source};
use super::batch::parallel;
use super::{Format, PendingFile, Recording, Written};
use crate::read::Camera;
use crate::urdf::{self, Robot};

/// Foxglove's messages.
#[allow(clippy::doc_markdown, reason = "generated from the .proto file")]
mod foxglove {
    include!(concat!(env!("OUT_DIR"), "/foxglove.rs"));
}

const FOXGLOVE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/foxglove.bin"));
const OURS: &[u8] = wheelarm_proto::MESSAGES_DESCRIPTOR;
/// ROS 2's text message.
const ROS_TEXT: &[u8] = b"string data\n";
/// What cx and cy of a calibration count from.
const CONVENTION: &str = "pixel centre, as OpenCV and ROS count: u, v, cx and cy are 0 at the \
centre of the first pixel; the recording counts from the picture's edge, there they are greater by 0.5";
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

/// The links below joints that move; a joint whose position is not recorded
/// stays where it is at zero.
fn links(robot: &Robot, columns: Columns) -> Source<'static> {
    let moving = robot.joints().iter().filter(|j| j.moves());
    let place = |name: &str| columns.names.iter().position(|n| n == name);
    let found = moving.filter_map(|j| Some((place(&j.name)?, j.clone())));
    let found = found.collect();
    Source::Links(columns, found)
}

/// The links that are in one place on others for the whole episode.
fn fixed(robot: &Robot, recorded: &[String]) -> Vec<(String, String, crate::pose::Pose)> {
    let still = robot.joints().iter();
    let still = still.filter(|j| !j.moves() || !recorded.contains(&j.name));
    still
        .map(|j| (j.parent.clone(), j.child.clone(), j.pose(0.0)))
        .collect()
}

/// A topic, the stamps of its messages, and what makes them.
type Topic<'a> = (String, Vec<u64>, Source<'a>);

/// What a viewer needs once: links that never move, and the robot's looks.
fn once(
    recording: &Recording,
    robot: Option<&Robot>,
    assets: &[v1::AssetText],
) -> anyhow::Result<Vec<Topic<'static>>> {
    let e = &recording.episode;
    let stamp = vec![recording.summary.span_nanos.0];
    let mut out = Vec::new();
    if let Some(robot) = robot {
        let recorded = e.names("joint_state", "position")?;
        let source = Source::Fixed(fixed(robot, &recorded));
        out.push(("/tf_static".to_owned(), stamp.clone(), source));
    }
    if let Some(drawn) = urdf::text(assets).and_then(|t| urdf::without_meshes(t).ok()) {
        let source = Source::Description(drawn);
        out.push(("/robot_description".to_owned(), stamp, source));
    }
    Ok(out)
}

fn sources<'a>(
    recording: &'a Recording,
    robot: Option<&Robot>,
    assets: &[v1::AssetText],
) -> anyhow::Result<Vec<Topic<'a>>> {
    let e = &recording.episode;
    let mut out: Vec<Topic<'a>> = once(recording, robot, assets)?;
    for (name, camera) in &recording.cameras {
        out.extend(pictures(name, camera));
    }
    // Every topic of the table: what is recorded has a place in the log.
    for topic in TopicId::ALL {
        if topic == TopicId::Event || e.has(topic.name()) {
            of_topic(&mut out, topic, recording, robot)?;
        }
    }
    Ok(out)
}

fn pictures<'a>(name: &str, camera: &'a Camera) -> [Topic<'a>; 5] {
    let of = |topic: String, source| (topic, camera.stamps().to_vec(), source);
    [
        of(format!("/camera/{name}/rgb"), Source::Colour(camera)),
        of(format!("/camera/{name}/depth"), Source::Depth(camera)),
        of(format!("/camera/{name}/ids"), Source::Ids(camera)),
        of(
            format!("/camera/{name}/calibration"),
            Source::Calibration(camera),
        ),
        of(format!("/tf/{name}"), Source::CameraFrame(camera)),
    ]
}

/// What becomes of one topic's samples.
fn of_topic(
    out: &mut Vec<Topic<'_>>,
    topic: TopicId,
    recording: &Recording,
    robot: Option<&Robot>,
) -> anyhow::Result<()> {
    let e = &recording.episode;
    let (described, roles) = (&recording.robot, &recording.roles);
    let stream = topic.name();
    let columns = || Columns::of(e, stream);
    let mut add = |place: &str, source: Source<'static>| {
        out.push((place.to_owned(), e.stamps(stream)?, source));
        anyhow::Ok(())
    };
    match topic {
        TopicId::JointState => {
            add("/joint_states", Source::Joints(columns()?))?;
            if let Some(robot) = robot {
                add("/tf/links", links(robot, columns()?))?;
            }
        }
        TopicId::FurnitureJoint => add("/furniture_joints", Source::Joints(columns()?))?,
        TopicId::Pose => {
            let tree = match robot {
                Some(_) => Source::Chair(columns()?, roles.chair, described.root_link.clone()),
                None => {
                    let links = described.frames.iter();
                    let links = links.map(|f| (f.parent.clone(), f.link.clone()));
                    Source::Frames(columns()?, links.collect())
                }
            };
            add("/tf", tree)?;
            let base = described.arm_base_link.clone();
            let effector = Source::Effector(columns()?, roles.end_effector, base);
            add("/end_effector", effector)?;
        }
        TopicId::Contact => {
            let pairs = e.texts(stream, "pairs")?;
            add("/contact", Source::Contacts(columns()?, pairs))?;
        }
        TopicId::ObjectPose => add("/tf/objects", Source::Objects(columns()?))?,
        TopicId::Imu => add("/imu", Source::Imu(columns()?))?,
        TopicId::Odometry => add("/odometry", Source::Odometry(columns()?))?,
        TopicId::Evaluation => {
            let evaluation = Evaluation {
                success: e.flags(stream, "success")?,
                done: e.flags(stream, "done")?,
                holds: e.flags(stream, "condition_holds")?,
                required: e.flags(stream, "condition_required")?,
                failure: e.texts(stream, "failure")?,
                columns: columns()?,
            };
            add("/evaluation", Source::Evaluation(Box::new(evaluation)))?;
        }
        TopicId::Phase => {
            let labels = e.u64s(stream, "label")?;
            add("/phase", Source::Phase(labels, e.texts(stream, "name")?))?;
        }
        TopicId::Applied => add("/applied", Source::Applied(e.applied()?))?,
        TopicId::Command => add("/command", Source::Command(e.commands()?))?,
        TopicId::Event => {
            if let (Ok(kinds), Ok(texts)) = (e.texts(stream, "kind"), e.texts(stream, "text")) {
                add("/events", Source::Log(kinds, texts))?;
            }
        }
        // `clock` and `state_hash` tell a viewer nothing; a skin has no message
        // that viewers know. Pictures are taken by camera; the rest is not
        // recorded.
        TopicId::Clock
        | TopicId::StateHash
        | TopicId::Deformable
        | TopicId::Camera
        | TopicId::Preview
        | TopicId::SentCommand
        | TopicId::Refusal
        | TopicId::EpisodeStart
        | TopicId::EpisodeStop
        | TopicId::Recorder => {}
    }
    Ok(())
}

fn write(
    path: &Path,
    recording: &Recording,
    threads: usize,
    tick: &dyn Fn(),
) -> anyhow::Result<usize> {
    let snapshot = recording.episode.snapshot()?;
    let robot = Robot::of(&snapshot.assets);
    let sources = sources(recording, robot.as_ref(), &snapshot.assets)?;
    let mut writer = mcap::WriteOptions::new()
        .compression(Some(mcap::Compression::Lz4))
        .chunk_size(Some(4 << 20))
        .library(format!("wheelarm-dataset {}", env!("CARGO_PKG_VERSION")))
        .create(BufWriter::new(File::create_new(path)?))?;
    let mut channels = Vec::new();
    for (topic, _, source) in &sources {
        let (encoding, schema, message) = match source.coding() {
            Coding::Foxglove => ("protobuf", FOXGLOVE, "protobuf"),
            Coding::Own => ("protobuf", OURS, "protobuf"),
            Coding::RosText => ("ros2msg", ROS_TEXT, "cdr"),
        };
        let schema = writer.add_schema(source.schema(), encoding, schema)?;
        channels.push(writer.add_channel(schema, topic, message, &BTreeMap::new())?);
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
    writer.write_metadata(&mcap::records::Metadata {
        name: "camera_calibration".into(),
        metadata: BTreeMap::from([("convention".to_owned(), CONVENTION.to_owned())]),
    })?;
    // What the numbers in the pictures of ids mean.
    let legend = snapshot.instances.iter();
    writer.write_metadata(&mcap::records::Metadata {
        name: "instance_ids".into(),
        metadata: legend.map(|i| (i.id.to_string(), i.name.clone())).collect(),
    })?;
    for asset in snapshot.assets.iter().filter(|a| a.path.ends_with(".urdf")) {
        writer.attach(&mcap::Attachment {
            log_time: s.span_nanos.0,
            create_time: 0,
            name: asset.path.clone(),
            media_type: "application/xml".into(),
            data: Cow::Borrowed(asset.text.as_bytes()),
        })?;
    }
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
