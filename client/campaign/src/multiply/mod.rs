//! `wheelarm multiply`: makes many new episodes from a few recorded ones of a task.
//!
//! The hand motion near the object is cut out of each source and kept relative to the object
//! (`wheelarm_expert::demonstration`); the path to the object is planned again in every new
//! scene. Episodes run as in `evaluate`, by workers in one process, without cameras;
//! successful ones are kept, marked with their source.

mod args;
mod entry;
pub mod mark;
mod report;
mod runner;
mod settings;
mod sources;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::bail;
use parking_lot::Mutex;
use wheelarm_dataset::publish;
use wheelarm_options::choice::make_folder;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::Named;
use wheelarm_rollout::EpisodeLog;

pub use args::MultiplyArgs;
use entry::Entry;
use report::Report;
use runner::Runner;
use settings::Settings;
use sources::Sources;

/// Seeds per requested episode, without `--seeds`.
const TRIES: u64 = 4;
/// Interval between checks for a free seed.
const WAIT: Duration = Duration::from_millis(50);

/// Progress of the run.
struct Progress {
    next: u64,
    end: u64,
    kept: u64,
    running: u64,
    problem: Option<anyhow::Error>,
}

/// Runs `wheelarm multiply`. Exit code 0 when the requested number of episodes was kept.
///
/// # Errors
/// When no source exists, a program cannot be started, or the folder cannot be written.
pub fn run(args: &MultiplyArgs) -> anyhow::Result<ExitCode> {
    let (first, end) = seeds(args)?;
    make_folder(&args.out)?;
    let kept = std::fs::canonicalize(&args.out)?;
    let is_kept = |dir: PathBuf| std::fs::canonicalize(dir).is_ok_and(|dir| dir == kept);
    if is_kept(args.dir.clone()) || is_kept(args.dir.join("episodes")) {
        bail!(
            "--out {} is the folder of the sources, which would change when a run resumes: choose another --out",
            args.out.display()
        );
    }
    let log: EpisodeLog<Entry> =
        EpisodeLog::open(&args.out.join("episodes.jsonl"), publish::sync_data)?;
    for warning in log.damage() {
        tracing::warn!("{warning}");
    }
    let sources = Sources::read(args)?;
    for (file, why) in &sources.left_out {
        println!("left out    {file}: {why}");
    }
    if sources.list.is_empty() {
        let others: Vec<&str> = sources.other_tasks.iter().map(String::as_str).collect();
        bail!(
            "{} contains no episode of the task {:?} that can be multiplied{}; record some that succeed",
            args.dir.display(),
            args.task,
            match others.is_empty() {
                true => String::new(),
                false => format!(" (it contains {})", others.join(", ")),
            }
        );
    }
    println!("sources     {}", sources.list.len());
    Settings::of(args, &sources)?.check(&args.out)?;
    let shown = sources.write(&args.out)?;
    let begun = Instant::now();
    let progress = Mutex::new(Progress {
        next: first,
        end,
        kept: log.entries().iter().filter(|entry| entry.kept).count() as u64,
        running: 0,
        problem: None,
    });
    let tried: BTreeSet<u64> = log.entries().iter().map(|entry| entry.seed).collect();
    std::thread::scope(|scope| {
        for index in 0..args.jobs.get() {
            let (progress, log, tried) = (&progress, &log, &tried);
            let (sources, shown) = (&sources, &shown);
            scope.spawn(move || {
                let runner = Runner::new(args, sources, shown, index);
                while let Some(seed) = next(progress, tried, args) {
                    let tried = runner.episode(seed).and_then(|entry| {
                        println!("{}", entry.line());
                        log.append(&entry)?;
                        Ok(entry)
                    });
                    let mut progress = progress.lock();
                    progress.running -= 1;
                    match tried {
                        Ok(entry) => progress.kept += u64::from(entry.kept),
                        Err(problem) => {
                            progress.problem.get_or_insert(problem);
                        }
                    }
                }
            });
        }
    });
    let progress = progress.into_inner();
    if let Some(problem) = progress.problem {
        return Err(problem);
    }
    let report = Report::new(args, &sources, log.entries(), begun.elapsed());
    report.write(&args.out)?;
    print!("{report}");
    Ok(match report.kept >= args.episodes.get() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

/// The seeds to try. Seeds for tests are rejected, because the episodes are training data.
fn seeds(args: &MultiplyArgs) -> anyhow::Result<(u64, u64)> {
    let (first, end) = args.seeds.unwrap_or_else(|| {
        let most = args.episodes.get().saturating_mul(TRIES);
        (args.first_seed(), args.first_seed().saturating_add(most))
    });
    let purpose = Purpose::of_range(first..end)?;
    match purpose {
        Purpose::Train | Purpose::Free | Purpose::Develop => Ok((first, end)),
        Purpose::Checkpoint
        | Purpose::PolicyClaim
        | Purpose::Adversarial
        | Purpose::OperatorClaim => bail!(
            "seeds {first}..{end} are for {}, and multiplied episodes are training data; use some of {}",
            purpose.name(),
            Purpose::Train.seeds()
        ),
    }
}

/// The next seed to try; `None` at the end. Starts only as many episodes as suffice if all
/// succeed, so that the kept seeds do not depend on the number of workers.
fn next(progress: &Mutex<Progress>, tried: &BTreeSet<u64>, args: &MultiplyArgs) -> Option<u64> {
    loop {
        let mut now = progress.lock();
        if now.problem.is_some() || now.kept >= args.episodes.get() {
            return None;
        }
        while now.next < now.end && tried.contains(&now.next) {
            now.next += 1;
        }
        if now.kept + now.running < args.episodes.get() {
            if now.next >= now.end {
                return None;
            }
            let seed = now.next;
            now.next += 1;
            now.running += 1;
            return Some(seed);
        }
        drop(now);
        std::thread::sleep(WAIT);
    }
}
