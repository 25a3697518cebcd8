//! The audit log: a line of JSON for every lease, episode, goal, refusal and log-in,
//! into a file if one is named, and into the program's log.
//!
//! The log is bounded because other clients can cause lines: texts are cut, lines of
//! one kind beyond a rate become one sum, and the file is rotated. A thread of its own
//! writes, so that a slow disk never delays a command.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use serde_json::{Value, json};

/// Longest text of a field, characters.
const LONGEST: usize = 256;
/// Lines of one kind: at once, and per second after that.
const RATE: [f64; 2] = [20.0, 2.0];
/// Time between two sums of one kind, s.
const SUM_SECS: f64 = 5.0;
/// Largest file, bytes. One former file of this size is kept beside it.
const LARGEST: u64 = 8 << 20;
/// Lines that may wait for the disk; more are counted.
const WAITING: usize = 256;
/// Longest wait for the disk at the end.
const FAREWELL: Duration = Duration::from_secs(2);

/// Where the lines go.
#[derive(Debug)]
pub struct Audit {
    kinds: BTreeMap<String, Kind>,
    /// Lines that did not fit in the queue to the disk (count).
    lost: u64,
    began: Instant,
    lines: Option<SyncSender<String>>,
    thread: Option<JoinHandle<()>>,
}

/// Lines of one kind.
#[derive(Debug)]
struct Kind {
    /// Lines that may be written now.
    left: f64,
    /// When `left` was true, s.
    at: f64,
    /// Lines that were not written since the last sum, and the newest of them.
    further: u64,
    newest: Value,
    /// When the last sum was written, s.
    summed: f64,
}

impl Audit {
    /// Appends to a file, if one is named; creates it and its folder where they are
    /// missing.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: Option<&Path>) -> anyhow::Result<Self> {
        let file = path.map(|path| {
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).with_context(|| {
                    format!("making the folder {} of the audit file", folder.display())
                })?;
            }
            Rotated::open(path, LARGEST)
                .with_context(|| format!("opening the audit file {}", path.display()))
        });
        let file = file.transpose()?;
        let (lines, waiting) = sync_channel(WAITING);
        let thread = std::thread::Builder::new()
            .name("audit".to_owned())
            .spawn(move || write_lines(&waiting, file))
            .context("starting the thread of the audit")?;
        Ok(Self {
            kinds: BTreeMap::new(),
            lost: 0,
            began: Instant::now(),
            lines: Some(lines),
            thread: Some(thread),
        })
    }

    /// Writes a line with the time, unless too many of its kind were written.
    pub fn write(&mut self, line: &Value) {
        let now = self.began.elapsed().as_secs_f64();
        if let Some(line) = self.admit(line, now) {
            self.put(line);
        }
    }

    /// Writes the sums that are due.
    pub fn tick(&mut self) {
        self.sum(self.began.elapsed().as_secs_f64(), SUM_SECS);
    }

    /// The line as it is written, or `None` where it is counted instead.
    fn admit(&mut self, line: &Value, now: f64) -> Option<Value> {
        let line = cut(line);
        let what = line["what"].as_str().unwrap_or_default().to_owned();
        let kind = self.kinds.entry(what).or_insert_with(|| Kind {
            left: RATE[0],
            at: now,
            further: 0,
            newest: Value::Null,
            summed: now,
        });
        kind.left = (kind.left + (now - kind.at).max(0.0) * RATE[1]).min(RATE[0]);
        kind.at = now;
        if kind.left < 1.0 {
            kind.further += 1;
            kind.newest = line;
            return None;
        }
        kind.left -= 1.0;
        Some(line)
    }

    fn sum(&mut self, now: f64, pause: f64) {
        let due = self.kinds.iter_mut().filter_map(|(what, kind)| {
            if kind.further == 0 || now - kind.summed < pause {
                return None;
            }
            kind.summed = now;
            let further = std::mem::take(&mut kind.further);
            let newest = std::mem::take(&mut kind.newest);
            Some(json!({
                "what": what,
                "further": further,
                "who": newest["who"],
                "text": format!("{further} further lines of {what:?}; the last: {}", newest["text"]),
            }))
        });
        let due: Vec<Value> = due.collect();
        for line in due {
            self.put(line);
        }
    }

    fn put(&mut self, mut line: Value) {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        line["unix_s"] = json!(now.unwrap_or_default().as_secs_f64());
        if self.lost > 0 {
            line["lost"] = json!(self.lost);
        }
        let Some(lines) = &self.lines else { return };
        match lines.try_send(line.to_string()) {
            Ok(()) => self.lost = 0,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => self.lost += 1,
        }
    }
}

