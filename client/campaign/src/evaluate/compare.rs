//! `wheelarm evaluate compare A B`: two evaluations of the same episodes, pair by
//! pair.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args;

use super::entry::Entry;
use wheelarm_dataset::sheet::chart;
use wheelarm_rollout::read_log;

use super::statistics::{bootstrap, clopper_pearson, mcnemar, mean};

/// Options of `wheelarm evaluate compare`.
#[derive(Args, Clone, Debug)]
pub struct CompareArgs {
    /// Folder of an evaluation.
    pub one: PathBuf,
    /// Folder of another one.
    pub other: PathBuf,
    /// Folder for the images `pairs.png` and `difference.png`; not written when absent.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Task, seed and settings, which identify a pair of episodes. The policy is not part of it,
/// because a folder contains only one.
type Key = (String, u64, String);

/// Prints the results of the pairs.
///
/// # Errors
/// When a folder contains no evaluation, or the two have no episode in common.
pub fn run(args: &CompareArgs) -> anyhow::Result<()> {
    let [one, other] = [read(&args.one)?, read(&args.other)?];
    let text = summary(&one, &other).with_context(|| {
        format!(
            "comparing {} and {}",
            args.one.display(),
            args.other.display()
        )
    })?;
    print!("{text}");
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out).with_context(|| format!("making {}", out.display()))?;
        write_charts(&one, &other, out)?;
        println!("images      {}", out.display());
    }
    Ok(())
}

/// The results of a folder, which are of one policy.
fn read(folder: &Path) -> anyhow::Result<BTreeMap<Key, Entry>> {
    let path = folder.join("episodes.jsonl");
    let (entries, damaged) =
        read_log::<Entry>(&path).context("name the folder that `wheelarm evaluate --out` wrote")?;
    for line in damaged {
        tracing::warn!(
            "{}: line {line} cannot be read: its episode is not compared; run the same \
             `wheelarm evaluate` again to repeat it",
            path.display()
        );
    }
    of_one_policy(entries.into_iter()).with_context(|| format!("reading {}", path.display()))
}

/// Entries by [`Key`]; the last entry of a repeated episode counts.
///
/// # Errors
/// When they are of several policies.
fn of_one_policy(entries: impl Iterator<Item = Entry>) -> anyhow::Result<BTreeMap<Key, Entry>> {
    let mut all = BTreeMap::new();
    let mut policies = BTreeSet::new();
    for entry in entries {
        policies.insert(name(&entry).to_owned());
        let key = (entry.task.clone(), entry.seed, entry.settings.clone());
        all.insert(key, entry);
    }
    if policies.len() > 1 {
        let policies: Vec<String> = policies.into_iter().collect();
        bail!(
            "it contains episodes of {} policies ({}); evaluate each into its own folder with --out, and compare those",
            policies.len(),
            policies.join("; ")
        );
    }
    Ok(all)
}

/// Name of the policy, or `the operator`.
fn name(entry: &Entry) -> &str {
    match entry.policy.as_str() {
        "" => "the operator",
        name => name,
    }
}

/// Least number of pairs for a bootstrap interval of the mean.
const LEAST_FOR_BOOTSTRAP: usize = 10;

/// Results of the pairs, by task and in total.
fn summary(one: &BTreeMap<Key, Entry>, other: &BTreeMap<Key, Entry>) -> anyhow::Result<String> {
    let mut tables: BTreeMap<&str, [usize; 4]> = BTreeMap::new();
    let mut all = [0; 4];
    for (key, a) in one {
        let Some(b) = other.get(key) else {
            continue;
        };
        let cell = 2 * usize::from(a.success) + usize::from(b.success);
        tables.entry(&key.0).or_default()[cell] += 1;
        all[cell] += 1;
    }
    let pairs = all.iter().sum::<usize>();
    ensure!(
        pairs > 0,
        "they have no episode in common: evaluate both on the same tasks and seeds, with the same settings"
    );
    let [a, b] = [one, other].map(|all| all.values().next().map_or("", name));
    let mut text = format!("A  {a}\nB  {b}\n");
    writeln!(
        text,
        "{:<20} {:>6} {:>6} {:>6} {:>6} {:>8} {:>8}  {:>9}",
        "task", "pairs", "A", "B", "only A", "only B", "neither", "p"
    )?;
    for (task, cells) in tables.iter().map(|(task, cells)| (*task, cells)) {
        text += &line(task, cells);
    }
    text += &line("all", &all);
    let [low, high] = clopper_pearson(all[2] + all[3], pairs);
    let [from, to] = clopper_pearson(all[1] + all[3], pairs);
    writeln!(
        text,
        "95 % (Clopper-Pearson): A {:.1}..{:.1} %, B {:.1}..{:.1} %; p: McNemar's exact test, two-sided",
        100.0 * low,
        100.0 * high,
        100.0 * from,
        100.0 * to
    )?;
    let differences = differences(one, other);
    if !differences.is_empty() {
        let pairs = differences.len();
        let interval = if pairs < LEAST_FOR_BOOTSTRAP {
            format!("no interval of fewer than {LEAST_FOR_BOOTSTRAP}")
        } else {
            let [low, high] = bootstrap(&differences);
            format!("95 % {low:+.1}..{high:+.1} (bootstrap)")
        };
        writeln!(
            text,
            "progress: B - A {:+.1} points on average of {pairs} pairs, {interval}",
            mean(&differences)
        )?;
    }
    let left = one.len() + other.len() - 2 * pairs;
    if left > 0 {
        writeln!(text, "{left} episodes are in only one of the two")?;
    }
    Ok(text)
}

