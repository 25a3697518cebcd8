//! `wheelarm evaluate --suite FILE`: runs the cells of a suite.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};
use wheelarm_dataset::publish;
use wheelarm_policy::ledger::Ledger;
use wheelarm_proto::{PHYSICS_VERSION, program};
use wheelarm_rollout::EpisodeLog;
use wheelarm_rollout::launcher::{TaskSources, tasks_of_program};

use super::super::args::EvaluateArgs;
use super::super::entry::{Entry, Job};
use super::super::work::{begin, work};
use super::figures::Row;
use super::file::{BASE, Cell, Suite};
use super::hardware::Hardware;
use super::report::{FORMAT, Identity, PolicyId, Session, SuiteReport};
use super::{ledger_check, page};
use crate::policy_options::{DriverChoice, Start, files};

/// File of a run's identity and sessions.
const RUN: &str = "run.json";

/// Identity and sessions of the run in a folder.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct RunFile {
    identity: Identity,
    sessions: Vec<Session>,
}

/// A driver with what identifies it.
pub struct Tested {
    /// The driver.
    pub driver: DriverChoice,
    /// Its training ledger; absent for an undeclared policy.
    pub ledger: Option<Ledger>,
    /// Digest of its files.
    pub files: String,
}

impl Tested {
    /// Starts the driver of `args` for the seeds of `suite`.
    ///
    /// # Errors
    /// When the policy does not start, was trained on the seeds, or its ledger is invalid.
    pub fn start(args: &EvaluateArgs, suite: &Suite) -> anyhow::Result<Self> {
        ensure!(
            !args.policy.training_seeds,
            "--training-seeds allows what a suite excludes; remove it"
        );
        let choice = &args.policy.policy;
        let driver = DriverChoice::start(
            &args.policy,
            &Start {
                seeds: suite.seeds.clone(),
                log: &args.out,
                alone: args.deterministic,
                takeover: None,
            },
        )?;
        let ledger = ledger_check::of_policy(choice, args.ledger.as_deref(), driver.weights())?;
        Ok(Self {
            driver,
            ledger,
            files: files::digest(choice)?,
        })
    }

    /// What identifies the run.
    #[must_use]
    pub fn identity(&self, args: &EvaluateArgs, suite: &Suite) -> Identity {
        let choice = &args.policy.policy;
        let name = self.driver.name();
        Identity {
            format: FORMAT.to_owned(),
            suite: suite.id(),
            policy: PolicyId {
                kind: choice.kind().to_owned(),
                name: match name.is_empty() {
                    true => choice.kind().to_owned(),
                    false => name,
                },
                weights: self.driver.weights().to_owned(),
                files: self.files.clone(),
                ledger: self.ledger.as_ref().map(Ledger::hash),
                undeclared: ledger_check::undeclared(self.ledger.as_ref(), &suite.cells),
                deterministic: args.deterministic || choice.is_exact(),
            },
            physics_version: PHYSICS_VERSION,
        }
    }

    /// The episodes of a cell.
    fn jobs(&self, suite: &Suite, cell: &Cell) -> Vec<Job> {
        let all = suite.episodes(cell);
        all.map(|(task, seed)| self.job(suite, cell, task, seed))
            .collect()
    }

    /// The episode of a cell.
    #[must_use]
    pub fn job(&self, suite: &Suite, cell: &Cell, task: &str, seed: u64) -> Job {
        Job {
            policy: self.driver.name(),
            policy_files: self.files.clone(),
            ..suite.job(cell, task, seed)
        }
    }
}

