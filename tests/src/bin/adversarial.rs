//! Adversarial operators against the physics: prints a line for every run and
//! ends with 1 when one exploded or broke a law.
//!
//! `adversarial [--rigid 140] [--soft 60] [--seconds 60] [--seed 0] [--only NAME] [--jobs N]`
//! or `adversarial --recorded FOLDER` for stored commands,
//! or `adversarial --guard 1000` for episodes that press the seated person.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::Result;
use clap::Parser;
use wheelarm_tests::adversary::{GuardRun, Recorded, Verdict, runs};

#[derive(Parser)]
struct Options {
    /// Runs over the rigid tasks.
    #[arg(long, default_value_t = 140)]
    rigid: usize,
    /// Runs at the bear.
    #[arg(long, default_value_t = 60)]
    soft: usize,
    /// Simulated length of a run, seconds.
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Seed of the first run.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Only runs whose line begins with this, for example "pick_bowl Harass".
    #[arg(long)]
    only: Option<String>,
    /// Runs at the same time; 0 takes every core.
    #[arg(long, default_value_t = 0)]
    jobs: usize,
    /// Folder of the assets.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// Plays the stored commands of a folder instead.
    #[arg(long)]
    recorded: Option<PathBuf>,
    /// Plays this many episodes that press the seated person under the guard, of
    /// `--seconds` each, instead.
    #[arg(long)]
    guard: Option<usize>,
    /// With `--guard`: the guard is off, to see what the operators can do.
    #[arg(long, requires = "guard")]
    unguarded: bool,
}

/// One run: it prints a line and returns whether every law held.
type Work = Box<dyn Fn(&str) -> bool + Send + Sync>;
type Job = (String, Work);

fn main() -> Result<ExitCode> {
    let options = Options::parse();
    let jobs = match &options.recorded {
        Some(folder) => recorded(folder, &options)?,
        None if options.guard.is_some() => guarded(&options),
        None => random(&options),
    };
    anyhow::ensure!(
        !jobs.is_empty(),
        "no run selected: use --rigid or --soft, and check --only"
    );
    let cores = std::thread::available_parallelism().map_or(1, Into::into);
    let workers = if options.jobs == 0 {
        cores
    } else {
        options.jobs
    };
    let (next, bad) = (AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some((name, job)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if !job(name) {
                        bad.fetch_add(1, Ordering::Relaxed);
                    }
                }
            });
        }
    });
    let (all, bad) = (jobs.len(), bad.into_inner());
    println!(
        "{} of {all} runs kept every law and did not explode",
        all - bad
    );
    Ok(ExitCode::from(u8::from(bad > 0)))
}

fn random(options: &Options) -> Vec<Job> {
    let runs = runs(options.rigid, options.soft, options.seed);
    let job = |run: wheelarm_tests::adversary::Run| -> Job {
        let (assets, seconds) = (options.assets.clone(), options.seconds);
        let name = format!("{} {:?} seed {}", run.task, run.kind, run.seed);
        let play = move || run.play(&assets, seconds);
        (name, Box::new(move |name| run_and_report(name, &play)))
    };
    let jobs = runs.into_iter().map(job);
    let only = options.only.as_deref().unwrap_or_default();
    jobs.filter(|(name, _)| name.starts_with(only)).collect()
}

fn recorded(folder: &PathBuf, options: &Options) -> Result<Vec<Job>> {
    let mut files: Vec<_> = std::fs::read_dir(folder)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "commands"))
        .collect();
    files.sort();
    let job = |path: PathBuf| -> Job {
        let assets = options.assets.clone();
        let name = path.display().to_string();
        let play = move || Recorded::read(&path)?.play(&assets);
        (name, Box::new(move |name| run_and_report(name, &play)))
    };
    Ok(files.into_iter().map(job).collect())
}

/// Episodes that press the person; `--seed` is the first seed.
fn guarded(options: &Options) -> Vec<Job> {
    let job = |i: usize| -> Job {
        let (assets, seconds) = (options.assets.clone(), options.seconds);
        let seed = options.seed + i as u64;
        let guard = !options.unguarded;
        let run = GuardRun { seed, guard };
        let name = format!("guard seed {seed}");
        (
            name,
            Box::new(move |name| pressed(name, run, &assets, seconds)),
        )
    };
    let only = options.only.as_deref().unwrap_or_default();
    let jobs = (0..options.guard.unwrap_or_default()).map(job);
    jobs.filter(|(name, _)| name.starts_with(only)).collect()
}

/// Prints the forces of an episode that presses the person; whether every part stayed
/// below the limit.
fn pressed(name: &str, run: GuardRun, assets: &Path, seconds: f64) -> bool {
    let play = || run.play(assets, seconds);
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(play));
    match result {
        Ok(Ok(verdict)) => {
            let good = verdict.broken.is_empty() && verdict.fault.is_none();
            println!(
                "{} {name}: {} control ticks; {:.1} N at most, touched in {:.1} % of them",
                if good { "ok " } else { "BAD" },
                verdict.ticks,
                verdict.force(),
                verdict.touched * 100.0
            );
            for what in verdict.broken.iter().chain(&verdict.fault) {
                println!("      {what}");
            }
            good
        }
        failed => report_failure(name, failed),
    }
}

/// Prints why a run has no verdict.
fn report_failure<T>(name: &str, result: std::thread::Result<Result<T>>) -> bool {
    match result {
        Ok(Err(error)) => println!("BAD {name}: {error:#}"),
        _ => println!("BAD {name}: panicked"),
    }
    false
}

/// Runs a job and prints its verdict; returns whether it was good.
fn run_and_report(name: &str, job: &dyn Fn() -> Result<Verdict>) -> bool {
    let begin = Instant::now();
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(job));
    let wall = begin.elapsed().as_secs_f64();
    match result {
        Ok(Ok(verdict)) => {
            let soft = verdict.soft.map_or_else(String::new, |s| {
                let ticks = s.ticks.max(1) as f64;
                format!(
                    "; node {:.2} m/s, {:.2} J, normal {:.1e} N, friction {:.4}, kick {:.3} m/s, rise {:.1e} J, {:.1e} J, {:.2} solutions and {:.1} steps a tick, {} softened, {} unsettled",
                    s.speed, s.energy, s.normal, s.friction, s.kick, s.rise, s.window_rise,
                    s.solutions as f64 / ticks, s.steps as f64 / ticks, s.softened, s.unsettled
                )
            });
            let good = verdict.broken.is_empty() && verdict.unlawful.is_empty();
            println!(
                "{} {name}: {:.1} s in {wall:.1} s; contact {:.0} N, joint {:.1} rad/s{soft}",
                if good { "ok " } else { "BAD" },
                verdict.ticks as f64 / 240.0,
                verdict.contact,
                verdict.joint,
            );
            for what in verdict.broken.iter().take(4).chain(&verdict.unlawful) {
                println!("      {what}");
            }
            good
        }
        failed => report_failure(name, failed),
    }
}
