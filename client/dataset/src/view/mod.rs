//! An episode as one self-contained HTML page: images and depth that
//! play, plots with the phases behind them, the instruction, the events.
//! Images are written one after the other, so that memory stays small.

use std::io::{BufWriter, Write};
use std::path::Path;

use anyhow::Context;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use jpeg_encoder::{ColorType, Encoder};
use serde_json::{Value, json};
use wheelarm_proto::{TopicId, v1};

use crate::align::Aligned;
use crate::convert::batch::parallel;
use crate::convert::{PendingFile, Recording, Size, scaled};
use crate::label;
use crate::publish;
use crate::read::{Camera, Frame};
use crate::sheet::raster;

const PAGE: &str = include_str!("page.html");
const DATA: &str = "/*DATA*/null";
const IMAGES: &str = "<!--IMAGES-->";
/// Greatest width of an image on the page, pixels.
const WIDTH: usize = 480;
const QUALITY: u8 = 75;
/// Images that are encoded together.
const BLOCK: usize = 16;
/// Number of images from which the range of depth is computed.
const PROBES: usize = 8;

/// Streams that the page shows.
///
/// Names every topic: a new stream does not compile until its place on the page is decided.
#[must_use]
pub fn wants(stream: &str) -> bool {
    let Some(topic) = TopicId::from_name(stream) else {
        return false;
    };
    match topic {
        TopicId::JointState
        | TopicId::Pose
        | TopicId::Imu
        | TopicId::Odometry
        | TopicId::Contact
        | TopicId::ObjectPose
        | TopicId::FurnitureJoint => true,
        TopicId::Clock
        | TopicId::Command
        | TopicId::Applied
        | TopicId::Deformable
        | TopicId::Disturbance
        | TopicId::Person
        | TopicId::Evaluation
        | TopicId::Phase
        | TopicId::StateHash
        | TopicId::SensedJoint
        | TopicId::SensedOdometry
        | TopicId::SensedImu
        | TopicId::Scan
        | TopicId::SensedScan
        | TopicId::Event
        | TopicId::Camera
        | TopicId::CompressedCamera
        | TopicId::Sensor
        | TopicId::Preview
        | TopicId::EpisodeStart
        | TopicId::EpisodeStop
        | TopicId::SentCommand
        | TopicId::Refusal
        | TopicId::Recorder => false,
    }
}

/// Writes the page; `tick` is called for every row.
///
/// # Errors
/// When images cannot be read or the file cannot be written.
pub fn page(
    recording: &Recording,
    out: &Path,
    threads: usize,
    tick: &(dyn Fn() + Sync),
) -> anyhow::Result<()> {
    let pending = PendingFile::new(out)?;
    let mut file = BufWriter::new(std::fs::File::create_new(pending.path())?);
    let (head, rest) = PAGE
        .split_once(DATA)
        .context("the page has a place for data")?;
    let (middle, tail) = rest
        .split_once(IMAGES)
        .context("the page has a place for images")?;
    // A "</" inside the data would end the script.
    let data = data(recording).to_string().replace("</", "<\\/");
    write!(file, "{head}{data}{middle}")?;
    for (number, (name, camera)) in recording.cameras.iter().enumerate() {
        let Some((width, height)) = camera.size() else {
            continue;
        };
        let small = if width > WIDTH {
            Size {
                width: WIDTH,
                height: (height * WIDTH / width).max(1),
            }
        } else {
            Size { width, height }
        };
        let range = depth_range(recording, camera)?;
        let rows: Vec<usize> = (0..recording.aligned.stamps.len()).collect();
        for block in rows.chunks(BLOCK) {
            let encoded = parallel(block.len(), threads, |i| {
                let Ok((_, index)) = recording.image(name, block[i]) else {
                    return Ok(None);
                };
                let frame = camera.frame(&recording.episode, index)?;
                let depth = match camera.has_depth() {
                    true => {
                        let image = raster::depth(&frame, range, small.width, small.height);
                        Some(jpeg(&image.pixels, small)?)
                    }
                    false => None,
                };
                let rgb = scaled(frame.rgb, Size { width, height }, small);
                Ok(Some((jpeg(&rgb, small)?, depth)))
            })?;
            writeln!(file, "<script>")?;
            for (row, images) in block.iter().zip(encoded) {
                if let Some((rgb, depth)) = images {
                    let key = serde_json::to_string(name)?.replace("</", "<\\/");
                    writeln!(file, "addImage({key}+\"/rgb\",{row},\"{rgb}\");")?;
                    if let Some(depth) = depth {
                        writeln!(file, "addImage({key}+\"/depth\",{row},\"{depth}\");")?;
                    }
                }
                if number == 0 {
                    tick();
                }
            }
            writeln!(file, "</script>")?;
        }
    }
    write!(file, "{tail}")?;
    let file = file
        .into_inner()
        .map_err(std::io::IntoInnerError::into_error)?;
    publish::sync_file(&file)?;
    pending.commit()?;
    Ok(())
}

fn jpeg(rgb: &[u8], size: Size) -> anyhow::Result<String> {
    let mut out = Vec::new();
    Encoder::new(&mut out, QUALITY).encode(
        rgb,
        u16::try_from(size.width)?,
        u16::try_from(size.height)?,
        ColorType::Rgb,
    )?;
    Ok(STANDARD.encode(out))
}

fn depth_range(recording: &Recording, camera: &Camera) -> anyhow::Result<(f32, f32)> {
    let step = camera.len().div_ceil(PROBES).max(1);
    let mut frames: Vec<Frame> = Vec::new();
    for index in (0..camera.len()).step_by(step) {
        frames.push(camera.frame(&recording.episode, index)?);
    }
    Ok(raster::depth_range(&frames))
}

