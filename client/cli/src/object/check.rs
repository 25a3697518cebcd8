//! `wheelarm object check`: trials of the scripted operator on a bench.

use std::fmt::Write;
use std::fs::File;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use wheelarm_import::object::{alone, object_of, with_table, yaw_deg};
use wheelarm_import::write;
use wheelarm_options::packs::PackArgs;
use wheelarm_pack::{ObjectFile, Pack, TrialsEntry};
use wheelarm_proto::installed::ASSETS_VARIABLE;
use wheelarm_proto::settings::Quality;
use wheelarm_proto::v1;
use wheelarm_rollout::{Backend, Driver, Expert, InProcess, Limits, Rollout, WorkerOptions};

use super::find::{assets_of, pack_with};
use super::tally::Tally;
use crate::home_report::store;

/// Scene of the trials, a pack of the assets.
const BENCH: &str = "bench";
/// Its tasks, in turn.
const TASKS: [&str; 2] = ["bench_lift", "bench_move"];
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
    /// Trials of each grasp before those of the object; a grasp that succeeds in less than half of
    /// them is left out.
    #[arg(long, default_value_t = 0, value_name = "N")]
    grasp_trials: u32,
    /// File to which one line of JSON with all results is appended.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
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
    let bench = Bench {
        assets,
        pack: alone(&pack, name)?,
        name,
    };
    let mut text = String::new();
    let mut table = table;
    let mut by_grasp = Vec::new();
    for (index, grasp) in table.grasps.iter().enumerate() {
        if args.grasp_trials == 0 {
            break;
        }
        let mut own = table.clone();
        own.grasps = vec![grasp.clone()];
        if let Some(stock) = &mut own.stock {
            // Turned as that grasp needs it.
            stock.yaw_deg = 180.0;
        }
        let what = format!("grasp {} ({})", index + 1, grasp.name);
        let tally = bench.trials(&own, &what, args.seed, args.grasp_trials)?;
        writeln!(text, "{name}, {what}: {}", tally.words())?;
        by_grasp.push(tally);
    }
    let sampled: Vec<String> = table
        .grasps
        .iter()
        .map(|grasp| grasp.name.clone())
        .collect();
    let is_kept = |index: usize| by_grasp.get(index).is_none_or(Tally::is_half);
    let kept: Vec<_> = (0..table.grasps.len()).filter(|&i| is_kept(i)).collect();
    if !kept.is_empty() && kept.len() < table.grasps.len() {
        let grasps = kept.iter().map(|&index| table.grasps[index].clone());
        table.grasps = grasps.collect();
        if let Some(stock) = &mut table.stock {
            stock.yaw_deg = yaw_deg(&table.grasps);
        }
    }
    let tally = bench.trials(&table, "trial", args.seed, args.trials)?;
    let is_graspable = tally.is_enough() || args.keep;
    let trials = TrialsEntry {
        of: tally.of,
        lifted: tally.lifted,
    };
    let judged = judged(&table, name, Some(trials), !is_graspable);
    let verdict = match (tally.is_enough(), args.keep) {
        (true, _) => "tasks may request it",
        (false, true) => "kept graspable by --keep",
        (false, false) => "kept as scenery, --keep keeps it graspable",
    };
    writeln!(text, "{name}: {}; {verdict}", tally.words())?;
    if !tally.still_after.is_empty() {
        let last = tally.still_after.iter().copied().fold(0.0, f64::max);
        let count = tally.still_after.len();
        writeln!(
            text,
            "put down {count} times: {} at rest and asleep, still after {last:.2} s at most",
            tally.rested
        )?;
    }
    save(&with_table(&pack, name, &judged)?, name, &path)?;
    if let Some(file) = &args.json {
        let grasps = by_grasp.iter().map(Tally::json);
        let line = serde_json::json!({
            "object": name,
            "category": judged.category,
            "kept": judged.grasps.iter().map(|grasp| &grasp.name).collect::<Vec<_>>(),
            "sampled": sampled,
            "grasps": grasps.collect::<Vec<_>>(),
            "trials": tally.json(),
            "graspable": is_graspable,
        });
        append(file, &line.to_string())
            .with_context(|| format!("cannot write {}", file.display()))?;
    }
    Ok(text)
}

/// Appends a line to a file.
fn append(path: &Path, line: &str) -> std::io::Result<()> {
    use std::io::Write as _;
    let mut file = File::options().append(true).create(true).open(path)?;
    file.write_all(format!("{line}\n").as_bytes())
}

/// The bench on which an object is tried, in a pack without others.
struct Bench<'a> {
    assets: PathBuf,
    pack: Pack,
    name: &'a str,
}

impl Bench<'_> {
    /// Runs trials with this table of the object.
    fn trials(
        &self,
        table: &ObjectFile,
        what: &str,
        seed: u64,
        trials: u32,
    ) -> anyhow::Result<Tally> {
        let name = self.name;
        let folder = tempfile::tempdir().context("making a folder for the trials")?;
        let mut tried = judged(table, name, None, false);
        if let Some(stock) = &mut tried.stock {
            // The bench is in a kitchen, whatever the rooms of the object.
            stock.rooms = None;
        }
        let tried = with_table(&self.pack, name, &tried)?;
        write(&tried, folder.path())?;
        let backend = InProcess::new(WorkerOptions {
            assets: Some(self.assets.clone()),
            packs: vec![folder.path().to_owned()],
            ..WorkerOptions::default()
        });
        let mut tally = Tally::default();
        for trial in 0..trials {
            let result = backend.run(&rollout(&tried, name, seed + u64::from(trial)))?;
            tally.add(&result);
            let end = match &result {
                Ok(finished) => finished.why().unwrap_or_else(|| finished.end()),
                Err(failure) => failure.to_string(),
            };
            eprintln!("{name}, {what}, {} of {trials}: {end}", trial + 1);
        }
        backend.rest();
        Ok(tally)
    }
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
            shakes: true,
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
            held_out: false,
            trials: None,
        });
    stock.trials = trials;
    stock.scenery = scenery;
    table
}

/// Writes the table of an object of the pack in its place. The other files of a folder stay as
/// they are: checks of other objects may run.
fn save(pack: &Pack, name: &str, path: &Path) -> anyhow::Result<()> {
    if path.is_file() {
        pack.write_zip(path)?;
        return Ok(());
    }
    let file = format!("objects/{name}.toml");
    let bytes = pack.file(&file).context("the pack has the object")?;
    // A further file in the pack would make it invalid meanwhile.
    let folder = path.parent().context("a pack without a folder")?;
    let mut new = tempfile::Builder::new()
        .permissions(std::fs::Permissions::from_mode(0o644))
        .tempfile_in(folder)
        .with_context(|| format!("cannot write into {}", folder.display()))?;
    std::io::Write::write_all(&mut new, bytes)?;
    new.persist(path.join(file))?;
    Ok(())
}
