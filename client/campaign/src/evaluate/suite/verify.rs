//! `wheelarm evaluate verify FILE`: checks the results of a suite, computes their figures again
//! from the rows, and repeats episodes.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use anyhow::{Context, bail, ensure};
use clap::{Args, Parser};

use super::super::args::EvaluateArgs;
use super::super::runner::Runner;
use super::figures::Row;
use super::file::Suite;
use super::leaderboard;
use super::report::SuiteReport;
use super::run::Tested;
use crate::adapters::AdapterArgs;
use crate::episode_seed::mixed;
use crate::policy_options::{Choice, PolicyArgs};
use wheelarm_options::packs::PackArgs;

/// Largest file of results, bytes: ten times the whole suite.
const LONGEST: u64 = 16 << 20;

/// Options of `wheelarm evaluate verify`.
#[derive(Args, Clone, Debug)]
pub struct VerifyArgs {
    /// Results that `wheelarm evaluate --suite` wrote.
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Suite of the results [default: the shipped suite of the same name].
    #[arg(long, value_name = "FILE")]
    pub suite: Option<PathBuf>,
    /// Repeats N sampled episodes with the policy of --policy and compares their final state
    /// hashes. `operator`, `hold` and `repeat` need no --policy.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rerun: Option<u32>,
    /// Writes the leaderboard of the files into this document.
    #[arg(long, value_name = "DOCUMENT", conflicts_with = "rerun")]
    pub leaderboard: Option<PathBuf>,
    /// Folder for the messages of a policy that --rerun starts.
    #[arg(long, default_value = "data/verify", value_name = "DIR")]
    pub out: PathBuf,
    /// Training ledger of the policy [default: the file beside the policy].
    #[arg(long, value_name = "FILE")]
    pub ledger: Option<PathBuf>,
    /// The results were made with --deterministic.
    #[arg(long)]
    pub deterministic: bool,
    #[command(flatten)]
    pub policy: PolicyArgs,
    #[command(flatten)]
    pub graphics: AdapterArgs,
    /// Assets folder; found by the server when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
    /// World packs.
    #[command(flatten)]
    pub packs: PackArgs,
}

/// The default options of `wheelarm evaluate`.
#[derive(Parser)]
struct Defaults {
    #[command(flatten)]
    args: EvaluateArgs,
}

/// Checks the files.
///
/// # Errors
/// The first reason why a file is not accepted.
pub fn run(args: &VerifyArgs) -> anyhow::Result<()> {
    let mut reports = Vec::new();
    for file in &args.files {
        let (suite, report) =
            read(file, args.suite.as_deref()).with_context(|| file.display().to_string())?;
        println!("{}", file.display());
        print!("{}", report.table());
        println!(
            "figures     follow from {} rows; suite {} ({}), physics {}",
            report.rows.len(),
            suite.name,
            suite.hash,
            report.identity.physics_version
        );
        if let Some(count) = args.rerun {
            let again = repeat(args, &suite, &report, count as usize);
            again.with_context(|| file.display().to_string())?;
        }
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        reports.push((name.into_owned(), suite, report));
    }
    if let Some(document) = &args.leaderboard {
        leaderboard::write(document, &reports)?;
        println!("leaderboard {}", document.display());
    }
    Ok(())
}

/// Reads and checks a file of results.
///
/// # Errors
/// As [`SuiteReport::read`] and [`SuiteReport::check`].
pub fn read(file: &Path, suite: Option<&Path>) -> anyhow::Result<(Suite, SuiteReport)> {
    let mut text = String::new();
    let open = std::fs::File::open(file).context("cannot open the file")?;
    open.take(LONGEST + 1)
        .read_to_string(&mut text)
        .context("cannot read the file")?;
    ensure!(
        text.len() as u64 <= LONGEST,
        "it is longer than {LONGEST} bytes: is it another file?"
    );
    let report = SuiteReport::read(&text)?;
    let suite = match suite {
        Some(path) => Suite::read(path)?,
        None => {
            let name = &report.identity.suite.name;
            ensure!(
                wheelarm_proto::keys::check_name(name).is_ok(),
                "the suite has the name {name:?}, expected letters, digits, `-` and `_`"
            );
            Suite::read(&Suite::shipped(name)).with_context(|| {
                format!("the suite {name} is not shipped: name its file with --suite")
            })?
        }
    };
    report.check(&suite)?;
    ensure!(!report.rows.is_empty(), "it has no complete cell");
    Ok((suite, report))
}

