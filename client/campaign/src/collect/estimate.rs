//! Estimate of a campaign before it starts: episodes, samples, disk, time, and the source of
//! each figure.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use anyhow::Context;
use serde::Deserialize;

use super::capacity::{Host, PIPELINES, free_disk, is_memory, worker_bytes};
use super::episode::Episode;
use super::journal::Ledger;
use crate::variation::camera_words;
use wheelarm_proto::settings::{Depth, Named};

use super::plan::Plan;

/// Default mean duration of an episode, simulated seconds: that of the operator with the
/// mustard, with a margin.
const SECONDS: f64 = 25.0;
/// Bytes per pixel of an image with color, depth and segmentation, in the file
/// (measured in the home scene at 1280x720: float32, 16-bit and no depth).
const PIXEL_BYTES: [f64; 3] = [2.0, 1.1, 0.7];
/// Bytes that a sensor model adds per pixel of its camera: noise cannot be compressed (measured, 640x360, 16-bit depth).
const SENSED_BYTES: f64 = 2.5;
/// Bytes of all other streams per simulated second (measured).
const STATE_BYTES: f64 = 0.32e6;
/// Simulated seconds per wall second of one worker without a measurement: a guess.
const FACTOR: f64 = 1.0;

/// Source of a mean duration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Episodes in the folder.
    Measured,
    /// The file of `--durations`.
    Evaluated,
    /// The plan.
    Plan,
    /// The default.
    Guess,
}

impl Source {
    fn word(self) -> &'static str {
        match self {
            Self::Measured => "episodes in the folder",
            Self::Evaluated => "wheelarm evaluate",
            Self::Plan => "the plan",
            Self::Guess => "a guess",
        }
    }
}

/// One task's share.
#[derive(Clone, Debug, PartialEq)]
pub struct Share {
    /// Task.
    pub task: String,
    /// Episodes of it.
    pub episodes: usize,
    /// Existing episodes of it.
    pub done: usize,
    /// Mean duration, simulated seconds, and its source.
    pub seconds: (f64, Source),
    /// Share of attempts that succeed.
    pub success: f64,
    /// Mean samples per episode of the reference.
    pub reference: Option<f64>,
}

/// Estimate of a campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// By task, in the order of the plan.
    pub shares: Vec<Share>,
    /// Samples per simulated second.
    pub sample_rate: f64,
    /// Bytes per simulated second.
    pub byte_rate: f64,
    /// Simulated seconds per wall second of one worker; whether measured.
    pub factor: (f64, bool),
}

#[derive(Deserialize)]
struct Evaluated {
    tasks: Vec<EvaluatedTask>,
}

#[derive(Deserialize)]
struct EvaluatedTask {
    task: String,
    mean_seconds: f64,
    rate: f64,
}

/// Mean duration (simulated seconds) and success rate by task, from the JSON
/// of `wheelarm evaluate`.
///
/// # Errors
/// When the file cannot be read or has another format.
pub fn durations(path: &Path) -> anyhow::Result<BTreeMap<String, (f64, f64)>> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("reading the durations {}", path.display()))?;
    let report: Evaluated = serde_json::from_str(&text).with_context(|| {
        format!(
            "{} is not a report of `wheelarm evaluate` (JSON with tasks, their mean_seconds and rate)",
            path.display()
        )
    })?;
    let tasks = report.tasks.into_iter().filter(|t| t.mean_seconds > 0.0);
    Ok(tasks.map(|t| (t.task, (t.mean_seconds, t.rate))).collect())
}

/// Estimates `episodes` of the plan.
#[must_use]
pub fn estimate(
    plan: &Plan,
    episodes: &[Episode],
    ledger: &Ledger,
    evaluated: &BTreeMap<String, (f64, f64)>,
) -> Estimate {
    let pixel_bytes = match plan.depth {
        Depth::Metres => PIXEL_BYTES[0],
        Depth::Millimetres => PIXEL_BYTES[1],
        Depth::Nothing => PIXEL_BYTES[2],
    };
    let done: Vec<_> = episodes
        .iter()
        .filter_map(|e| ledger.done.get(&e.id))
        .collect();
    let simulated: f64 = done.iter().map(|d| d.seconds).sum();
    let wall: f64 = done.iter().map(|d| d.wall_seconds).sum();
    let bytes: f64 = done.iter().map(|d| d.bytes as f64).sum();
    let measured = simulated > 0.0 && wall > 0.0;
    let shares = plan.tasks.iter().map(|task| {
        let of_task = || episodes.iter().filter(|e| e.task == task.name);
        let existing: Vec<f64> = of_task()
            .filter_map(|e| ledger.done.get(&e.id))
            .map(|d| d.seconds)
            .collect();
        let known = evaluated.get(&task.name);
        let seconds = if !existing.is_empty() {
            (
                existing.iter().sum::<f64>() / existing.len() as f64,
                Source::Measured,
            )
        } else if let Some((seconds, _)) = known {
            (*seconds, Source::Evaluated)
        } else if let Some(seconds) = task.seconds {
            (seconds, Source::Plan)
        } else {
            (SECONDS, Source::Guess)
        };
        Share {
            task: task.name.clone(),
            episodes: of_task().count(),
            done: existing.len(),
            seconds,
            success: known.map_or(1.0, |(_, rate)| rate.clamp(0.05, 1.0)),
            reference: task.reference_samples,
        }
    });
    Estimate {
        shares: shares.filter(|share| share.episodes > 0).collect(),
        sample_rate: plan.sample_rate_hz,
        byte_rate: if measured {
            bytes / simulated
        } else {
            plan.pixels_per_second() * pixel_bytes
                + plan.sensed_pixels_per_second() * SENSED_BYTES
                + STATE_BYTES
        },
        factor: if measured {
            (simulated / wall, true)
        } else {
            (FACTOR, false)
        },
    }
}

