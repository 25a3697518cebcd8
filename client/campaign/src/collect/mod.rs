//! `wheelarm collect`: makes a dataset from a plan, on one host or on many.
//!
//! Each worker runs a server, a recorder and the scripted operator in lock-step, one episode
//! at a time, in one process or in three. Append-only journals are the only state, so a kill
//! at any time costs at most the running episodes. Shards need no coordinator: name, seed
//! and shard of an episode follow from the plan alone.

mod acceptance;
mod activity;
mod attempt;
mod capacity;
mod card;
mod episode;
mod estimate;
mod failure_analysis;
mod fleet;
mod folder;
mod journal;
mod manifest;
mod merge;
mod names;
mod plan;
mod progress;
mod resume;
mod rights;
mod slot;
mod stop;

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use wheelarm_proto::installed;

use crate::adapters::AdapterArgs;
use crate::worker_mode::WorkerMode;
use crate::worlds::tasks_of_homes;
use attempt::Setup;
use capacity::{Host, PIPELINES, free_disk, is_memory, worker_bytes};
use episode::{Episode, Shard, episodes};
use estimate::{Estimate, estimate};
use fleet::Tally;
use folder::Folder;
use manifest::Manifest;
use plan::Plan;
use progress::ProgressView;
use resume::{jobs, ledger, settle};
use slot::Slot;
use stop::Stop;
use wheelarm_options::choice::{did_you_mean, named, patience};
use wheelarm_options::packs::PackArgs;
use wheelarm_rollout::launcher::TaskSources;

pub use plan::PlanError;

/// Exit code of a dataset that lacks episodes, and of a run in which the physics
/// or a server broke for good.
const INCOMPLETE: u8 = 3;

/// Options of `wheelarm collect`.
#[derive(Args, Clone, Debug)]
pub struct CollectArgs {
    /// The plan, for example assets/campaigns/small.toml.
    #[arg(required_unless_present = "merge")]
    pub plan: Option<PathBuf>,
    /// Folder for the dataset; the plan's, else data/NAME.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Folder for running recordings, converted to the files of the dataset at their end:
    /// in memory (/dev/shm) or on a local disk, if the disk of the dataset is slow. Default:
    /// in the dataset.
    #[arg(long, value_name = "DIR")]
    pub scratch: Option<PathBuf>,
    /// Only prints episodes, samples, disk and time. Fails when the plan names a missing
    /// asset, or the disk is too small.
    #[arg(long)]
    pub dry_run: bool,
    /// Report of `wheelarm evaluate` (JSON) with mean durations and success rates.
    #[arg(long, value_name = "FILE")]
    pub durations: Option<PathBuf>,
    /// Episodes made at the same time; as many as memory and cores allow when absent.
    #[arg(long, alias = "workers", value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// Makes part I of N, from 0/N to N-1/N, without a coordinator.
    #[arg(long, value_name = "I/N", default_value_t = Shard::WHOLE)]
    pub shard: Shard,
    /// Assets folder; found by the server when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
    /// World packs.
    #[command(flatten)]
    pub packs: PackArgs,
    #[command(flatten)]
    pub graphics: AdapterArgs,
    /// Processes of a worker: `process` runs server, recorder and operator in one process,
    /// `socket` runs each in its own.
    #[arg(long, value_parser = named::<WorkerMode>(), default_value = "process")]
    pub worker: WorkerMode,
    /// Wall seconds without a reply after which a server is ended, at least 5.
    #[arg(long, default_value = "180", value_parser = patience::<5>, value_name = "SECONDS")]
    pub patience: Duration,
    /// Joins the folders of shards into one dataset (--out, else the first), checks every
    /// file and lists missing episodes.
    #[arg(
        long,
        value_name = "DIR",
        num_args = 1..,
        conflicts_with_all = ["plan", "dry_run", "durations", "jobs", "shard", "adapter", "scratch"]
    )]
    pub merge: Vec<PathBuf>,
}

