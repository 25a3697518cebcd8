//! What was tried, so that an interrupted run is resumed (`crate::ledger`).

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::ledger::Line;

/// What came of one try.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Seed of the scene.
    pub seed: u64,
    /// The task succeeded and the file is there.
    pub kept: bool,
    /// The episode whose demonstration was adapted; empty where none could be.
    pub source: String,
    /// How it ended, in a word or two.
    pub end: String,
    /// Why it failed, in words.
    pub why: String,
    /// Label of its file.
    pub label: String,
    /// Simulated seconds.
    pub seconds: f64,
    /// Wall seconds.
    pub wall_seconds: f64,
    /// What the operator noted.
    pub notes: Vec<String>,
}

impl Entry {
    /// One line for people.
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

impl Line for Entry {
    const COMMAND: &'static str = "multiply";

    fn is_of_the_same(&self, known: &Self) -> bool {
        self.seed == known.seed
    }
}

/// The file of what was tried.
pub type Ledger = crate::ledger::Ledger<Entry>;

impl Ledger {
    /// How many were kept.
    #[must_use]
    pub fn kept(&self) -> u64 {
        let entries = self.entries();
        entries.iter().filter(|entry| entry.kept).count() as u64
    }

    /// Seeds that were tried.
    #[must_use]
    pub fn seeds(&self) -> BTreeSet<u64> {
        self.entries().iter().map(|entry| entry.seed).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interrupted_run_knows_what_it_tried() {
        let folder = tempfile::tempdir().unwrap();
        let entry = |seed, kept| Entry {
            seed,
            kept,
            source: "one".to_owned(),
            end: "success".to_owned(),
            why: String::new(),
            label: format!("pick_bowl-multiplied-seed{seed}"),
            seconds: 15.0,
            wall_seconds: 2.0,
            notes: Vec::new(),
        };
        let ledger = Ledger::open(folder.path()).unwrap();
        ledger.add(&entry(5, true)).unwrap();
        ledger.add(&entry(6, false)).unwrap();
        let told = Ledger::open(folder.path()).err().unwrap().to_string();
        assert!(told.contains("another `wheelarm multiply`"), "{told}");
        drop(ledger);
        let again = Ledger::open(folder.path()).unwrap();
        assert_eq!(again.entries(), [entry(5, true), entry(6, false)]);
        assert_eq!((again.kept(), again.seeds()), (1, [5, 6].into()));
    }
}
