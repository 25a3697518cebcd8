//! What has been done: an append-only file of JSON lines per shard, each line
//! on the disk before anybody believes it.
//!
//! A last line that a crash cut short is left out, and dropped when the next one
//! is written. Nothing else is ever rewritten.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use wheelarm_dataset::publish;

use super::episode::Shard;
use super::loss::Loss;
use crate::broken::Broken;

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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Done {
    /// Name of the episode.
    pub episode: String,
    /// Task.
    pub task: String,
    /// The attempt that succeeded, from 0.
    pub attempt: u32,
    /// Its seed.
    pub seed: u64,
    /// What the plan fixed about it.
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
    /// Wall seconds of its worker: the start of the programs is in them, the
    /// finishing of the file is not, for the next episode runs meanwhile.
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
    /// The scenario with the drawn values.
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
    /// What the plan fixed about the episode.
    pub settings: String,
    /// Why it failed.
    pub reason: String,
    /// Simulated seconds.
    pub seconds: f64,
    /// Wall seconds.
    pub wall_seconds: f64,
    /// What broke; absent when it was the task that failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub broken: Option<Broken>,
    /// Which server of this attempt it was that died or hung, from 1; 0 when
    /// none did.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub death: u32,
    /// Of a kept recording: why the episode was lost, and from when on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss: Option<Box<Loss>>,
    /// Where something broke, the scenario that reproduces it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<serde_json::Value>,
}

fn is_zero(count: &u32) -> bool {
    *count == 0
}

/// Runs of the same attempt when its server dies or hangs: what happens twice
/// is taken for the scenario's fault, and the next attempt has a fresh seed.
pub const DEATHS: u32 = 2;

/// The journals of a dataset taken together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ledger {
    /// By episode name.
    pub done: BTreeMap<String, Done>,
    /// By episode name, in the order of the attempts.
    pub failed: BTreeMap<String, Vec<Failed>>,
    /// Lines that cannot be read, most likely cut by a power loss in the middle
    /// of a write: journal and line from 1. What they said is not known.
    pub torn: Vec<(PathBuf, usize)>,
}

impl Ledger {
    /// Reads every journal of `folder`; a folder that is absent is empty.
    ///
    /// # Errors
    /// When a journal is there but cannot be read.
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
            let text = std::fs::read(&file)
                .with_context(|| format!("reading the journal {}", file.display()))?;
            for (at, line) in text.split(|byte| *byte == b'\n').enumerate() {
                if line.is_empty() {
                    continue;
                }
                match serde_json::from_slice(line) {
                    Ok(entry) => ledger.add(entry),
                    Err(_) => ledger.torn.push((file.clone(), at + 1)),
                }
            }
        }
        Ok(ledger)
    }

    /// Takes one more entry. An episode whose file got lost is made again: the
    /// newest word counts.
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

    /// Whether a failure has been told, by this journal or by another.
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

/// The journal of one shard, open for appending and locked.
#[derive(Debug)]
pub struct Journal {
    file: File,
    /// Length of what is whole, bytes, where a line that was cut follows it.
    whole: Option<u64>,
}

impl Journal {
    /// Opens the journal of `shard` in `folder`, or makes it.
    ///
    /// # Errors
    /// When another process works on this shard, or the file cannot be used.
    pub fn open(folder: &Path, shard: Shard) -> anyhow::Result<Self> {
        Self::open_named(folder, &format!("shard-{}-of-{}", shard.index, shard.count))
    }

    /// Opens the journal called `name` in `folder`, or makes it.
    ///
    /// # Errors
    /// As [`Journal::open`].
    pub fn open_named(folder: &Path, name: &str) -> anyhow::Result<Self> {
        let path = folder.join(format!("{name}.jsonl"));
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .read(true)
            .open(&path)
            .with_context(|| format!("opening the journal {}", path.display()))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!(
                "another `wheelarm collect` writes {}; wait for its end, or take another --shard or --out",
                path.display()
            ),
            // Some network file systems know no locks.
            Err(TryLockError::Error(e)) => {
                tracing::warn!(
                    "{} cannot be locked ({e}); see to it that no shard runs twice",
                    path.display()
                );
            }
        }
        let mut text = Vec::new();
        file.read_to_end(&mut text)
            .with_context(|| format!("reading the journal {}", path.display()))?;
        let last = text.rsplit(|byte| *byte == b'\n').next();
        let mut whole = None;
        if let Some(last) = last.filter(|last| !last.is_empty()) {
            if serde_json::from_slice::<Entry>(last).is_ok() {
                // Its end alone is missing.
                file.write_all(b"\n").context("writing the journal")?;
            } else {
                whole = Some((text.len() - last.len()) as u64);
            }
        }
        Ok(Self { file, whole })
    }

    /// Appends an entry; it is on the disk afterwards.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn append(&mut self, entry: &Entry) -> anyhow::Result<()> {
        let mut line = serde_json::to_vec(entry)?;
        line.push(b'\n');
        let mut cut = self.whole.take().into_iter();
        // A line that was cut must not swallow this one.
        cut.try_for_each(|whole| self.file.set_len(whole))
            .and_then(|()| self.file.write_all(&line))
            .and_then(|()| publish::sync_data(&self.file))
            .context("writing the journal; is the disk full?")
    }
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
    fn a_server_that_died_once_has_its_attempt_tried_once_more() {
        let died = |attempt: u32, death: u32| {
            Entry::Failed(Failed {
                broken: Some(Broken::Server),
                death,
                ..failed(attempt)
            })
        };
        let mut ledger = Ledger::default();
        assert_eq!(ledger.next_attempt("a-0000"), (0, 0));
        ledger.add(died(0, 1));
        // A second journal may say the same.
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
    fn a_line_cut_short_is_ignored_and_swallows_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = Journal::open(folder.path(), Shard::WHOLE).unwrap();
        journal.append(&Entry::Failed(failed(0))).unwrap();
        drop(journal);
        let path = folder.path().join("shard-0-of-1.jsonl");
        let whole = std::fs::read(&path).unwrap();
        for cut in 1..whole.len() {
            let torn = [&whole[..], &whole[..cut]].concat();
            std::fs::write(&path, torn).unwrap();
            let torn = Ledger::read(folder.path()).unwrap().torn;
            let is_torn = cut < whole.len() - 1;
            assert_eq!(torn.len(), usize::from(is_torn), "cut at {cut}");
            let mut journal = Journal::open(folder.path(), Shard::WHOLE).unwrap();
            journal.append(&Entry::Failed(failed(1))).unwrap();
            let ledger = Ledger::read(folder.path()).unwrap();
            assert_eq!(ledger.next_attempt("a-0000"), (2, 0), "cut at {cut}");
            assert_eq!(ledger.torn, [], "cut at {cut}: it is dropped");
        }
    }

    #[test]
    fn a_shard_is_made_by_one_process_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let first = Journal::open(folder.path(), Shard::WHOLE).unwrap();
        let problem = Journal::open(folder.path(), Shard::WHOLE).unwrap_err();
        assert!(problem.to_string().contains("another"), "{problem}");
        drop(first);
        Journal::open(folder.path(), Shard::WHOLE).unwrap();
    }
}
