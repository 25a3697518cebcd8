//! `wheelarm evaluate`: runs tasks over many seeds and counts the successes of the scripted
//! operator or a policy.
//!
//! Every episode runs in lock-step on a server that the command starts, by default without
//! cameras and without a recorder. Its result is appended to `episodes.jsonl` at once, so that
//! an interrupted run resumes. A server failure costs one episode: its entry has the scenario
//! that reproduces it, and a new server continues.

mod args;
mod compare;
mod entry;
mod episode_monitor;
mod grid;
mod milestone;
mod page;
mod progress;
mod redraw;
mod report;
mod runner;
mod scope;
mod statistics;
mod suite;
mod work;

use std::collections::BTreeMap;
use std::process::ExitCode;

use anyhow::{Context, bail};
use wheelarm_dataset::publish;
use wheelarm_options::choice::make_folder;
use wheelarm_proto::v1;
use wheelarm_rollout::EpisodeLog;

use crate::listed_tasks::check_task;
use crate::policy_options::{Choice, DriverChoice, Start, files};
use crate::variation::Variation;
use crate::worlds::tasks_of_homes;
use entry::Job;
use report::Report;
use scope::Scope;
use wheelarm_rollout::launcher::TaskSources;
use work::{begin, work};

pub use args::EvaluateArgs;
pub use entry::Entry;
pub use suite::SuiteReport;

/// Exit code when an episode broke.
const BROKEN: u8 = 3;

