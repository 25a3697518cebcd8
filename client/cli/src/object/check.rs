//! `wheelarm object check`: trials of the scripted operator on a bench.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use wheelarm_import::object::{object_of, with_table};
use wheelarm_import::write;
use wheelarm_options::packs::PackArgs;
use wheelarm_pack::{ObjectFile, Pack, TrialsEntry};
use wheelarm_proto::installed::ASSETS_VARIABLE;
use wheelarm_proto::settings::Quality;
use wheelarm_proto::v1;
use wheelarm_rollout::{
    Backend, Driver, Expert, InProcess, Limits, Rollout, RolloutResult, WorkerOptions,
};

use super::find::{assets_of, pack_with};
use crate::home_report::store;

/// Scene of the trials, a pack of the assets.
const BENCH: &str = "bench";
/// Its tasks, in turn.
const TASKS: [&str; 2] = ["bench_lift", "bench_move"];
/// Trials of ten that have to succeed.
const NEEDED: u32 = 9;
/// Wall time without progress after which a trial has failed.
const PATIENCE: Duration = Duration::from_secs(120);

/// Arguments of `wheelarm object check`.
#[derive(Args, Debug)]
pub struct CheckArgs {
    /// Name of the object.
    name: String,
    /// Number of trials.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    trials: u32,
    /// Seed of the first trial.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Keeps the object graspable whatever the trials show.
    #[arg(long, alias = "force")]
    keep: bool,
    /// Folders of packs.
    #[command(flatten)]
    packs: PackArgs,
    /// Assets folder; by default the installed one.
    #[arg(long, env = ASSETS_VARIABLE, value_name = "DIR")]
    assets: Option<PathBuf>,
}

/// Results of trials: successes, and failures by their reason.
#[derive(Clone, Debug, Default, PartialEq)]
struct Tally {
    of: u32,
    lifted: u32,
    failures: BTreeMap<String, u32>,
}

impl Tally {
    fn add(&mut self, result: &RolloutResult) {
        self.of += 1;
        let reason = match result {
            Ok(finished) if finished.succeeded() => {
                self.lifted += 1;
                return;
            }
            Ok(finished) => finished.end(),
            Err(failure) => failure.to_string(),
        };
        *self.failures.entry(reason).or_default() += 1;
    }

    fn is_enough(&self) -> bool {
        10 * self.lifted >= NEEDED * self.of
    }

    /// For example `6 of 20 lifts (4 slipped, 10 not reached)`.
    fn words(&self) -> String {
        let mut text = format!("{} of {} trials", self.lifted, self.of);
        if !self.failures.is_empty() {
            let failures = self.failures.iter().map(|(why, n)| format!("{n} {why}"));
            text += &format!(" ({})", failures.collect::<Vec<_>>().join(", "));
        }
        text
    }
}

/// Runs the trials and returns the output.
pub fn run(args: &CheckArgs) -> anyhow::Result<String> {
    let assets = assets_of(args.assets.as_ref())?;
    let name = &args.name;
    let (pack, path) = pack_with(&store(&args.packs), name)?;
    let table = object_of(&pack, name).context("the object was read when the pack was checked")?;
    if table.grasps.is_empty() {
        bail!(
            "{name} has no grasps: it is scenery; import it again with another --size or --parts, \
             or write [[grasps]] into {}",
            path.join(format!("objects/{name}.toml")).display()
        );
    }
    let folder = tempfile::tempdir().context("making a folder for the trials")?;
    let mut tried = judged(&table, name, None, false);
    if let Some(stock) = &mut tried.stock {
        // The bench is in a kitchen, whatever the rooms of the object.
        stock.rooms = None;
    }
    let tried = with_table(&pack, name, &tried)?;
    write(&tried, folder.path())?;
    let backend = InProcess::new(WorkerOptions {
        assets: Some(assets),
        packs: vec![folder.path().to_owned()],
        ..WorkerOptions::default()
    });
    let mut tally = Tally::default();
    let mut text = String::new();
    for trial in 0..args.trials {
        let rollout = rollout(&pack, name, args.seed + u64::from(trial));
        let result = backend.run(&rollout)?;
        tally.add(&result);
        eprintln!(
            "trial {} of {}: {}",
            trial + 1,
            args.trials,
            match &result {
                Ok(finished) => finished.end(),
                Err(failure) => failure.to_string(),
            }
        );
    }
    backend.rest();
    let is_graspable = tally.is_enough() || args.keep;
    let trials = TrialsEntry {
        of: tally.of,
        lifted: tally.lifted,
    };
    let table = judged(&table, name, Some(trials), !is_graspable);
    let verdict = match (tally.is_enough(), args.keep) {
        (true, _) => "tasks may request it",
        (false, true) => "kept graspable by --keep",
        (false, false) => "kept as scenery, --keep keeps it graspable",
    };
    writeln!(text, "{name}: {}; {verdict}", tally.words())?;
    save(&with_table(&pack, name, &table)?, &path)?;
    Ok(text)
}

/// One trial.
fn rollout(pack: &Pack, name: &str, seed: u64) -> Rollout {
    let scenario = v1::Scenario {
        scene: BENCH.to_owned(),
        task: Some(TASKS[(seed % 2) as usize].to_owned()),
        target: Some(name.to_owned()),
        seed: Some(seed),
        packs: vec![v1::PackRef {
            name: pack.id().name.clone(),
            ..v1::PackRef::default()
        }],
        pacing: v1::Pacing::LockStep.into(),
        quality: Quality::Standard.code().into(),
        ..v1::Scenario::default()
    };
    Rollout {
        scenario,
        label: format!("{name}-{seed}"),
        driver: Driver::Expert(Expert {
            // The other task ends with the object put down.
            shakes: seed.is_multiple_of(2),
            ..Expert::default()
        }),
        record: None,
        limits: Limits::patience(PATIENCE),
        folder: None,
        observer: Arc::new(()),
    }
}

/// The table of an object with the result of trials.
fn judged(
    table: &ObjectFile,
    name: &str,
    trials: Option<TrialsEntry>,
    scenery: bool,
) -> ObjectFile {
    let mut table = table.clone();
    let stock = table
        .stock
        .get_or_insert_with(|| wheelarm_pack::StockEntry {
            words: name.replace(['_', '-'], " "),
            headroom: 0.3,
            depth: 0.2,
            yaw_deg: 20.0,
            rooms: None,
            scenery: false,
            trials: None,
        });
    stock.trials = trials;
    stock.scenery = scenery;
    table
}

/// Writes the pack in its place.
fn save(pack: &Pack, path: &std::path::Path) -> anyhow::Result<()> {
    if path.is_file() {
        pack.write_zip(path)?;
        return Ok(());
    }
    let folder = path.parent().context("a pack without a folder")?;
    write(pack, folder)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nine_of_ten_trials_are_needed() {
        let tally = |lifted| Tally {
            of: 20,
            lifted,
            failures: BTreeMap::from([("dropped".to_owned(), 20 - lifted)]),
        };
        assert!(tally(18).is_enough() && !tally(17).is_enough());
        assert_eq!(tally(6).words(), "6 of 20 trials (14 dropped)");
    }
}