/// Runs cells of a suite and writes their report. Returns whether an episode broke.
///
/// # Errors
/// When the suite or the policy is rejected, a program does not start, or the folder has the
/// results of another run.
pub fn run(args: &EvaluateArgs, file: &Path) -> anyhow::Result<bool> {
    let suite = Suite::read(file)?;
    let mut cells = suite.chosen(&args.cells)?;
    check_tasks(args, &cells)?;
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("making the folder {}", args.out.display()))?;
    let tested = Tested::start(args, &suite)?;
    if !tested.driver.observes_images() {
        let (images, others): (Vec<_>, Vec<_>) = cells.into_iter().partition(|c| needs_images(c));
        for cell in images {
            println!(
                "skipped     {}: it changes images, and this policy observes none",
                cell.name
            );
        }
        cells = others;
    }
    match &tested.ledger {
        Some(ledger) => ledger_check::check(ledger, &suite, &cells)?,
        None => println!(
            "ledger      undeclared: no training ledger is beside the policy; name one with --ledger"
        ),
    }
    let log = EpisodeLog::open(&args.out.join("episodes.jsonl"), publish::sync_data)?;
    for warning in log.damage() {
        tracing::warn!("{warning}");
    }
    let jobs = cells.iter().map(|cell| (*cell, tested.jobs(&suite, cell)));
    let by_cell: Vec<(&Cell, Vec<Job>)> = jobs.collect();
    let wanted: Vec<Job> = by_cell.iter().flat_map(|(_, jobs)| jobs.clone()).collect();
    let by_settings: BTreeMap<String, &Cell> = by_cell
        .iter()
        .flat_map(|(cell, jobs)| jobs.iter().map(move |job| (job.settings(), *cell)))
        .collect();
    begin(args, &wanted, &log)?;
    let run = resume(
        args,
        tested.identity(args, &suite),
        log.entries().len(),
        &tested,
    )?;

    let known = log.entries();
    let is_done = |job: &Job| {
        let mut own = known.iter().filter(|entry| entry.is_of(job));
        own.any(|entry| !args.again || entry.broken.is_none())
    };
    let open: Vec<Job> = wanted.iter().filter(|job| !is_done(job)).cloned().collect();
    println!(
        "suite       {} ({}): {} of {} episodes of {} cells are open",
        suite.name,
        suite.hash,
        open.len(),
        wanted.len(),
        cells.len()
    );
    work(args, &tested.driver, &open, &log, &|entry| {
        let cell = by_settings.get(&entry.settings);
        match tested.ledger.as_ref().zip(cell) {
            Some((ledger, cell)) => ledger_check::check_entry(ledger, cell, entry),
            None => Ok(()),
        }
    })?;
    conclude(args, &suite, &tested, run, &log.entries())
}

/// Writes and prints the report of the complete cells.
fn conclude(
    args: &EvaluateArgs,
    suite: &Suite,
    tested: &Tested,
    run: RunFile,
    entries: &[Entry],
) -> anyhow::Result<bool> {
    let mut rows = Vec::new();
    for cell in &suite.cells {
        let jobs = tested.jobs(suite, cell);
        let all = jobs
            .iter()
            .map(|job| entries.iter().find(|entry| entry.is_of(job)));
        let all: Vec<Option<&Entry>> = all.collect();
        let done: Vec<Row> = all
            .iter()
            .flatten()
            .map(|entry| Row::new(cell, entry))
            .collect();
        if done.len() == all.len() {
            rows.extend(done);
        } else if !done.is_empty() {
            println!(
                "incomplete  {}: {} of {} episodes; it is not in the report until it is complete",
                cell.name,
                done.len(),
                all.len()
            );
        }
    }
    let is_broken = rows.iter().any(|row| row.broken);
    let report = SuiteReport::new(suite, run.identity, run.sessions, rows);
    print!("{}", report.table());
    if report.cell(BASE).is_none() {
        println!(
            "the cell {BASE} is not complete, so no kept share is computed; run --cells {BASE}"
        );
    }
    let path = args.out.join(format!("{}.json", suite.name));
    write(&path, &report.text()?)?;
    println!("results     {}", path.display());
    let chart = page::chart(suite, &report);
    write(&args.out.join("chart.svg"), &chart)?;
    let path = args.out.join("report.html");
    write(&path, &page::page(suite, &report, &chart))?;
    println!("page        {}", path.display());
    Ok(is_broken)
}

/// Writes a file as a whole, so that an interrupted run leaves no cut one.
fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    let part = path.with_extension("part");
    std::fs::write(&part, text)
        .and_then(|()| std::fs::rename(&part, path))
        .with_context(|| format!("writing {}", path.display()))
}

/// Whether the cell has sensor models of cameras.
fn needs_images(cell: &Cell) -> bool {
    let mut sensors = cell.variation.scenario.sensors.iter();
    sensors.any(|sensor| !sensor.camera.is_empty())
}

/// Rejects a suite with tasks that the assets do not have.
fn check_tasks(args: &EvaluateArgs, cells: &[&Cell]) -> anyhow::Result<()> {
    let listed = tasks_of_program(TaskSources {
        assets: args.assets.as_deref(),
        packs: &args.packs.packs,
        scene: &args.scene,
        objects: &args.objects.objects,
    })?;
    for cell in cells.iter().filter(|cell| cell.scenes.is_empty()) {
        let mut tasks = cell.tasks.iter();
        let unknown = tasks.find(|task| listed.iter().all(|known| known.name != **task));
        if let Some(task) = unknown {
            bail!(
                "the cell {} has the task {task:?}, which these assets do not have; use the assets of the suite's version",
                cell.name
            );
        }
    }
    Ok(())
}

