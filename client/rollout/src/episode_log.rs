//! Results of episodes as they arrive: an append-only file with one JSON object per
//! line, from which an interrupted command resumes.
//!
//! A crash can cut the last line short, and a bad disk can damage any line. Such a line is
//! reported ([`EpisodeLog::damage`]) and its episode is made again, so that no episode is
//! lost or counted twice. The next append removes a cut last line; no other line is ever
//! rewritten, except by [`EpisodeLog::set_aside`], which keeps a copy. A line that is valid
//! JSON and no entry is of another version of the program: the log is not opened, because
//! its episode would be made and counted again.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use parking_lot::Mutex;
use serde::Serialize;
use serde::de::{DeserializeOwned, IgnoredAny};

/// One line of a log.
pub trait LogEntry: Clone + Serialize + DeserializeOwned {
    /// Name of the command that writes the log.
    const COMMAND: &'static str;
    /// Options that name another log, for the error of a log that is in use.
    const OTHER_LOG: &'static str = "--out";

    /// Whether this entry takes the place of `known`, an earlier one of the same episode.
    fn replaces(&self, known: &Self) -> bool;
}

/// A log, open for appending and locked against other processes.
#[derive(Debug)]
pub struct EpisodeLog<E> {
    path: PathBuf,
    sync: fn(&File) -> io::Result<()>,
    inner: Mutex<Inner<E>>,
}

#[derive(Debug)]
struct Inner<E> {
    file: File,
    /// Lines that cannot be read, from 1.
    damaged: Vec<usize>,
    /// Length of the complete lines, bytes; set where a cut line follows them.
    complete: Option<u64>,
    entries: Vec<E>,
}

impl<E: LogEntry> EpisodeLog<E> {
    /// Opens the log at `path`, or creates it. `sync` writes the file's data to the disk.
    ///
    /// # Errors
    /// When another process has the log open, a line is of another version of the program, or
    /// the file cannot be read or written.
    pub fn open(path: &Path, sync: fn(&File) -> io::Result<()>) -> anyhow::Result<Self> {
        let context = || format!("opening {}", path.display());
        let mut file = OpenOptions::new()
            .create(true)
            .read(true)
            .append(true)
            .open(path)
            .with_context(context)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!(
                "another `wheelarm {}` writes {}; wait for its end, or use another {}",
                E::COMMAND,
                path.display(),
                E::OTHER_LOG
            ),
            // Some network file systems have no locks.
            Err(TryLockError::Error(problem)) => tracing::warn!(
                "{} cannot be locked ({problem}); run no second `wheelarm {}` on it",
                path.display(),
                E::COMMAND
            ),
        }
        let mut text = Vec::new();
        file.read_to_end(&mut text).with_context(context)?;
        let Parsed {
            entries: all,
            damaged,
            foreign,
        } = parse(&text);
        if let Some((line, why)) = foreign {
            bail!(
                "{}: line {line} is not an entry of this version of `wheelarm {}`: {why}; resume \
                 with the version that wrote it, or use another {}",
                path.display(),
                E::COMMAND,
                E::OTHER_LOG
            );
        }
        let mut entries = Vec::new();
        for entry in all {
            insert(&mut entries, entry);
        }
        let last = text
            .rsplit(|byte| *byte == b'\n')
            .next()
            .unwrap_or_default();
        let mut complete = None;
        if serde_json::from_slice::<E>(last).is_ok() {
            // Only the line's end is missing.
            file.write_all(b"\n").with_context(context)?;
        } else if !last.is_empty() {
            complete = Some((text.len() - last.len()) as u64);
        }
        Ok(Self {
            path: path.to_owned(),
            sync,
            inner: Mutex::new(Inner {
                file,
                damaged,
                complete,
                entries,
            }),
        })
    }

    /// All entries of the log, without those that others replaced.
    #[must_use]
    pub fn entries(&self) -> Vec<E> {
        self.inner.lock().entries.clone()
    }

    /// A warning for each line that could not be read when the log was opened.
    #[must_use]
    pub fn damage(&self) -> Vec<String> {
        let inner = self.inner.lock();
        let lines = inner.damaged.iter();
        lines.map(|line| damaged_line(&self.path, *line)).collect()
    }

    /// Appends an entry; it is on the disk when this returns.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn append(&self, entry: &E) -> anyhow::Result<()> {
        let mut line = serde_json::to_vec(entry)?;
        line.push(b'\n');
        let mut inner = self.inner.lock();
        let mut cut = inner.complete.take().into_iter();
        cut.try_for_each(|complete| inner.file.set_len(complete))
            .and_then(|()| inner.file.write_all(&line))
            .and_then(|()| (self.sync)(&inner.file))
            .with_context(|| format!("writing {}; is the disk full?", self.path.display()))?;
        insert(&mut inner.entries, entry.clone());
        Ok(())
    }

    /// Removes the entries for which `is_old` is true and keeps a copy of the whole file,
    /// whose path it returns. Without such entries nothing changes.
    ///
    /// # Errors
    /// When the copy or the file cannot be written.
    pub fn set_aside(&self, is_old: impl Fn(&E) -> bool) -> anyhow::Result<Option<PathBuf>> {
        let mut inner = self.inner.lock();
        if !inner.entries.iter().any(&is_old) {
            return Ok(None);
        }
        let context = || format!("writing {}", self.path.display());
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let name = |number: u32| self.path.with_file_name(format!("{stem}-{number}.jsonl"));
        let free = (1..).map(name).find(|path| !path.exists());
        let aside = free.context("no free name for the earlier results")?;
        std::fs::copy(&self.path, &aside)
            .with_context(|| format!("writing {}", aside.display()))?;
        inner.entries.retain(|entry| !is_old(entry));
        let mut text = String::new();
        for entry in &inner.entries {
            text += &serde_json::to_string(entry)?;
            text.push('\n');
        }
        inner.complete = None;
        inner.file.set_len(0).with_context(context)?;
        inner
            .file
            .write_all(text.as_bytes())
            .with_context(context)?;
        Ok(Some(aside))
    }
}

