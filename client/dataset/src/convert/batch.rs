//! Several files at once: one that cannot be read is reported and the rest
//! goes on; long work shows how far it is.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use parking_lot::Mutex;

use super::{Format, ReadOptions, Recording, Written};

/// The result for every file, in the order of the files.
pub type Results<T> = Vec<(PathBuf, anyhow::Result<T>)>;

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
                    let result = work(index, file);
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
                    let result = work(index);
                    done.lock().push((index, result));
                }
            });
        }
    });
    let mut done = done.into_inner();
    done.sort_by_key(|d| d.0);
    done.into_iter().map(|d| d.1).collect()
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

/// Exports files and returns what became of each; the last entry of a format
/// that collects is the data set itself.
pub fn export(
    files: &[PathBuf],
    jobs: usize,
    options: &ReadOptions,
    format: Box<dyn Format>,
) -> Results<Written> {
    let bar = bar("rows");
    let jobs = if format.collects() { 1 } else { jobs };
    let mut results = each(files, jobs, |index, file| {
        let needs = format.needs_pictures();
        let mut recording = Recording::open_for(file, options, &|s| format.wants(s), needs)?;
        recording.number = index + 1;
        bar.inc_length(recording.aligned.stamps.len() as u64);
        let written = format.add(&recording, &|| bar.inc(1))?;
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

/// Prints the failures and says whether there were any.
pub fn failures<T>(results: &Results<T>) -> bool {
    let mut any = false;
    for (file, result) in results {
        if let Err(problem) = result {
            any = true;
            eprintln!("{}", named(file, &format!("{problem:#}")));
        }
    }
    any
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!(failures(&results));
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
