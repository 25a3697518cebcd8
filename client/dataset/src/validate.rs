//! Whether a recording is fit for use: counts, order, gaps, numbers that are
//! none, quaternions, images, calibration, hashes. Reads every byte.

use std::collections::BTreeSet;
use std::fmt;
use std::io::Read;
use std::path::Path;

use anyhow::Context;
use sha2::{Digest, Sha256};

use wheelarm_proto::digest::{self, StreamDigest};
use wheelarm_proto::{StreamId, TopicId};

use crate::account::StreamAccount;
use crate::align::{Rule, is_periodic, usual_distance};
use crate::convert::batch::parallel;
use crate::read::{ElementKind, Episode, ReadError, Values};

/// Samples farther apart than this many usual distances are a gap.
const GAP: f64 = 1.75;
/// Norms of quaternions may be off by this.
const NORM: f64 = 1e-6;
/// Least contrast of an image that shows anything, levels of 255.
const FLAT: f64 = 1.0;
/// Hashes are this many ticks apart: one simulated second.
const HASH_TICKS: u64 = 240;

/// The reason.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// The reason.
    pub problems: Vec<String>,
    /// Figures for people.
    pub facts: Vec<String>,
}

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for fact in &self.facts {
            writeln!(f, "  {fact}")?;
        }
        for problem in &self.problems {
            writeln!(f, "  PROBLEM {problem}")?;
        }
        Ok(())
    }
}

/// Looks at everything in a file.
///
/// # Errors
/// When it is not an episode or cannot be read to the end.
pub fn validate(path: &Path, threads: usize) -> anyhow::Result<Findings> {
    let episode = Episode::open(path)?;
    let mut found = Findings::default();
    let summary = episode.summary()?;
    if !summary.complete {
        found.problems.push(format!(
            "the recording is partial: {}",
            summary.problems.join("; ")
        ));
    }
    if episode.is_broken() {
        let words = summary.anomalies.last().map_or("", String::as_str);
        found.problems.push(format!(
            "the physics broke, the episode is not fit for training: {words}"
        ));
    } else if !summary.anomalies.is_empty() {
        found
            .facts
            .push(format!("anomalies: {}", summary.anomalies.join("; ")));
    }
    if episode.started()?.as_recorded {
        let drawn = "rendered from the states of another recording; replay that one";
        found.facts.push(drawn.into());
    } else if episode.snapshot()?.snapshot.is_empty() {
        found
            .problems
            .push("the state at the start is absent: it cannot be replayed".into());
    }
    for account in &summary.streams {
        contents(&episode, account, threads, &mut found).with_context(|| account.stream.clone())?;
        if StreamId::parse(&account.stream) != StreamId::EVENTS {
            stream(&episode, &account.stream, account.received, &mut found)
                .with_context(|| account.stream.clone())?;
        }
    }
    for camera in episode.cameras()? {
        images(&episode, &camera, threads, &mut found).with_context(|| camera.clone())?;
    }
    for sensor in episode.sensors()? {
        sensed(&episode, &sensor, threads, &mut found).with_context(|| sensor.clone())?;
    }
    hashes(&episode, &mut found)?;
    checksum(path, &mut found)?;
    Ok(found)
}

/// The values read; a dataset of the wrong size is a problem of the
/// recording, and the check continues.
fn sized<T>(read: Result<T, ReadError>, found: &mut Findings) -> Result<Option<T>, ReadError> {
    match read {
        Err(ReadError::Shape {
            dataset,
            found: has,
            expected,
            ..
        }) => {
            let words = format!("{dataset} has {has}, expected {expected}");
            if !found.problems.contains(&words) {
                found.problems.push(words);
            }
            Ok(None)
        }
        read => read.map(Some),
    }
}