/// Progress of B minus that of A, pair by pair, points.
fn differences(one: &BTreeMap<Key, Entry>, other: &BTreeMap<Key, Entry>) -> Vec<f64> {
    let percent = |entry: &Entry| Some(f64::from(entry.course.as_ref()?.percent));
    let pairs = one.iter().filter_map(|(key, a)| {
        let b = other.get(key)?;
        Some(percent(b)? - percent(a)?)
    });
    pairs.collect()
}

/// Writes charts of the successes by pair and of the differences of progress.
fn write_charts(
    one: &BTreeMap<Key, Entry>,
    other: &BTreeMap<Key, Entry>,
    out: &Path,
) -> anyhow::Result<()> {
    let kinds = ["both", "neither", "only A", "only B"].map(str::to_owned);
    let mut rows: BTreeMap<&str, Vec<(u64, usize)>> = BTreeMap::new();
    for (key, a) in one {
        if let Some(b) = other.get(key) {
            let kind = match (a.success, b.success) {
                (true, true) => 0,
                (false, false) => 1,
                (true, false) => 2,
                (false, true) => 3,
            };
            rows.entry(&key.0).or_default().push((key.1, kind));
        }
    }
    let rows: Vec<_> = rows
        .into_iter()
        .map(|(task, pairs)| (task.to_owned(), pairs))
        .collect();
    let path = out.join("pairs.png");
    chart::squares("Pairs by task and seed", &kinds, &rows, &path)?;
    let differences = differences(one, other);
    if !differences.is_empty() {
        chart::histogram(
            "Progress of B less that of A, pair by pair",
            "points of progress",
            &differences,
            bootstrap(&differences),
            &out.join("difference.png"),
        )?;
    }
    Ok(())
}

/// `cells` by success of A (times two) and of B.
fn line(task: &str, &[neither, only_b, only_a, both]: &[usize; 4]) -> String {
    format!(
        "{task:<20} {:>6} {:>6} {:>6} {only_a:>6} {only_b:>8} {neither:>8}  {:>9.2e}\n",
        neither + only_b + only_a + both,
        only_a + both,
        only_b + both,
        mcnemar(only_a, only_b)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(successes: &[bool]) -> BTreeMap<Key, Entry> {
        let line = |(seed, success): (usize, &bool)| {
            let text = format!(
                r#"{{"task":"pick_bowl","seed":{seed},"success":{success},"course":{{"way":"lift","percent":{},"reached":[]}},"why":"","conditions":[],"seconds":1.0,"factor":1.0,"hash":"","notes":[]}}"#,
                if *success { 100 } else { 40 }
            );
            let entry: Entry = serde_json::from_str(&text).unwrap();
            let key = (entry.task.clone(), entry.seed, entry.settings.clone());
            (key, entry)
        };
        successes.iter().enumerate().map(line).collect()
    }

    #[test]
    fn folder_of_several_policies_is_rejected() {
        let mut all: Vec<Entry> = entries(&[true, false]).into_values().collect();
        assert_eq!(of_one_policy(all.clone().into_iter()).unwrap().len(), 2);
        all[1].policy = "act".to_owned();
        let error = of_one_policy(all.into_iter()).unwrap_err().to_string();
        assert!(error.contains("(act; the operator)"), "{error}");
        assert!(error.contains("--out"), "{error}");
    }

    #[test]
    fn pairs_are_counted_by_who_succeeded() {
        let one = entries(&[true, true, true, false, false]);
        let other = entries(&[true, false, false, true]);
        let text = summary(&one, &other).unwrap();
        let line: Vec<&str> = text
            .lines()
            .find(|line| line.starts_with("pick_bowl"))
            .unwrap()
            .split_whitespace()
            .collect();
        assert_eq!(line[1..], ["4", "3", "2", "2", "1", "0", "1.00e0"]);
        assert!(text.contains("1 episodes are in only one"), "{text}");
        // 0, -60, -60 and 60 points.
        assert!(
            text.contains("B - A -15.0 points on average of 4"),
            "{text}"
        );
        let folder = tempfile::tempdir().unwrap();
        write_charts(&one, &other, folder.path()).unwrap();
        for name in ["pairs.png", "difference.png"] {
            assert!(folder.path().join(name).is_file(), "{name}");
        }
        let none = summary(&one, &BTreeMap::new()).unwrap_err().to_string();
        assert!(none.contains("no episode in common"), "{none}");
    }
}
