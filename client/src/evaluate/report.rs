//! Rates of success by task and by failed condition.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use super::entry::Entry;
use super::scope::Scope;
use super::statistics::{clopper_pearson, wilson};

/// What came of one task.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TaskReport {
    /// Task.
    pub task: String,
    /// Episodes done.
    pub episodes: usize,
    /// Episodes that succeeded.
    pub successes: usize,
    /// Episodes in which something broke; they count as failed.
    pub broken: usize,
    /// Share of successes; 0 without episodes.
    pub rate: f64,
    /// Wilson's interval of the share at 95 %, lower and upper end.
    pub interval: [f64; 2],
    /// Clopper and Pearson's exact interval of the share at 95 %.
    pub exact_interval: [f64; 2],
    /// Mean simulated seconds of the successful episodes.
    pub mean_seconds: f64,
    /// Simulated seconds per wall second over all episodes.
    pub factor: f64,
    /// How often each required condition did not hold at the end.
    pub failed_conditions: BTreeMap<String, usize>,
    /// How often each condition that is only reported did not hold.
    pub reported_conditions: BTreeMap<String, usize>,
    /// Seeds that failed, with the reason.
    pub failed_seeds: BTreeMap<u64, String>,
}

/// What came of all tasks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The split; absent where seeds were named.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<String>,
    /// What the seeds are for.
    pub purpose: &'static str,
    /// What the scenarios say beside task and seed; empty for what is usual.
    pub settings: String,
    /// By task.
    pub tasks: Vec<TaskReport>,
    /// All episodes.
    pub episodes: usize,
    /// All successes.
    pub successes: usize,
    /// Wilson's interval of their share at 95 %, lower and upper end.
    pub interval: [f64; 2],
    /// Clopper and Pearson's exact interval of their share at 95 %.
    pub exact_interval: [f64; 2],
}

impl Report {
    /// Counts the entries of `tasks`.
    #[must_use]
    pub fn new(tasks: &[String], entries: &[Entry], scope: &Scope) -> Self {
        let tasks: Vec<TaskReport> = tasks.iter().map(|task| count(task, entries)).collect();
        let episodes = tasks.iter().map(|task| task.episodes).sum();
        let successes = tasks.iter().map(|task| task.successes).sum();
        Self {
            split: scope.split.clone(),
            purpose: scope.purpose(),
            settings: scope.variation.words(0).trim_start().to_owned(),
            episodes,
            successes,
            interval: wilson(successes, episodes),
            exact_interval: clopper_pearson(successes, episodes),
            tasks,
        }
    }

    /// The report as JSON.
    ///
    /// # Errors
    /// Never for finite numbers.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|text| text + "\n")
    }
}

fn count(task: &str, entries: &[Entry]) -> TaskReport {
    let own: Vec<&Entry> = entries.iter().filter(|entry| entry.task == task).collect();
    let good: Vec<&&Entry> = own.iter().filter(|entry| entry.success).collect();
    let mut failed_conditions = BTreeMap::new();
    let mut reported_conditions = BTreeMap::new();
    for entry in &own {
        for condition in entry.conditions.iter().filter(|c| !c.holds) {
            let counts = if condition.required {
                &mut failed_conditions
            } else {
                &mut reported_conditions
            };
            *counts.entry(condition.name.clone()).or_insert(0) += 1;
        }
    }
    let mean = |sum: f64, count: usize| if count == 0 { 0.0 } else { sum / count as f64 };
    let simulated: f64 = own.iter().map(|entry| entry.seconds).sum();
    let wall: f64 = own
        .iter()
        .map(|entry| entry.seconds / entry.factor.max(1e-9))
        .sum();
    TaskReport {
        task: task.to_owned(),
        episodes: own.len(),
        successes: good.len(),
        broken: own.iter().filter(|entry| entry.broken.is_some()).count(),
        rate: mean(good.len() as f64, own.len()),
        interval: wilson(good.len(), own.len()),
        exact_interval: clopper_pearson(good.len(), own.len()),
        mean_seconds: mean(good.iter().map(|entry| entry.seconds).sum(), good.len()),
        factor: if wall > 0.0 { simulated / wall } else { 0.0 },
        failed_conditions,
        reported_conditions,
        failed_seeds: own
            .iter()
            .filter(|entry| !entry.success)
            .map(|entry| (entry.seed, entry.why.clone()))
            .collect(),
    }
}

