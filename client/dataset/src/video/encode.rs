//! Encoders and their arguments. A GIF takes two passes: its 256 colours are
//! chosen from all frames, then the frames are drawn in them.

use std::ffi::OsString;
use std::path::Path;

use anyhow::{bail, ensure};

use crate::convert::Size;
use crate::convert::ffmpeg::{Program, argument};

/// The fix without the program.
const WITHOUT: &str = "look at the episode by `wheelarm dataset view`, which needs none";
/// The encoder of MP4 that every player and browser reads.
const H264: &str = "libx264";

/// File format of a video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Mp4,
    Gif,
}

impl Kind {
    /// By the ending of the file.
    ///
    /// # Errors
    /// When it is another one.
    pub fn from_path(out: &Path) -> anyhow::Result<Self> {
        let ending = out.extension().unwrap_or_default().to_string_lossy();
        match ending.to_ascii_lowercase().as_str() {
            "mp4" => Ok(Self::Mp4),
            "gif" => Ok(Self::Gif),
            _ => bail!(
                "cannot select a video format for {}: let it end in .mp4 or .gif",
                out.display()
            ),
        }
    }

    pub fn ending(self) -> &'static str {
        match self {
            Self::Mp4 => "mp4",
            Self::Gif => "gif",
        }
    }

    /// Frames per second: the requested ones, or `there` and no more than one
    /// likes to see, for a GIF to carry.
    ///
    /// # Errors
    /// When a player cannot show as many.
    pub fn rate(self, requested: Option<f64>, there: f64) -> anyhow::Result<f64> {
        // A GIF counts hundredths of a second, and viewers replace less than two by ten.
        let (most, usual) = match self {
            Self::Mp4 => (120.0, 30.0),
            Self::Gif => (50.0, 10.0),
        };
        let Some(requested) = requested else {
            return Ok(there.clamp(1.0, usual));
        };
        ensure!(
            (0.1..=most).contains(&requested),
            "--fps {requested} is outside of 0.1 to {most} for {}",
            self.ending()
        );
        Ok(requested)
    }

    /// Width of the frame: the requested one, or that of the images side by side
    /// and no more than a page shows.
    ///
    /// # Errors
    /// When no images exist.
    pub fn width(self, requested: Option<usize>, sizes: &[Size]) -> anyhow::Result<usize> {
        let tallest = sizes.iter().map(|size| size.height).max();
        let Some(tallest) = tallest else {
            bail!("no images exist");
        };
        let side_by_side = sizes.iter().map(|s| s.width * tallest / s.height).sum();
        let most = match self {
            Self::Mp4 => 1920,
            Self::Gif => 800,
        };
        // Text needs some room, however small the images are.
        Ok(requested.unwrap_or_else(|| most.min(side_by_side).max(480)))
    }
}

/// Renders all frames in order into the encoder.
type Draw<'a> = &'a dyn Fn(&mut dyn FnMut(&[u8]) -> anyhow::Result<()>) -> anyhow::Result<()>;

/// The program for one kind of video.
pub(super) struct Encoder {
    program: Program,
    kind: Kind,
}

impl Encoder {
    /// Finds the program and checks its capabilities.
    ///
    /// # Errors
    /// When it is missing or lacks an encoder, with the fix.
    pub fn find(kind: Kind) -> anyhow::Result<Self> {
        let program = Program::named(WITHOUT);
        let wanted = match kind {
            Kind::Mp4 => H264,
            Kind::Gif => "gif",
        };
        ensure!(
            program.encoders()?.has(wanted),
            "{} has no encoder {wanted}: {}",
            program.name(),
            program.cure()
        );
        Ok(Self { program, kind })
    }

    /// Number of passes over all frames.
    pub fn passes(&self) -> usize {
        match self.kind {
            Kind::Mp4 => 1,
            Kind::Gif => 2,
        }
    }

    /// Encodes the frames of `size` that `draw` renders into `path`; returns its size, bytes.
    /// Files beside it are deleted with its folder.
    ///
    /// # Errors
    /// When the program or a frame fails.
    pub fn encode(
        &self,
        path: &Path,
        size: Size,
        rate: f64,
        draw: Draw<'_>,
    ) -> anyhow::Result<u64> {
        match self.kind {
            Kind::Mp4 => self.pass(&mp4(size, rate, path)?, path, draw),
            Kind::Gif => {
                let colours = path.with_file_name("colours.png");
                self.pass(&palette(size, rate, &colours)?, &colours, draw)?;
                self.pass(&gif(size, rate, &colours, path)?, path, draw)
            }
        }
    }

