//! The work is done by a process of its own, because a damaged file can crash the HDF5
//! library or keep it in an endless loop, which no program survives that calls it. This
//! process finds out which file did it, names it, and has the work done without it.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};
use rustix::process::{Signal, getpid, kill_process};
use wheelarm_dataset::convert::{batch, begin};
use wheelarm_dataset::read;

use super::arguments::{BROKEN, FAILED, FINE, PARTIAL};
use super::children::{self, end_with, list, paths};

/// Work order of a worker process, `PARENT/BEGAN/COUNT/ALONE/JOURNAL`: the supervisor's
/// process ID; start of the command, microseconds of Unix time; number of files to leave
/// out, whose paths arrive on standard input; 1 to read one file at a time; and the path of
/// the journal of files that are being read.
const VARIABLE: &str = "WHEELARM_DATASET_WORK";
/// A call of HDF5 that lasts longer has no end, seconds: the longest write a few MB. Where a
/// drive can be silent for longer, this variable gives it more.
const PATIENCE_VARIABLE: &str = "WHEELARM_DATASET_PATIENCE";
const PATIENCE: u32 = 60;
/// Ends a process that waits for HDF5 without end; no other process sends it.
const STUCK: Signal = Signal::ALARM;

/// Work order of a worker process.
pub struct WorkOrder {
    /// Files that it leaves out.
    pub left_out: Vec<PathBuf>,
    /// It reads one file at a time.
    pub alone: bool,
}

/// The work order of this process; `None` for the supervisor.
///
/// # Errors
/// When the variable is malformed.
pub fn work_order() -> anyhow::Result<Option<WorkOrder>> {
    let Some(value) = std::env::var_os(VARIABLE) else {
        return Ok(None);
    };
    let value = value.to_string_lossy();
    let parts: Vec<&str> = value.splitn(5, '/').collect();
    let [Ok(parent), Ok(began), Ok(count), Ok(alone)] = [0, 1, 2, 3].map(|i| {
        let number = parts.get(i).copied().unwrap_or_default().parse::<u64>();
        number.map_err(drop)
    }) else {
        bail!("{VARIABLE} is {value:?}; it is set by this program for its own processes: unset it")
    };
    end_with(usize::try_from(parent)?)?;
    begin(UNIX_EPOCH + Duration::from_micros(began));
    keep_the_journal(&parts);
    let mut bytes = Vec::new();
    if count > 0 {
        std::io::stdin().lock().read_to_end(&mut bytes)?;
    }
    Ok(Some(WorkOrder {
        left_out: paths(&bytes).collect(),
        alone: alone == 1,
    }))
}

/// Journals which files are read, in this process as in those that it starts.
pub fn keep_the_journal_of_parts() {
    if let Some(value) = std::env::var_os(VARIABLE) {
        keep_the_journal(&value.to_string_lossy().splitn(5, '/').collect::<Vec<_>>());
    }
}

fn keep_the_journal(parts: &[&str]) {
    let journal = parts.get(4).filter(|path| !path.is_empty());
    let opened = journal.and_then(|path| File::options().append(true).open(path).ok());
    if let Some(journal) = opened {
        batch::keep_journal(journal);
    }
}

/// Seconds that a call of HDF5 may last.
fn patience() -> anyhow::Result<u32> {
    let Some(value) = std::env::var_os(PATIENCE_VARIABLE) else {
        return Ok(PATIENCE);
    };
    let value = value.to_string_lossy();
    let seconds = value.parse().ok().filter(|seconds| *seconds > 0);
    seconds.with_context(|| {
        format!("{PATIENCE_VARIABLE} is {value:?}: give it whole seconds, 1 or more, or unset it")
    })
}

/// Ends this process when HDF5 is in one call for longer than any takes, so that the one
/// that supervises notices. Counts seconds in which this process ran.
///
/// # Errors
/// When the limit is invalid.
pub fn end_when_stuck() -> anyhow::Result<()> {
    let patience = patience()?;
    static CALLS: AtomicU64 = AtomicU64::new(0);
    std::thread::spawn(|| {
        loop {
            read::wait_for_library();
            CALLS.fetch_add(1, Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(500));
        }
    });
    std::thread::spawn(move || {
        let (mut last, mut unchanged) = (0, 0);
        while unchanged < patience {
            std::thread::sleep(Duration::from_secs(1));
            let now = CALLS.load(Ordering::Relaxed);
            unchanged = if now == last { unchanged + 1 } else { 0 };
            last = now;
        }
        // A call of the library cannot be interrupted.
        let _ = kill_process(getpid(), STUCK);
    });
    Ok(())
}

/// Has the work done that this program was started for, and returns its exit code; `files`
/// are the recordings that it reads.
///
/// # Errors
/// When the work breaks, and no file by itself is the cause.
pub fn supervised(mut files: impl FnMut() -> anyhow::Result<Vec<PathBuf>>) -> anyhow::Result<u8> {
    let mut asks = Work {
        began: SystemTime::now(),
        damaged: BTreeSet::new(),
        journal: Journal::new(),
        alone: false,
    };
    loop {
        let status = asks.work()?;
        let Some(how) = broke(status) else {
            let code = exit_code(status);
            let only_some = !asks.damaged.is_empty() && matches!(code, FINE | PARTIAL);
            return Ok(if only_some { FAILED } else { code });
        };
        let mut left = files()?;
        left.retain(|file| !asks.damaged.contains(file));
        let mut suspects = asks.journal.being_read();
        if suspects.is_empty() {
            suspects.clone_from(&left);
        }
        let found = match &suspects[..] {
            [one] => vec![(one.clone(), how)],
            several => {
                let found = probe(several)?;
                if found.is_empty() && !asks.alone {
                    eprintln!(
                        "the work {how}; begun again with one file at a time to find out which does it"
                    );
                    asks.alone = true;
                    continue;
                }
                anyhow::ensure!(
                    !found.is_empty(),
                    "the work {how}, which no single file reproduces: run it again, and please report it"
                );
                found
            }
        };
        for (file, how) in &found {
            eprintln!(
                "{}: reading it {how}: the file is damaged; leave it out, or copy it again from where it was recorded",
                file.display()
            );
        }
        let is_over = found.len() >= left.len();
        asks.damaged.extend(found.into_iter().map(|(file, _)| file));
        if is_over {
            return Ok(FAILED);
        }
        eprintln!(
            "begun again without what is damaged: {} so far",
            asks.damaged.len()
        );
    }
}