impl Estimate {
    /// Simulated seconds of the dataset.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        let of = |s: &Share| s.episodes as f64 * s.seconds.0;
        self.shares.iter().map(of).sum()
    }

    /// Remaining simulated seconds, failed attempts included.
    #[must_use]
    pub fn seconds_left(&self) -> f64 {
        let of = |s: &Share| (s.episodes - s.done) as f64 * s.seconds.0 / s.success;
        self.shares.iter().map(of).sum()
    }

    /// Remaining bytes to write.
    #[must_use]
    pub fn bytes_left(&self) -> f64 {
        let of = |s: &Share| (s.episodes - s.done) as f64 * s.seconds.0;
        self.shares.iter().map(of).sum::<f64>() * self.byte_rate
    }

    /// Bytes of the longest episode.
    #[must_use]
    pub fn largest(&self) -> f64 {
        let longest = self.shares.iter().map(|s| s.seconds.0).fold(0.0, f64::max);
        longest * self.byte_rate
    }

    /// Checks that the disk of the folder `out` has space for the missing files.
    ///
    /// # Errors
    /// When it is too small, with both sizes.
    pub fn check_disk(&self, out: &Path) -> anyhow::Result<()> {
        fits(out, self.bytes_left(), free_disk(out))
    }

    /// The table of `--dry-run`; `workers` is their number and the bytes of recordings that
    /// each keeps in memory.
    #[must_use]
    pub fn table(&self, plan: &Plan, out: &Path, workers: (usize, f64)) -> String {
        let mut text = String::new();
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "{:<22} {:>8} {:>6} {:>12} {:>10} {:>11}  duration from",
            "task", "episodes", "done", "s each", "samples", "reference"
        );
        let mut reference = 0.0;
        for share in &self.shares {
            let samples = share.episodes as f64 * share.seconds.0 * self.sample_rate;
            let theirs = share.reference.map(|r| r * share.episodes as f64);
            reference += theirs.unwrap_or(0.0);
            let _ = writeln!(
                text,
                "{:<22} {:>8} {:>6} {:>12.1} {:>10.0} {:>11}  {}",
                share.task,
                share.episodes,
                share.done,
                share.seconds.0,
                samples,
                theirs.map_or_else(|| "-".to_owned(), |r| format!("{r:.0}")),
                share.seconds.1.word()
            );
        }
        let episodes: usize = self.shares.iter().map(|s| s.episodes).sum();
        let done: usize = self.shares.iter().map(|s| s.done).sum();
        let _ = writeln!(
            text,
            "{:<22} {episodes:>8} {done:>6} {:>12} {:>10.0} {:>11}",
            "all",
            "",
            self.seconds() * self.sample_rate,
            if reference > 0.0 {
                format!("{reference:.0}")
            } else {
                "-".to_owned()
            },
        );
        self.resources(plan, out, workers, &mut text);
        text
    }

    /// Workers whose running recordings fit into `free` bytes, at least 1.
    #[must_use]
    pub fn workers_in(&self, free: u64) -> usize {
        let each = PIPELINES as f64 * self.largest();
        ((free as f64 / each.max(1.0)) as usize).max(1)
    }

    /// Line with the needed and the free space of the folder for running recordings.
    #[must_use]
    pub fn scratch(&self, scratch: &Path, workers: usize) -> String {
        let need = (PIPELINES * workers) as f64 * self.largest();
        let free = free_disk(scratch).map_or_else(String::new, |free| {
            let short = if (free as f64) < need {
                ": NOT ENOUGH"
            } else {
                ""
            };
            format!(", {} free{short}", bytes(free as f64))
        });
        let place = if is_memory(scratch) {
            "in memory"
        } else {
            "on disk"
        };
        format!(
            "scratch   {} {place}, {}{free}",
            bytes(need),
            scratch.display()
        )
    }

    fn resources(&self, plan: &Plan, out: &Path, (workers, kept): (usize, f64), text: &mut String) {
        let host = Host::measure();
        let cameras: Vec<String> = camera_words(plan.scenario());
        let _ = writeln!(
            text,
            "cameras   {} ({} depth)",
            if cameras.is_empty() {
                "none".to_owned()
            } else {
                cameras.join(", ")
            },
            plan.depth.name()
        );
        let _ = writeln!(text, "folder    {}", out.display());
        let free = free_disk(out).map_or_else(String::new, |free| {
            let short = if (free as f64) < self.bytes_left() {
                ": NOT ENOUGH"
            } else {
                ""
            };
            format!(", {} free{short}", bytes(free as f64))
        });
        let _ = writeln!(
            text,
            "disk      {} to write{free}",
            bytes(self.bytes_left())
        );
        let needed = (worker_bytes(plan) + kept) * workers as f64;
        let memory = host.memory.map_or_else(String::new, |free| {
            let short = if (free as f64) < needed {
                ": NOT ENOUGH"
            } else {
                ""
            };
            format!(" of {} free{short}", bytes(free as f64))
        });
        let _ = writeln!(
            text,
            "workers   {workers}, on {} cores, {} of memory{memory}",
            host.cores,
            bytes(needed),
        );
        let (factor, measured) = self.factor;
        let _ = writeln!(
            text,
            "time      {} at {factor:.2}x real time per worker ({})",
            duration(self.seconds_left() / (factor * workers as f64)),
            if measured {
                "measured in the folder"
            } else {
                "a guess: make one episode and run this again"
            }
        );
    }
}

