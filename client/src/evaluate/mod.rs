//! `wheelarm evaluate`: the scripted operator does tasks over many seeds and
//! the rates of success are counted.
//!
//! Every episode runs in lock-step on a server of the command's own, without
//! cameras and without a recorder unless asked. Its result is appended to
//! `episodes.jsonl` as soon as it is there, so that an interrupted run goes on
//! where it was. What breaks a server costs one episode: it is entered with the
//! scenario that reproduces it, and a new server goes on.

mod episode;
mod grid;
mod ledger;
mod pulse;
mod report;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, bail};
use clap::Args;
use wheelarm_proto::v1;

pub use episode::Entry;
use episode::Worker;
use ledger::Ledger;
use wheelarm_proto::settings::{Pacing, Quality};
use wheelarm_rig::local::{LocalServer, ServerOptions};

/// Options of `wheelarm evaluate`.
#[derive(Args, Clone, Debug)]
pub struct EvaluateArgs {
    /// Task, or `all`.
    #[arg(long, default_value = "all")]
    pub task: String,
    /// Seeds, `FIRST..LAST` without the last.
    #[arg(long, value_parser = crate::demo::seed_range, value_name = "A..B")]
    pub seeds: Option<(u64, u64)>,
    /// Episodes of each task; from the first seed, 0 when no seeds are given.
    #[arg(long, value_name = "N")]
    pub episodes: Option<u64>,
    /// Servers at work at one time.
    #[arg(long, default_value_t = 1, value_name = "J")]
    pub jobs: usize,
    /// Folder for the results; an interrupted run in it goes on.
    #[arg(long, default_value = "data/evaluate")]
    pub out: PathBuf,
    /// Records every episode as an HDF5 file into the folder.
    #[arg(long)]
    pub record: bool,
    /// Camera of the recordings, `NAME=WIDTHxHEIGHT@HZ`, may be given several
    /// times, `*` for each of the robot's that is not named; `*=640x360@10` when absent.
    #[arg(long, requires = "record", value_name = "CAMERA")]
    pub camera: Vec<String>,
    /// Does those episodes anew in which something broke; without it they count as done.
    #[arg(long)]
    pub again: bool,
    /// Wall seconds without a sign of life after which a server is ended.
    #[arg(long, default_value_t = 60.0, value_name = "SECONDS")]
    pub patience: f64,
    /// No picture of the end of each task.
    #[arg(long)]
    pub no_grid: bool,
    /// Scene.
    #[arg(long, default_value = "home")]
    pub scene: String,
    /// Robot, a folder in assets/robots.
    #[arg(long, default_value = "wheelarm")]
    pub robot: String,
    /// Assets folder; the server looks for it when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
}

impl EvaluateArgs {
    /// First seed and the one after the last.
    fn range(&self) -> (u64, u64) {
        let (first, end) = self.seeds.unwrap_or((0, self.episodes.unwrap_or(10)));
        let end = self.episodes.map_or(end, |count| end.min(first + count));
        (first, end)
    }

    /// How a server of this evaluation is started.
    fn server(&self, task: &str, seed: u64, cameras: Vec<String>) -> ServerOptions {
        ServerOptions {
            scene: self.scene.clone(),
            task: task.to_owned(),
            robot: self.robot.clone(),
            seed,
            pacing: Pacing::LockStep,
            cameras,
            quality: Quality::Standard,
            assets: self.assets.clone(),
        }
    }
}

/// One episode to do.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Job {
    task: String,
    seed: u64,
}

/// Exit code when something broke in an episode.
const BROKEN: u8 = 3;

