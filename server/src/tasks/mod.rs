//! Tasks: what is asked, where things start, and whether it was done.
//!
//! `load` reads `assets/tasks/NAME.toml` into a `spec`, `draw` chooses one start
//! from a seed, `evaluate` judges snapshots by the `predicates` of the file.
//! Nothing here moves anything; the same seed and the same snapshots give the
//! same answers.

mod condition;
mod context;
mod draw;
mod evaluate;
mod file;
mod goal;
mod load;
mod placement_clearance;
mod predicates;
#[cfg(test)]
mod reach_tests;
mod spec;
#[cfg(test)]
mod tests;

pub use draw::{Draw, draw};
pub use evaluate::{Condition, Evaluation, Evaluator, EvaluatorState, Failure, HARD};
pub use goal::Goal;
pub use load::list;
pub use spec::{ConditionSpec, FailureSpec, PlaceSpec, Range, SlideSpec, StartSpec, TaskSpec};
