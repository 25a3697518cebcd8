//! Several files at once: one that cannot be read is reported and the rest
//! continues, even after a panic; long work shows its progress.

use std::any::Any;
use std::fs::File;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use parking_lot::Mutex;

use super::{AlreadyThere, Format, ReadOptions, Recording, Written};

/// The result for every file, in the order of the files.
pub type Results<T> = Vec<(PathBuf, anyhow::Result<T>)>;

/// Journal of the files that are being read.
static JOURNAL: OnceLock<Mutex<File>> = OnceLock::new();

/// Has it written into `file` when the reading of a recording begins and ends: `+` or `-`,
/// its path, and a zero byte.
pub fn keep_journal(file: File) {
    // The first value counts.
    let _ = JOURNAL.set(Mutex::new(file));
}

fn note(what: char, file: &Path) {
    if let Some(journal) = JOURNAL.get() {
        let mut line = vec![what as u8];
        line.extend_from_slice(file.as_os_str().as_encoded_bytes());
        line.push(0);
        // Without it more files are looked at when one breaks the program.
        let _ = journal.lock().write_all(&line);
    }
}

/// Does `work` for every file, with its number from 0, in up to `jobs` threads.
pub fn each<T: Send>(
    files: &[PathBuf],
    jobs: usize,
    work: impl Fn(usize, &Path) -> anyhow::Result<T> + Sync,
) -> Results<T> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, anyhow::Result<T>)>> = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, files.len().max(1)) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(file) = files.get(index) else { break };
                    note('+', file);
                    let result = whole(|| work(index, file));
                    note('-', file);
                    done.lock().push((index, result));
                }
            });
        }
    });
    let mut done = done.into_inner();
    done.sort_by_key(|d| d.0);
    done.into_iter()
        .map(|(index, result)| (files[index].clone(), result))
        .collect()
}

/// Maps `0..count` in up to `jobs` threads, keeping the order.
///
/// # Errors
/// The first one of `work`.
pub fn parallel<T: Send>(
    count: usize,
    jobs: usize,
    work: impl Fn(usize) -> anyhow::Result<T> + Sync,
) -> anyhow::Result<Vec<T>> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, anyhow::Result<T>)>> = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, count.max(1)) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= count {
                        break;
                    }
                    let result = whole(|| work(index));
                    done.lock().push((index, result));
                }
            });
        }
    });
    let mut done = done.into_inner();
    done.sort_by_key(|d| d.0);
    done.into_iter().map(|d| d.1).collect()
}

/// The result of `work`; a panic in it is an error like others. What it shares with
/// other files is locked for single steps alone.
fn whole<T>(work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    let panicked = |cause: Box<dyn Any + Send>| {
        let words = cause.downcast_ref::<String>().map(String::as_str);
        let words = words.or_else(|| cause.downcast_ref::<&str>().copied());
        Err(anyhow::anyhow!(
            "this file causes an internal error ({}): leave the file out, and please report it",
            words.unwrap_or("a panic without words")
        ))
    };
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(panicked)
}

/// Threads that this machine runs at once.
#[must_use]
pub fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// A bar on the terminal that counts `unit`; silent elsewhere.
#[must_use]
pub fn bar(unit: &str) -> ProgressBar {
    let bar = ProgressBar::new(0);
    let template =
        format!("{{elapsed_precise}} {{bar:30}} {{pos}} of {{len}} {unit}, {{per_sec}} {{msg}}");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar
}

/// Numbers of recordings, from 1 on where a process has all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbers {
    /// Of the first.
    pub first: usize,
    /// From each to the next.
    pub step: usize,
}

impl Numbers {
    /// Of all recordings.
    pub const ALL: Self = Self { first: 1, step: 1 };
}