fn stream(
    episode: &Episode,
    name: &str,
    received: u64,
    found: &mut Findings,
) -> anyhow::Result<()> {
    let stamps = episode.stamps(name)?;
    // Where they have another size that is reported, and nothing is missing by them.
    let sequence = sized(episode.u64s(name, "sequence"), found)?;
    let sequence = sequence.unwrap_or_else(|| (0..stamps.len() as u64).collect());
    let mut wrong = |words: String| found.problems.push(format!("{name}: {words}"));
    if stamps.len() as u64 != received {
        wrong(format!(
            "{} stamps, the account says {received}",
            stamps.len()
        ));
    }
    let periodic = is_periodic(name);
    let falls = |w: &[u64]| w[0] > w[1] || periodic && w[0] == w[1];
    if let Some(i) = stamps.windows(2).position(falls) {
        let words = if periodic { "do not rise" } else { "go back" };
        wrong(format!("stamps {words} at sample {}", i + 1));
    }
    let lost: u64 = sequence
        .windows(2)
        .map(|w| w[1].saturating_sub(w[0]).saturating_sub(1))
        .sum();
    if lost > 0 {
        wrong(format!("{lost} sequence numbers are missing inside"));
    }
    let usual = usual_distance(&stamps).unwrap_or(0);
    let gaps = stamps
        .windows(2)
        .filter(|w| w[1].saturating_sub(w[0]) as f64 > GAP * usual as f64);
    let widest = gaps.clone().map(|w| w[1] - w[0]).max();
    // The latency of a sensor's images varies; none is missing by its
    // sequence numbers.
    let even = periodic && StreamId::parse(name).sensor_name().is_none();
    if let Some(widest) = widest.filter(|_| even) {
        wrong(format!(
            "{} gaps, the widest {:.3} s",
            gaps.count(),
            widest as f64 * 1e-9
        ));
    }
    for meta in episode.columns(name)? {
        let mut wrong = |words: String| found.problems.push(format!("{name}: {words}"));
        if meta.units.is_empty() {
            wrong(format!("{} has no units", meta.name));
        }
        if meta.kind == ElementKind::Other {
            if meta.count != stamps.len() {
                wrong(format!(
                    "{} has {} rows, expected {}",
                    meta.name,
                    meta.count,
                    stamps.len()
                ));
            }
            continue;
        }
        let Some(values) = sized(episode.values(&meta), found)? else {
            continue;
        };
        let Values::F64(all) = values else {
            continue;
        };
        if meta.width() == 0 {
            continue;
        }
        let mut wrong = |words: String| found.problems.push(format!("{name}: {words}"));
        let rule = Rule::for_column(&meta);
        // Distances of a scan are infinite where nothing is within the range.
        let is_scan = [TopicId::Scan, TopicId::SensedScan]
            .iter()
            .any(|t| t.name() == name);
        let is_bad = |v: &&f64| if is_scan { v.is_nan() } else { !v.is_finite() };
        let bad = all.iter().filter(is_bad).count();
        let optional = may_be_absent(name, &meta.name, rule);
        if bad > 0 && !optional {
            wrong(format!("{}: {bad} numbers are not finite", meta.name));
        }
        let (step, at) = match rule {
            Rule::Pose => (7, 3),
            Rule::Quaternion => (4, 0),
            _ => continue,
        };
        let off = all
            .chunks_exact(step)
            .map(|q| (q[at..at + 4].iter().map(|v| v * v).sum::<f64>().sqrt() - 1.0).abs())
            .filter(|n| n.is_finite())
            .fold(0.0, f64::max);
        if off > NORM {
            wrong(format!(
                "{}: the norm of a quaternion is off by {off:.2e}",
                meta.name
            ));
        }
    }
    Ok(())
}

