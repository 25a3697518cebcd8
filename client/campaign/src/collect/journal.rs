//! The journals of a dataset: an [`EpisodeLog`] per shard, and their union.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::{Deserialize, Serialize};
use wheelarm_dataset::publish;
use wheelarm_rollout::{EpisodeLog, FailureCause, LogEntry, read_log};

use super::episode::Shard;
use super::failure_analysis::Loss;

/// One line of a journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Entry {
    /// An episode is in the dataset.
    Done(Box<Done>),
    /// An attempt failed, at the task or because something broke.
    Failed(Failed),
}

/// An episode that is in the dataset.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Done {
    /// Name of the episode.
    pub episode: String,
    /// Task.
    pub task: String,
    /// The attempt that succeeded, from 0.
    pub attempt: u32,
    /// Its seed.
    pub seed: u64,
    /// Settings that the plan fixed.
    pub settings: String,
    /// The file, relative to the dataset's folder.
    pub file: String,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// The task's required conditions held at the end.
    pub success: bool,
    /// The instruction sentence.
    pub instruction: String,
    /// Simulated seconds.
    pub seconds: f64,
    /// Wall seconds of its worker, with the start of the programs and without the finishing
    /// of the file, during which the next episode runs.
    pub wall_seconds: f64,
    /// Samples of every stream (count).
    pub counts: BTreeMap<String, u64>,
    /// Samples that were published and are not in the file (count).
    pub missed: u64,
    /// When it was finished, Unix milliseconds.
    pub finished_unix_millis: u64,
    /// Whether the first image of a camera shows the target; absent where unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_in_first_images: Option<bool>,
    /// Server version and graphics adapter.
    pub origin: [String; 2],
    /// The scenario with the sampled values.
    pub scenario: serde_json::Value,
}

/// An attempt that failed, at the task or because something broke.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failed {
    /// Name of the episode.
    pub episode: String,
    /// Task.
    pub task: String,
    /// The attempt, from 0.
    pub attempt: u32,
    /// Its seed.
    pub seed: u64,
    /// Settings that the plan fixed.
    pub settings: String,
    /// Reason of the failure.
    pub reason: String,
    /// Simulated seconds.
    pub seconds: f64,
    /// Wall seconds.
    pub wall_seconds: f64,
    /// Cause, if the episode broke; absent when the task failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub broken: Option<FailureCause>,
    /// Number of the server of this attempt that died or hung, from 1; 0 when none did.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub death: u32,
    /// Of a kept recording: cause and tick of the loss.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss: Option<Box<Loss>>,
    /// Scenario that reproduces a broken episode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<serde_json::Value>,
}

fn is_zero(count: &u32) -> bool {
    *count == 0
}

/// Runs of the same attempt when its server dies or hangs. A second death is attributed to
/// the scenario, and the next attempt has a new seed.
pub const DEATHS: u32 = 2;

/// The journals of a dataset taken together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ledger {
    /// By episode name.
    pub done: BTreeMap<String, Done>,
    /// By episode name, in the order of the attempts.
    pub failed: BTreeMap<String, Vec<Failed>>,
    /// Lines that cannot be read, most likely truncated by a power loss during a
    /// write: journal and line number from 1. Their content is unknown.
    pub torn: Vec<(PathBuf, usize)>,
}

impl Ledger {
    /// Reads every journal of `folder`; a folder that is absent is empty.
    ///
    /// # Errors
    /// When a journal exists but cannot be read.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        let mut files: Vec<_> = match std::fs::read_dir(folder) {
            Ok(entries) => entries.flatten().map(|entry| entry.path()).collect(),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Vec::new(),
            Err(e) => return Err(e).with_context(|| format!("reading {}", folder.display())),
        };
        files.retain(|file| file.extension().is_some_and(|e| e == "jsonl"));
        files.sort();
        let mut ledger = Self::default();
        for file in files {
            let (entries, cut) = read_log(&file)?;
            entries.into_iter().for_each(|entry| ledger.add(entry));
            ledger
                .torn
                .extend(cut.into_iter().map(|line| (file.clone(), line)));
        }
        Ok(ledger)
    }

    /// Adds an entry. The newest entry of an episode counts, because an episode whose file
    /// is lost is repeated.
    pub fn add(&mut self, entry: Entry) {
        match entry {
            Entry::Done(done) => {
                let known = self.done.get(&done.episode);
                if known.is_none_or(|k| k.finished_unix_millis <= done.finished_unix_millis) {
                    self.done.insert(done.episode.clone(), *done);
                }
            }
            Entry::Failed(failed) => {
                if !self.knows(&failed) {
                    let attempts = self.failed.entry(failed.episode.clone()).or_default();
                    attempts.push(failed);
                    attempts.sort_by_key(|a| (a.attempt, a.death == 0, a.death));
                }
            }
        }
    }

    /// Whether a failure has an entry in this journal or another.
    #[must_use]
    pub fn knows(&self, failed: &Failed) -> bool {
        let attempts = self.failed.get(&failed.episode);
        attempts.is_some_and(|attempts| {
            let mut attempts = attempts.iter();
            attempts.any(|a| (a.attempt, a.death) == (failed.attempt, failed.death))
        })
    }

    /// Number of the next attempt at an episode, and how often a server died or
    /// hung in it so far.
    #[must_use]
    pub fn next_attempt(&self, episode: &str) -> (u32, u32) {
        let attempts = self.failed.get(episode);
        match attempts.and_then(|attempts| attempts.last()) {
            None => (0, 0),
            Some(last) if (1..DEATHS).contains(&last.death) => (last.attempt, last.death),
            Some(last) => (last.attempt + 1, 0),
        }
    }
}

