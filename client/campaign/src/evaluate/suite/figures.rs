//! Figures of a suite, computed from its rows: rates, intervals and kept shares by cell.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::super::entry::Entry;
use super::super::statistics::{ratio_bootstrap, wilson};
use super::file::{Cell, Suite};

/// Digits after the decimal point of the figures in a file.
const DIGITS: f64 = 1e6;

/// The result of one episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Cell.
    pub cell: String,
    /// Task.
    pub task: String,
    /// Seed.
    pub seed: u64,
    /// Whether it succeeded.
    pub success: bool,
    /// Its end and the first missing step, in words.
    pub cause: String,
    /// Whether a program or the physics broke.
    pub broken: bool,
    /// Furthest step, percent of the way; absent when the episode was not monitored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub progress: Option<u8>,
    /// Simulated seconds, in milliseconds.
    pub milliseconds: u64,
    /// Sentence.
    pub instruction: String,
    /// Hash of the last state.
    pub state: String,
}

impl Row {
    /// The row of an entry.
    #[must_use]
    pub fn new(cell: &Cell, entry: &Entry) -> Self {
        Self {
            cell: cell.name.clone(),
            task: entry.task.clone(),
            seed: entry.seed,
            success: entry.success,
            cause: entry.cause(),
            broken: entry.broken.is_some(),
            progress: entry.course.as_ref().map(|course| course.percent),
            milliseconds: (entry.seconds * 1e3).round() as u64,
            instruction: entry.instruction.clone(),
            state: entry.hash.clone(),
        }
    }
}

/// Share of successes of the reference cell that are kept, over pairs of equal task and seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kept {
    /// Cell of the reference.
    pub against: String,
    /// Pairs.
    pub pairs: usize,
    /// Successes of the reference, and of this cell.
    pub successes: [usize; 2],
    /// Ratio of the successes.
    pub share: f64,
    /// Paired bootstrap interval of the ratio at 95 %.
    pub interval: [f64; 2],
}

/// Figures of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellFigures {
    /// Cell.
    pub cell: String,
    /// Episodes.
    pub episodes: usize,
    /// Successes.
    pub successes: usize,
    /// Episodes in which something broke; they count as failed.
    pub broken: usize,
    /// Share of successes.
    pub rate: f64,
    /// Wilson's interval of the share at 95 %.
    pub interval: [f64; 2],
    /// Kept share; absent for the base, without the reference, and when the reference has no
    /// success.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept: Option<Kept>,
    /// Successes and episodes by task.
    pub tasks: BTreeMap<String, [usize; 2]>,
    /// Failures by cause.
    pub causes: BTreeMap<String, usize>,
}

/// Figures of the cells that `rows` contain, in the order of the suite.
#[must_use]
pub fn figures(suite: &Suite, rows: &[Row]) -> Vec<CellFigures> {
    let cells = suite.cells.iter();
    let with_rows = cells.filter(|cell| rows.iter().any(|row| row.cell == cell.name));
    with_rows.map(|cell| of_cell(cell, rows)).collect()
}

fn of_cell(cell: &Cell, rows: &[Row]) -> CellFigures {
    let own: Vec<&Row> = rows.iter().filter(|row| row.cell == cell.name).collect();
    let mut tasks: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    let mut causes = BTreeMap::new();
    for row in &own {
        let [successes, episodes] = tasks.entry(row.task.clone()).or_default();
        *successes += usize::from(row.success);
        *episodes += 1;
        if !row.success {
            *causes.entry(row.cause.clone()).or_default() += 1;
        }
    }
    let (episodes, successes) = (own.len(), own.iter().filter(|row| row.success).count());
    CellFigures {
        cell: cell.name.clone(),
        episodes,
        successes,
        broken: own.iter().filter(|row| row.broken).count(),
        rate: rounded(successes as f64 / episodes.max(1) as f64),
        interval: wilson(successes, episodes).map(rounded),
        kept: kept(cell, &own, rows),
        tasks,
        causes,
    }
}

fn kept(cell: &Cell, own: &[&Row], rows: &[Row]) -> Option<Kept> {
    let reference: BTreeMap<(&str, u64), bool> = rows
        .iter()
        .filter(|row| row.cell == cell.against)
        .map(|row| ((row.task.as_str(), row.seed), row.success))
        .collect();
    let pairs: Vec<(bool, bool)> = own
        .iter()
        .filter_map(|row| {
            let before = reference.get(&(row.task.as_str(), row.seed))?;
            Some((*before, row.success))
        })
        .collect();
    let before = pairs.iter().filter(|(before, _)| *before).count();
    let after = pairs.iter().filter(|(_, after)| *after).count();
    let number = |success| f64::from(u8::from(success));
    let numbers: Vec<(f64, f64)> = pairs
        .iter()
        .map(|(before, after)| (number(*before), number(*after)))
        .collect();
    let interval = ratio_bootstrap(&numbers)?;
    Some(Kept {
        against: cell.against.clone(),
        pairs: pairs.len(),
        successes: [before, after],
        share: rounded(after as f64 / before as f64),
        interval: interval.map(rounded),
    })
}

fn rounded(value: f64) -> f64 {
    (value * DIGITS).round() / DIGITS
}

#[cfg(test)]
mod tests {
    use super::super::test_suite::{row, suite};
    use super::*;

    #[test]
    fn kept_share_compares_pairs_of_equal_task_and_seed() {
        let suite = suite();
        // Base 3 of 4; start-2 2 of 4, one of them where the base failed.
        let mut rows = vec![
            row("base", "pick_bowl", 600, true),
            row("base", "pick_bowl", 601, true),
            row("base", "pick_mustard", 600, true),
            row("base", "pick_mustard", 601, false),
            row("start-2", "pick_mustard", 601, true),
            row("start-2", "pick_bowl", 600, true),
            row("start-2", "pick_bowl", 601, false),
            row("start-2", "pick_mustard", 600, false),
        ];
        let cells = figures(&suite, &rows);
        assert_eq!(cells.len(), 2);
        assert_eq!((cells[0].rate, &cells[0].kept), (0.75, &None));
        let kept = cells[1].kept.clone().unwrap();
        assert_eq!((kept.pairs, kept.successes), (4, [3, 2]));
        assert_eq!(kept.share, 0.666_667);
        assert_eq!(cells[1].tasks["pick_bowl"], [1, 2]);
        assert_eq!(cells[1].causes["timeout"], 2);
        // Without a success of the base the share is absent.
        rows.iter_mut().take(4).for_each(|row| row.success = false);
        assert_eq!(figures(&suite, &rows)[1].kept, None);
        // Nor without the base.
        assert_eq!(figures(&suite, &rows[4..])[0].kept, None);
    }
}