/// Reads a log without locking it: its entries in order, and the numbers (from 1) of the
/// lines that cannot be read.
///
/// # Errors
/// When the file cannot be read.
pub fn read_log<E: LogEntry>(path: &Path) -> anyhow::Result<(Vec<E>, Vec<usize>)> {
    let text = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    let mut parsed = parse(&text);
    parsed.damaged.extend(parsed.foreign.map(|(line, _)| line));
    parsed.damaged.sort_unstable();
    Ok((parsed.entries, parsed.damaged))
}

/// The warning about a line that cannot be read, numbered from 1.
#[must_use]
pub fn damaged_line(log: &Path, line: usize) -> String {
    format!(
        "{}: line {line} is damaged, as by a power loss during a write: it is skipped, and its \
         episode is repeated",
        log.display()
    )
}

/// The lines of a log.
struct Parsed<E> {
    entries: Vec<E>,
    /// Numbers of the lines that are not JSON, from 1.
    damaged: Vec<usize>,
    /// The first line that is JSON and no entry, from 1, with the reason.
    foreign: Option<(usize, String)>,
}

fn parse<E: LogEntry>(text: &[u8]) -> Parsed<E> {
    let mut parsed = Parsed {
        entries: Vec::new(),
        damaged: Vec::new(),
        foreign: None,
    };
    // Bytes, because a cut line may end in the middle of a character.
    for (index, line) in text.split(|byte| *byte == b'\n').enumerate() {
        if line.is_empty() {
            continue;
        }
        match serde_json::from_slice(line) {
            Ok(entry) => parsed.entries.push(entry),
            Err(why) if why.is_data() && serde_json::from_slice::<IgnoredAny>(line).is_ok() => {
                parsed.foreign.get_or_insert((index + 1, why.to_string()));
            }
            Err(_) => parsed.damaged.push(index + 1),
        }
    }
    parsed
}

