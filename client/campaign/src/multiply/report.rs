//! Report of a run: counts, reasons of failures, used sources.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use serde::Serialize;

use super::args::MultiplyArgs;
use super::entry::Entry;
use super::sources::Sources;

/// Report of a run; `report.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Task.
    pub task: String,
    /// Tried scenes, including those of an interrupted run.
    pub tried: u64,
    /// Episodes that were kept.
    pub kept: u64,
    /// Count of episodes by failure.
    pub failures: BTreeMap<String, u64>,
    /// By source: scenes in which it was adapted, and episodes that were kept.
    pub sources: BTreeMap<String, [u64; 2]>,
    /// Skipped sources with reasons.
    pub left_out: Vec<(String, String)>,
    /// Seed of the choice among the sources and of the noise.
    pub seed: u64,
    /// Deviation of the hand, metres.
    pub noise: f64,
    /// Disturbances, as `--disturb`.
    pub disturb: Option<String>,
    /// Wall seconds of this run.
    pub wall_seconds: f64,
    /// Number of attempts.
    pub episodes: Vec<Entry>,
}

impl Report {
    /// The report of all `entries`.
    pub(super) fn new(
        args: &MultiplyArgs,
        sources: &Sources,
        mut entries: Vec<Entry>,
        wall: Duration,
    ) -> Self {
        entries.sort_by_key(|entry| entry.seed);
        let mut failures = BTreeMap::new();
        let names = sources.list.iter().map(|one| (one.source.clone(), [0, 0]));
        let mut by_source: BTreeMap<String, [u64; 2]> = names.collect();
        for entry in &entries {
            if !entry.kept {
                *failures.entry(entry.end.clone()).or_insert(0) += 1;
            }
            if !entry.source.is_empty() {
                let counts = by_source.entry(entry.source.clone()).or_default();
                counts[0] += 1;
                counts[1] += u64::from(entry.kept);
            }
        }
        Self {
            task: args.task.clone(),
            tried: entries.len() as u64,
            kept: entries.iter().filter(|entry| entry.kept).count() as u64,
            failures,
            sources: by_source,
            left_out: sources.left_out.clone(),
            seed: args.seed,
            noise: args.noise,
            disturb: args.disturb.map(|disturb| disturb.text()),
            wall_seconds: wall.as_secs_f64(),
            episodes: entries,
        }
    }

    /// Writes the report.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        let path = folder.join("report.json");
        let text = serde_json::to_string_pretty(self)?;
        std::fs::write(&path, text + "\n").with_context(|| format!("writing {}", path.display()))
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = 100.0 * self.kept as f64 / self.tried.max(1) as f64;
        writeln!(
            f,
            "{}: {} of {} kept ({share:.0} %), this run took {:.0} s",
            self.task, self.kept, self.tried, self.wall_seconds
        )?;
        for (end, count) in &self.failures {
            writeln!(f, "  {count:>4}  {end}")?;
        }
        for (source, [tried, kept]) in &self.sources {
            writeln!(f, "  {source}: {kept} of {tried}")?;
        }
        Ok(())
    }
}
