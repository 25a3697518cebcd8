//! A synthetic recording: samples for a writer, and its closing.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bytes::Bytes;
use wheelarm_dataset::log::Closing;
use wheelarm_dataset::writer::{EpisodeWriter, WriterOptions};
use wheelarm_proto::{Message, StreamId};

use crate::synthetic::{self, Random};

const SIZE: (u32, u32) = (32, 20);

/// Everything that was offered to a writer, by stream in order.
pub type Offered = BTreeMap<String, Vec<Bytes>>;

pub fn camera_frame(r: &mut Random, camera: &str, sequence: u64) -> Bytes {
    let header = synthetic::header(sequence, 24 * sequence);
    let frame = synthetic::frame(camera, header, SIZE, |x, y| {
        let depth = match (x + y) % 7 {
            0 => f32::INFINITY,
            _ => 0.5 + (r.below(1000) as f32) * 0.01,
        };
        ([x as u8, y as u8, r.below(256) as u8], depth, (x % 3) as u8)
    });
    Bytes::from(frame.encode_to_vec())
}

/// Offers `samples` of every stream, mixed, with sequence numbers from 100.
pub fn offer_all(writer: &mut EpisodeWriter, seed: u64, samples: u64) -> Offered {
    let mut r = Random(seed);
    let mut offered = Offered::new();
    for i in 0..samples {
        for stream in &StreamId::all([], [])
            .map(|s| s.to_string())
            .collect::<Vec<_>>()
        {
            let header = synthetic::header(100 + i, 4 * i);
            let payload = Bytes::from(r.message(stream, header, 3));
            writer.offer(stream, payload.clone()).unwrap();
            offered.entry(stream.clone()).or_default().push(payload);
        }
        if i % 6 == 0 {
            for camera in ["gen3", "wheelchair"] {
                let payload = camera_frame(&mut r, camera, i / 6);
                let stream = StreamId::camera(camera).to_string();
                writer.offer(&stream, payload.clone()).unwrap();
                offered.entry(stream).or_default().push(payload);
            }
        }
    }
    offered
}

pub fn manifest(offered: &Offered) -> Vec<(String, u64, u64)> {
    let first = |s: &str| if s.starts_with("camera/") { 0 } else { 100 };
    offered
        .iter()
        .map(|(s, list)| (s.clone(), first(s), list.len() as u64))
        .collect()
}

fn closing(offered: &Offered) -> Closing {
    Closing {
        stopped: Some(synthetic::stopped(600, &manifest(offered))),
        ..Default::default()
    }
}

pub fn record(
    dir: &Path,
    label: &str,
    options: &WriterOptions,
    samples: u64,
) -> (PathBuf, Offered) {
    let started = synthetic::started(label);
    let mut writer = EpisodeWriter::open(dir, &started, &synthetic::snapshot(), options).unwrap();
    let offered = offer_all(&mut writer, 1, samples);
    let log = writer.close(closing(&offered)).unwrap();
    (log, offered)
}

pub fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}