/// Exports files and returns the result of each; the last entry of a format
/// that collects is the data set itself.
pub fn export(
    files: &[PathBuf],
    numbers: Numbers,
    jobs: usize,
    options: &ReadOptions,
    format: Box<dyn Format>,
) -> Results<Written> {
    // A worker process shows no bar, because it is one of several.
    let bar = match numbers {
        Numbers::ALL => bar("rows"),
        _ => ProgressBar::hidden(),
    };
    let jobs = if format.collects() { 1 } else { jobs };
    let mut results = each(files, jobs, |index, file| {
        let needs = format.needs_images();
        let mut recording = Recording::open_for(file, options, &|s| format.wants(s), needs)?;
        recording.number = numbers.first + index * numbers.step;
        bar.inc_length(recording.aligned.stamps.len() as u64);
        let mut written = format.add(&recording, &|| bar.inc(1))?;
        if !recording.summary.complete {
            let problems = recording.summary.problems.join("; ");
            written
                .notes
                .push(format!("the recording is partial: {problems}"));
        }
        bar.suspend(|| say(file, &written));
        Ok(written)
    });
    bar.finish_and_clear();
    match format.finish() {
        Ok(None) => {}
        Ok(Some(written)) => {
            println!(
                "{}: {} rows in all",
                written.path.display(),
                written.samples
            );
            results.push((written.path.clone(), Ok(written)));
        }
        Err(problem) => results.push((PathBuf::from("data set"), Err(problem))),
    }
    results
}

fn say(file: &Path, written: &Written) {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    println!(
        "{name} -> {}: {} samples",
        written.path.display(),
        written.samples
    );
    for note in &written.notes {
        println!("  {note}");
    }
}

/// A problem with its file, which many problems name themselves.
fn named(file: &Path, problem: &str) -> String {
    let name = file.display().to_string();
    if problem.contains(&name) {
        problem.to_owned()
    } else {
        format!("{name}: {problem}")
    }
}

/// Prints the failures and says whether there were any. Of several files, what was written
/// before is not a failure: an interrupted command resumes when it is started again.
pub fn failures<T>(results: &Results<T>, several: bool) -> bool {
    let (mut any, mut there) = (false, 0);
    for (file, result) in results {
        let Err(problem) = result else { continue };
        match problem.downcast_ref() {
            Some(AlreadyThere::Again(_)) => continue,
            Some(AlreadyThere::Before(_)) if several => {
                there += 1;
                continue;
            }
            _ => {}
        }
        any = true;
        eprintln!("{}", named(file, &format!("{problem:#}")));
    }
    if there > 0 {
        eprintln!(
            "{there} of {} exist already; what exists is never overwritten: made with other options it needs another --out",
            results.len()
        );
    }
    any
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_causes_a_panic_is_reported_and_the_others_are_processed() {
        let files = ["a.h5", "b.h5", "c.h5"].map(PathBuf::from);
        let results = each(&files, 2, |index, _| {
            let row = [0, 1].get(index).copied().expect("a row");
            parallel(2, 2, |i| Ok([7, 8][i] + row))
        });
        let fine: Vec<bool> = results.iter().map(|r| r.1.is_ok()).collect();
        assert_eq!(fine, [true, true, false]);
        let error = results[2].1.as_ref().unwrap_err().to_string();
        assert!(
            error.contains("a row") && error.contains("report it"),
            "{error}"
        );
        let inner = parallel(3, 2, |i| Ok([7, 8].get(i).copied().expect("two")));
        assert!(inner.unwrap_err().to_string().contains("two"));
    }

    #[test]
    fn a_file_that_fails_does_not_stop_the_others_and_order_is_kept() {
        let files: Vec<PathBuf> = (0..20).map(|i| PathBuf::from(i.to_string())).collect();
        let results = each(&files, 4, |_, file| {
            let number: usize = file.to_string_lossy().parse()?;
            anyhow::ensure!(number != 7, "seven");
            Ok(number)
        });
        assert_eq!(results.len(), 20);
        for (i, (file, result)) in results.iter().enumerate() {
            assert_eq!(file, &files[i]);
            assert_eq!(result.is_err(), i == 7);
        }
        assert!(failures(&results, true));
        assert_eq!(named(Path::new("a.h5"), "a.h5 is empty"), "a.h5 is empty");
        assert_eq!(named(Path::new("a.h5"), "no rows"), "a.h5: no rows");
        assert!(
            parallel(5, 3, |i| {
                anyhow::ensure!(i < 4, "four");
                Ok(i)
            })
            .is_err()
        );
        assert_eq!(parallel(5, 3, Ok).unwrap(), [0, 1, 2, 3, 4]);
    }
}
