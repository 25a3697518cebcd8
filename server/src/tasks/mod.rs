//! Tasks: what is asked, where things start, and whether it was done.
//!
//! `area_load` reads `assets/areas/NAME.toml`: what stands in an area and how it is
//! drawn. `load` reads `assets/tasks/NAME.toml` into a `spec`: a `template`, and
//! queries for what it is about. `scene_draw` draws a scene from area and seed and
//! knows of no task; `draw` then takes a target in it, and `sentence` says it by
//! the grammar where a scenario asks. `evaluate` judges snapshots
//! by the `predicates` of the template. Nothing here moves anything; the same seed
//! and the same snapshots give the same answers.

mod area;
mod area_load;
mod arrangement;
#[cfg(test)]
mod care_tests;
mod condition;
mod context;
mod draw;
mod evaluate;
mod failure;
mod file;
mod floor;
mod goal;
mod known;
mod load;
mod placement_clearance;
mod predicates;
mod query;
mod random;
#[cfg(test)]
mod reach_tests;
mod rest;
mod scene_draw;
mod sentence;
mod spec;
pub mod table;
mod takeable;
mod template;
#[cfg(test)]
mod tests;

pub use area::{AreaSpec, PlaceSpec, Range, RestShares, SlideSpec, StartSpec, Variant};
pub use draw::{Draw, draw, variant_of};
pub use evaluate::{Condition, Evaluation, Evaluator, EvaluatorState, HARD};
pub use failure::Failure;
pub use floor::{Floor, collision_boxes};
pub use goal::Goal;
pub use load::list;
pub use scene_draw::{SceneDraw, draw_scene};
pub use sentence::{Language, POLITENESS, sentence};
pub use spec::{ConditionSpec, FailureSpec, TaskSpec, WaitSpec};
