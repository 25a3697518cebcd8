//! Arguments shared by subcommands, and exit codes.

use std::path::PathBuf;

use clap::Args;
use wheelarm_dataset::align::Interpolation;

/// Everything is there.
pub const FINE: u8 = 0;
/// A file could not be read or written.
pub const FAILED: u8 = 1;
/// A worker process crashed; the supervisor finds the cause.
pub const BROKEN: u8 = 134;
/// Readable, but partial or with problems.
pub const PARTIAL: u8 = 3;

/// Recordings and how many are processed at once.
#[derive(Args)]
pub struct Files {
    /// Episode files, or folders with some.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Files at once; the number of CPUs without it.
    #[arg(long, value_name = "N", value_parser = jobs)]
    pub jobs: Option<usize>,
    /// Damaged ones among them.
    #[arg(skip)]
    pub left_out: Vec<PathBuf>,
}

/// Recordings and how they are aligned and labelled.
#[derive(Args)]
pub struct Input {
    #[command(flatten)]
    pub files: Files,
    /// Camera whose stamps are the rows; the one on the arm when absent.
    #[arg(long, value_name = "CAMERA")]
    pub reference: Option<String>,
    /// Greatest distance of the samples around a row, for example `imu=0.02`;
    /// 2.5 times a stream's usual distance without it. Can be repeated.
    #[arg(long = "max-age", value_name = "STREAM=SECONDS", value_parser = limit)]
    pub limits: Vec<(String, f64)>,
    /// Curve between two samples.
    #[arg(long, value_enum, default_value_t, value_name = "CURVE")]
    pub interpolation: Interpolation,
    /// Table of corrected segments, as `label --out` writes it.
    #[arg(long, value_name = "CSV")]
    pub corrections: Option<PathBuf>,
}

/// Parses a number of files at once.
fn jobs(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| *count > 0);
    count.ok_or_else(|| {
        format!("invalid number of files at once {text:?}: write it as 4, 1 or more")
    })
}

/// Parses `STREAM=SECONDS`.
fn limit(text: &str) -> Result<(String, f64), String> {
    text.split_once('=')
        .and_then(|(stream, seconds)| Some((stream.to_owned(), seconds.parse().ok()?)))
        .filter(|(stream, seconds)| !stream.is_empty() && (0.0..1e6).contains(seconds))
        .ok_or_else(|| format!("invalid limit {text:?}: write it as imu=0.02"))
}

/// Parses seconds of idleness.
pub fn idle(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s| (0.0..1e6).contains(s));
    seconds.ok_or_else(|| format!("invalid seconds {text:?}: write them as 0.5, 0 or more"))
}
