//! The work is done by a process of its own, because a damaged file can crash the HDF5
//! library or keep it in an endless loop, which no program survives that calls it. This
//! process finds out which file did it, names it, and has the work done without it.

use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use anyhow::{Context, bail};
use rustix::process::Signal;
use wheelarm_dataset::convert::batch;

use super::arguments::{BROKEN, FAILED};
use super::parts::{end_with, list, paths};

/// Tells a process that it is to do the work, as `PARENT/COUNT`: the process that asks for
/// it, and how many files it leaves out, which come by its standard input.
const VARIABLE: &str = "WHEELARM_DATASET_WORK";
/// A call of HDF5 that lasts longer has no end, seconds: the longest write a few MB. Where a
/// drive can be silent for longer, this variable gives it more.
const PATIENCE_VARIABLE: &str = "WHEELARM_DATASET_PATIENCE";
const PATIENCE: u32 = 60;

/// The files that this process was told to leave out, and `None` where it is the one that
/// supervises.
///
/// # Errors
/// When what it was told cannot be read.
pub fn left_out() -> anyhow::Result<Option<Vec<PathBuf>>> {
    let Some(told) = std::env::var_os(VARIABLE) else {
        return Ok(None);
    };
    let told = told.to_string_lossy();
    let numbers = told
        .split_once('/')
        .map(|(a, b)| (a.parse(), b.parse::<usize>()));
    let Some((Ok(parent), Ok(count))) = numbers else {
        bail!("{VARIABLE} is {told:?}; it is set by this program for its own processes: unset it")
    };
    end_with(parent)?;
    let mut bytes = Vec::new();
    if count > 0 {
        std::io::stdin().lock().read_to_end(&mut bytes)?;
    }
    Ok(Some(paths(&bytes).collect()))
}

/// Seconds that a call of HDF5 may last.
fn patience() -> anyhow::Result<u32> {
    let Some(told) = std::env::var_os(PATIENCE_VARIABLE) else {
        return Ok(PATIENCE);
    };
    let told = told.to_string_lossy();
    let seconds = told.parse().ok().filter(|seconds| *seconds > 0);
    seconds.with_context(|| {
        format!("{PATIENCE_VARIABLE} is {told:?}: give it whole seconds, 1 or more, or unset it")
    })
}

/// Ends this process when HDF5 is in one call for longer than any takes, so that the one
/// that supervises hears of it. Counts seconds in which this process ran.
///
/// # Errors
/// When the time that it may take is none.
pub fn end_when_stuck() -> anyhow::Result<()> {
    let patience = patience()?;
    static CALLS: AtomicU64 = AtomicU64::new(0);
    std::thread::spawn(|| {
        loop {
            // HDF5 does one call at a time, so that this one waits for another's end.
            hdf5::sync::sync(|| ());
            CALLS.fetch_add(1, Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(500));
        }
    });
    std::thread::spawn(move || {
        let (mut seen, mut unchanged) = (0, 0);
        while unchanged < patience {
            std::thread::sleep(Duration::from_secs(1));
            let now = CALLS.load(Ordering::Relaxed);
            unchanged = if now == seen { unchanged + 1 } else { 0 };
            seen = now;
        }
        std::process::abort();
    });
    Ok(())
}

/// Has the work done that this program was started for, and returns its exit code; `files`
/// are the recordings that it reads.
///
/// # Errors
/// When the work breaks, and no file by itself is the cause.
pub fn supervised(mut files: impl FnMut() -> anyhow::Result<Vec<PathBuf>>) -> anyhow::Result<u8> {
    let mut damaged: BTreeSet<PathBuf> = BTreeSet::new();
    loop {
        let arguments: Vec<_> = std::env::args_os().skip(1).collect();
        let status = work(&arguments, &damaged)?;
        let Some(how) = broke(status) else {
            let code = exit_code(status);
            return Ok(if damaged.is_empty() {
                code
            } else {
                code.max(FAILED)
            });
        };
        let mut left = files()?;
        left.retain(|file| !damaged.contains(file));
        let found = probe(&left)?;
        anyhow::ensure!(
            !found.is_empty(),
            "the work {how}, which no file brings out alone: run it again, with fewer --jobs where memory is short, and please report it"
        );
        for (file, how) in &found {
            eprintln!(
                "{}: reading it {how}: the file is damaged; leave it out, or copy it again from where it was recorded",
                file.display()
            );
        }
        let is_over = found.len() == left.len();
        damaged.extend(found.into_iter().map(|(file, _)| file));
        if is_over {
            return Ok(FAILED);
        }
        eprintln!("begun again without {} damaged", damaged.len());
    }
}

/// Runs this program with `arguments` until it ends.
fn work(
    arguments: &[std::ffi::OsString],
    damaged: &BTreeSet<PathBuf>,
) -> anyhow::Result<ExitStatus> {
    let mut command = this_program(damaged.len())?;
    command.args(arguments);
    if damaged.is_empty() {
        return command.status().context("starting the work");
    }
    let mut child = command
        .stdin(Stdio::piped())
        .spawn()
        .context("starting the work")?;
    // One that ended at once says why by its exit.
    let _ = child
        .stdin
        .take()
        .map(|mut to| to.write_all(&list(damaged.iter())));
    child.wait().context("waiting for the work")
}

/// Files that break who reads them, each read by a process of its own.
fn probe(files: &[PathBuf]) -> anyhow::Result<Vec<(PathBuf, String)>> {
    let ended = batch::parallel(files.len(), batch::threads(), |index| {
        let mut command = this_program(0)?;
        let (input, output, errors) = (Stdio::null(), Stdio::null(), Stdio::null());
        command
            .args(["validate", "--jobs", "1", "--"])
            .arg(&files[index]);
        let status = command.stdin(input).stdout(output).stderr(errors).status();
        let status = status.with_context(|| format!("reading {}", files[index].display()))?;
        Ok(broke(status))
    })?;
    let found = files.iter().cloned().zip(ended);
    Ok(found.filter_map(|(file, how)| Some((file, how?))).collect())
}

fn this_program(without: usize) -> anyhow::Result<Command> {
    let program = std::env::current_exe().context("finding this program")?;
    let mut command = Command::new(program);
    command.env(VARIABLE, format!("{}/{without}", std::process::id()));
    Ok(command)
}

/// How a process broke; `None` when it ended by itself or by another's will.
fn broke(status: ExitStatus) -> Option<String> {
    const CRASHES: [Signal; 4] = [Signal::SEGV, Signal::BUS, Signal::FPE, Signal::ILL];
    match status.signal() {
        None => (status.code() == Some(i32::from(BROKEN)))
            .then(|| "crashed a process of the export".to_owned()),
        Some(signal) if signal == Signal::ABORT.as_raw() => Some(format!(
            "came to no end within {} s, or a library gave it up",
            patience().unwrap_or(PATIENCE)
        )),
        Some(signal) => CRASHES
            .map(Signal::as_raw)
            .contains(&signal)
            .then(|| format!("crashed the HDF5 library (signal {signal})")),
    }
}

/// What this process ends with when the work ended like that.
fn exit_code(status: ExitStatus) -> u8 {
    if status.signal() == Some(Signal::KILL.as_raw()) {
        eprintln!(
            "the work was killed from outside; where memory was short, run it again with fewer --jobs"
        );
    }
    let signal = || status.signal().map_or(1, |signal| 128 + signal);
    u8::try_from(status.code().unwrap_or_else(signal)).unwrap_or(FAILED)
}
