//! Images as LeRobot's videos: encoders and their arguments.

use std::ffi::OsString;
use std::path::Path;

use anyhow::{Context, ensure};
use serde_json::{Map, Value, json};

use super::depth_code;
use crate::convert::Size;
use crate::convert::ffmpeg::{Encoders, Program, Stream, argument};

/// Interval of key frames, at which a reader may begin, frames.
const KEY_FRAMES: u32 = 2;
/// The fix without the program.
const WITHOUT: &str = "use --images png";

/// How images are stored in a LeRobot set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ImageFormat {
    /// H.264 where ffmpeg has libx264, else AV1.
    #[default]
    Video,
    /// H.264 with colour at every pixel.
    H264,
    /// AV1 with colour at every second pixel, LeRobot's own default.
    Av1,
    /// PNG images inside Parquet, exact; needs no ffmpeg.
    Png,
}

/// Codec of a video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Codec {
    /// AV1 by SVT-AV1.
    Av1,
    /// H.264 by x264.
    H264,
    /// Codes of depth, lossless, in HEVC by x265: LeRobot 0.6's depth video.
    Depth,
}

impl Codec {
    /// Name of the encoder in ffmpeg.
    fn encoder(self) -> &'static str {
        match self {
            Self::Av1 => "libsvtav1",
            Self::H264 => "libx264",
            Self::Depth => "libx265",
        }
    }

    /// Name of its format, as readers call it.
    fn name(self) -> &'static str {
        match self {
            Self::Av1 => "av1",
            Self::H264 => "h264",
            Self::Depth => "hevc",
        }
    }

    /// Layout of a pixel in the file.
    fn pixel(self) -> &'static str {
        match self {
            Self::Av1 => "yuv420p",
            Self::H264 => "yuv444p",
            Self::Depth => "gray12le",
        }
    }

    /// Layout of a pixel in the pipe.
    fn raw(self) -> &'static str {
        match self {
            Self::Av1 | Self::H264 => "rgb24",
            Self::Depth => "gray12le",
        }
    }

    /// Least width and height, and their common divisor, pixels.
    fn grid(self) -> (usize, usize) {
        match self {
            Self::Av1 => (64, 2),
            Self::H264 => (2, 1),
            Self::Depth => (32, 1),
        }
    }

    /// Quality and effort, by measurement (guide, LeRobot): at least 38 dB at
    /// 640×360, depth without loss.
    fn options(self) -> &'static [&'static str] {
        match self {
            Self::Av1 => &["-preset", "8", "-crf", "10"],
            Self::H264 => &["-preset", "medium", "-crf", "20", "-bf", "0"],
            Self::Depth => &[
                "-preset",
                "veryfast",
                "-x265-params",
                "lossless=1:bframes=0:scenecut=0:log-level=error",
                "-tag:v",
                "hvc1",
            ],
        }
    }

    /// Arguments of ffmpeg: frames of `size` from its input, `rate` of them a
    /// second, become `path`.
    fn arguments(self, size: Size, rate: u32, path: &Path) -> std::io::Result<Vec<OsString>> {
        let Size { width, height } = size;
        let (keys, video) = (KEY_FRAMES.to_string(), format!("{width}x{height}"));
        let rate = rate.to_string();
        let head = ["-hide_banner", "-loglevel", "error", "-n"];
        let input = ["-f", "rawvideo", "-pix_fmt", self.raw()];
        let frames = ["-video_size", &video, "-framerate", &rate, "-i", "pipe:0"];
        let coder = ["-an", "-c:v", self.encoder(), "-g", &keys];
        let scaler = ["-sws_flags", "accurate_rnd+full_chroma_int+bicubic"];
        let end = ["-pix_fmt", self.pixel(), "-f", "mp4"];
        let all = [&head[..], &input, &frames, &scaler, &coder];
        let all = all.into_iter().chain([self.options(), &end]).flatten();
        let all = all.map(OsString::from);
        Ok(all.chain([argument(path)?]).collect())
    }

    /// Entry of a feature in `meta/info.json`, as LeRobot reads it.
    pub fn info(self, size: Size, rate: u32) -> Value {
        let is_depth = self == Self::Depth;
        let mut info = Map::new();
        let mut put = |name: &str, value: Value| info.insert(name.to_owned(), value);
        put("video.height", json!(size.height));
        put("video.width", json!(size.width));
        put("video.codec", json!(self.name()));
        put("video.pix_fmt", json!(self.pixel()));
        put("video.fps", json!(rate));
        put("video.channels", json!(if is_depth { 1 } else { 3 }));
        put("video.g", json!(KEY_FRAMES));
        put("has_audio", json!(false));
        put("is_depth_map", json!(is_depth));
        if is_depth {
            put("depth_unit", json!("mm"));
            put("video.depth_min", json!(depth_code::LEAST));
            put("video.depth_max", json!(depth_code::MOST));
            put("video.shift", json!(depth_code::SHIFT));
            put("video.use_log", json!(true));
            put("video.extra_options", json!({"x265-params": "lossless=1"}));
        }
        Value::Object(info)
    }
}

