//! Result of one episode, as a line of `episodes.jsonl`.

use serde::{Deserialize, Serialize};
use wheelarm_proto::v1;
use wheelarm_rollout::{FailureCause, LogEntry};

use super::milestone::Course;
use crate::variation::Variation;

/// One episode to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Task.
    pub task: String,
    /// Seed of the scenario and of the operator's habits.
    pub seed: u64,
    /// Variation between episodes beside the sampling of their task.
    pub variation: Variation,
    /// Name of the policy; empty for the scripted operator.
    pub policy: String,
    /// Digest of the policy's files (`crate::policy_options::files`); empty without any.
    pub policy_files: String,
}

impl Job {
    /// Label of its recording, where that is free.
    #[must_use]
    pub fn label(&self) -> String {
        label(&self.task, self.seed)
    }

    /// Settings of its scenario beside task and seed, as one line; empty for the defaults.
    #[must_use]
    pub fn settings(&self) -> String {
        let [scene, robot, ..] = self.variation.images_and_rates();
        let mut words = self.variation.words(0);
        for (name, value) in [("scene", scene), ("robot", robot)] {
            if !value.is_empty() {
                words.push_str(&format!(" {name}={value}"));
            }
        }
        words.trim_start().to_owned()
    }
}

fn label(task: &str, seed: u64) -> String {
    format!("{task}-seed{seed}")
}

/// One condition of the task at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// Predicate.
    pub name: String,
    /// Whether it held.
    pub holds: bool,
    /// Whether it had to.
    pub required: bool,
    /// The measured quantity, in the unit of its threshold (SI).
    pub value: f64,
}

impl From<&v1::Condition> for Condition {
    fn from(condition: &v1::Condition) -> Self {
        Self {
            name: condition.name.clone(),
            holds: condition.holds,
            required: condition.required,
            value: condition.value,
        }
    }
}

/// For serde, which passes a reference.
fn is_zero(count: &u32) -> bool {
    *count == 0
}

/// Result of one episode.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Task.
    pub task: String,
    /// Seed of the scenario and of the operator's habits.
    pub seed: u64,
    /// Other settings of its scenario, as one line; empty for the defaults.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub settings: String,
    /// Name of the policy; empty for the scripted operator.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub policy: String,
    /// Digest of the policy's files when it was done; empty without any.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub policy_files: String,
    /// Label of its recording; empty where it was not recorded, absent in lines from
    /// before labels were written down.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub label: Option<String>,
    /// Operator and task agree that it is done.
    pub success: bool,
    /// Reason of a failure; empty after success.
    pub why: String,
    /// End of the episode, in a word or two: `success`, the task's reason to fail
    /// (`timeout`, `dropped`, …), `gave up` where the operator did, or what broke.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub end: String,
    /// Progress; absent when the episode was not monitored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub course: Option<Course>,
    /// The task's conditions at the end.
    pub conditions: Vec<Condition>,
    /// Simulated seconds.
    pub seconds: f64,
    /// Simulated seconds per wall second.
    pub factor: f64,
    /// Hash of the newest state that was published, once per simulated second;
    /// equal in every run of the same episode.
    pub hash: String,
    /// Start poses that the server rejected because of the person before it took one
    /// (count); absent for none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub rejected_starts: u32,
    /// Sentence of the episode; empty in lines of earlier versions and where the episode did
    /// not begin.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub instruction: String,
    /// Target of the task; empty as the sentence.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub target: String,
    /// Notes of the operator.
    pub notes: Vec<String>,
    /// Wall time of the policy's answers, s: their number, mean, and what 99 of 100
    /// stayed below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thinking: Option<(usize, f64, f64)>,
    /// Cause, if the episode broke.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub broken: Option<FailureCause>,
    /// Scenario that reproduces a broken episode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<serde_json::Value>,
}

impl LogEntry for Entry {
    const COMMAND: &'static str = "evaluate";

    /// The same episode of the same policy.
    fn replaces(&self, known: &Self) -> bool {
        fn key(e: &Entry) -> (u64, [&String; 3]) {
            (e.seed, [&e.task, &e.settings, &e.policy])
        }
        key(self) == key(known)
    }
}

