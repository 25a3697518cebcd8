//! Tasks: goals, sampled starts, and evaluation.
//!
//! - `area_load` reads `assets/areas/NAME.toml`: the contents of an area and their
//!   ranges.
//! - `load` reads `assets/tasks/NAME.toml` into a `spec`: a `template`, and queries for
//!   its objects.
//! - `home_query` reads a task without an area: queries for places of a home
//!   (`place_query`) and for objects of the `stock`, which `home_objects` samples.
//! - `scene_sampling` samples a scene from area and seed, independent of the task. By the
//!   rules of `sampling_rules`, `floor`, `drivable` and `grasp_reach` limit starts and objects,
//!   and `leaf_reach` doors of furniture that are to be closed.
//! - `task_sampling` then selects a target in it, and `sentence` generates an
//!   instruction by the grammar when a scenario requests one.
//! - `evaluate` evaluates snapshots by the `predicates` of the template.
//!
//! The results depend only on the seed and the snapshots.

mod area;
mod area_load;
mod arrangement;
#[cfg(test)]
mod care_tests;
mod condition;
mod condition_spec;
mod context;
mod drivable;
mod evaluate;
mod failure;
mod file;
mod floor;
mod goal;
mod grasp_clearance;
mod grasp_reach;
mod home_objects;
mod home_query;
mod home_sites;
mod joint_query;
mod leaf_reach;
mod load;
mod map;
mod name_check;
mod place_query;
mod placement_clearance;
mod predicates;
mod pushing_arm;
mod query;
mod random;
#[cfg(test)]
mod reach_tests;
mod rest;
mod sampling_rules;
mod scene_sampling;
mod sentence;
mod spec;
mod stock;
pub mod table;
mod task_sampling;
mod template;
#[cfg(test)]
mod tests;

pub use area::{AreaSpec, PlaceSpec, Range, RestShares, SlideSpec, StartSpec, Variant};
pub use condition_spec::ConditionSpec;
pub use evaluate::{Condition, Evaluation, Evaluator, EvaluatorState, HARD};
pub use failure::Failure;
pub use floor::{Floor, collision_boxes};
pub use goal::Goal;
pub use load::{list, stocked, usable};
pub use map::{Door, HomeMap, MapSource, Room};
pub use sampling_rules::SamplingRules;
pub use scene_sampling::{SceneSample, sample_scene};
pub use sentence::{Language, POLITENESS, sentence};
pub use spec::{FailureSpec, TaskSpec, WaitSpec};
pub use task_sampling::{TaskSample, sample, sample_reached, variant_of};
