//! Comparison of a suite with the training ledger of a policy.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use wheelarm_dataset::read::Episode;
use wheelarm_policy::ledger::{Kind, Ledger, sentence};
use wheelarm_proto::defaults;
use wheelarm_proto::installed::file_or_asset;

use super::super::entry::Entry;
use super::file::{Cell, Suite};
use crate::policy_options::Choice;

/// End of the name of a ledger beside a policy.
const SUFFIX: &str = "ledger.json";

/// The training ledger of a policy: the named file, else the one beside the policy; absent
/// for an undeclared policy. `weights` is the SHA-256 of its weights, empty without any.
///
/// # Errors
/// When the file cannot be read, is malformed, or is the ledger of another policy.
pub fn of_policy(
    choice: &Choice,
    named: Option<&Path>,
    weights: &str,
) -> anyhow::Result<Option<Ledger>> {
    let path = match (named, choice) {
        (Some(path), _) => Some(path.to_owned()),
        (None, Choice::Operator | Choice::Hold | Choice::Repeat) => {
            return Ok(Some(Ledger::untrained()));
        }
        (None, Choice::Replay(folder)) => return Ok(Some(of_recordings(folder)?)),
        (None, Choice::Act(file)) => Some(file_or_asset(&file.with_extension(SUFFIX))),
        (None, Choice::Lerobot(folder)) => Some(folder.join(SUFFIX)),
        (None, Choice::Exec(_) | Choice::Zenoh(_) | Choice::Openpi(_)) => None,
    };
    let Some(path) = path.filter(|path| named.is_some() || path.is_file()) else {
        return Ok(None);
    };
    let about = || format!("the training ledger {}", path.display());
    let text = std::fs::read_to_string(&path).with_context(about)?;
    let ledger = Ledger::read(&text).with_context(about)?;
    ensure!(
        ledger.policy.is_empty() || weights.is_empty() || ledger.policy == weights,
        "{} is of the policy with the weights {}, and these weights are {weights}: name the ledger of this policy with --ledger",
        about(),
        ledger.policy
    );
    Ok(Some(ledger))
}