/// The journal of one shard.
pub type Journal = EpisodeLog<Entry>;

impl LogEntry for Entry {
    const COMMAND: &'static str = "collect";
    const OTHER_LOG: &'static str = "--shard or --out";

    /// Every line counts: [`Ledger`] puts them together.
    fn replaces(&self, _: &Self) -> bool {
        false
    }
}

/// Opens the journal of `shard` in `folder`, or makes it.
///
/// # Errors
/// When another process works on this shard, or the file cannot be used.
pub fn open(folder: &Path, shard: Shard) -> anyhow::Result<Journal> {
    open_named(folder, &format!("shard-{}-of-{}", shard.index, shard.count))
}

/// Opens the journal called `name` in `folder`, or makes it.
///
/// # Errors
/// As [`open`].
pub fn open_named(folder: &Path, name: &str) -> anyhow::Result<Journal> {
    EpisodeLog::open(&folder.join(format!("{name}.jsonl")), publish::sync_data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failed(attempt: u32) -> Failed {
        Failed {
            episode: "a-0000".into(),
            task: "a".into(),
            attempt,
            seed: 0,
            settings: String::new(),
            reason: "dropped".into(),
            seconds: 1.0,
            wall_seconds: 1.0,
            broken: None,
            loss: None,
            death: 0,
            scenario: None,
        }
    }

    #[test]
    fn attempt_is_repeated_once_after_a_server_death() {
        let died = |attempt: u32, death: u32| {
            Entry::Failed(Failed {
                broken: Some(FailureCause::Server),
                death,
                ..failed(attempt)
            })
        };
        let mut ledger = Ledger::default();
        assert_eq!(ledger.next_attempt("a-0000"), (0, 0));
        ledger.add(died(0, 1));
        // A second journal may have the same entry.
        ledger.add(died(0, 1));
        assert_eq!(ledger.next_attempt("a-0000"), (0, 1));
        let mut failed_then = ledger.clone();
        failed_then.add(Entry::Failed(failed(0)));
        assert_eq!(failed_then.next_attempt("a-0000"), (1, 0));
        ledger.add(died(0, 2));
        assert_eq!(ledger.next_attempt("a-0000"), (1, 0));
        assert_eq!(ledger.failed["a-0000"].len(), 2, "each is in the ledger");
    }

    #[test]
    fn journals_of_earlier_versions_are_read_and_resumed() {
        let text = include_str!("../../../../tests/data/episode-logs/collect.jsonl");
        let mut ledger = Ledger::default();
        for entry in crate::earlier_logs::resumed(text) {
            ledger.add(entry);
        }
        assert_eq!(ledger.done["pick_mustard-0000"].attempt, 0);
        let failed = &ledger.failed["pick_mustard-0001"];
        assert_eq!(failed[0].broken, Some(FailureCause::Server));
        assert_eq!((failed[0].death, failed[1].death), (1, 0));
        assert_eq!(ledger.next_attempt("pick_mustard-0001"), (2, 0));
    }

    #[test]
    fn truncated_journal_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let journal = open(folder.path(), Shard::WHOLE).unwrap();
        journal.append(&Entry::Failed(failed(0))).unwrap();
        drop(journal);
        let path = folder.path().join("shard-0-of-1.jsonl");
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, [&whole[..], &whole[..whole.len() / 2]].concat()).unwrap();
        let torn = Ledger::read(folder.path()).unwrap().torn;
        assert_eq!(torn, [(path.clone(), 2)]);
        let journal = open(folder.path(), Shard::WHOLE).unwrap();
        let error = open(folder.path(), Shard::WHOLE).unwrap_err().to_string();
        assert!(error.contains("--shard or --out"), "{error}");
        journal.append(&Entry::Failed(failed(1))).unwrap();
        let ledger = Ledger::read(folder.path()).unwrap();
        assert_eq!(ledger.next_attempt("a-0000"), (2, 0));
        assert_eq!(ledger.torn, []);
    }
}