/// The program, after a query of its capabilities.
#[derive(Clone, Debug)]
pub(super) struct Ffmpeg {
    program: Program,
    /// Codec of colour.
    pub colour: Codec,
}

impl Ffmpeg {
    /// Finds the program and the encoders that `format`, and depth when it is
    /// requested, need; `None` for PNG.
    ///
    /// # Errors
    /// When it is missing or lacks an encoder, with the fix.
    pub fn find(format: ImageFormat, depth: bool) -> anyhow::Result<Option<Self>> {
        Self::of(Program::named(WITHOUT), format, depth)
    }

    fn of(program: Program, format: ImageFormat, depth: bool) -> anyhow::Result<Option<Self>> {
        if format == ImageFormat::Png {
            return Ok(None);
        }
        let encoders = program.encoders()?;
        let colour = chosen(&encoders, format)
            .with_context(|| format!("{} cannot do it: {}", program.name(), program.cure()))?;
        if depth {
            let options = program.request(&["-h", "encoder=libx265"])?;
            ensure!(
                options.contains(Codec::Depth.pixel()),
                "{} has no libx265 that codes {}, which depth needs: {}",
                program.name(),
                Codec::Depth.pixel(),
                program.cure()
            );
        }
        Ok(Some(Self { program, colour }))
    }

    /// Begins a video of `size` at `rate` frames a second.
    ///
    /// # Errors
    /// When the codec does not support the size, or the program does not start.
    pub fn begin(
        &self,
        codec: Codec,
        size: Size,
        rate: u32,
        path: &Path,
    ) -> anyhow::Result<Stream> {
        let ((least, step), Size { width, height }) = (codec.grid(), size);
        ensure!(
            width.min(height) >= least && width % step + height % step == 0,
            "{} needs images of at least {least} pixels each way, in multiples of {step}; these are of {width}x{height}: choose another size with --size, or --images",
            codec.encoder()
        );
        self.program
            .begin(&codec.arguments(size, rate, path)?, path)
    }

    /// Puts videos of one codec one behind the other, unchanged. All are in
    /// `folder`; each has a name of plain letters and its length in frames.
    ///
    /// ffmpeg adds up the durations of the parts in microseconds, and a frame lasts no
    /// whole number of them at most rates. So timestamps are not taken from there:
    /// `setts` (ffmpeg 4.4 and later) makes them of the number of each frame.
    ///
    /// # Errors
    /// When the program fails, or the video does not have these frames at their times.
    pub fn join(
        &self,
        folder: &Path,
        parts: &[(String, usize)],
        rate: u32,
        to: &Path,
    ) -> anyhow::Result<()> {
        let mut list = String::from("ffconcat version 1.0\n");
        for (name, frames) in parts {
            let seconds = *frames as f64 / f64::from(rate);
            list.push_str(&format!("file {name}\nduration {seconds:.6}\n"));
        }
        let path = folder.join("parts.txt");
        std::fs::write(&path, list)?;
        let times = format!("setts=ts=floor(N/({rate}*TB)+0.5):duration=floor(1/({rate}*TB)+0.5)");
        let head = [
            "-hide_banner",
            "-loglevel",
            "error",
            "-n",
            "-f",
            "concat",
            "-i",
        ];
        let mut arguments: Vec<OsString> = head.map(OsString::from).to_vec();
        arguments.push(argument(&path)?);
        arguments.extend(["-c", "copy", "-bsf:v", &times, "-f", "mp4"].map(OsString::from));
        arguments.push(argument(to)?);
        let output = self.program.run(&arguments)?;
        let errors = String::from_utf8_lossy(&output.stderr);
        ensure!(
            output.status.success(),
            "{} could not join {} videos ({}): {}",
            self.program.name(),
            parts.len(),
            output.status,
            errors.trim()
        );
        self.check(to, parts.iter().map(|(_, frames)| frames).sum(), rate)
    }