/// Parameters of the worker process.
struct Work {
    began: SystemTime,
    damaged: BTreeSet<PathBuf>,
    journal: Journal,
    alone: bool,
}

impl Work {
    /// Runs this program until it ends.
    fn work(&self) -> anyhow::Result<ExitStatus> {
        self.journal.empty();
        let began = self.began.duration_since(UNIX_EPOCH).unwrap_or_default();
        let mut command =
            worker_command(began, self.damaged.len(), self.alone, &self.journal.path)?;
        command.args(std::env::args_os().skip(1));
        if self.damaged.is_empty() {
            return command.status().context("starting this program");
        }
        let child = command.stdin(Stdio::piped()).spawn();
        let mut child = child.context("starting this program")?;
        // A process that ended at once gives the reason by its exit code.
        let all = list(self.damaged.iter());
        let _ = child.stdin.take().map(|mut to| to.write_all(&all));
        child.wait().context("waiting for the work")
    }
}

/// A file in which the worker lists the files that it reads.
struct Journal {
    path: PathBuf,
}

impl Journal {
    /// Made anew, and for this user alone: others may write beside it, and what they put
    /// there under its name is neither followed nor used.
    fn new() -> Self {
        let name = format!("wheelarm-dataset-{}.reads", std::process::id());
        let path = std::env::temp_dir().join(name);
        let _ = std::fs::remove_file(&path);
        let made = File::options()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&path);
        // Without it more files are looked at when one breaks the program.
        Self {
            path: made.map_or_else(|_| PathBuf::new(), |_| path),
        }
    }

    fn empty(&self) {
        let _ = File::options().write(true).truncate(true).open(&self.path);
    }

    /// Files whose reading has begun and not ended.
    fn being_read(&self) -> Vec<PathBuf> {
        let mut open: Vec<PathBuf> = Vec::new();
        for line in paths(&std::fs::read(&self.path).unwrap_or_default()) {
            let line = line.as_os_str().as_bytes();
            let (what, file) = line.split_at(1);
            let file = PathBuf::from(OsStr::from_bytes(file));
            match what {
                b"+" => open.push(file),
                _ => open.retain(|one| *one != file),
            }
        }
        open
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Files that crash their reader, each read by its own process.
fn probe(files: &[PathBuf]) -> anyhow::Result<Vec<(PathBuf, String)>> {
    let ended = batch::parallel(files.len(), batch::threads(), |index| {
        let mut command = worker_command(Duration::ZERO, 0, true, Path::new(""))?;
        let (input, output, errors) = (Stdio::null(), Stdio::null(), Stdio::null());
        command
            .args(["validate", "--jobs", "1", "--"])
            .arg(&files[index]);
        let status = command.stdin(input).stdout(output).stderr(errors).status();
        Ok(broke(status.context("starting this program")?))
    })?;
    let found = files.iter().cloned().zip(ended);
    Ok(found.filter_map(|(file, how)| Some((file, how?))).collect())
}

fn worker_command(
    began: Duration,
    without: usize,
    alone: bool,
    journal: &Path,
) -> anyhow::Result<Command> {
    let mut command = children::this_program()?;
    let (own, began, alone) = (std::process::id(), began.as_micros(), u8::from(alone));
    let value = format!("{own}/{began}/{without}/{alone}/{}", journal.display());
    command.env(VARIABLE, value);
    Ok(command)
}

/// How a process crashed; `None` when it exited or was terminated.
fn broke(status: ExitStatus) -> Option<String> {
    const CRASHES: [Signal; 5] = [
        Signal::SEGV,
        Signal::BUS,
        Signal::FPE,
        Signal::ILL,
        Signal::ABORT,
    ];
    match status.signal() {
        None => (status.code() == Some(i32::from(BROKEN)))
            .then(|| "broke a process of the export".to_owned()),
        Some(signal) if signal == STUCK.as_raw() => Some(format!(
            "did not end within {} s ({PATIENCE_VARIABLE} gives a slow drive more)",
            patience().unwrap_or(PATIENCE)
        )),
        Some(signal) => CRASHES
            .map(Signal::as_raw)
            .contains(&signal)
            .then(|| format!("crashed the program (signal {signal})")),
    }
}

/// Exit code of this process for the worker's exit status.
fn exit_code(status: ExitStatus) -> u8 {
    if status.signal() == Some(Signal::KILL.as_raw()) {
        eprintln!(
            "the work was killed from outside; where memory was short, run it again with fewer --jobs"
        );
    }
    let signal = || status.signal().map_or(1, |signal| 128 + signal);
    u8::try_from(status.code().unwrap_or_else(signal)).unwrap_or(FAILED)
}