/// Runs the evaluation. Exit code 0 when every episode succeeded, 3 when one of them broke.
///
/// # Errors
/// When a program cannot be started, a recorder fails, or the folder cannot be
/// written.
pub fn run(args: &EvaluateArgs) -> anyhow::Result<ExitCode> {
    match &args.subcommand {
        Some(args::Subcommand::Compare(args)) => {
            compare::run(args)?;
            return Ok(ExitCode::SUCCESS);
        }
        Some(args::Subcommand::Verify(args)) => {
            suite::verify(args)?;
            return Ok(ExitCode::SUCCESS);
        }
        None => {}
    }
    if let Some(file) = &args.suite {
        let is_broken = suite::run(args, file)?;
        return Ok(match is_broken {
            true => ExitCode::from(BROKEN),
            false => ExitCode::SUCCESS,
        });
    }
    make_folder(&args.out)?;
    let scope = args.scope()?;
    let tasks = tasks(args, scope.layout, &scope.variation)?;
    let driver = DriverChoice::start(
        &args.policy,
        &Start {
            seeds: scope.seeds.clone(),
            log: &args.out,
            alone: args.deterministic,
            takeover: args.takeover,
        },
    )?;
    let policy = driver.name();
    let policy_files = files::digest(&args.policy.policy)?;
    // Seed by seed, so that an interrupted run has about as many episodes of every task.
    let wanted: Vec<Job> = scope
        .seeds
        .clone()
        .flat_map(|seed| {
            tasks.iter().map({
                let (variation, policy, policy_files) = (&scope.variation, &policy, &policy_files);
                move |task| Job {
                    task: task.clone(),
                    seed,
                    variation: variation.clone(),
                    policy: policy.clone(),
                    policy_files: policy_files.clone(),
                }
            })
        })
        .collect();
    let log = EpisodeLog::open(&args.out.join("episodes.jsonl"), publish::sync_data)?;
    for warning in log.damage() {
        tracing::warn!("{warning}");
    }
    begin(args, &wanted, &log)?;
    let known = log.entries();
    let is_done = |job: &Job| {
        let mut counted = known
            .iter()
            .filter(|entry| !args.again || entry.broken.is_none());
        counted.any(|entry| entry.is_of(job))
    };
    let (done, open): (Vec<Job>, Vec<Job>) = wanted.into_iter().partition(|job| is_done(job));
    if !done.is_empty() {
        let entries = known
            .iter()
            .filter(|entry| done.iter().any(|job| entry.is_of(job)));
        let entries: Vec<&Entry> = entries.collect();
        print!("{}", skipped(args, &entries, done.len() + open.len()));
    }
    work(args, &driver, &open, &log, &|_| Ok(()))?;
    let entries: Vec<Entry> = log
        .entries()
        .into_iter()
        .filter(|entry| done.iter().chain(&open).any(|job| entry.is_of(job)))
        .collect();
    conclude(
        args,
        &scope,
        &Report::new(&tasks, &entries, &scope),
        &entries,
    )?;
    Ok(if entries.iter().any(|entry| entry.broken.is_some()) {
        println!(
            "broken episodes are listed with their scenarios in {}; --again repeats them",
            args.out.join("episodes.jsonl").display()
        );
        ExitCode::from(BROKEN)
    } else if entries.iter().all(|entry| entry.success) && entries.len() == done.len() + open.len()
    {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Prints and writes the report, with its images.
fn conclude(
    args: &EvaluateArgs,
    scope: &Scope,
    report: &Report,
    entries: &[Entry],
) -> anyhow::Result<()> {
    print!("{report}");
    let path = args.out.join("report.json");
    std::fs::write(&path, report.json()?).with_context(|| format!("writing {}", path.display()))?;
    println!("report      {}", path.display());
    let redrawn = redraw::render_failures(args, entries)?;
    let path = page::write(&args.out, report, entries, &redrawn)?;
    println!("page        {}", path.display());
    // Episodes are repeated for it, which only the scripted operator does identically.
    if !args.no_grid && args.policy.policy == Choice::Operator {
        let path = grid::write(args, scope, report, entries)?;
        println!("images      {}", path.display());
    }
    Ok(())
}

/// Message about episodes that are already done, with the fix if they are not recorded.
fn skipped(args: &EvaluateArgs, done: &[&Entry], wanted: usize) -> String {
    let mut text = format!(
        "{} of {wanted} episodes are in {} already\n",
        done.len(),
        args.out.display()
    );
    if !args.record {
        return text;
    }
    let mut seeds: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for entry in done {
        let file = |label| args.out.join(format!("{label}.h5"));
        if !entry.recording().is_some_and(|label| file(label).is_file()) {
            let seeds = seeds.entry(entry.task.as_str()).or_default();
            seeds.push(entry.seed.to_string());
        }
    }
    if seeds.is_empty() {
        return text;
    }
    for (task, seeds) in seeds {
        text += &format!("    not recorded: {task} seed {}\n", seeds.join(", "));
    }
    text += "they count as done, so --record makes no file of them: choose another folder with \
             --out to run and record them\n";
    text
}

/// Names of the tasks to run. With the axis `layout`, `all` means the tasks that have several
/// layouts.
fn tasks(args: &EvaluateArgs, layout: bool, variation: &Variation) -> anyhow::Result<Vec<String>> {
    let packs = variation.scenario.packs.iter();
    let objects: Vec<String> = packs.map(|pack| pack.name.clone()).collect();
    let homes = &variation.homes;
    let sources = TaskSources {
        assets: args.assets.as_deref(),
        packs: &args.packs.packs,
        scene: &args.scene,
        objects: &objects,
    };
    let named = match args.task.as_str() {
        "all" => Vec::new(),
        list => each_once(list)?,
    };
    let listed = tasks_of_homes(sources, homes, &named)?;
    let (several, one): (Vec<_>, Vec<_>) = listed.iter().partition(|task| task.variants.len() > 1);
    let names = |tasks: Vec<&v1::TaskInfo>| {
        let names = tasks.into_iter().map(|task| task.name.clone());
        names.collect::<Vec<String>>()
    };
    let (several, one, all) = (names(several), names(one), names(listed.iter().collect()));
    if args.task == "all" {
        if layout {
            eprintln!("skipped, because they have one layout: {}", one.join(", "));
        }
        // Tasks of every home are named one by one: what they sample depends on the home.
        let of_areas = names(listed.iter().filter(|task| !task.area.is_empty()).collect());
        let chosen = if layout { several } else { all };
        let of_areas = |name: &String| of_areas.contains(name);
        return Ok(chosen.into_iter().filter(of_areas).collect());
    }
    let mut tasks = Vec::new();
    for name in each_once(&args.task)? {
        check_task(sources, &listed, name)?;
        if layout && one.iter().any(|task| task == name) {
            bail!(
                "the task {name:?} has one layout, so the axis `layout` changes nothing; tasks with several: {}",
                several.join(", ")
            );
        }
        tasks.push(name.to_owned());
    }
    Ok(tasks)
}

/// The names of a list with commas.
///
/// # Errors
/// When a name is listed twice: its episodes would count twice.
fn each_once(list: &str) -> anyhow::Result<Vec<&str>> {
    let names: Vec<&str> = list.split(',').collect();
    for (i, name) in names.iter().enumerate() {
        if names[..i].contains(name) {
            bail!("--task names {name:?} twice; remove one");
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        args: EvaluateArgs,
    }

    #[test]
    fn earlier_unrecorded_episodes_are_listed_with_the_fix() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().to_str().unwrap();
        let args = |more: &[&str]| Cli::parse_from([&["evaluate", "--out", out], more].concat());
        let entry = |seed: u64| {
            let text = format!(
                r#"{{"task":"pick_bowl","seed":{seed},"success":true,"why":"","conditions":[],"seconds":9.0,"factor":1.0,"hash":"","notes":[]}}"#
            );
            serde_json::from_str::<Entry>(&text).unwrap()
        };
        let [zero, one, two] = [0, 1, 2].map(entry);
        let done = [&zero, &one, &two];
        let plain = skipped(&args(&[]).args, &done, 4);
        assert_eq!(plain, format!("3 of 4 episodes are in {out} already\n"));
        std::fs::write(folder.path().join("pick_bowl-seed1.h5"), "").unwrap();
        let text = skipped(&args(&["--record"]).args, &done, 4);
        assert!(
            text.contains("not recorded: pick_bowl seed 0, 2\n"),
            "{text}"
        );
        assert!(text.contains("choose another folder with --out"), "{text}");
        std::fs::write(folder.path().join("pick_bowl-seed0.h5"), "").unwrap();
        let lines = |done: &[&Entry]| skipped(&args(&["--record"]).args, done, 4).lines().count();
        assert_eq!(lines(&[&zero, &one]), 1);
        // That file is another policy's.
        let unrecorded = Entry {
            label: Some(String::new()),
            ..entry(0)
        };
        assert_eq!(lines(&[&unrecorded, &one]), 3);
    }

    #[test]
    fn duplicate_task_name_is_rejected() {
        assert_eq!(each_once("b,a").unwrap(), ["b", "a"]);
        let text = each_once("a,b,a").unwrap_err().to_string();
        assert!(text.contains("\"a\" twice"), "{text}");
    }
}