/// Runs the evaluation. Success when every episode of every task succeeded, 3
/// when something broke in one of them.
///
/// # Errors
/// When a program cannot be started, a recorder fails, or the folder cannot be
/// written.
pub fn run(args: &EvaluateArgs) -> anyhow::Result<ExitCode> {
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("making the folder {}", args.out.display()))?;
    let tasks = tasks(args)?;
    let (first, end) = args.range();
    let ledger = Ledger::open(&args.out)?;
    let known = ledger.entries();
    let is_known = |job: &Job| {
        known
            .iter()
            .filter(|entry| !args.again || entry.broken.is_empty())
            .any(|entry| entry.task == job.task && entry.seed == job.seed)
    };
    let wanted: Vec<Job> = tasks
        .iter()
        .flat_map(|task| {
            (first..end).map(|seed| Job {
                task: task.clone(),
                seed,
            })
        })
        .collect();
    let open: Vec<Job> = wanted
        .iter()
        .filter(|job| !is_known(job))
        .cloned()
        .collect();
    if open.len() < wanted.len() {
        println!(
            "{} of {} episodes are in {} already",
            wanted.len() - open.len(),
            wanted.len(),
            args.out.display()
        );
    }
    work(args, &open, &ledger)?;
    let entries: Vec<Entry> = ledger
        .entries()
        .into_iter()
        .filter(|entry| tasks.contains(&entry.task) && (first..end).contains(&entry.seed))
        .collect();
    let report = report::Report::new(&tasks, &entries);
    print!("{report}");
    let path = args.out.join("report.json");
    std::fs::write(&path, report.json()?).with_context(|| format!("writing {}", path.display()))?;
    println!("report      {}", path.display());
    if !args.no_grid {
        println!(
            "pictures    {}",
            grid::draw(args, &report, &entries)?.display()
        );
    }
    if entries.iter().any(|entry| !entry.broken.is_empty()) {
        println!(
            "what broke is entered with its scenario in {}; --again does it anew",
            args.out.join("episodes.jsonl").display()
        );
        return Ok(ExitCode::from(BROKEN));
    }
    let all_good = entries.iter().all(|entry| entry.success);
    Ok(if all_good && entries.len() == wanted.len() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Names of the tasks to do, as a server knows them.
fn tasks(args: &EvaluateArgs) -> anyhow::Result<Vec<String>> {
    let server = LocalServer::start(&args.server("", 0, Vec::new()))?;
    let link = server.link()?;
    let list: v1::TaskList = link.ask(&v1::TasksRequest {})?;
    server.stop(link)?;
    let all: Vec<String> = list.tasks.into_iter().map(|task| task.name).collect();
    if args.task == "all" {
        return Ok(all);
    }
    let mut tasks = Vec::new();
    for name in args.task.split(',') {
        if !all.iter().any(|task| task == name) {
            bail!(
                "there is no task {name:?}; the tasks are: {}",
                all.join(", ")
            );
        }
        tasks.push(name.to_owned());
    }
    Ok(tasks)
}

/// Does the open episodes with as many servers as asked.
fn work(args: &EvaluateArgs, open: &[Job], ledger: &Ledger) -> anyhow::Result<()> {
    if open.is_empty() {
        return Ok(());
    }
    let next = AtomicUsize::new(0);
    let trouble: Mutex<Option<anyhow::Error>> = Mutex::new(None);
    let one_after_another = |index: usize| -> anyhow::Result<()> {
        let mut worker: Option<Worker> = None;
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = open.get(at) else {
                break;
            };
            let able = match &mut worker {
                Some(worker) => worker,
                none => none.insert(Worker::start(args, index)?),
            };
            let (entry, lives) = able.episode(job)?;
            if !lives {
                worker = None;
            }
            println!("{:>4} of {}  {}", at + 1, open.len(), entry.line());
            ledger.add(&entry)?;
        }
        worker.map_or(Ok(()), Worker::stop)
    };
    std::thread::scope(|scope| {
        for index in 0..args.jobs.clamp(1, open.len()) {
            let (trouble, next, one_after_another) = (&trouble, &next, &one_after_another);
            scope.spawn(move || {
                if let Err(error) = one_after_another(index) {
                    // The others finish what they are at.
                    next.store(open.len(), Ordering::Relaxed);
                    let mut first = trouble
                        .lock()
                        .unwrap_or_else(std::sync::PoisonError::into_inner);
                    first.get_or_insert(error);
                }
            });
        }
    });
    let trouble = trouble
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    trouble.map_or(Ok(()), Err)
}
