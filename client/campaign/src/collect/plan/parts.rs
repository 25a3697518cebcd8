//! Parts of a checked plan, and why a plan cannot be used.

use std::fmt;
use std::path::PathBuf;

/// One task.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Name below assets/tasks.
    pub name: String,
    /// Line of the plan that names it.
    pub line: usize,
    /// Episodes wanted.
    pub episodes: u32,
    /// Seed of the first episode; the next ones follow.
    pub first_seed: u64,
    /// Mean duration, simulated seconds, if the plan knows it.
    pub seconds: Option<f64>,
    /// Mean samples per episode of the dataset that this one is modelled on.
    pub reference_samples: Option<f64>,
}

/// A plan that cannot be used.
#[derive(Debug, thiserror::Error)]
pub struct PlanError {
    pub(super) path: PathBuf,
    pub(super) line: Option<usize>,
    pub(super) what: String,
}

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.path.display(), self.what),
            None => write!(f, "{}: {}", self.path.display(), self.what),
        }
    }
}