/// Whether a column has NaN where a message has no value: a command without an arm, a contact
/// or a push that does not exist.
///
/// Names every topic: a new stream does not compile until this is decided.
fn may_be_absent(stream: &str, column: &str, rule: Rule) -> bool {
    let Some(topic) = StreamId::parse(stream).topic() else {
        return false;
    };
    match topic {
        TopicId::Command | TopicId::Contact | TopicId::Evaluation | TopicId::Disturbance => true,
        TopicId::Person => column == "contact_force",
        TopicId::Applied => matches!(rule, Rule::Nearest | Rule::Pose),
        TopicId::JointState
        | TopicId::Pose
        | TopicId::Imu
        | TopicId::Odometry
        | TopicId::Clock
        | TopicId::ObjectPose
        | TopicId::FurnitureJoint
        | TopicId::Deformable
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

/// Whether the messages in the file, where they can be had as they came, are
/// those that were recorded, by their digest.
fn contents(
    episode: &Episode,
    account: &StreamAccount,
    threads: usize,
    found: &mut Findings,
) -> anyhow::Result<()> {
    let name = &account.stream;
    let id = StreamId::parse(name);
    if account.digest.is_empty() || id == StreamId::EVENTS {
        return Ok(());
    }
    let images = match &id {
        StreamId::Camera(camera) => sized(episode.camera(camera), found)?,
        StreamId::Sensor(sensor) => sized(episode.sensor(sensor), found)?,
        _ => None,
    };
    let has_images = id.camera_name().or(id.sensor_name()).is_some();
    if has_images && images.is_none() {
        return Ok(());
    }
    let digests = match images {
        Some(camera) => {
            let all = parallel(camera.len(), threads, |i| {
                let message = camera.encoded(episode, i)?;
                Ok(message.map(|m| digest::of_message([&m[..]])))
            })?;
            all.into_iter().collect::<Option<Vec<_>>>()
        }
        None => sized(episode.encoded(name), found)?.flatten().map(|all| {
            let messages = all.iter().map(|m| digest::of_message([&m[..]]));
            messages.collect()
        }),
    };
    let Some(digests) = digests else {
        return Ok(());
    };
    let value = StreamDigest::from_messages(&digests)
        .map(|b| format!("{b:02x}"))
        .concat();
    if value == account.digest {
        found.facts.push(format!(
            "{name}: {} messages as they came, by their digest",
            digests.len()
        ));
    } else {
        found.problems.push(format!(
            "{name}: the messages in the file are not those that were recorded: their digest is {value}, the file says {}",
            account.digest
        ));
    }
    Ok(())
}

/// Figures of one image.
struct Figures {
    mean: f64,
    contrast: f64,
    hit: f64,
    bad_depth: usize,
    /// The first id without an instance.
    stranger: Option<u16>,
}

fn images(
    episode: &Episode,
    name: &str,
    threads: usize,
    found: &mut Findings,
) -> anyhow::Result<()> {
    let Some(camera) = sized(episode.camera(name), found)? else {
        return Ok(());
    };
    let stream = camera.stream();
    if camera.is_empty() {
        found.problems.push(format!("{stream}: it has no images"));
        return Ok(());
    }
    let instances = episode.snapshot()?.instances;
    let known: BTreeSet<u32> = instances.iter().map(|instance| instance.id).collect();
    let stranger = |ids: Vec<u16>| {
        let mut distinct = ids;
        distinct.dedup();
        let mut strangers = distinct.into_iter().filter(|&id| id != 0);
        strangers.find(|&id| !known.contains(&u32::from(id)))
    };
    let all = parallel(camera.len(), threads, |i| {
        let rgb = camera.rgb(episode, i)?;
        let ids = match camera.has_ids() {
            true => camera.ids(episode, i)?,
            false => Vec::new(),
        };
        let depth = match camera.has_depth() {
            true => camera.depth(episode, i)?,
            false => Vec::new(),
        };
        let n = rgb.len().max(1) as f64;
        let mean = rgb.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let variance = rgb
            .iter()
            .map(|&v| (f64::from(v) - mean).powi(2))
            .sum::<f64>()
            / n;
        let hit = depth.iter().filter(|d| d.is_finite()).count() as f64 / depth.len().max(1) as f64;
        Ok(Figures {
            mean,
            contrast: variance.sqrt(),
            hit,
            bad_depth: depth.iter().filter(|d| d.is_nan() || **d < 0.0).count(),
            stranger: stranger(ids),
        })
    })?;
    let mut wrong = |words: String| found.problems.push(format!("{stream}: {words}"));
    let flat = all.iter().filter(|f| f.contrast < FLAT).count();
    if flat > 0 {
        wrong(format!("{flat} images of one colour"));
    }
    let bad: usize = all.iter().map(|f| f.bad_depth).sum();
    if bad > 0 {
        wrong(format!("{bad} depths are NaN or negative"));
    }
    let strangers: BTreeSet<u16> = all.iter().filter_map(|f| f.stranger).collect();
    if !strangers.is_empty() {
        wrong(format!("ids of no instance: {strangers:?}"));
    }
    let empty = all.iter().filter(|f| f.hit == 0.0).count();
    if empty > 0 && camera.has_depth() {
        wrong(format!("{empty} images without any depth"));
    }
    let size = camera.size().unwrap_or((0, 0));
    let first = camera.intrinsics(0);
    let sane = first[0] as usize == size.0
        && first[1] as usize == size.1
        && first[2] > 0.0
        && first[3] > 0.0
        && (0.0..=first[0]).contains(&first[4])
        && (0.0..=first[1]).contains(&first[5]);
    if !sane {
        wrong(format!(
            "calibration {first:?} does not fit images of {size:?}"
        ));
    }
    if (1..camera.len()).any(|i| camera.intrinsics(i) != first) {
        wrong("the calibration changes within the episode".into());
    }
    let mean = |f: &dyn Fn(&Figures) -> f64| all.iter().map(f).sum::<f64>() / all.len() as f64;
    let depth = match camera.has_depth() {
        true => format!("depth at {:.1} % of the pixels", 100.0 * mean(&|f| f.hit)),
        false => "no depth".to_owned(),
    };
    found.facts.push(format!(
        "{stream}: {} images of {}x{}, mean level {:.0}, contrast {:.0}, {}",
        all.len(),
        size.0,
        size.1,
        mean(&|f| f.mean),
        mean(&|f| f.contrast),
        depth,
    ));
    Ok(())
}

/// What a sensor model made of a camera's images: they show something, the
/// calibration stays, and nothing arrives before it was exposed.
fn sensed(
    episode: &Episode,
    name: &str,
    threads: usize,
    found: &mut Findings,
) -> anyhow::Result<()> {
    let Some(sensor) = sized(episode.sensor(name), found)? else {
        return Ok(());
    };
    let stream = sensor.stream();
    let all = parallel(sensor.len(), threads, |i| {
        if !sensor.has_depth() {
            let rgb = sensor.rgb(episode, i)?;
            return Ok(rgb.iter().map(|&v| f64::from(v)).sum::<f64>() / rgb.len().max(1) as f64);
        }
        let depth = sensor.depth(episode, i)?;
        let returns = depth.iter().filter(|d| d.is_finite()).count();
        Ok(100.0 * returns as f64 / depth.len().max(1) as f64)
    })?;
    let mut wrong = |words: String| found.problems.push(format!("{stream}: {words}"));
    let first = sensor.intrinsics(0);
    if (1..sensor.len()).any(|i| sensor.intrinsics(i) != first) {
        wrong("the calibration changes within the episode".into());
    }
    let ages = sensor.stamps().iter().zip(sensor.exposures());
    if ages.clone().any(|(arrival, exposure)| arrival < exposure) {
        wrong("images arrive before they are exposed".into());
    }
    let age: u64 = ages
        .map(|(arrival, exposure)| arrival.saturating_sub(*exposure))
        .sum();
    let n = all.len().max(1) as f64;
    let (w, h) = sensor.size().unwrap_or((0, 0));
    found.facts.push(format!(
        "{stream}: {} images of {w}x{h}, {:.0} ms old when they arrive, {} {:.0}{}",
        all.len(),
        age as f64 * 1e-6 / n,
        ["mean level", "returns at"][usize::from(sensor.has_depth())],
        all.iter().sum::<f64>() / n,
        ["", " % of the pixels"][usize::from(sensor.has_depth())],
    ));
    Ok(())
}

fn hashes(episode: &Episode, found: &mut Findings) -> anyhow::Result<()> {
    if !episode.has("state_hash") {
        found
            .problems
            .push("the recording has no state hashes: a replay cannot be checked".into());
        return Ok(());
    }
    let Some(all) = sized(episode.state_hashes(), found)? else {
        return Ok(());
    };
    if all
        .windows(2)
        .any(|w| w[1].0.saturating_sub(w[0].0) != HASH_TICKS)
    {
        found
            .problems
            .push(format!("state hashes are not {HASH_TICKS} ticks apart"));
    }
    if all.iter().any(|h| h.1 == 0) {
        found.problems.push("a state hash is 0".into());
    }
    found.facts.push(format!("{} state hashes", all.len()));
    Ok(())
}

/// Compares the file with `FILE.sha256` if it exists.
fn checksum(path: &Path, found: &mut Findings) -> anyhow::Result<()> {
    let mut digest = Sha256::new();
    let mut file = std::fs::File::open(path)?;
    let mut block = vec![0; 1 << 20];
    loop {
        let n = file.read(&mut block)?;
        if n == 0 {
            break;
        }
        digest.update(&block[..n]);
    }
    let sum: String = digest
        .finalize()
        .iter()
        .map(|b| format!("{b:02x}"))
        .collect();
    let beside = path.with_added_extension("sha256");
    match std::fs::read_to_string(&beside) {
        Ok(text) => {
            let listed = text.split_whitespace().next().unwrap_or_default();
            if listed.eq_ignore_ascii_case(&sum) {
                found
                    .facts
                    .push(format!("SHA-256 as in {}", beside.display()));
            } else {
                found.problems.push(format!(
                    "SHA-256 is {sum}, {} says {listed}",
                    beside.display()
                ));
            }
        }
        Err(_) => found.facts.push(format!("SHA-256 {sum}")),
    }
    Ok(())
}