/// The ledger of the recordings that `replay:DIR` plays.
fn of_recordings(folder: &Path) -> anyhow::Result<Ledger> {
    let mut ledger = Ledger::default();
    let entries = std::fs::read_dir(folder)
        .with_context(|| format!("reading the recordings in {}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|end| end == "h5"));
    for file in files {
        let about = || format!("reading {}", file.display());
        ledger.add(
            &Episode::open(&file)
                .with_context(about)?
                .scenario()
                .with_context(about)?,
        );
    }
    Ok(ledger)
}

/// Rejects a policy that was trained on the seeds, specimens or homes of `cells`. Sentences and
/// objects are known when the server has sampled them: [`check_entry`].
///
/// # Errors
/// The first overlap, with the cell.
pub fn check(ledger: &Ledger, suite: &Suite, cells: &[&Cell]) -> anyhow::Result<()> {
    for cell in cells {
        let mut tested = Ledger::default();
        for (task, seed) in suite.episodes(cell) {
            let mut scenario = suite.job(cell, task, seed).variation.for_episode(seed);
            scenario.seed = Some(seed);
            if scenario.scene.is_empty() {
                defaults::SCENE.clone_into(&mut scenario.scene);
            }
            tested.add(&scenario);
        }
        check_overlap(ledger, &tested, cell)?;
    }
    Ok(())
}

/// Rejects an episode whose sentence or target is in the ledger, where its cell requires that
/// it is not.
///
/// # Errors
/// The overlap.
pub fn check_entry(ledger: &Ledger, cell: &Cell, entry: &Entry) -> anyhow::Result<()> {
    let mut tested = Ledger::default();
    if !entry.instruction.is_empty() {
        tested.declare(Kind::Sentences, sentence(&entry.instruction));
    }
    if !entry.target.is_empty() {
        tested.declare(Kind::Objects, &entry.target);
    }
    check_overlap(ledger, &tested, cell).with_context(|| {
        format!(
            "{} seed {}: {:?}",
            entry.task, entry.seed, entry.instruction
        )
    })
}

fn check_overlap(ledger: &Ledger, tested: &Ledger, cell: &Cell) -> anyhow::Result<()> {
    for kind in &cell.unseen {
        if let Some(overlap) = ledger.overlap(tested, *kind) {
            bail!(
                "the policy was trained on content of the cell {}: {overlap}; train without it, or evaluate with --split or --seeds, which is not a result of the suite",
                cell.name
            );
        }
    }
    Ok(())
}

/// Kinds of content that `cells` require to be unseen and the ledger does not declare; all of
/// them without a ledger.
#[must_use]
pub fn undeclared(ledger: Option<&Ledger>, cells: &[Cell]) -> Vec<Kind> {
    let needed: BTreeSet<Kind> = cells
        .iter()
        .flat_map(|cell| &cell.unseen)
        .copied()
        .collect();
    let is_declared = |kind: &Kind| ledger.is_some_and(|ledger| ledger.declares(*kind));
    needed
        .into_iter()
        .filter(|kind| !is_declared(kind))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::test_suite::suite;
    use super::*;
    use wheelarm_proto::v1;

    fn trained_on(seed: u64, sentence: &str) -> Ledger {
        let mut ledger = Ledger::default();
        ledger.add(&v1::Scenario {
            seed: Some(seed),
            scene: "a".to_owned(),
            instruction: Some(sentence.to_owned()),
            ..v1::Scenario::default()
        });
        ledger
    }

    #[test]
    fn policy_that_was_trained_on_the_suite_is_rejected() {
        let suite = suite();
        let [base, _, home] = &suite.cells[..] else {
            panic!("three cells");
        };
        let check = |seed, cells: &[&Cell]| {
            let result = check(&trained_on(seed, ""), &suite, cells);
            result.map_err(|error| error.to_string())
        };
        assert_eq!(check(10_000, &[base]), Ok(()));
        let error = check(601, &[base]).unwrap_err();
        assert!(error.contains("cell base: seeds 601"), "{error}");
        // Training in the home "a" is allowed in the base, which does not test it.
        let error = check(10_000, &[base, home]).unwrap_err();
        assert!(error.contains("cell home-1: homes a"), "{error}");
        let all = [Kind::Seeds, Kind::Homes];
        assert_eq!(undeclared(None, &suite.cells), all);
        assert!(undeclared(Some(&Ledger::untrained()), &suite.cells).is_empty());
    }

    #[test]
    fn sentence_of_the_training_ends_a_cell_of_unseen_sentences() {
        let mut cell = suite().cells[0].clone();
        let ledger = trained_on(10_000, "Take the bowl.");
        let entry = Entry {
            instruction: "take the bowl".to_owned(),
            ..Entry::default()
        };
        check_entry(&ledger, &cell, &entry).unwrap();
        cell.unseen.insert(Kind::Sentences);
        let error = format!("{:#}", check_entry(&ledger, &cell, &entry).unwrap_err());
        assert!(error.contains("sentences"), "{error}");
        let other = Entry {
            instruction: "take the deep dish".to_owned(),
            ..Entry::default()
        };
        check_entry(&ledger, &cell, &other).unwrap();
    }

    #[test]
    fn ledger_is_the_named_file_or_the_one_beside_the_policy() {
        let folder = tempfile::tempdir().unwrap();
        let policy = folder.path().join("p.safetensors");
        let beside = folder.path().join("p.ledger.json");
        let act = Choice::Act(policy);
        assert_eq!(of_policy(&act, None, "ab").unwrap(), None);
        let mut ledger = trained_on(10_000, "");
        ledger.policy = "ab".to_owned();
        std::fs::write(&beside, ledger.text()).unwrap();
        assert_eq!(of_policy(&act, None, "ab").unwrap(), Some(ledger.clone()));
        let exec = Choice::Exec("true".to_owned());
        assert_eq!(of_policy(&exec, None, "").unwrap(), None);
        assert_eq!(of_policy(&exec, Some(&beside), "").unwrap(), Some(ledger));
        let error = of_policy(&act, None, "cd").unwrap_err().to_string();
        assert!(error.contains("--ledger"), "{error}");
        let hold = of_policy(&Choice::Hold, None, "").unwrap();
        assert_eq!(hold, Some(Ledger::untrained()));
        let missing = of_policy(&exec, Some(Path::new("none.json")), "");
        assert!(format!("{:#}", missing.unwrap_err()).contains("none.json"));
    }
}
