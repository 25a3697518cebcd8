//! Many episodes: `collect`, `evaluate`, `multiply` and `replay`.
//!
//! Each command decides which episodes run and what is kept; `wheelarm_rollout` runs them.

mod adapters;
mod axis;
pub mod collect;
mod disturb;
#[cfg(test)]
mod earlier_logs;
mod episode_seed;
pub mod evaluate;
mod frozen;
pub mod listed_tasks;
pub mod multiply;
pub mod policy_options;
mod renamed_keys;
pub mod replay;
mod sentences;
mod text_file;
mod variation;
mod worker_mode;
pub mod worlds;