    /// Checks that frame k of a video is shown at k / `rate` s, as the table says.
    ///
    /// # Errors
    /// With the first frame that is not.
    pub fn check(&self, video: &Path, frames: usize, rate: u32) -> anyhow::Result<()> {
        let head = ["-hide_banner", "-loglevel", "error", "-i"];
        let mut arguments: Vec<OsString> = head.map(OsString::from).to_vec();
        arguments.push(argument(video)?);
        // A line for each packet, `0, dts, pts, duration, bytes, hash`, behind the line
        // `#tb 0: 1/15360`; frames are not decoded.
        arguments.extend(["-map", "0:v", "-c", "copy", "-f", "framecrc", "-"].map(OsString::from));
        let output = self.program.run(&arguments)?;
        let text = String::from_utf8_lossy(&output.stdout);
        let times = Times::parse(&text).with_context(|| {
            format!(
                "{} cannot list the frames of {}: {}",
                self.program.name(),
                video.display(),
                String::from_utf8_lossy(&output.stderr).trim()
            )
        })?;
        times
            .check(frames, rate)
            .with_context(|| format!("the video {} does not fit its table", video.display()))
    }
}

/// LeRobot rejects a frame that is farther than this from its row, s.
const TOLERANCE: f64 = 1e-4;

/// When the frames of a video are shown.
#[derive(Debug, PartialEq)]
struct Times {
    /// Unit, s.
    unit: f64,
    /// In the order of the times.
    shown: Vec<i64>,
}

impl Times {
    /// Parses the output of ffmpeg's `framecrc`.
    fn parse(text: &str) -> Option<Self> {
        let mut unit = None;
        let mut shown = Vec::new();
        for line in text.lines() {
            if let Some(base) = line.strip_prefix("#tb 0:") {
                let (over, under) = base.trim().split_once('/')?;
                unit = Some(over.parse::<f64>().ok()? / under.parse::<f64>().ok()?);
            } else if !line.starts_with('#') {
                shown.push(line.split(',').nth(2)?.trim().parse().ok()?);
            }
        }
        shown.sort_unstable();
        Some(Self { unit: unit?, shown })
    }

    /// Checks number and times of the frames; half of LeRobot's tolerance is left to it.
    fn check(&self, frames: usize, rate: u32) -> anyhow::Result<()> {
        ensure!(
            self.shown.len() == frames,
            "it has {} frames, expected {frames}",
            self.shown.len()
        );
        for (k, &shown) in self.shown.iter().enumerate() {
            let (is, wanted) = (shown as f64 * self.unit, k as f64 / f64::from(rate));
            ensure!(
                (is - wanted).abs() < 0.5 * TOLERANCE,
                "frame {k} is shown at {is:.6} s, expected {wanted:.6} s"
            );
        }
        Ok(())
    }
}