/// Reads the run of the folder, or begins it, and adds this session.
///
/// # Errors
/// When the folder has a run of another suite, policy or physics version.
fn resume(
    args: &EvaluateArgs,
    identity: Identity,
    done: usize,
    tested: &Tested,
) -> anyhow::Result<RunFile> {
    let path = args.out.join(RUN);
    let known: Option<RunFile> = match std::fs::read_to_string(&path) {
        Ok(text) => Some(
            serde_json::from_str(&text)
                .with_context(|| format!("{} is malformed; use another --out", path.display()))?,
        ),
        Err(_) if !path.exists() => None,
        Err(error) => return Err(error).with_context(|| format!("reading {}", path.display())),
    };
    let session = Session {
        program: program::version().to_owned(),
        hardware: Hardware::here(tested.driver.observes_images())?,
        episodes_before: done,
    };
    let run = continued(
        known.filter(|run| !args.fresh || run.identity == identity),
        identity,
        session,
    )
    .with_context(|| format!("continuing {}", args.out.display()))?;
    write(&path, &(serde_json::to_string_pretty(&run)? + "\n"))?;
    Ok(run)
}

/// The run with another session.
fn continued(
    known: Option<RunFile>,
    identity: Identity,
    session: Session,
) -> anyhow::Result<RunFile> {
    let Some(mut run) = known else {
        ensure!(
            session.episodes_before == 0,
            "it has {} episodes of another evaluation; use another --out",
            session.episodes_before
        );
        return Ok(RunFile {
            identity,
            sessions: vec![session],
        });
    };
    let before = &run.identity;
    for (what, was, now) in [
        (
            "the physics version",
            before.physics_version.to_string(),
            identity.physics_version.to_string(),
        ),
        (
            "the suite",
            before.suite.name.clone(),
            identity.suite.name.clone(),
        ),
        (
            "the suite's hash",
            before.suite.hash.clone(),
            identity.suite.hash.clone(),
        ),
        (
            "the policy",
            before.policy.name.clone(),
            identity.policy.name.clone(),
        ),
        (
            "the training ledger",
            format!("{:?}", before.policy.ledger),
            format!("{:?}", identity.policy.ledger),
        ),
    ] {
        ensure!(
            was == now,
            "{what} was {was} and is {now}: use another --out, or --fresh to repeat all episodes"
        );
    }
    ensure!(
        *before == identity,
        "the policy was {:?} and is {:?}: use the same options, or another --out",
        before.policy,
        identity.policy
    );
    let is_same =
        |last: &Session| (&last.program, &last.hardware) == (&session.program, &session.hardware);
    if !run.sessions.last().is_some_and(is_same) {
        run.sessions.push(session);
    }
    Ok(run)
}

#[cfg(test)]
mod tests {
    use super::super::test_suite::{identity, suite};
    use super::*;

    #[test]
    fn run_continues_with_the_same_suite_policy_and_physics_only() {
        let session = |program: &str, episodes_before| Session {
            program: program.to_owned(),
            hardware: Hardware {
                system: String::new(),
                processor: "test".to_owned(),
                cores: 2,
                adapters: Vec::new(),
            },
            episodes_before,
        };
        let identity = identity(&suite());
        let begun = || continued(None, identity.clone(), session("1", 0)).unwrap();
        let again = continued(Some(begun()), identity.clone(), session("1", 3)).unwrap();
        assert_eq!(again.sessions, [session("1", 0)]);
        let later = continued(Some(again), identity.clone(), session("2", 5)).unwrap();
        assert_eq!(later.sessions, [session("1", 0), session("2", 5)]);
        let problem = |change: fn(&mut Identity)| {
            let mut other = identity.clone();
            change(&mut other);
            let result = continued(Some(begun()), other, session("1", 3));
            result.unwrap_err().to_string()
        };
        assert!(problem(|i| i.physics_version = 1).contains("physics version was"));
        assert!(problem(|i| i.suite.hash = "1".to_owned()).contains("the suite's hash was"));
        assert!(
            problem(|i| i.policy.name = "x".to_owned()).contains("the policy was hold and is x")
        );
        assert!(problem(|i| i.policy.deterministic = false).contains("the same options"));
        let foreign = continued(None, identity.clone(), session("1", 4)).unwrap_err();
        assert!(foreign.to_string().contains("another evaluation"));
    }
}
