//! Results as they come, one JSON object per line. A line that was cut off by an
//! interruption is left out, and what it told of is done again.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use parking_lot::Mutex;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// One result.
pub trait Line: Clone + Serialize + DeserializeOwned {
    /// The command that writes it, for people.
    const COMMAND: &'static str;

    /// Whether it is of the same thing, so that the newest word counts.
    fn is_of_the_same(&self, known: &Self) -> bool;
}

/// The file of results.
pub struct Ledger<L> {
    path: PathBuf,
    inner: Mutex<(File, Vec<L>)>,
}

impl<L: Line> Ledger<L> {
    /// Opens the ledger of a folder, or makes it.
    ///
    /// # Errors
    /// When the file cannot be read or written, or another command is at it.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join("episodes.jsonl");
        let context = || format!("opening {}", path.display());
        let mut file = OpenOptions::new()
            .create(true)
            .read(true)
            .append(true)
            .open(&path)
            .with_context(context)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => bail!(
                "another `wheelarm {}` writes {}; wait for its end, or take another --out",
                L::COMMAND,
                path.display()
            ),
            // Some network file systems know no locks.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        let mut text = Vec::new();
        file.read_to_end(&mut text).with_context(context)?;
        let mut entries = Vec::new();
        // A line that was cut may end in the middle of a character.
        for entry in text
            .split(|byte| *byte == b'\n')
            .filter_map(|line| serde_json::from_slice(line).ok())
        {
            take(&mut entries, entry);
        }
        if !text.is_empty() && !text.ends_with(b"\n") {
            file.write_all(b"\n").with_context(context)?;
        }
        Ok(Self {
            path,
            inner: Mutex::new((file, entries)),
        })
    }

    /// Everything that is in it.
    #[must_use]
    pub fn entries(&self) -> Vec<L> {
        self.inner.lock().1.clone()
    }

    /// Removes the results that `is_old` says, where there are any, and keeps a copy of the
    /// whole file of before; its path.
    ///
    /// # Errors
    /// When the copy or the file cannot be written.
    pub fn set_aside(&self, is_old: impl Fn(&L) -> bool) -> anyhow::Result<Option<PathBuf>> {
        let mut inner = self.inner.lock();
        if !inner.1.iter().any(&is_old) {
            return Ok(None);
        }
        let context = || format!("writing {}", self.path.display());
        let name = |number: u32| self.path.with_file_name(format!("episodes-{number}.jsonl"));
        let free = (1..).map(name).find(|path| !path.exists());
        let aside = free.context("no free name for the results of before")?;
        std::fs::copy(&self.path, &aside)
            .with_context(|| format!("writing {}", aside.display()))?;
        inner.1.retain(|line| !is_old(line));
        let mut text = String::new();
        for line in &inner.1 {
            text += &serde_json::to_string(line)?;
            text.push('\n');
        }
        inner.0.set_len(0).with_context(context)?;
        inner.0.write_all(text.as_bytes()).with_context(context)?;
        Ok(Some(aside))
    }

    /// Appends one result.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn add(&self, entry: &L) -> anyhow::Result<()> {
        let mut line = serde_json::to_string(entry)?;
        line.push('\n');
        let mut inner = self.inner.lock();
        // In one piece, so that two processes do not mix their lines.
        inner
            .0
            .write_all(line.as_bytes())
            .with_context(|| format!("writing {}", self.path.display()))?;
        take(&mut inner.1, entry.clone());
        Ok(())
    }
}

/// The newest word of the same thing counts.
fn take<L: Line>(lines: &mut Vec<L>, line: L) {
    lines.retain(|known| !line.is_of_the_same(known));
    lines.push(line);
}
