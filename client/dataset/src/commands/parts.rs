//! An export by several processes. In one, HDF5 reads for one thread at a time and the
//! kernel gives memory to one at a time: 32 cores did the work of two and a half.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Stdio};

use anyhow::{Context, bail};
use wheelarm_dataset::convert::batch::{self, Numbers};

use super::arguments::{BROKEN, FAILED, FINE};
use super::children::{end_with, list, paths, this_program};

/// Part of an export's worker process, `INDEX/COUNT/PARENT`, with the process ID of its
/// parent; the paths of all files arrive on standard input.
const VARIABLE: &str = "WHEELARM_EXPORT_PART";
/// Threads of a process.
const THREADS: usize = 2;
/// Least number of files of a process: starting one takes as long as a short file.
const FILES: usize = 4;

/// Processes that `files` files are worth with `jobs` of them at once; 1: this one alone.
pub fn worth(files: usize, jobs: usize) -> usize {
    (jobs / THREADS).min(files / FILES).max(1)
}

/// Whether this process is one of several of an export.
pub fn is_one() -> bool {
    std::env::var_os(VARIABLE).is_some()
}

/// The files that this process exports, where it is one of several.
///
/// # Errors
/// When the variable does not name a part.
pub fn own() -> anyhow::Result<Option<(Vec<PathBuf>, Numbers)>> {
    let Some(value) = std::env::var_os(VARIABLE) else {
        return Ok(None);
    };
    let value = value.to_string_lossy();
    let numbers: Vec<Option<usize>> = value.split('/').map(|n| n.parse().ok()).collect();
    let (index, count, parent) = match numbers[..] {
        [Some(index), Some(count), Some(parent)] if index < count => (index, count, parent),
        _ => {
            bail!("{VARIABLE} is {value:?}; it is set by an export for its own processes: unset it")
        }
    };
    end_with(parent)?;
    let mut list = Vec::new();
    std::io::stdin().lock().read_to_end(&mut list)?;
    let own = paths(&list).skip(index).step_by(count);
    let numbers = Numbers {
        first: index + 1,
        step: count,
    };
    Ok(Some((own.collect(), numbers)))
}

/// Exports `files` by `count` processes like this one, and prints their output.
///
/// # Errors
/// When one cannot be started.
pub fn export(files: &[PathBuf], count: usize) -> anyhow::Result<u8> {
    let list = list(files.iter());
    let bar = batch::bar("files");
    bar.set_length(files.len() as u64);
    let mut children = Vec::new();
    for index in 0..count {
        children.push(Part(start(index, count)?));
    }
    let codes: Vec<anyhow::Result<u8>> = std::thread::scope(|scope| {
        let followed = children.iter_mut().map(|child| {
            let (list, bar) = (&list, &bar);
            scope.spawn(move || {
                // A process that ended at once gives the reason by its exit code.
                let _ = child.0.stdin.take().map(|mut to| to.write_all(list));
                let output = child.0.stdout.take().context("its output is not here")?;
                blocks(BufReader::new(output), |block| {
                    bar.inc(1);
                    bar.suspend(|| print!("{block}"));
                })?;
                let ended = child.0.wait()?;
                if ended.signal() == Some(rustix::process::Signal::KILL.as_raw()) {
                    eprintln!(
                        "a process of the export was killed; what it had left is not there: \
                         export again, with fewer --jobs where memory was short"
                    );
                    return Ok(FAILED);
                }
                Ok(match ended.code() {
                    Some(0) => FINE,
                    Some(_) => FAILED,
                    None => BROKEN,
                })
            })
        });
        let followed: Vec<_> = followed.collect();
        let joined = followed.into_iter().map(|thread| {
            let joined = thread.join();
            joined.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        joined.collect()
    });
    bar.finish_and_clear();
    let mut worst = FINE;
    for code in codes {
        worst = worst.max(code?);
    }
    Ok(worst)
}

/// A process that does not outlive this one's interest in it.
struct Part(Child);

impl Drop for Part {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start(index: usize, count: usize) -> anyhow::Result<Child> {
    let mut command = this_program()?;
    command
        .args(std::env::args_os().skip(1))
        .env(VARIABLE, format!("{index}/{count}/{}", std::process::id()))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped());
    let started = command.spawn();
    started.with_context(|| format!("starting process {} of {count} of the export", index + 1))
}

/// Calls `done` with each line and the indented ones below it.
fn blocks(mut output: impl BufRead, mut done: impl FnMut(&str)) -> std::io::Result<()> {
    let (mut block, mut line) = (String::new(), String::new());
    loop {
        line.clear();
        let is_end = output.read_line(&mut line)? == 0;
        if !block.is_empty() && (is_end || !line.starts_with(' ')) {
            done(&block);
            block.clear();
        }
        if is_end {
            return Ok(());
        }
        block += &line;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_files_or_cores_start_no_processes() {
        assert_eq!(worth(1000, 32), 16);
        assert_eq!(worth(9, 32), 2);
        assert_eq!(worth(1000, 2), 1);
        assert_eq!(worth(7, 32), 1);
        assert_eq!(worth(0, 0), 1);
    }

    #[test]
    fn notes_stay_below_their_file() {
        let mut found = Vec::new();
        let output = "a -> b\n  one\n  two\nc -> d\ne";
        blocks(output.as_bytes(), |block| found.push(block.to_owned())).unwrap();
        assert_eq!(found, ["a -> b\n  one\n  two\n", "c -> d\n", "e"]);
    }
}