impl Drop for Audit {
    fn drop(&mut self) {
        self.sum(f64::INFINITY, 0.0);
        self.lines = None;
        let Some(thread) = self.thread.take() else {
            return;
        };
        // A disk that hangs does not keep the gateway from ending.
        let since = Instant::now();
        while !thread.is_finished() && since.elapsed() < FAREWELL {
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

/// The line with texts cut to [`LONGEST`]; it has one level of fields.
fn cut(line: &Value) -> Value {
    let mut line = line.clone();
    for (_, value) in line.as_object_mut().into_iter().flatten() {
        if let Value::String(text) = value
            && let Some((end, _)) = text.char_indices().nth(LONGEST)
        {
            text.truncate(end);
            text.push('…');
        }
    }
    line
}

fn write_lines(lines: &Receiver<String>, mut file: Option<Rotated>) {
    for line in lines {
        tracing::info!(target: "audit", "{line}");
        if let Some(open) = &mut file
            && let Err(error) = open.write(&line)
        {
            tracing::error!("cannot write the audit file: {error}; it is closed");
            file = None;
        }
    }
}

/// A file that becomes `PATH.1` when it is full.
#[derive(Debug)]
struct Rotated {
    path: PathBuf,
    file: File,
    bytes: u64,
    largest: u64,
}

impl Rotated {
    fn open(path: &Path, largest: u64) -> std::io::Result<Self> {
        let file = File::options().create(true).append(true).open(path)?;
        let bytes = file.metadata()?.len();
        Ok(Self {
            path: path.to_owned(),
            file,
            bytes,
            largest,
        })
    }

    fn write(&mut self, line: &str) -> std::io::Result<()> {
        let line = format!("{line}\n");
        let bytes = line.len() as u64;
        // A device (`/dev/stderr`) counts no bytes and is never renamed.
        if self.bytes > 0 && self.bytes + bytes > self.largest {
            let is_file = self.file.metadata()?.is_file();
            if is_file {
                let mut former = self.path.clone().into_os_string();
                former.push(".1");
                std::fs::rename(&self.path, former)?;
                *self = Self::open(&self.path, self.largest)?;
            } else {
                self.bytes = 0;
            }
        }
        self.file.write_all(line.as_bytes())?;
        self.bytes += bytes;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(path: &Path) -> Vec<Value> {
        let text = std::fs::read_to_string(path).unwrap();
        let read = text.lines().map(|line| serde_json::from_str(line).unwrap());
        read.collect()
    }

    #[test]
    fn the_folder_of_the_audit_file_is_created() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/audit.jsonl");
        let mut audit = Audit::open(Some(&path)).unwrap();
        audit.write(&json!({"what": "lease"}));
        drop(audit);
        assert_eq!(lines(&path)[0]["what"], "lease");
    }

    #[test]
    fn a_flood_of_refusals_is_summed_up_and_hides_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("audit.jsonl");
        let mut audit = Audit::open(Some(&path)).unwrap();
        let long = "x".repeat(100_000);
        for number in 0..2000 {
            let who = format!("{long}{number}");
            audit.write(&json!({"what": "refused", "who": who, "text": long}));
            audit.tick();
        }
        audit.write(&json!({"what": "control", "who": "anna"}));
        drop(audit);
        let size = std::fs::metadata(&path).unwrap().len();
        assert!(size < 64 << 10, "{size} bytes");
        let lines = lines(&path);
        let controls = lines.iter().filter(|line| line["what"] == "control");
        assert_eq!(controls.count(), 1);
        let refused: u64 = lines
            .iter()
            .filter(|line| line["what"] == "refused")
            .map(|line| line["further"].as_u64().unwrap_or(1))
            .sum();
        assert_eq!(refused, 2000, "every refusal is counted");
    }

    #[test]
    fn lines_of_one_kind_have_a_rate() {
        let mut audit = Audit::open(None).unwrap();
        let line = json!({"what": "refused", "who": "ben"});
        let written = (0..100_000)
            .filter(|i| audit.admit(&line, f64::from(*i) * 1e-3).is_some())
            .count();
        // 100 s of 1000 lines a second.
        assert!((200..=221).contains(&written), "{written}");
    }

    #[test]
    fn the_audit_file_is_rotated_at_its_size_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("audit.jsonl");
        let mut file = Rotated::open(&path, 1000).unwrap();
        for _ in 0..500 {
            file.write(&"x".repeat(99)).unwrap();
        }
        let sizes = [path.clone(), folder.path().join("audit.jsonl.1")]
            .map(|path| std::fs::metadata(path).unwrap().len());
        assert!(sizes.iter().all(|size| *size <= 1000), "{sizes:?}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
        // A program that starts again goes on in the same file.
        assert_eq!(Rotated::open(&path, 1000).unwrap().bytes, sizes[0]);
    }
}