/// Bytes as text with a unit.
#[must_use]
pub fn bytes(value: f64) -> String {
    match value {
        v if v >= 1e12 => format!("{:.1} TB", v * 1e-12),
        v if v >= 1e9 => format!("{:.1} GB", v * 1e-9),
        v => format!("{:.0} MB", v * 1e-6),
    }
}

/// A duration as text with units.
#[must_use]
pub fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    let (hours, minutes) = (whole / 3600, whole / 60 % 60);
    match whole {
        0..60 => format!("{whole} s"),
        60..3600 => format!("{minutes} min {:02} s", whole % 60),
        _ => format!("{hours} h {minutes:02} min"),
    }
}

/// Checks `left` bytes against the `free` ones of a disk.
fn fits(out: &Path, left: f64, free: Option<u64>) -> anyhow::Result<()> {
    match free {
        Some(free) if (free as f64) < left => anyhow::bail!(
            "the disk of {} is too small: the files need {}, {} are free; free some space, \
             choose another folder with --out, or make a part with --shard",
            out.display(),
            bytes(left),
            bytes(free as f64)
        ),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collect::episode::episodes;

    const PLAN: &str = "name = \"x\"\n[[scenario.cameras]]\nname = \"gen3\"\nwidth = 100\nheight = 100\n[[task]]\nname = \"a\"\nepisodes = 4\nseconds = 10\nreference_samples = 50\n[[task]]\nname = \"b\"\nepisodes = 2\n";

    #[test]
    fn full_disk_is_an_error_with_both_sizes() {
        let out = Path::new("data/x");
        assert!(fits(out, 5e9, Some(6_000_000_000)).is_ok());
        assert!(fits(out, 5e9, None).is_ok());
        let error = fits(out, 5e9, Some(4_000_000_000)).unwrap_err().to_string();
        assert!(error.contains("data/x is too small"), "{error}");
        assert!(
            error.contains(&bytes(5e9)) && error.contains(&bytes(4e9)),
            "{error}"
        );
    }

    #[test]
    fn estimate_uses_the_best_known_duration() {
        let plan = Plan::parse("p.toml".as_ref(), PLAN.to_owned()).unwrap();
        let all = episodes(&plan);
        let plain = estimate(&plan, &all, &Ledger::default(), &BTreeMap::new());
        assert_eq!(plain.seconds(), 4.0 * 10.0 + 2.0 * SECONDS);
        assert_eq!(plain.byte_rate, 10.0 * 10_000.0 * 2.0 + STATE_BYTES);
        let evaluated = BTreeMap::from([("b".to_owned(), (5.0, 0.5))]);
        let better = estimate(&plan, &all, &Ledger::default(), &evaluated);
        assert_eq!(better.seconds(), 50.0);
        assert_eq!(better.seconds_left(), 4.0 * 10.0 + 2.0 * 5.0 / 0.5);
        let table = better.table(&plan, Path::new("/"), (2, 0.0));
        assert!(table.contains("        500         200"), "{table}");
        assert!(table.contains("wheelarm evaluate"), "{table}");
    }

    #[test]
    fn durations_are_readable() {
        assert_eq!(duration(59.4), "59 s");
        assert_eq!(duration(61.0), "1 min 01 s");
        assert_eq!(duration(7260.0), "2 h 01 min");
    }
}