/// The codec of `format` among the encoders that ffmpeg lists.
fn chosen(encoders: &Encoders, format: ImageFormat) -> anyhow::Result<Codec> {
    let wanted: &[Codec] = match format {
        ImageFormat::H264 => &[Codec::H264],
        ImageFormat::Av1 => &[Codec::Av1],
        ImageFormat::Video | ImageFormat::Png => &[Codec::H264, Codec::Av1],
    };
    let has = |codec: &Codec| encoders.has(codec.encoder());
    let names: Vec<_> = wanted.iter().map(|codec| codec.encoder()).collect();
    let found = wanted.iter().copied().find(has);
    found.with_context(|| format!("it has no encoder {}", names.join(" or ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 96,
        height: 64,
    };

    #[test]
    fn the_encoder_is_chosen_among_the_available_ones() {
        let both = &Encoders::parse(
            " V..... libsvtav1   SVT-AV1 (codec av1)\n V....D libx264   libx264 H.264\n",
        );
        let one = &Encoders::parse(
            " V..... libsvtav1   SVT-AV1\n V....D libx264rgb   libx264 H.264 RGB\n",
        );
        assert_eq!(chosen(both, ImageFormat::Video).unwrap(), Codec::H264);
        assert_eq!(chosen(both, ImageFormat::Av1).unwrap(), Codec::Av1);
        assert_eq!(chosen(one, ImageFormat::Video).unwrap(), Codec::Av1);
        let error = chosen(one, ImageFormat::H264).unwrap_err().to_string();
        assert!(error.contains("libx264"), "{error}");
    }

    #[test]
    fn png_needs_no_program_and_an_unsupported_size_is_an_error() {
        let nowhere = Program::from_path("/nowhere/ffmpeg".into(), WITHOUT);
        let png = Ffmpeg::of(nowhere.clone(), ImageFormat::Png, true).unwrap();
        assert!(png.is_none());
        let error = Ffmpeg::of(nowhere.clone(), ImageFormat::Video, false);
        let error = error.unwrap_err().to_string();
        assert!(error.contains("or use --images png"), "{error}");
        let odd = Size {
            width: 97,
            height: 64,
        };
        let ffmpeg = Ffmpeg {
            program: nowhere,
            colour: Codec::Av1,
        };
        let error = ffmpeg
            .begin(Codec::Av1, odd, 10, Path::new("0.mp4"))
            .map(drop);
        let error = error.unwrap_err().to_string();
        assert!(
            error.contains("97x64") && error.contains("--size"),
            "{error}"
        );
    }

    #[test]
    fn arguments_and_metadata_say_the_same() {
        for codec in [Codec::Av1, Codec::H264, Codec::Depth] {
            let path = Path::new("a folder/it's $(here).mp4");
            let arguments = codec.arguments(SIZE, 10, path).unwrap();
            assert_eq!(*arguments.last().unwrap(), argument(path).unwrap());
            let arguments: Vec<_> = arguments.iter().map(|a| a.to_string_lossy()).collect();
            let after = |flag: &str| {
                let found = arguments.iter().rposition(|a| a == flag).unwrap();
                arguments[found + 1].clone()
            };
            let info = codec.info(SIZE, 10);
            assert_eq!(info["video.pix_fmt"], *after("-pix_fmt"));
            assert_eq!(info["video.g"].to_string(), after("-g"));
            assert_eq!(info["video.fps"].to_string(), after("-framerate"));
            assert_eq!(after("-video_size"), "96x64");
            assert_eq!(info["is_depth_map"], codec == Codec::Depth);
            assert_eq!(info.get("depth_unit").is_some(), codec == Codec::Depth);
        }
    }

    #[test]
    fn joined_videos_do_not_drift_from_their_table() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let ffmpeg = Ffmpeg::find(ImageFormat::H264, false).unwrap().unwrap();
        let rate = 30;
        let part = folder.join("0.mp4");
        let mut stream = ffmpeg.begin(Codec::H264, SIZE, rate, &part).unwrap();
        for level in 0..8 {
            stream.put(&vec![30 * level; 3 * 96 * 64]).unwrap();
        }
        stream.finish().unwrap();
        ffmpeg.check(&part, 8, rate).unwrap();
        // Rounded durations of 360 parts add up to 120 us.
        let to = folder.join("all.mp4");
        let parts = vec![("0.mp4".to_owned(), 8); 360];
        ffmpeg.join(folder, &parts, rate, &to).unwrap();
        ffmpeg.check(&to, 8 * 360, rate).unwrap();
        let error = format!("{:#}", ffmpeg.check(&to, 8 * 360 + 1, rate).unwrap_err());
        assert!(
            error.contains("it has 2880 frames, expected 2881"),
            "{error}"
        );
    }

    #[test]
    fn drift_of_a_video_is_found_before_lerobot_finds_it() {
        let text = "#tb 0: 1/15360\n#media_type 0: video\n0, 0, 0, 512, 9, 0x1\n\
                    0, 1024, 1024, 512, 9, 0x1\n0, 513, 513, 512, 9, 0x1, F=0x0\n";
        let times = Times::parse(text).unwrap();
        assert_eq!(times.shown, [0, 513, 1024]);
        let error = times.check(3, 30).unwrap_err().to_string();
        assert!(
            error.starts_with("frame 1 is shown at 0.033398 s, expected"),
            "{error}"
        );
        assert!(Times::parse("0, NOPTS, NOPTS, 1, 2, 0x1").is_none());
        let even = Times {
            shown: vec![0, 512, 1024],
            ..times
        };
        even.check(3, 30).unwrap();
    }
}