impl Entry {
    /// An empty result of `job`.
    #[must_use]
    pub fn for_job(job: &Job) -> Self {
        Self {
            task: job.task.clone(),
            seed: job.seed,
            settings: job.settings(),
            policy: job.policy.clone(),
            policy_files: job.policy_files.clone(),
            ..Self::default()
        }
    }

    /// Whether it is the result of `job`.
    #[must_use]
    pub fn is_of(&self, job: &Job) -> bool {
        self.is_of_name(job) && self.policy_files == job.policy_files
    }

    /// Whether it is the result of `job` by other files of its policy.
    #[must_use]
    pub fn is_outdated(&self, job: &Job) -> bool {
        self.is_of_name(job) && self.policy_files != job.policy_files
    }

    fn is_of_name(&self, job: &Job) -> bool {
        (&self.task, self.seed, &self.policy) == (&job.task, job.seed, &job.policy)
            && self.settings == job.settings()
    }

    /// Label of its recording; `None` where it was not recorded.
    #[must_use]
    pub fn recording(&self) -> Option<String> {
        match &self.label {
            None => Some(label(&self.task, self.seed)),
            Some(label) => Some(label.clone()).filter(|label| !label.is_empty()),
        }
    }

    /// Cause of the failure, in words that many episodes share; `success` otherwise.
    #[must_use]
    pub fn cause(&self) -> String {
        let end = match self.end.as_str() {
            "" => "failed",
            end => end,
        };
        let missing = self.course.as_ref().and_then(|course| course.missing);
        match missing.filter(|_| !self.success && self.broken.is_none()) {
            Some(step) => format!("{end}, not {}", step.words()),
            None => end.to_owned(),
        }
    }

    /// Whether something else than the target was knocked over.
    #[must_use]
    pub fn knocked_over(&self) -> bool {
        let knocks = |c: &&Condition| c.name.starts_with("nothing_knocked_over");
        self.conditions
            .iter()
            .find(knocks)
            .is_some_and(|c| !c.holds)
    }

    /// The entry in one line.
    #[must_use]
    pub fn line(&self) -> String {
        format!(
            "{:<20} seed {:<4} {} {:5.1} s, {:4.1}x{}",
            self.task,
            self.seed,
            if self.success { "yes" } else { "NO " },
            self.seconds,
            self.factor,
            if self.success {
                String::new()
            } else {
                format!("  {}", self.why.lines().next().unwrap_or_default())
            }
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earlier_logs::resumed;

    #[test]
    fn results_name_scene_robot_and_packs_of_objects() {
        let job = |scenario| Job {
            task: "take_anything".to_owned(),
            seed: 3,
            variation: Variation {
                scenario,
                ..Variation::default()
            },
            policy: String::new(),
            policy_files: String::new(),
        };
        assert_eq!(job(v1::Scenario::default()).settings(), "");
        let settings = job(v1::Scenario {
            scene: "studio-nordic-3".to_owned(),
            robot: "wheelarm_wide".to_owned(),
            packs: vec![v1::PackRef {
                name: "care".to_owned(),
                ..v1::PackRef::default()
            }],
            ..v1::Scenario::default()
        })
        .settings();
        for word in ["care", "scene=studio-nordic-3", "robot=wheelarm_wide"] {
            assert!(settings.contains(word), "{settings}");
        }
    }

    #[test]
    fn results_of_earlier_versions_are_read_and_resumed() {
        let text = include_str!("../../../../tests/data/episode-logs/evaluate.jsonl");
        let entries = resumed::<Entry>(text);
        let ends = entries.iter().map(|entry| entry.end.as_str());
        assert_eq!(
            ends.collect::<Vec<_>>(),
            ["success", "success", "server broke", ""]
        );
        assert_eq!(entries[2].broken, Some(FailureCause::Server));
        let job = |entry: &Entry| Job {
            task: entry.task.clone(),
            seed: entry.seed,
            variation: Variation::default(),
            policy: entry.policy.clone(),
            policy_files: entry.policy_files.clone(),
        };
        for entry in &entries {
            assert!(entry.is_of(&job(entry)), "{entry:?}");
            let others = entries.iter().filter(|other| other.is_of(&job(entry)));
            assert_eq!(others.count(), 1, "{entry:?}");
        }
        assert_eq!(entries[3].recording().as_deref(), Some("pick_bowl-seed7"));
    }
}