/// An interval of shares, in percent.
fn percent([low, high]: [f64; 2]) -> String {
    format!("{:.1}..{:.1} %", 100.0 * low, 100.0 * high)
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<20} {:>9} {:>6} {:>13} {:>8} {:>7}",
            "task", "successes", "rate", "95 %", "mean", "speed"
        )?;
        for task in &self.tasks {
            writeln!(
                f,
                "{:<20} {:>4}/{:<4} {:>4.0} % {:>13} {:>6.1} s {:>6.1}x",
                task.task,
                task.successes,
                task.episodes,
                100.0 * task.rate,
                percent(task.interval),
                task.mean_seconds,
                task.factor
            )?;
            if task.broken > 0 {
                writeln!(f, "    broken: {}", task.broken)?;
            }
            for (name, count) in &task.failed_conditions {
                writeln!(f, "    not {name}: {count}")?;
            }
            for (name, count) in &task.reported_conditions {
                writeln!(f, "    only reported, not {name}: {count}")?;
            }
            for (seed, why) in &task.failed_seeds {
                writeln!(f, "    seed {seed}: {why}")?;
            }
        }
        let [done, all] = [self.successes, self.episodes];
        writeln!(
            f,
            "{:<20} {done:>4}/{all:<4} {:>20}",
            "all",
            percent(self.interval)
        )?;
        let split = self
            .split
            .as_deref()
            .map_or(String::new(), |name| format!("split {name}, "));
        let settings = match self.settings.as_str() {
            "" => String::new(),
            words => format!(", {words}"),
        };
        writeln!(f, "{split}seeds for {}{settings}", self.purpose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::entry::Condition;
    use crate::variation::Variation;

    #[test]
    fn rates_count_by_task_and_by_failed_condition() {
        let entry = |task: &str, seed, success| Entry {
            task: task.to_owned(),
            seed,
            settings: String::new(),
            policy: String::new(),
            thinking: None,
            success,
            why: if success { "" } else { "dropped" }.to_owned(),
            conditions: vec![
                Condition {
                    name: "held".to_owned(),
                    holds: success,
                    required: true,
                    value: 0.0,
                },
                Condition {
                    name: "calm".to_owned(),
                    holds: false,
                    required: false,
                    value: 0.0,
                },
            ],
            seconds: 10.0 + seed as f64,
            factor: 5.0,
            hash: String::new(),
            notes: Vec::new(),
            broken: None,
            scenario: None,
        };
        let entries = [
            entry("a", 0, true),
            entry("a", 1, false),
            entry("a", 2, true),
            entry("b", 0, true),
        ];
        let names = ["a", "b", "c"].map(str::to_owned);
        let scope = Scope {
            layout: false,
            split: Some("develop".to_owned()),
            seeds: 0..3,
            variation: Variation::default(),
        };
        let report = Report::new(&names, &entries, &scope);
        let [a, b, c] = &report.tasks[..] else {
            panic!("three tasks");
        };
        assert_eq!((a.successes, a.episodes, b.successes), (2, 3, 1));
        assert!((a.mean_seconds - 11.0).abs() < 1e-12, "{a:?}");
        assert!((a.factor - 5.0).abs() < 1e-12, "{a:?}");
        assert_eq!(a.failed_conditions["held"], 1);
        assert_eq!(a.reported_conditions["calm"], 3);
        assert_eq!(a.failed_seeds[&1], "dropped");
        assert_eq!((c.episodes, c.rate), (0, 0.0));
        assert_eq!((c.interval, report.interval), ([0.0, 1.0], wilson(3, 4)));
        let text = report.to_string();
        for words in ["3/4", "split develop, seeds for develop"] {
            assert!(text.contains(words), "{text}");
        }
    }
}
