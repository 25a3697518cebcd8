//! Benchmark of writing an episode with two RGB-D cameras at 1280x720: frames
//! per second (a frame is a pair of images with depth and segmentation) until every
//! byte is in the log, and until the HDF5 file is finished; bytes and processor
//! time per frame.
//!
//! `cargo run --release --example record_bench -- [FRAMES] [f32|u16] [DIR] [IMAGES]`
//!
//! IMAGES is a `frames.bin` of the server's example `dump_frames`; without it
//! the images show a synthetic room.

mod synthetic;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use bytes::Bytes;
use wheelarm_dataset::depth::Depth;
use wheelarm_dataset::finish::finish;
use wheelarm_dataset::log::Closing;
use wheelarm_dataset::writer::{EpisodeWriter, WriterOptions};
use wheelarm_proto::digest::{self, StreamDigest};
use wheelarm_proto::{Message, v1};

const SIZE: (u32, u32) = (1280, 720);
const DISTINCT: u64 = 6;
const PIXELS: usize = SIZE.0 as usize * SIZE.1 as usize;

fn main() -> anyhow::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let frames: u64 = args.first().map_or(Ok(60), |n| n.parse())?;
    let depth = match args.get(1).map(String::as_str) {
        Some("u16") => Depth::Millimetres,
        _ => Depth::Metres,
    };
    let dir = args.get(2).map_or_else(std::env::temp_dir, PathBuf::from);
    let label = format!("record_bench_{}", std::process::id());

    // Images are rendered before the clock starts.
    let pairs: Vec<[v1::CameraFrame; 2]> = match args.get(3) {
        Some(path) => dumped(Path::new(path))?,
        None => (0..DISTINCT).map(pair).collect(),
    };
    let distinct = pairs.len() as u64;
    let raw: usize = pairs[0]
        .iter()
        .map(|f| f.color.len() + f.depth.len() + f.segmentation.len())
        .sum();

    let baseline = raw_disk(&dir, &pairs, frames)?;
    let options = WriterOptions {
        depth,
        ..Default::default()
    };
    let started = synthetic::started(&label);
    let mut writer = EpisodeWriter::open(&dir, &started, &synthetic::snapshot(), &options)?;
    let (clock, processor) = (Instant::now(), processor_seconds());
    for i in 0..frames {
        for frame in &pairs[(i % distinct) as usize] {
            let frame = v1::CameraFrame {
                header: Some(synthetic::header(i, 24 * i)),
                ..frame.clone()
            };
            let stream = format!("camera/{}", frame.camera);
            writer.offer(&stream, Bytes::from(frame.encode_to_vec()))?;
        }
    }
    let cameras = ["camera/gen3", "camera/wheelchair"];
    let counts = cameras.map(|c| (c.to_owned(), 0, frames));
    let stopped = Some(synthetic::stopped(24 * frames, &counts));
    let log = writer.close(Closing {
        stopped,
        ..Default::default()
    })?;
    let logged = clock.elapsed().as_secs_f64();
    let finished = finish(&log, None)?;
    let whole = clock.elapsed().as_secs_f64();
    let processor = processor_seconds() - processor;
    anyhow::ensure!(
        finished.account.complete(),
        "{:?}",
        finished.account.problems
    );

    let rate = frames as f64;
    println!("frames                   {frames} pairs of 1280x720 RGB, depth ({depth:?}), ids");
    println!("raw bytes per frame      {:.2} MB", raw as f64 / 1e6);
    println!(
        "file bytes per frame     {:.2} MB",
        finished.bytes as f64 / rate / 1e6
    );
    println!("until durable in the log {:.1} frames/s", rate / logged);
    println!("until the file is there  {:.1} frames/s", rate / whole);
    println!("processor time per frame {:.1} ms", 1e3 * processor / rate);
    println!(
        "raw write and sync       {:.1} frames/s (same bytes, uncompressed)",
        rate / baseline
    );
    std::fs::remove_file(&finished.path)?;
    digests(&pairs, frames);
    Ok(())
}

/// Additional work of server and recorder, each once: hash every message.
fn digests(pairs: &[[v1::CameraFrame; 2]], frames: u64) {
    let encoded: Vec<Vec<u8>> = pairs.iter().flatten().map(Message::encode_to_vec).collect();
    let (mut stream, mut bytes) = (StreamDigest::default(), 0);
    let clock = Instant::now();
    for i in 0..2 * frames as usize {
        let message = &encoded[i % encoded.len()];
        bytes += message.len();
        stream.add(&digest::of_message([&message[..]]));
    }
    let seconds = clock.elapsed().as_secs_f64();
    println!(
        "digest of a frame        {:.2} ms, {:.2} GB/s ({:02x?})",
        1e3 * seconds / frames as f64,
        bytes as f64 / seconds / 1e9,
        &stream.value()[..4]
    );
}

/// CPU time of all threads so far, in hundredths of a second; `None` where the
/// system does not report it.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default();
    let ticks = fields.split_whitespace().skip(11).take(2);
    ticks.filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn pair(i: u64) -> [v1::CameraFrame; 2] {
    let s = i as f64 / DISTINCT as f64;
    let image =
        |camera: &str, view| synthetic::smooth::image(camera, synthetic::header(0, 0), SIZE, view);
    [
        image("gen3", ([1.2 + s, 0.4, 1.2], 0.1, 0.25)),
        image("wheelchair", ([-2.0 + s, 1.0 - s, 1.5], -0.3 * s, 0.3)),
    ]
}

/// Images of the home: colour, depth and ids of both cameras, one after the other.
fn dumped(path: &Path) -> anyhow::Result<Vec<[v1::CameraFrame; 2]>> {
    let bytes = Bytes::from(std::fs::read(path)?);
    let frame = 9 * PIXELS;
    anyhow::ensure!(
        !bytes.is_empty() && bytes.len().is_multiple_of(2 * frame),
        "{} has {} bytes, expected a multiple of {}",
        path.display(),
        bytes.len(),
        2 * frame
    );
    let image = |camera: &str, from: usize| v1::CameraFrame {
        color: bytes.slice(from..from + 3 * PIXELS),
        depth: bytes.slice(from + 3 * PIXELS..from + 7 * PIXELS),
        segmentation: bytes.slice(from + 7 * PIXELS..from + frame),
        ..synthetic::smooth::image(
            camera,
            synthetic::header(0, 0),
            SIZE,
            ([0.0, 0.0, 1.0], 0.0, 0.0),
        )
    };
    Ok((0..bytes.len())
        .step_by(2 * frame)
        .map(|from| [image("gen3", from), image("wheelchair", from + frame)])
        .collect())
}

/// Writes the uncompressed bytes with one sync at the end; seconds.
fn raw_disk(dir: &Path, pairs: &[[v1::CameraFrame; 2]], frames: u64) -> anyhow::Result<f64> {
    let path = dir.join(format!("record_bench_raw_{}", std::process::id()));
    let mut file = std::fs::File::create(&path)?;
    let clock = Instant::now();
    for i in 0..frames {
        for frame in &pairs[i as usize % pairs.len()] {
            file.write_all(&frame.color)?;
            file.write_all(&frame.depth)?;
            file.write_all(&frame.segmentation)?;
        }
    }
    file.sync_all()?;
    let seconds = clock.elapsed().as_secs_f64();
    std::fs::remove_file(&path)?;
    Ok(seconds)
}