/// Runs `wheelarm collect`. Exit code 0 when every planned episode exists, 3 when episodes
/// are missing, or a failure of the physics or a server made an attempt be replaced.
///
/// # Errors
/// When the plan is invalid, the folder belongs to another plan or cannot be written, or
/// this host cannot make an episode.
pub fn run(args: &CollectArgs) -> anyhow::Result<ExitCode> {
    if let Some(first) = args.merge.first() {
        let out = args.out.as_ref().unwrap_or(first);
        let manifest = merge::merge(&args.merge, out)?;
        return Ok(print_dataset(&manifest, &Folder::at(out)));
    }
    let path = args
        .plan
        .as_deref()
        .context("the plan is missing: name one, for example assets/campaigns/small.toml")?;
    let plan = Plan::read(path)?;
    for warning in &plan.warnings {
        eprintln!("warning: {}: {warning}", path.display());
    }
    let out = args.out.clone().or_else(|| plan.out.clone());
    let out = out.unwrap_or_else(|| Path::new("data").join(&plan.name));
    let mine: Vec<Episode> = episodes(&plan)
        .into_iter()
        .filter(|episode| args.shard.has(episode))
        .collect();
    let (ledger, warnings) = ledger(&Folder::at(&out), &mine)?;
    for warning in warnings {
        tracing::warn!("{warning}");
    }
    let evaluated = args.durations.as_deref().map(estimate::durations);
    let estimate = estimate(
        &plan,
        &mine,
        &ledger,
        &evaluated.transpose()?.unwrap_or_default(),
    );
    let left = mine.len() - ledger.done.len();
    let host = Host::measure();
    // A recording is about as large as its file.
    let in_memory = args.scratch.as_deref().is_some_and(is_memory);
    let kept = if in_memory {
        PIPELINES as f64 * estimate.largest()
    } else {
        0.0
    };
    let free_scratch = args.scratch.as_deref().and_then(free_disk);
    let most = free_scratch.map_or(usize::MAX, |free| estimate.workers_in(free));
    let fits = || host.workers(&plan, kept).min(most).min(left.max(1));
    let workers = args.jobs.map_or_else(fits, NonZeroUsize::get);
    host.check(workers)?;
    let packs = &args.packs.packs;
    let unknown = unknown(path, &plan, args.assets.as_deref(), packs)?;
    if let Some(problem) = unknown {
        bail!("{problem}");
    }
    let assets = args.assets.clone().or_else(installed::assets);
    if let Some(words) = rights::check(path, &plan, &assets.unwrap_or_default(), packs)? {
        eprintln!("warning: {words}; with pack_license = \"commercial\" in the plan it is refused");
    }
    let needed = (worker_bytes(&plan) + kept) * workers as f64;
    let free = host.memory.filter(|free| (*free as f64) < needed);
    let short = free.map(|free| {
        let [needed, free] = [needed, free as f64].map(estimate::bytes);
        format!("{workers} workers need {needed} of memory and {free} are free")
    });
    if args.dry_run {
        print!("{}", estimate.table(&plan, &out, (workers, kept)));
        if let Some(scratch) = &args.scratch {
            println!("{}", estimate.scratch(scratch, workers));
        }
        estimate.check_disk(&out)?;
        if let Some(words) = short {
            bail!("{words}; use fewer --jobs or smaller cameras");
        }
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(words) = short {
        tracing::warn!("{words}; a worker that the system kills is replaced, with fewer at a time");
    }
    let mut folder = Folder::make(&out)?;
    if let Some(scratch) = &args.scratch {
        folder = folder.with_scratch(scratch, args.shard)?;
    }
    let setup = Setup {
        plan,
        folder,
        assets: args.assets.clone(),
        packs: args.packs.packs.clone(),
        mode: args.worker,
        patience: args.patience,
    };
    let slots = args.graphics.of_workers(workers)?;
    let slots: Vec<Slot> = slots
        .into_iter()
        .map(|adapter| setup.slot(adapter))
        .collect();
    collect(&setup, args.shard, mine, &estimate, &slots)
}

/// Makes the missing episodes of `mine`.
fn collect(
    setup: &Setup,
    shard: Shard,
    mine: Vec<Episode>,
    estimate: &Estimate,
    slots: &[Slot],
) -> anyhow::Result<ExitCode> {
    let stop = Stop::default();
    stop.listen()?;
    let folder = &setup.folder;
    let journal = journal::open(&folder.journal(), shard)?;
    // Another run may have written before this one held the lock.
    let (mut ledger, _) = ledger(folder, &mine)?;
    folder.keep_plan(&setup.plan.text)?;
    settle(folder, &mine, &journal, &mut ledger)?;
    let jobs = jobs(&mine, &ledger, estimate);
    let slots = &slots[..slots.len().min(jobs.len().max(1))];
    let workers = slots.len();
    println!(
        "{}: {} of {} episodes exist, {workers} workers make the others in {}",
        setup.plan.name,
        ledger.done.len(),
        mine.len(),
        folder.root().display()
    );
    let expected = jobs.iter().map(|job| job.expected).sum();
    let show = ProgressView::new(PIPELINES * workers, ledger.done.len(), mine.len(), expected);
    let tally = fleet::work(
        setup,
        jobs,
        journal,
        slots,
        estimate.largest(),
        (&stop, &show),
    );
    folder.clear_scratch();
    let (ledger, _) = resume::ledger(folder, &mine)?;
    let manifest = Manifest::new(&setup.plan.name, &mine, &ledger);
    explain(&tally, setup.plan.attempts);
    // A shard knows only its own part: the merge writes the manifest.
    if shard == Shard::WHOLE {
        manifest.write(folder)?;
        card::write(folder, &setup.plan, &manifest)?;
        return finish(&tally, print_dataset(&manifest, folder));
    }
    println!("shard {shard}: {}", manifest.line());
    finish(&tally, code(&manifest))
}

fn finish(tally: &Tally, code: ExitCode) -> anyhow::Result<ExitCode> {
    match &tally.ended {
        Some(why) => bail!("ended early: {why}"),
        None if !tally.entered.is_empty() => Ok(ExitCode::from(INCOMPLETE)),
        None => Ok(code),
    }
}

/// Prints the content of a dataset.
fn print_dataset(manifest: &Manifest, folder: &Folder) -> ExitCode {
    for id in &manifest.missing {
        println!("missing: {id}");
    }
    println!("{}", manifest.line());
    println!(
        "manifest  {}",
        folder.root().join("manifest.json").display()
    );
    println!("report    {}", folder.root().join("report.md").display());
    code(manifest)
}

fn code(manifest: &Manifest) -> ExitCode {
    if manifest.complete {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(INCOMPLETE)
    }
}

/// Prints the failures of a run.
fn explain(tally: &Tally, attempts: u32) {
    for id in &tally.given_up {
        println!(
            "{id}: all {attempts} attempts failed; a larger `attempts` in the plan adds new seeds"
        );
    }
    for (id, words) in &tally.entered {
        println!("{id}: broken, the journal has its scenario: {words}");
    }
    for (id, words) in &tally.broken {
        println!("{id}: not made, the next run tries again: {words}");
    }
    if tally.retired > 0 {
        println!(
            "{} workers were killed, most likely for lack of memory; their episodes were repeated with the same seeds: use fewer --jobs, or a job with more memory",
            tally.retired
        );
    }
    if tally.discarded > 0 {
        println!(
            "{} running episodes were discarded; the same command resumes",
            tally.discarded
        );
    }
}

/// The first name of the plan that the assets do not define, as an error message.
fn unknown(
    path: &Path,
    plan: &Plan,
    assets: Option<&Path>,
    packs: &[PathBuf],
) -> anyhow::Result<Option<String>> {
    let folder = assets.map(Path::to_owned).or_else(installed::assets);
    let named = folder.and_then(|folder| names::unknown(path, plan, &folder, packs));
    match named {
        Some(problem) => Ok(Some(problem)),
        None => unknown_tasks(path, plan, assets, packs),
    }
}

/// The first task of the plan that the server does not know, as an error message.
fn unknown_tasks(
    path: &Path,
    plan: &Plan,
    assets: Option<&Path>,
    packs: &[PathBuf],
) -> anyhow::Result<Option<String>> {
    let packs_of_plan = plan.scenario().packs.iter();
    let objects: Vec<String> = packs_of_plan
        .map(|pack| pack.name.clone())
        .filter(|name| *name != plan.scenario().scene)
        .collect();
    let sources = TaskSources {
        assets,
        packs,
        scene: &plan.scenario().scene,
        objects: &objects,
    };
    let wanted: Vec<&str> = plan.tasks.iter().map(|task| task.name.as_str()).collect();
    let listed = tasks_of_homes(sources, &plan.variation.homes, &wanted)?;
    let known: BTreeSet<&str> = listed.iter().map(|task| task.name.as_str()).collect();
    let unknown = plan
        .tasks
        .iter()
        .find(|task| !known.contains(task.name.as_str()));
    Ok(unknown.map(|task| {
        let known: Vec<&str> = known.into_iter().collect();
        format!(
            "{}:{}: no task named {:?} in the assets; available: {}; correct the name or remove the entry{}",
            path.display(),
            task.line,
            task.name,
            known.join(", "),
            did_you_mean(&task.name, known.iter().copied())
        )
    }))
}
