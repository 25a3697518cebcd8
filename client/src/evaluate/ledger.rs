//! The results as they come, one JSON object per line. A line that was cut off
//! by an interruption is left out, and its episode is done again.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use parking_lot::Mutex;

use super::entry::Entry;

/// The file of results.
pub struct Ledger {
    path: PathBuf,
    inner: Mutex<(File, Vec<Entry>)>,
}

impl Ledger {
    /// Opens the ledger of a folder, or makes it.
    ///
    /// # Errors
    /// When the file cannot be read or written.
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
                "another `wheelarm evaluate` writes {}; wait for its end, or take another --out",
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
    pub fn entries(&self) -> Vec<Entry> {
        self.inner.lock().1.clone()
    }

    /// Appends one result.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn add(&self, entry: &Entry) -> anyhow::Result<()> {
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

/// Of an episode that was done again the newest word counts.
fn take(entries: &mut Vec<Entry>, entry: Entry) {
    let of = |e: &Entry| {
        let job = (e.task.clone(), e.seed, e.settings.clone());
        (job, e.policy.clone())
    };
    let new = of(&entry);
    entries.retain(|known| of(known) != new);
    entries.push(entry);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::broken::Broken;

    #[test]
    fn a_cut_line_is_left_out_and_the_rest_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let entry = |seed| Entry {
            task: "pick_mustard".to_owned(),
            seed,
            settings: String::new(),
            policy: String::new(),
            label: None,
            thinking: None,
            success: true,
            why: String::new(),
            end: String::new(),
            course: None,
            conditions: Vec::new(),
            seconds: 16.5,
            factor: 8.0,
            hash: "00".to_owned(),
            notes: Vec::new(),
            broken: None,
            scenario: None,
        };
        let ledger = Ledger::open(folder.path()).unwrap();
        ledger.add(&entry(0)).unwrap();
        ledger.add(&entry(1)).unwrap();
        drop(ledger);
        let path = folder.path().join("episodes.jsonl");
        let text = std::fs::read_to_string(&path).unwrap();
        // In the middle of a character, too.
        let cut = [text.as_bytes(), "{\"task\": \"90°".as_bytes()].concat();
        std::fs::write(&path, &cut[..cut.len() - 1]).unwrap();
        let ledger = Ledger::open(folder.path()).unwrap();
        assert_eq!(ledger.entries(), [entry(0), entry(1)]);
        drop(ledger);
        std::fs::write(&path, &text[..text.len() - 9]).unwrap();
        let ledger = Ledger::open(folder.path()).unwrap();
        assert_eq!(ledger.entries(), [entry(0)]);
        // Nobody else writes meanwhile.
        let told = Ledger::open(folder.path()).err().unwrap().to_string();
        assert!(told.contains("another `wheelarm evaluate`"), "{told}");
        drop(ledger);
        let with = |entry: &Entry| {
            Ledger::open(folder.path()).unwrap().add(entry).unwrap();
            Ledger::open(folder.path()).unwrap().entries()
        };
        assert_eq!(with(&entry(2)), [entry(0), entry(2)]);
        let broken = Entry {
            success: false,
            broken: Some(Broken::Server),
            ..entry(0)
        };
        let again = with(&broken);
        assert_eq!(again, [entry(2), broken.clone()], "the newest word counts");
        let elsewhere = Entry {
            settings: "starts=anywhere".to_owned(),
            ..entry(2)
        };
        assert_eq!(
            with(&elsewhere),
            [entry(2), broken.clone(), elsewhere.clone()],
            "other starts are another episode"
        );
        let policy = Entry {
            policy: "act".to_owned(),
            ..entry(2)
        };
        assert_eq!(
            with(&policy),
            [entry(2), broken, elsewhere, policy],
            "another policy's is another episode"
        );
    }
}
