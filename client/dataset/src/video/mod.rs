//! A video of an episode for people: cameras side by side, below them the
//! instruction, the current phase, and the time. MP4 or GIF, both by ffmpeg.

mod encode;
mod frame;
mod layout;
mod story;
mod times;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};

use crate::convert::batch::parallel;
use crate::convert::{PendingFolder, Size};
use crate::publish;
use crate::read::{Camera, Episode};
use crate::sheet::style;

use self::encode::Kind;
use self::frame::Painter;
use self::layout::Layout;
use self::story::Story;
use self::times::Span;

/// Frames that are drawn together.
const BLOCK: usize = 16;

/// Options of a video.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VideoOptions {
    /// Cameras or image sensors from left to right; every camera when empty.
    pub cameras: Vec<String>,
    /// Simulated seconds per second of the video; 1 when absent.
    pub speed: Option<f64>,
    /// Frames per second of the video; when absent those that were recorded, but no
    /// more than a player shows well.
    pub frames_per_second: Option<f64>,
    /// Width of the video, pixels; when absent that of the images, but no more
    /// than a page shows well.
    pub width: Option<usize>,
    /// First moment, seconds from the beginning of the episode.
    pub from: Option<f64>,
    /// Last moment, seconds from the beginning of the episode.
    pub to: Option<f64>,
    /// Images alone, without text.
    pub is_plain: bool,
}

/// The written video.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Made {
    /// The file.
    pub path: PathBuf,
    /// Its size, pixels.
    pub size: Size,
    /// Frames in it.
    pub frames: usize,
    /// Bytes of it.
    pub bytes: u64,
}

/// Makes the video `out`, MP4 or GIF by its ending. `begun` receives how many frames
/// will be rendered, and `tick` is called for each.
///
/// # Errors
/// When no such camera or moment exists, ffmpeg is missing, or the file cannot be
/// written; then no partial file is left.
pub fn video(
    episode: &Episode,
    options: &VideoOptions,
    out: &Path,
    threads: usize,
    begun: &dyn Fn(usize),
    tick: &(dyn Fn() + Sync),
) -> anyhow::Result<Made> {
    let kind = Kind::from_path(out)?;
    let cameras = cameras(episode, &options.cameras)?;
    let speed = options.speed.unwrap_or(1.0);
    ensure!(
        (0.05..=100.0).contains(&speed),
        "--speed {speed} is outside of 0.05 to 100"
    );
    let recorded = times::rate(cameras.iter().map(Camera::stamps));
    let rate = kind.rate(options.frames_per_second, recorded * speed)?;
    let summary = episode.summary()?;
    let span = Span::new(summary.span_nanos, options.from, options.to)?;
    let moments = span.moments(speed, rate);
    let sizes: Vec<Size> = cameras.iter().filter_map(size).collect();
    let layout = Layout::new(
        &sizes,
        kind.width(options.width, &sizes)?,
        !options.is_plain,
    )?;
    ensure!(style::register(), "cannot use the built-in fonts");
    let story = Story::read(episode, &summary, span)?;
    let painter = Painter {
        layout: &layout,
        story: &story,
        names: names(&cameras),
        speed,
    };
    let encoder = encode::Encoder::find(kind)?;
    let scratch = PendingFolder::new(out)?;
    let path = scratch.path().join(format!("video.{}", kind.ending()));
    begun(moments.len() * encoder.passes());
    let draw = |put: &mut dyn FnMut(&[u8]) -> anyhow::Result<()>| {
        for block in moments.chunks(BLOCK) {
            let frames = parallel(block.len(), threads, |k| {
                let images = cameras.iter().map(|camera| {
                    let index = times::newest(camera.exposures(), block[k]);
                    let size = size(camera).context("a camera with images")?;
                    Ok((camera.rgb(episode, index)?, size))
                });
                let images = images.collect::<anyhow::Result<Vec<_>>>()?;
                painter.frame(images, block[k])
            })?;
            for frame in &frames {
                put(frame)?;
                tick();
            }
        }
        Ok(())
    };
    let bytes = encoder.encode(&path, layout.size, rate, &draw)?;
    publish::file(&path, out)?;
    Ok(Made {
        path: out.to_owned(),
        size: layout.size,
        frames: moments.len(),
        bytes,
    })
}

fn size(camera: &Camera) -> Option<Size> {
    let (width, height) = camera.size()?;
    Some(Size { width, height })
}

/// The cameras and sensors of these names, or every camera.
fn cameras(episode: &Episode, names: &[String]) -> anyhow::Result<Vec<Camera>> {
    let mut found = Vec::new();
    let (all, sensors) = (episode.cameras()?, episode.sensors()?);
    let wanted = if names.is_empty() { &all } else { names };
    for name in wanted {
        let camera = if all.contains(name) {
            episode.camera(name)?
        } else if sensors.contains(name) {
            episode.sensor(name)?
        } else {
            let there: Vec<_> = all.iter().chain(&sensors).cloned().collect();
            bail!(
                "{} has no camera {name}; it has {}. `wheelarm replay FILE --out DIR --camera {name}=640x360@10` renders the episode again with one",
                episode.path().display(),
                there.join(", ")
            );
        };
        let shows = camera.has_rgb() && camera.size().is_some() && !camera.is_empty();
        if shows {
            found.push(camera);
        } else if !names.is_empty() {
            bail!("{} has no images in colour", camera.stream());
        }
    }
    ensure!(
        !found.is_empty(),
        "{} has no images; `wheelarm replay FILE --out DIR --camera wheelchair=640x360@10` renders the episode again with some",
        episode.path().display()
    );
    Ok(found)
}

/// Titles of the images: the camera's name, or the sensor's.
fn names(cameras: &[Camera]) -> Vec<String> {
    let name = |camera: &Camera| camera.stream().rsplit('/').next().map(str::to_owned);
    cameras.iter().filter_map(name).collect()
}
