//! Rates of success by task and by failed condition.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use super::entry::Entry;
use super::scope::Scope;
use super::statistics::{clopper_pearson, mean, quantiles, wilson};

/// Results of one task.
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
    /// Simulated seconds of the successful episodes: quantiles of [`SHARES`]; absent
    /// without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_quantiles: Option<[f64; 5]>,
    /// Progress of the episodes; absent when none was monitored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub progress: Option<ProgressReport>,
    /// Episodes in which something else than the target was knocked over.
    pub knocked_over: usize,
    /// Episodes in which the robot hit something hard, and how often in all.
    pub hard_contacts: [usize; 2],
    /// The policy's answers: their number, mean wall time and the time that 99 of 100
    /// stayed below in the slowest episode, milliseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inference_ms: Option<(usize, f64, f64)>,
    /// Count of the policy's errors by kind.
    pub policy_errors: BTreeMap<String, usize>,
    /// Count of episodes by end.
    pub ends: BTreeMap<String, usize>,
    /// Causes of failures with their seeds, the most frequent first.
    pub causes: Vec<(String, Vec<u64>)>,
    /// Hash of the newest state by seed.
    pub state_hashes: BTreeMap<u64, String>,
    /// Simulated seconds per wall second over all episodes.
    pub factor: f64,
    /// Count of failures of each required condition at the end.
    pub failed_conditions: BTreeMap<String, usize>,
    /// Count of failures of each condition that is only reported.
    pub reported_conditions: BTreeMap<String, usize>,
    /// Seeds that failed, with the reason.
    pub failed_seeds: BTreeMap<u64, String>,
}

/// Shares of the reported quantiles.
pub const SHARES: [f64; 5] = [0.1, 0.25, 0.5, 0.75, 0.9];

/// Progress of episodes, percent of the way.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProgressReport {
    /// Episodes that a course is known of: not those that broke.
    pub episodes: usize,
    /// Mean, percent.
    pub mean: f64,
    /// Quantiles of [`SHARES`], percent.
    pub quantiles: [f64; 5],
    /// Share of the episodes whose furthest step is this one, by name of the step.
    pub furthest: Vec<(String, f64)>,
}

/// Results of all tasks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The split; absent where seeds were named.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<String>,
    /// Name of the policy; `operator` for the scripted one.
    pub policy: String,
    /// Purpose of the seeds.
    pub purpose: &'static str,
    /// Settings of the scenarios beside task and seed; empty for the defaults.
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
    /// Start poses that the server sampled, and those that it rejected because of the
    /// person.
    #[serde(rename = "drawn_starts")]
    pub sampled_starts: [usize; 2],
}