fn data(recording: &Recording) -> Value {
    let aligned = &recording.aligned;
    let start = aligned.stamps.first().copied().unwrap_or(0);
    let time: Vec<f64> = aligned
        .stamps
        .iter()
        .map(|&s| (s - start) as f64 * 1e-9)
        .collect();
    let s = &recording.summary;
    let images: Vec<Value> = recording
        .cameras
        .iter()
        .flat_map(|(c, camera)| {
            let kinds = [("rgb", "colour"), ("depth", "depth (warm is near)")];
            let kinds = kinds.into_iter().take(1 + usize::from(camera.has_depth()));
            kinds.map(move |(kind, words)| json!({"key": format!("{c}/{kind}"), "title": format!("{c}, {words}")}))
        })
        .collect();
    let mut facts = vec![
        ["label".to_owned(), s.label.clone()],
        [
            "task".to_owned(),
            format!("{} ({}, {})", s.task[0], s.task[1], s.task[2]),
        ],
    ];
    for (name, holds, value) in &s.conditions {
        facts.push([
            name.clone(),
            format!(
                "{} ({value:.4})",
                if *holds { "holds" } else { "does not hold" }
            ),
        ]);
    }
    if !s.failure_reason.is_empty() {
        facts.push(["failure".to_owned(), s.failure_reason.clone()]);
    }
    facts.extend(s.problems.iter().map(|p| ["problem".to_owned(), p.clone()]));
    json!({
        "label": s.label, "instruction": s.instruction, "success": s.success, "complete": s.complete,
        "task": s.task[0], "seed": s.seed, "time": time, "labels": recording.labels,
        "phases": label::NAMES, "images": images, "plots": plots(recording), "facts": facts,
    })
}

fn plots(recording: &Recording) -> Vec<Value> {
    let aligned = &recording.aligned;
    let plot = |title: &str, stream: &str, column: &str, parts: &[(usize, String)]| {
        let signal = aligned.signal(stream, column)?;
        let values: Vec<Vec<Value>> = parts
            .iter()
            .map(|(at, _)| {
                let one = |row: usize| signal.row(row).get(*at).filter(|v| v.is_finite());
                // Five digits are enough for the eye and keep the page small.
                let rounded = |v: &f64| json!((v * 1e5).round() / 1e5);
                (0..aligned.stamps.len())
                    .map(|row| one(row).map_or(Value::Null, rounded))
                    .collect()
            })
            .collect();
        let names: Vec<&str> = parts.iter().map(|p| p.1.as_str()).collect();
        Some(json!({"title": title, "names": names, "values": values}))
    };
    let names_of = |stream: &str, column: &str| {
        aligned
            .signal(stream, column)
            .map(|s| s.meta.names.clone())
            .unwrap_or_default()
    };
    let (joints, roles) = (&recording.robot.joints, &recording.roles);
    let some = |wanted: &dyn Fn(v1::JointRole) -> bool| -> Vec<(usize, String)> {
        let all = joints.iter().enumerate();
        all.filter(|(_, joint)| wanted(joint.role()))
            .map(|(i, joint)| (i, joint.name.clone()))
            .collect()
    };
    let three = |from: usize| -> Vec<(usize, String)> {
        ["x", "y", "z"]
            .iter()
            .enumerate()
            .map(|(k, n)| (from + k, (*n).to_owned()))
            .collect()
    };
    let arm = some(&|role| role == v1::JointRole::Arm);
    let grip = some(&|role| matches!(role, v1::JointRole::Knuckle | v1::JointRole::KnuckleRight));
    let pads = [(0, "left".to_owned()), (1, "right".to_owned())];
    let speed = [
        (0, "forward, m/s".to_owned()),
        (5, "turn, rad/s".to_owned()),
    ];
    let furniture: Vec<(usize, String)> = names_of("furniture_joint", "position")
        .into_iter()
        .enumerate()
        .filter(|(at, _)| moves(aligned, *at))
        .collect();
    [
        plot("Arm joints, rad", "joint_state", "position", &arm),
        plot(
            "End effector in base_link, m",
            "pose",
            "pose",
            &three(7 * roles.end_effector),
        ),
        plot(
            "Chair in house, m",
            "pose",
            "pose",
            &three(7 * roles.chair)[..2],
        ),
        plot("Chair's speed", "odometry", "twist", &speed),
        plot("Gripper, rad", "joint_state", "position", &grip),
        plot("Force at the finger tips, N", "contact", "pad_force", &pads),
        plot(
            "IMU: acceleration x and y, m/s²",
            "imu",
            "linear_acceleration",
            &three(0)[..2],
        ),
        plot(
            "IMU: acceleration z, m/s²",
            "imu",
            "linear_acceleration",
            &three(0)[2..],
        ),
        plot(
            "IMU: angular velocity, rad/s",
            "imu",
            "angular_velocity",
            &three(0),
        ),
        plot(
            "Drawers that moved, m or rad",
            "furniture_joint",
            "position",
            &furniture,
        )
        .filter(|_| !furniture.is_empty()),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// A drawer that moves less is not drawn, m or rad.
const STILL: f64 = 1e-3;

fn moves(aligned: &Aligned, joint: usize) -> bool {
    let Some(signal) = aligned.signal("furniture_joint", "position") else {
        return false;
    };
    let rows = 0..aligned.stamps.len();
    let values = rows.filter_map(|row| signal.row(row).get(joint).filter(|v| v.is_finite()));
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
    high - low > STILL
}