    fn pass(&self, arguments: &[OsString], path: &Path, draw: Draw<'_>) -> anyhow::Result<u64> {
        let mut stream = self.program.begin(arguments, path)?;
        draw(&mut |frame| stream.put(frame))?;
        stream.finish()
    }
}

/// Frames of `size` from the pipe, then the file `more` if there is one, then `rest`, then
/// the file that is made.
fn arguments(
    size: Size,
    rate: f64,
    more: Option<&Path>,
    rest: &[&str],
    path: &Path,
) -> std::io::Result<Vec<OsString>> {
    let (video, rate) = (format!("{}x{}", size.width, size.height), rate.to_string());
    let head = ["-hide_banner", "-loglevel", "error", "-n"];
    let input = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", &video];
    let pipe = ["-framerate", &rate, "-i", "pipe:0"];
    let all = head.iter().chain(&input).chain(&pipe);
    let mut all: Vec<OsString> = all.map(OsString::from).collect();
    if let Some(more) = more {
        all.extend(["-i".into(), argument(more)?]);
    }
    all.extend(rest.iter().map(OsString::from));
    all.push(argument(path)?);
    Ok(all)
}

fn mp4(size: Size, rate: f64, path: &Path) -> std::io::Result<Vec<OsString>> {
    // Colour at every second pixel is what browsers decode; a video may
    // begin to play before all of it is there.
    let rest = [
        "-an",
        "-c:v",
        H264,
        "-preset",
        "medium",
        "-crf",
        "20",
        "-pix_fmt",
        "yuv420p",
        "-movflags",
        "+faststart",
        "-f",
        "mp4",
    ];
    arguments(size, rate, None, &rest, path)
}

fn palette(size: Size, rate: f64, path: &Path) -> std::io::Result<Vec<OsString>> {
    let rest = [
        "-vf",
        "palettegen=stats_mode=full",
        "-f",
        "image2",
        "-update",
        "1",
    ];
    arguments(size, rate, None, &rest, path)
}

fn gif(size: Size, rate: f64, colours: &Path, path: &Path) -> std::io::Result<Vec<OsString>> {
    // An ordered pattern is constant where the image is, and so compresses well.
    let dither = "paletteuse=dither=bayer:bayer_scale=5:diff_mode=rectangle";
    let rest = ["-lavfi", dither, "-loop", "0", "-f", "gif"];
    arguments(size, rate, Some(colours), &rest, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 640,
        height: 360,
    };

    #[test]
    fn the_extension_selects_the_format() {
        for (name, kind) in [("a/b.mp4", Kind::Mp4), ("b.x.GIF", Kind::Gif)] {
            assert_eq!(Kind::from_path(Path::new(name)).unwrap(), kind);
        }
        for name in ["a.avi", "gif", "b."] {
            let error = Kind::from_path(Path::new(name)).unwrap_err().to_string();
            assert!(error.contains(".mp4 or .gif"), "{error}");
        }
    }

    #[test]
    fn rate_and_width_are_those_of_the_images_within_limits() {
        assert_eq!(Kind::Mp4.rate(None, 10.0).unwrap(), 10.0);
        assert_eq!(Kind::Mp4.rate(None, 240.0).unwrap(), 30.0);
        assert_eq!(Kind::Gif.rate(None, 20.0).unwrap(), 10.0);
        assert_eq!(Kind::Gif.rate(Some(25.0), 1.0).unwrap(), 25.0);
        let error = Kind::Gif.rate(Some(60.0), 10.0).unwrap_err().to_string();
        assert!(
            error.contains("--fps 60") && error.contains("50"),
            "{error}"
        );
        assert_eq!(Kind::Mp4.width(None, &[SIZE, SIZE]).unwrap(), 1280);
        assert_eq!(Kind::Gif.width(None, &[SIZE, SIZE]).unwrap(), 800);
        assert_eq!(Kind::Gif.width(Some(300), &[SIZE]).unwrap(), 300);
        let small = Size {
            width: 64,
            height: 36,
        };
        assert_eq!(Kind::Mp4.width(None, &[small]).unwrap(), 480);
    }
}
