//! The results of `wheelarm multiply`, from which an interrupted run resumes.

use serde::{Deserialize, Serialize};
use wheelarm_rollout::LogEntry;

/// Result of one attempt.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Seed of the scene.
    pub seed: u64,
    /// Whether the task succeeded and the file was kept.
    pub kept: bool,
    /// The episode whose demonstration was adapted; empty where none could be.
    pub source: String,
    /// End of the episode, in a word or two.
    pub end: String,
    /// Reason of the failure.
    pub why: String,
    /// Label of its file.
    pub label: String,
    /// Simulated seconds.
    pub seconds: f64,
    /// Wall seconds.
    pub wall_seconds: f64,
    /// Notes of the operator.
    pub notes: Vec<String>,
}

impl Entry {
    /// The entry in one line.
    #[must_use]
    pub fn line(&self) -> String {
        let source = match self.source.as_str() {
            "" => String::new(),
            source => format!(" as in {source}"),
        };
        match self.kept {
            true => format!("kept   seed {}{source}, {:.1} s", self.seed, self.seconds),
            false => format!("failed seed {}{source}: {}", self.seed, self.why),
        }
    }
}

impl LogEntry for Entry {
    const COMMAND: &'static str = "multiply";

    fn replaces(&self, known: &Self) -> bool {
        self.seed == known.seed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earlier_logs::resumed;

    #[test]
    fn results_of_earlier_versions_are_read_and_resumed() {
        let text = include_str!("../../../../tests/data/episode-logs/multiply.jsonl");
        let entries = resumed::<Entry>(text);
        let seeds: Vec<u64> = entries.iter().map(|entry| entry.seed).collect();
        assert_eq!(seeds, [500_000, 500_001]);
        assert!(entries.iter().all(|entry| entry.kept));
    }
}
