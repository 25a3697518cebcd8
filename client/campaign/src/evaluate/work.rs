//! Runs the open episodes of an evaluation on several servers.

use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::bail;
use parking_lot::Mutex;
use wheelarm_rollout::EpisodeLog;

use super::args::EvaluateArgs;
use super::entry::{Entry, Job};
use super::runner::Runner;
use crate::adapters::AdapterArgs;
use crate::policy_options::DriverChoice;

/// Moves earlier results aside with `--fresh`. Otherwise rejects results of a policy with
/// other files, because they would be counted together with the new ones.
///
/// # Errors
/// When results of other files exist, or the log cannot be rewritten.
pub fn begin(args: &EvaluateArgs, wanted: &[Job], log: &EpisodeLog<Entry>) -> anyhow::Result<()> {
    if args.fresh {
        let is_old = |entry: &Entry| {
            wanted
                .iter()
                .any(|job| entry.is_of(job) || entry.is_outdated(job))
        };
        if let Some(aside) = log.set_aside(is_old)? {
            println!("the earlier results are in {}", aside.display());
        }
        return Ok(());
    }
    let known = log.entries();
    let is_outdated = |entry: &&Entry| wanted.iter().any(|job| entry.is_outdated(job));
    let outdated = known.iter().filter(is_outdated).count();
    if outdated > 0 {
        bail!(
            "the files of the policy changed since {outdated} of the episodes in {}: add --fresh \
             to repeat all episodes, or choose another folder with --out",
            args.out.display()
        );
    }
    Ok(())
}

/// A check of each result before it is stored; its error ends the evaluation.
pub type Check<'a> = &'a (dyn Fn(&Entry) -> anyhow::Result<()> + Sync);

/// Runs the open episodes on `--jobs` servers.
///
/// # Errors
/// When a program does not start, a recorder fails, the log cannot be written, or `check`
/// rejects a result.
pub fn work(
    args: &EvaluateArgs,
    driver: &DriverChoice,
    open: &[Job],
    log: &EpisodeLog<Entry>,
    check: Check<'_>,
) -> anyhow::Result<()> {
    if open.is_empty() {
        return Ok(());
    }
    let next = AtomicUsize::new(0);
    let trouble: Mutex<Option<anyhow::Error>> = Mutex::new(None);
    let adapters = args.graphics.of_workers(args.jobs.get().min(open.len()))?;
    std::thread::scope(|scope| {
        for (index, adapter) in adapters.into_iter().enumerate() {
            let (trouble, next) = (&trouble, &next);
            scope.spawn(move || {
                let mut args = args.clone();
                args.graphics = AdapterArgs::only(adapter);
                if let Err(error) =
                    run_sequentially((&args, driver), index, (open, next), log, check)
                {
                    // The other runners finish their episodes.
                    next.store(open.len(), Ordering::Relaxed);
                    trouble.lock().get_or_insert(error);
                }
            });
        }
    });
    trouble.into_inner().map_or(Ok(()), Err)
}

/// Runs the episodes of runner number `index`: takes the next open one until none is left.
fn run_sequentially(
    (args, driver): (&EvaluateArgs, &DriverChoice),
    index: usize,
    (open, next): (&[Job], &AtomicUsize),
    log: &EpisodeLog<Entry>,
    check: Check<'_>,
) -> anyhow::Result<()> {
    let mut current: Option<(String, Runner<'_>)> = None;
    loop {
        let at = next.fetch_add(1, Ordering::Relaxed);
        let Some(job) = open.get(at) else {
            return Ok(());
        };
        // A server keeps the settings that a scenario leaves out, so other settings need
        // another server.
        let settings = job.variation.words(0);
        let runner = match &current {
            Some((known, runner)) if *known == settings => runner,
            _ => {
                &current
                    .insert((settings, Runner::new(args, driver, index)?))
                    .1
            }
        };
        let entry = runner.episode(job)?;
        println!("{:>4} of {}  {}", at + 1, open.len(), entry.line());
        check(&entry)?;
        log.append(&entry)?;
    }
}
