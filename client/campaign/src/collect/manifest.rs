//! Content of a dataset, as `manifest.json` and `report.md`, made from its journals.

use std::fmt::Write;
use wheelarm_proto::StreamId;

use serde::Serialize;

use super::episode::Episode;
use super::estimate::{bytes, duration};
use super::folder::{Folder, write_whole};
use super::journal::{Done, Failed, Ledger};

/// Content of a dataset.
#[derive(Clone, Debug, Serialize)]
pub struct Manifest {
    /// Always `wheelarm manifest`.
    pub format: &'static str,
    /// Version of this layout.
    pub version: u32,
    /// Name of the dataset.
    pub name: String,
    /// Whether every episode of the plan exists.
    pub complete: bool,
    /// Episodes of the plan (count).
    pub planned: usize,
    /// Simulated seconds of all episodes.
    pub seconds: f64,
    /// Size of all files, bytes.
    pub bytes: u64,
    /// The episodes, in the order of the plan.
    pub episodes: Vec<Done>,
    /// Missing episodes of the plan.
    pub missing: Vec<String>,
    /// Failed attempts, which are not in the dataset; kept recordings with tick and cause
    /// of the loss.
    pub failed_attempts: Vec<Failed>,
}

impl Manifest {
    /// The manifest of the episodes of a plan.
    #[must_use]
    pub fn new(name: &str, episodes: &[Episode], ledger: &Ledger) -> Self {
        let there = |e: &&Episode| ledger.done.contains_key(&e.id);
        let done: Vec<Done> = episodes
            .iter()
            .filter_map(|e| ledger.done.get(&e.id).cloned())
            .collect();
        let missing: Vec<String> = episodes
            .iter()
            .filter(|e| !there(e))
            .map(|e| e.id.clone())
            .collect();
        let failed = episodes.iter().filter_map(|e| ledger.failed.get(&e.id));
        Self {
            format: "wheelarm manifest",
            version: 1,
            name: name.to_owned(),
            complete: missing.is_empty(),
            planned: episodes.len(),
            seconds: done.iter().map(|d| d.seconds).sum(),
            bytes: done.iter().map(|d| d.bytes).sum(),
            episodes: done,
            missing,
            failed_attempts: failed.flatten().cloned().collect(),
        }
    }

    /// Writes both files into the dataset's folder.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Folder) -> anyhow::Result<()> {
        let json = serde_json::to_vec_pretty(self)?;
        write_whole(&folder.root().join("manifest.json"), &json)?;
        write_whole(&folder.root().join("report.md"), self.report().as_bytes())
    }

    /// Summary in one line.
    #[must_use]
    pub fn line(&self) -> String {
        format!(
            "{} of {} episodes, {} simulated, {}, {} failed attempts{}",
            self.episodes.len(),
            self.planned,
            duration(self.seconds),
            bytes(self.bytes as f64),
            self.failed_attempts.len(),
            if self.complete {
                ": complete"
            } else {
                ": NOT complete"
            }
        )
    }

    /// The report in Markdown.
    #[must_use]
    pub fn report(&self) -> String {
        let mut text = format!("# {}\n\n{}\n\n", self.name, self.line());
        text.push_str("| task | episodes | missing | failed attempts | mean s | images | samples |\n|---|---|---|---|---|---|---|\n");
        for task in self.tasks() {
            let of = || self.episodes.iter().filter(|d| d.task == task);
            let count = of().count();
            let seconds: f64 = of().map(|d| d.seconds).sum();
            let sum = |of_cameras: bool| -> u64 {
                let counts = of().flat_map(|d| &d.counts);
                counts
                    .filter(|(stream, _)| StreamId::parse(stream).is_camera() == of_cameras)
                    .map(|(_, count)| count)
                    .sum()
            };
            let missing = self.missing.iter().filter(|id| task_of(id) == task).count();
            let failed = self
                .failed_attempts
                .iter()
                .filter(|f| f.task == task)
                .count();
            // Writing into a string cannot fail.
            let _ = writeln!(
                text,
                "| {task} | {count} | {missing} | {failed} | {:.1} | {} | {} |",
                seconds / (count.max(1)) as f64,
                sum(true),
                sum(false)
            );
        }
        if !self.missing.is_empty() {
            let _ = writeln!(text, "\nMissing: {}", self.missing.join(", "));
        }
        if !self.failed_attempts.is_empty() {
            text.push_str("\n## Failed attempts, which are not in the dataset\n\n");
        }
        for failed in &self.failed_attempts {
            let _ = writeln!(
                text,
                "- {} attempt {}, seed {}, after {:.1} s: {}{}",
                failed.episode,
                failed.attempt,
                failed.seed,
                failed.seconds,
                failed.reason,
                failed.loss.as_ref().map_or(String::new(), |loss| format!(
                    "; {}: {} from tick {}",
                    loss.file,
                    loss.cause.word(),
                    loss.tick
                ))
            );
        }
        text
    }

    /// Tasks with done or missing episodes, in the order of the plan.
    fn tasks(&self) -> Vec<&str> {
        let done = self.episodes.iter().map(|d| d.task.as_str());
        let missing = self.missing.iter().map(|id| task_of(id));
        let mut tasks: Vec<&str> = Vec::new();
        for task in done.chain(missing) {
            if !tasks.contains(&task) {
                tasks.push(task);
            }
        }
        tasks
    }
}

/// The task in an episode's name `TASK-NNNN`.
fn task_of(id: &str) -> &str {
    id.rsplit_once('-').map_or(id, |(task, _)| task)
}