impl Report {
    /// Counts the entries of `tasks`.
    #[must_use]
    pub fn new(tasks: &[String], entries: &[Entry], scope: &Scope) -> Self {
        let tasks: Vec<TaskReport> = tasks.iter().map(|task| count(task, entries)).collect();
        let episodes = tasks.iter().map(|task| task.episodes).sum();
        let successes = tasks.iter().map(|task| task.successes).sum();
        let of_tasks = entries
            .iter()
            .filter(|entry| tasks.iter().any(|task| task.task == entry.task));
        let rejected = of_tasks.map(|entry| entry.rejected_starts as usize).sum();
        Self {
            split: scope.split.clone(),
            policy: entries
                .iter()
                .map(|entry| entry.policy.clone())
                .find(|name| !name.is_empty())
                .unwrap_or_else(|| "operator".to_owned()),
            purpose: scope.purpose(),
            settings: scope.variation.words(0).trim_start().to_owned(),
            episodes,
            successes,
            interval: wilson(successes, episodes),
            exact_interval: clopper_pearson(successes, episodes),
            sampled_starts: [episodes + rejected, rejected],
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
    let seconds: Vec<f64> = good.iter().map(|entry| entry.seconds).collect();
    let mut policy_errors = BTreeMap::new();
    let mut ends = BTreeMap::new();
    let mut causes: BTreeMap<String, Vec<u64>> = BTreeMap::new();
    for entry in &own {
        if let Some(kind) = entry.end.strip_prefix("policy ") {
            *policy_errors.entry(kind.to_owned()).or_insert(0) += 1;
        }
        *ends.entry(entry.end.clone()).or_insert(0) += 1;
        if !entry.success {
            causes.entry(entry.cause()).or_default().push(entry.seed);
        }
    }
    ends.remove("");
    let mut causes: Vec<_> = causes.into_iter().collect();
    causes.sort_by_key(|(_, seeds)| std::cmp::Reverse(seeds.len()));
    for (_, seeds) in &mut causes {
        seeds.sort_unstable();
    }
    let hits = own.iter().filter_map(|entry| entry.course.as_ref());
    let hits: Vec<usize> = hits.map(|course| course.hard_contacts.len()).collect();
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
        rate: good.len() as f64 / own.len().max(1) as f64,
        interval: wilson(good.len(), own.len()),
        exact_interval: clopper_pearson(good.len(), own.len()),
        mean_seconds: mean(&seconds),
        seconds_quantiles: quantiles(&seconds, SHARES),
        progress: progress(&own),
        knocked_over: own.iter().filter(|entry| entry.knocked_over()).count(),
        hard_contacts: [hits.iter().filter(|n| **n > 0).count(), hits.iter().sum()],
        inference_ms: inference(&own),
        policy_errors,
        ends,
        causes,
        state_hashes: own
            .iter()
            .map(|entry| (entry.seed, entry.hash.clone()))
            .collect(),
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

/// Progress of the episodes, and the share by furthest step.
fn progress(own: &[&Entry]) -> Option<ProgressReport> {
    let courses: Vec<_> = own
        .iter()
        .filter_map(|entry| entry.course.as_ref())
        .collect();
    let percents: Vec<f64> = courses.iter().map(|c| f64::from(c.percent)).collect();
    let way = courses.first()?.way.steps();
    let steps = way.iter().map(|(step, percent)| (*percent, step.words()));
    let share = |percent: u8| {
        let as_far = courses.iter().filter(|c| c.percent == percent).count();
        as_far as f64 / courses.len() as f64
    };
    Some(ProgressReport {
        episodes: courses.len(),
        mean: mean(&percents),
        quantiles: quantiles(&percents, SHARES)?,
        furthest: [(0, "nothing")]
            .into_iter()
            .chain(steps)
            .map(|(percent, words)| (words.to_owned(), share(percent)))
            .collect(),
    })
}

/// The policy's answers in all episodes: number, mean and slowest 99 %, milliseconds.
fn inference(own: &[&Entry]) -> Option<(usize, f64, f64)> {
    let all: Vec<_> = own.iter().filter_map(|entry| entry.thinking).collect();
    let count = all.iter().map(|(count, ..)| count).sum::<usize>();
    let sum: f64 = all
        .iter()
        .map(|(count, mean, _)| *count as f64 * mean)
        .sum();
    let slowest = all.iter().map(|(.., slow)| *slow).fold(0.0, f64::max);
    (count > 0).then(|| (count, 1e3 * sum / count as f64, 1e3 * slowest))
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
            let mean = match task.successes {
                0 => "-".to_owned(),
                _ => format!("{:.1} s", task.mean_seconds),
            };
            writeln!(
                f,
                "{:<20} {:>4}/{:<4} {:>4.0} % {:>13} {mean:>8} {:>6.1}x",
                task.task,
                task.successes,
                task.episodes,
                100.0 * task.rate,
                percent(task.interval),
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
                let why = why.replace('\n', "\n        ");
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
        if let [sampled, rejected] = self.sampled_starts
            && rejected > 0
        {
            let share = 100.0 * rejected as f64 / sampled as f64;
            writeln!(
                f,
                "start poses {rejected} of {sampled} rejected because of the person ({share:.1} %)"
            )?;
        }
        writeln!(f, "{split}seeds for {}{settings}", self.purpose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::entry::Condition;
    use crate::evaluate::milestone::{Course, Milestone, Way};
    use crate::variation::Variation;
    use wheelarm_rollout::FailureCause;

    #[test]
    fn rates_count_by_task_and_by_failed_condition() {
        let entry = |task: &str, seed, success| Entry {
            task: task.to_owned(),
            seed,
            settings: String::new(),
            policy: String::new(),
            policy_files: String::new(),
            label: None,
            thinking: None,
            success,
            why: if success { "" } else { "dropped" }.to_owned(),
            end: if success { "success" } else { "timeout" }.to_owned(),
            course: Some(Course {
                way: Way::Lift,
                percent: if success { 100 } else { 40 },
                missing: (!success).then_some(Milestone::Gripped),
                reached: Vec::new(),
                hard_contacts: vec!["arm on table".to_owned(); seed as usize],
            }),
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
            rejected_starts: 0,
            instruction: String::new(),
            target: String::new(),
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
        let far = a.progress.clone().unwrap();
        assert!((far.mean - 80.0).abs() < 1e-12, "{far:?}");
        // A broken episode has no course: the mean covers the others.
        let mut broken = entry("a", 3, false);
        (broken.course, broken.broken) = (None, Some(FailureCause::Server));
        let with = Report::new(&names, &[&entries[..], &[broken]].concat(), &scope);
        let with = with.tasks[0].progress.clone().unwrap();
        assert_eq!((far.episodes, with.episodes, with.mean), (3, 3, far.mean));
        assert_eq!(far.quantiles[2], 100.0);
        let shares: Vec<f64> = far.furthest.iter().map(|(_, share)| *share).collect();
        assert_eq!(shares, [0.0, 0.0, 1.0 / 3.0, 0.0, 0.0, 2.0 / 3.0]);
        assert_eq!(a.hard_contacts, [2, 3]);
        assert_eq!(a.ends["timeout"], 1);
        assert_eq!(a.causes, [("timeout, not both pads".to_owned(), vec![1])]);
        assert_eq!(a.seconds_quantiles.unwrap()[2], 11.0);
        assert_eq!((&c.progress, c.seconds_quantiles), (&None, None));
        assert_eq!((c.interval, report.interval), ([0.0, 1.0], wilson(3, 4)));
        let text = report.to_string();
        for words in ["3/4", " 11.0 s ", "split develop, seeds for develop"] {
            assert!(text.contains(words), "{text}");
        }
        let none = text.lines().find(|line| line.starts_with("c ")).unwrap();
        assert!(none.contains(" - ") && !none.contains(" s "), "{none}");
    }
}