fn insert<E: LogEntry>(entries: &mut Vec<E>, entry: E) {
    entries.retain(|known| !entry.replaces(known));
    entries.push(entry);
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct Line {
        seed: u64,
        why: String,
    }

    impl LogEntry for Line {
        const COMMAND: &'static str = "test";

        fn replaces(&self, known: &Self) -> bool {
            self.seed == known.seed
        }
    }

    fn line(seed: u64) -> Line {
        Line {
            seed,
            why: "turned by 90°".to_owned(),
        }
    }

    /// Opens a log that no process has open. A child process of another test may hold the lock
    /// between its fork and its exec.
    fn open(path: &Path) -> EpisodeLog<Line> {
        let mut opened = (0..500).map(|_| {
            let opened = EpisodeLog::open(path, File::sync_data);
            if opened.is_err() {
                std::thread::sleep(std::time::Duration::from_millis(20));
            }
            opened
        });
        opened.find_map(Result::ok).expect("a free log")
    }

    #[test]
    fn truncated_line_is_ignored_and_removed_by_the_next_append() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("episodes.jsonl");
        open(&path).append(&line(0)).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let text = String::from_utf8(whole.clone()).unwrap();
        let second = text.replace('0', "1").into_bytes();
        for cut in 1..second.len() {
            std::fs::write(&path, [&whole[..], &second[..cut]].concat()).unwrap();
            let is_cut = cut < second.len() - 1;
            let (entries, torn) = read_log::<Line>(&path).unwrap();
            assert_eq!(torn, if is_cut { vec![2] } else { vec![] }, "cut at {cut}");
            let log = open(&path);
            assert_eq!(log.entries(), entries);
            log.append(&line(7)).unwrap();
            drop(log);
            let (entries, torn) = read_log::<Line>(&path).unwrap();
            assert_eq!(torn, [0; 0], "cut at {cut}");
            assert_eq!(entries.len(), 3 - usize::from(is_cut), "cut at {cut}");
            assert_eq!(entries.last(), Some(&line(7)));
        }
    }

    #[test]
    fn damaged_line_is_reported_and_its_episode_is_made_once_more() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("episodes.jsonl");
        let log = open(&path);
        assert_eq!(log.damage(), [""; 0]);
        for seed in 0..3 {
            log.append(&line(seed)).unwrap();
        }
        drop(log);
        let whole = std::fs::read(&path).unwrap();
        let second = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        // A block of zeros, a flipped byte, and a line that lost its beginning.
        for (at, bytes) in [
            (second, &[0_u8; 12][..]),
            (second + 2, &b"\x80"[..]),
            (second, &b"      "[..]),
        ] {
            let mut text = whole.clone();
            text[at..at + bytes.len()].copy_from_slice(bytes);
            std::fs::write(&path, &text).unwrap();
            let log = open(&path);
            let damage = log.damage();
            assert_eq!(damage.len(), 1, "{damage:?}");
            assert!(
                damage[0].contains("episodes.jsonl: line 2 is damaged"),
                "{damage:?}"
            );
            assert_eq!(log.entries(), [line(0), line(2)]);
            log.append(&line(1)).unwrap();
            drop(log);
            // The damaged line stays, and the repeated episode counts once.
            let resumed = std::fs::read(&path).unwrap();
            assert!(resumed.starts_with(&text));
            assert_eq!(open(&path).entries(), [line(0), line(2), line(1)]);
        }
    }

    #[test]
    fn log_of_another_version_is_not_resumed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("episodes.jsonl");
        open(&path).append(&line(0)).unwrap();
        let mut text = std::fs::read_to_string(&path).unwrap();
        text += "{\"seed\":\"one\",\"why\":\"\"}\n";
        std::fs::write(&path, &text).unwrap();
        let error = EpisodeLog::<Line>::open(&path, File::sync_data).unwrap_err();
        let error = error.to_string();
        for words in ["episodes.jsonl: line 2", "invalid type", "--out"] {
            assert!(error.contains(words), "{error}");
        }
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        assert_eq!(read_log::<Line>(&path).unwrap(), (vec![line(0)], vec![2]));
    }

    #[test]
    fn newest_entry_of_an_episode_counts_and_old_ones_can_be_set_aside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("episodes.jsonl");
        let log = open(&path);
        let newer = Line {
            why: "again".to_owned(),
            ..line(0)
        };
        for entry in [&line(0), &line(1), &newer] {
            log.append(entry).unwrap();
        }
        assert_eq!(log.entries(), [line(1), newer.clone()]);
        assert_eq!(log.set_aside(|entry| entry.seed == 9).unwrap(), None);
        let aside = log.set_aside(|entry| entry.seed == 1).unwrap().unwrap();
        assert_eq!(aside, folder.path().join("episodes-1.jsonl"));
        assert_eq!(read_log::<Line>(&aside).unwrap().0.len(), 3);
        drop(log);
        assert_eq!(open(&path).entries(), [newer]);
    }

    #[test]
    fn log_has_one_writing_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("episodes.jsonl");
        let first = open(&path);
        let error = EpisodeLog::<Line>::open(&path, File::sync_data).unwrap_err();
        assert!(error.to_string().contains("another `wheelarm test`"));
        drop(first);
        open(&path);
    }
}
