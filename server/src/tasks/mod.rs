//! Tasks: what is asked, where things start, and whether it was done.
//!
//! `spec` reads `assets/tasks/NAME.toml`, `draw` chooses one start from a seed,
//! `evaluate` judges snapshots by the `predicate`s of the file. Nothing here
//! moves anything; the same seed and the same snapshots give the same answers.

mod context;
mod draw;
mod evaluate;
mod file;
mod goal;
mod predicate;
#[cfg(test)]
mod reach_tests;
mod room;
mod spec;
#[cfg(test)]
mod tests;

pub use draw::{Draw, draw};
pub use evaluate::{Condition, Evaluation, Evaluator, EvaluatorState, Failure, HARD};
pub use goal::Goal;
pub use predicate::Predicate;
pub use spec::{
    ConditionSpec, FailureSpec, PlaceSpec, Range, SlideSpec, StartSpec, TaskSpec, list,
};
