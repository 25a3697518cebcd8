//! A bag as `ros2 bag` writes it: the folder LABEL with LABEL_0.mcap and
//! metadata.yaml, every recorded sample at its own time, without resampling.
//! Standard messages where there is one, JSON in `std_msgs/msg/String` for the rest.

mod channel;
mod furniture;
mod metadata;
mod topics;
mod words;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;

use self::channel::Channel;
use self::metadata::{Bag, Topic};
use super::links::Descriptions;
use super::ros2::{description, type_hash};
use super::series::in_order;
use super::{Format, PendingFolder, Recording, Written};
use crate::credits::PackCredits;
use crate::publish;

/// Writes the bag `LABEL` per episode.
#[derive(Clone, Debug)]
pub struct Rosbag2 {
    /// Folder of the bags.
    pub out: PathBuf,
    /// Threads that read images.
    pub threads: usize,
}

impl Format for Rosbag2 {
    fn wants(&self, _: &str) -> bool {
        false
    }

    fn needs_images(&self) -> bool {
        false
    }

    fn add(&self, recording: &Recording, tick: &(dyn Fn() + Sync)) -> anyhow::Result<Written> {
        let label = &recording.summary.label;
        let pending = PendingFolder::new(&self.out.join(label))?;
        let file = format!("{label}_0.mcap");
        let snapshot = recording.episode.snapshot()?;
        let described = Descriptions::read(&snapshot);
        let channels = topics::channels(recording, &described, &snapshot)?;
        let mut bag = bag(&file, recording, &channels);
        let packs = PackCredits::of_episode(&recording.episode)?;
        if !packs.is_empty() {
            let credits: serde_json::Value = packs.iter().map(PackCredits::json).collect();
            bag.words
                .push(("world_packs".to_owned(), credits.to_string()));
        }
        write(
            &pending.path().join(&file),
            recording,
            &channels,
            &bag,
            self.threads,
            tick,
        )?;
        let mut text = File::create_new(pending.path().join("metadata.yaml"))?;
        text.write_all(bag.text().as_bytes())?;
        publish::sync_file(&text)?;
        let mut notes = Vec::new();
        if described.robot.is_none() {
            notes.push("without a robot description: only the recorded frames are in /tf".into());
        }
        Ok(Written {
            path: pending.commit()?,
            samples: bag.messages(),
            notes,
        })
    }
}

/// Metadata of the bag. Several channels may share a topic.
fn bag(file: &str, recording: &Recording, channels: &[Channel<'_>]) -> Bag {
    let mut topics: BTreeMap<&str, Topic> = BTreeMap::new();
    for channel in channels {
        let topic = topics.entry(&channel.topic).or_insert_with(|| Topic {
            name: channel.topic.clone(),
            kind: channel.kind.name,
            hash: type_hash(channel.kind.name),
            latched: channel.kind.latched,
            messages: 0,
        });
        topic.messages += channel.stamps.len();
    }
    let stamps = || channels.iter().flat_map(|channel| &channel.stamps);
    let s = &recording.summary;
    let words = [
        ("label", s.label.clone()),
        ("instruction", s.instruction.clone()),
        ("task", s.task[0].clone()),
        ("seed", s.seed.to_string()),
        ("success", s.success.to_string()),
        ("complete", s.complete.to_string()),
    ];
    Bag {
        file: file.to_owned(),
        start: stamps().min().copied().unwrap_or_default(),
        end: stamps().max().copied().unwrap_or_default(),
        topics: topics.into_values().collect(),
        words: words.map(|(k, v)| (k.to_owned(), v)).into(),
    }
}

fn write(
    path: &Path,
    recording: &Recording,
    channels: &[Channel<'_>],
    bag: &Bag,
    threads: usize,
    tick: &dyn Fn(),
) -> anyhow::Result<()> {
    let mut writer = mcap::WriteOptions::new()
        .profile("ros2")
        .compression(Some(mcap::Compression::Lz4))
        .chunk_size(Some(4 << 20))
        .library(format!("wheelarm-dataset {}", env!("CARGO_PKG_VERSION")))
        .create(BufWriter::new(File::create_new(path)?))?;
    writer.write_metadata(&mcap::records::Metadata {
        name: "rosbag2".to_owned(),
        metadata: BTreeMap::from([("serialized_metadata".to_owned(), bag.entries())]),
    })?;
    // Channels come last: metadata ends the chunk that channels open, and Rerun 0.26
    // rejects a chunk without a message.
    let mut ids = BTreeMap::new();
    for topic in &bag.topics {
        let text = description(topic.kind);
        let schema = writer.add_schema(topic.kind, "ros2msg", text.as_bytes())?;
        let metadata = BTreeMap::from([
            ("offered_qos_profiles".to_owned(), topic.quality()),
            ("topic_type_hash".to_owned(), topic.hash.clone()),
        ]);
        let id = writer.add_channel(schema, &topic.name, "cdr", &metadata)?;
        ids.insert(topic.name.as_str(), (id, 0_u32));
    }
    let reference = topics::colour(&recording.aligned.reference);
    in_order(channels, threads, |message| {
        let topic = channels[message.series].topic.as_str();
        let (channel_id, count) = ids.get_mut(topic).expect("every topic has a channel");
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *count,
            log_time: message.stamp,
            publish_time: message.stamp,
        };
        *count += 1;
        writer.write_to_known_channel(&header, message.bytes)?;
        if topic == reference {
            tick();
        }
        Ok(())
    })?;
    writer.finish()?;
    publish::sync_file(&File::open(path)?)?;
    Ok(())
}
