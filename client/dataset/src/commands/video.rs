//! The command that makes a video of an episode.

use std::path::{Path, PathBuf};

use clap::Args;
use wheelarm_dataset::convert::batch;
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::video::{self as videos, VideoOptions};

use super::arguments::FINE;

/// Arguments of `wheelarm dataset video`.
#[derive(Args)]
pub struct Video {
    /// The episode file.
    pub file: PathBuf,
    /// The video, ending in .mp4 or .gif; FILE with the ending .mp4 without it.
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// Camera or image sensor; several are shown side by side. Every camera of the
    /// recording without it.
    #[arg(long = "camera", value_name = "NAME")]
    cameras: Vec<String>,
    /// Simulated seconds per second, 0.05 to 100.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    speed: f64,
    /// Frames per second; without it those that were recorded, at most 30, in a
    /// GIF 10.
    #[arg(long, value_name = "N")]
    fps: Option<f64>,
    /// Width of the whole, pixels; without it that of the images side by side, at
    /// most 1920, in a GIF 800.
    #[arg(long, value_name = "PIXELS")]
    width: Option<usize>,
    /// First moment, seconds from the beginning of the episode.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    from: Option<f64>,
    /// Last moment, seconds from the beginning of the episode.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    to: Option<f64>,
    /// Images alone: no instruction, phase, time and names.
    #[arg(long)]
    plain: bool,
}

/// Parses a moment.
fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s| (0.0..1e6).contains(s));
    seconds.ok_or_else(|| format!("invalid seconds {text:?}: write them as 2.5, 0 or more"))
}

pub fn video(arguments: Video) -> anyhow::Result<u8> {
    let out = arguments.out.as_deref();
    let out = out.map_or_else(|| arguments.file.with_extension("mp4"), Path::to_owned);
    let options = VideoOptions {
        cameras: arguments.cameras,
        speed: Some(arguments.speed),
        frames_per_second: arguments.fps,
        width: arguments.width,
        from: arguments.from,
        to: arguments.to,
        is_plain: arguments.plain,
    };
    let episode = Episode::open(&arguments.file)?;
    let bar = batch::bar("frames");
    let made = videos::video(
        &episode,
        &options,
        &out,
        batch::threads(),
        &|frames| bar.set_length(frames as u64),
        &|| bar.inc(1),
    );
    bar.finish_and_clear();
    let made = made?;
    println!(
        "{}: {}x{}, {} frames, {:.2} MB",
        made.path.display(),
        made.size.width,
        made.size.height,
        made.frames,
        made.bytes as f64 * 1e-6
    );
    Ok(FINE)
}
