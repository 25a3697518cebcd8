//! MCAP for Foxglove: its well-known messages where there is one, ours for the
//! rest; every recorded sample at its own time, without resampling.

mod channel;
mod channels;
mod foxglove;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use wheelarm_proto::v1;

use super::links::Descriptions;
use super::series::in_order;
use super::{Format, PendingFile, Recording, Written};
use crate::credits::PackCredits;

/// Origin of cx and cy of a calibration.
const CONVENTION: &str = "pixel centre, as OpenCV and ROS count: u, v, cx and cy are 0 at the \
centre of the first pixel; the recording counts from the image's edge, there they are greater by 0.5";

/// Writes `LABEL.mcap` per episode.
#[derive(Clone, Debug)]
pub struct McapLog {
    /// Folder of the files.
    pub out: PathBuf,
    /// Threads that compress images.
    pub threads: usize,
}

impl Format for McapLog {
    fn wants(&self, _: &str) -> bool {
        false
    }

    fn needs_images(&self) -> bool {
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

fn write(
    path: &Path,
    recording: &Recording,
    threads: usize,
    tick: &dyn Fn(),
) -> anyhow::Result<usize> {
    let snapshot = recording.episode.snapshot()?;
    let described = Descriptions::read(&snapshot);
    let channels = channels::channels(recording, &described, &snapshot)?;
    let mut writer = mcap::WriteOptions::new()
        .compression(Some(mcap::Compression::Lz4))
        .chunk_size(Some(4 << 20))
        .library(format!("wheelarm-dataset {}", env!("CARGO_PKG_VERSION")))
        .create(BufWriter::new(File::create_new(path)?))?;
    let packs = PackCredits::of_episode(&recording.episode)?;
    for (name, metadata) in metadata(recording, &snapshot.instances, &packs) {
        let name = name.to_owned();
        writer.write_metadata(&mcap::records::Metadata { name, metadata })?;
    }
    for asset in snapshot.assets.iter().filter(|a| a.path.ends_with(".urdf")) {
        writer.attach(&mcap::Attachment {
            log_time: recording.summary.span_nanos.0,
            create_time: 0,
            name: asset.path.clone(),
            media_type: "application/xml".into(),
            data: Cow::Borrowed(asset.text.as_bytes()),
        })?;
    }
    // Channels come last: metadata and attachments end the chunk that channels open, and
    // Rerun 0.26 rejects a chunk without a message.
    let mut ids = Vec::new();
    for channel in &channels {
        let schema = &channel.kind;
        let id = writer.add_schema(&schema.name, schema.language, schema.description)?;
        let none = BTreeMap::new();
        ids.push(writer.add_channel(id, &channel.topic, schema.encoding, &none)?);
    }
    let reference = format!("/camera/{}/rgb", recording.aligned.reference);
    let count = in_order(&channels, threads, |message| {
        let header = MessageHeader {
            channel_id: ids[message.series],
            sequence: message.sample as u32,
            log_time: message.stamp,
            publish_time: message.stamp,
        };
        writer.write_to_known_channel(&header, message.bytes)?;
        if channels[message.series].topic == reference {
            tick();
        }
        Ok(())
    })?;
    writer.finish()?;
    Ok(count)
}

/// Content stored once in the file: the episode, the convention of its
/// calibrations, the meaning of instance IDs, and authors and licenses of world packs.
fn metadata(
    recording: &Recording,
    legend: &[v1::Instance],
    packs: &[PackCredits],
) -> Vec<(&'static str, BTreeMap<String, String>)> {
    let s = &recording.summary;
    let words = [
        ("label", s.label.clone()),
        ("instruction", s.instruction.clone()),
        ("task", s.task[0].clone()),
        ("seed", s.seed.to_string()),
        ("success", s.success.to_string()),
        ("complete", s.complete.to_string()),
    ];
    let words = words.map(|(k, v)| (k.to_owned(), v));
    let convention = ("convention".to_owned(), CONVENTION.to_owned());
    let legend = legend.iter().map(|i| (i.id.to_string(), i.name.clone()));
    let mut all = vec![
        ("episode", words.into_iter().collect()),
        ("camera_calibration", BTreeMap::from([convention])),
        ("instance_ids", legend.collect()),
    ];
    if !packs.is_empty() {
        let credits = packs.iter();
        let credits = credits.map(|one| (one.pack.name.clone(), one.json().to_string()));
        all.push(("world_packs", credits.collect()));
    }
    all
}
