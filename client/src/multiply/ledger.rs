//! What was tried, one JSON object per line, so that an interrupted run is resumed.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use parking_lot::Mutex;
use serde::{Deserialize, Serialize};

/// What came of one try.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Seed of the scene.
    pub seed: u64,
    /// The task succeeded and the file is there.
    pub kept: bool,
    /// The episode whose demonstration was adapted; empty where none could be.
    pub source: String,
    /// How it ended, in a word or two.
    pub end: String,
    /// Why it failed, in words.
    pub why: String,
    /// Label of its file.
    pub label: String,
    /// Simulated seconds.
    pub seconds: f64,
    /// Wall seconds.
    pub wall_seconds: f64,
    /// What the operator noted.
    pub notes: Vec<String>,
}

impl Entry {
    /// One line for people.
    #[must_use]
    pub fn line(&self) -> String {
        let source = match self.source.as_str() {
            "" => String::new(),
            source => format!(" as in {source}"),
        };
        match self.kept {
            true => format!("kept   seed {}{source}, {:.1} s", self.seed, self.seconds),
            false => format!("failed seed {}{source}: {}", self.seed, self.why),
        }
    }
}

/// The file of results.
pub struct Ledger {
    path: PathBuf,
    inner: Mutex<(File, Vec<Entry>)>,
}

impl Ledger {
    /// Opens the ledger of a folder, or makes it.
    ///
    /// # Errors
    /// When the file cannot be read or written, or another run is at it.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join("episodes.jsonl");
        let context = || format!("opening {}", path.display());
        let mut options = OpenOptions::new();
        let options = options.create(true).read(true).append(true);
        let mut file = options.open(&path).with_context(context)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => bail!(
                "another `wheelarm multiply` is at work in {}; wait for its end, or take another --out",
                folder.display()
            ),
            // Some network file systems know no locks.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).with_context(context)?;
        let text = String::from_utf8_lossy(&bytes);
        let lines = text.lines();
        let entries = lines.filter_map(|line| serde_json::from_str(line).ok());
        let entries = entries.collect();
        if !bytes.is_empty() && !bytes.ends_with(b"\n") {
            file.write_all(b"\n").with_context(context)?;
        }
        Ok(Self {
            path,
            inner: Mutex::new((file, entries)),
        })
    }

    /// Everything that is in it.
    #[must_use]
    pub fn entries(&self) -> Vec<Entry> {
        self.inner.lock().1.clone()
    }

    /// How many were kept.
    #[must_use]
    pub fn kept(&self) -> u64 {
        let inner = self.inner.lock();
        inner.1.iter().filter(|entry| entry.kept).count() as u64
    }

    /// Whether a seed was tried.
    #[must_use]
    pub fn knows(&self, seed: u64) -> bool {
        self.inner.lock().1.iter().any(|entry| entry.seed == seed)
    }

    /// Appends one result.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn add(&self, entry: &Entry) -> anyhow::Result<()> {
        let mut line = serde_json::to_string(entry)?;
        line.push('\n');
        let mut inner = self.inner.lock();
        let written = inner.0.write_all(line.as_bytes());
        written.with_context(|| format!("writing {}", self.path.display()))?;
        inner.1.push(entry.clone());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interrupted_run_knows_what_it_tried() {
        let folder = tempfile::tempdir().unwrap();
        let entry = |seed, kept| Entry {
            seed,
            kept,
            source: "one".to_owned(),
            end: "success".to_owned(),
            why: String::new(),
            label: format!("pick_bowl-multiplied-seed{seed}"),
            seconds: 15.0,
            wall_seconds: 2.0,
            notes: Vec::new(),
        };
        let ledger = Ledger::open(folder.path()).unwrap();
        ledger.add(&entry(5, true)).unwrap();
        ledger.add(&entry(6, false)).unwrap();
        let told = Ledger::open(folder.path()).err().unwrap().to_string();
        assert!(told.contains("another `wheelarm multiply`"), "{told}");
        drop(ledger);
        let again = Ledger::open(folder.path()).unwrap();
        assert_eq!(again.entries(), [entry(5, true), entry(6, false)]);
        assert!(again.kept() == 1 && again.knows(6) && !again.knows(7));
    }
}
