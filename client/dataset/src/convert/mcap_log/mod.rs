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
use wheelarm_proto::{names, v1};

use self::columns::Columns;
use self::source::{Coding, Evaluation, Source};
use super::batch::parallel;
use super::{Format, PendingFile, Recording, Written};
use crate::urdf::{self, Robot};

/// Foxglove's messages.
#[allow(clippy::doc_markdown, reason = "generated from the .proto file")]
mod foxglove {
    include!(concat!(env!("OUT_DIR"), "/foxglove.rs"));
}

const FOXGLOVE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/foxglove.bin"));
const OURS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/wheelarm.bin"));
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
            format!("/camera/{name}/ids"),
            stamps.clone(),
            Source::Ids(camera),
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
    add("/joint_states", "joint_state", &|c| Ok(Source::Joints(c)))?;
    add("/furniture_joints", "furniture_joint", &|c| {
        Ok(Source::Joints(c))
    })?;
    match robot {
        Some(robot) => {
            add("/tf", "pose", &|c| Ok(Source::Chair(c)))?;
            add("/tf/links", "joint_state", &|c| Ok(links(robot, c)))?;
        }
        None => add("/tf", "pose", &|c| Ok(Source::Frames(c)))?,
    }
    add("/contact", "contact", &|c| {
        Ok(Source::Contacts(c, e.texts("contact", "pairs")?))
    })?;
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