/// Repeats sampled episodes and compares them.
fn repeat(
    args: &VerifyArgs,
    suite: &Suite,
    report: &SuiteReport,
    count: usize,
) -> anyhow::Result<()> {
    let policy = &report.identity.policy;
    let mut evaluate = Defaults::try_parse_from(["evaluate"])?.args;
    evaluate.policy = args.policy.clone();
    if let Some(builtin) = [Choice::Operator, Choice::Hold, Choice::Repeat]
        .into_iter()
        .find(|choice| choice.kind() == policy.kind)
    {
        evaluate.policy.policy = builtin;
    }
    evaluate.deterministic = args.deterministic;
    evaluate.ledger.clone_from(&args.ledger);
    evaluate.out.clone_from(&args.out);
    evaluate.graphics = args.graphics.clone();
    evaluate.assets.clone_from(&args.assets);
    evaluate.packs = args.packs.clone();
    ensure!(
        evaluate.policy.policy.kind() == policy.kind,
        "--rerun needs the policy of the results: add --policy {}:…",
        policy.kind
    );
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("making the folder {}", args.out.display()))?;
    let tested = Tested::start(&evaluate, suite)?;
    let identity = tested.identity(&evaluate, suite);
    if let Some(difference) = policy.difference(&identity.policy) {
        bail!("--rerun needs the policy of the results: {difference}");
    }
    let nanos = SystemTime::UNIX_EPOCH
        .elapsed()
        .map_or(0, |time| time.as_nanos() as u64);
    let (mut equal, mut outcomes, mut differences) = (0, 0, Vec::new());
    let sampled = sample(&report.rows, count, nanos);
    for row in &sampled {
        let cell = suite.cell(&row.cell).context("a cell of the suite")?;
        let job = tested.job(suite, cell, &row.task, row.seed);
        // A server keeps the settings that a scenario leaves out: each cell has its own.
        let entry = Runner::new(&evaluate, &tested.driver, 0)?.episode(&job)?;
        let again = Row::new(cell, &entry);
        let is_equal = again == **row;
        equal += usize::from(is_equal);
        outcomes += usize::from(again.success == row.success);
        let verdict = if is_equal { "equal" } else { "DIFFERS" };
        println!(
            "rerun       {} {} seed {}: {} {}, {verdict}",
            row.cell, row.task, row.seed, again.cause, again.state
        );
        if !is_equal {
            differences.push(format!(
                "{} {} seed {}: {} {} in the file, {} {} here",
                row.cell, row.task, row.seed, row.cause, row.state, again.cause, again.state
            ));
        }
    }
    println!(
        "rerun       {equal} of {} episodes are equal bit by bit, {outcomes} have the same outcome",
        sampled.len()
    );
    if differences.is_empty() {
        return Ok(());
    }
    if policy.deterministic {
        bail!("episodes differ: {}", differences.join("; "));
    }
    println!(
        "            the policy is not deterministic across machines, so differences reject nothing; a run with --deterministic is equal on the same hardware"
    );
    Ok(())
}

/// `count` different rows that did not break, by `random`.
fn sample(rows: &[Row], count: usize, random: u64) -> Vec<&Row> {
    let mut whole: Vec<&Row> = rows.iter().filter(|row| !row.broken).collect();
    whole.sort_by_key(|row| {
        let name = [row.cell.as_str(), &row.task].concat();
        let start = mixed(random ^ row.seed);
        name.bytes()
            .fold(start, |hash, byte| mixed(hash ^ u64::from(byte)))
    });
    whole.truncate(count);
    whole
}

#[cfg(test)]
mod tests {
    use super::super::test_suite::{SMALL, frozen, identity, rows, suite};
    use super::*;

    #[test]
    fn file_is_read_with_the_suite_that_it_names() {
        let folder = tempfile::tempdir().unwrap();
        let suite = suite();
        let report = SuiteReport::new(&suite, identity(&suite), Vec::new(), rows(&suite));
        let (file, toml) = (
            folder.path().join("r.json"),
            folder.path().join("small.toml"),
        );
        std::fs::write(&file, report.text().unwrap()).unwrap();
        std::fs::write(&toml, frozen(SMALL)).unwrap();
        assert_eq!(read(&file, Some(&toml)).unwrap(), (suite, report.clone()));
        let problem = |suite| format!("{:#}", read(&file, suite).unwrap_err());
        assert!(problem(None).contains("small is not shipped"));
        let changed = SMALL.replace("602", "603");
        std::fs::write(&toml, frozen(&changed)).unwrap();
        assert!(problem(Some(&toml)).contains("run the suite of this version"));
        std::fs::write(&toml, SMALL).unwrap();
        assert!(problem(Some(&toml)).contains("not frozen"));
        let none = read(&folder.path().join("none.json"), None).unwrap_err();
        assert!(format!("{none:#}").contains("cannot open"));
    }

    #[test]
    fn sampled_rows_are_different_and_vary() {
        let suite = suite();
        let mut rows = rows(&suite);
        rows[0].broken = true;
        let all = sample(&rows, 100, 1);
        assert_eq!(all.len(), rows.len() - 1);
        let firsts = (0..40).map(|random| sample(&rows, 2, random)[0]);
        let mut firsts: Vec<(&str, &str, u64)> = firsts
            .map(|row| (row.cell.as_str(), row.task.as_str(), row.seed))
            .collect();
        firsts.sort_unstable();
        firsts.dedup();
        assert!(firsts.len() > 4, "{firsts:?}");
    }

    #[test]
    fn options_of_an_evaluation_have_defaults() {
        let args = Defaults::try_parse_from(["evaluate"]).unwrap().args;
        assert!(args.suite.is_none() && args.policy.policy == Choice::Operator);
    }
}
