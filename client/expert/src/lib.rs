//! The scripted operator: small skills that drive the chair and use the arm.
//!
//! It uses only what every client sees: streams, queries and commands. The
//! skills are pure; `run` alone speaks to the network.

#![warn(missing_docs)]

pub mod base_placement;
pub mod clearance;
pub mod demonstration;
pub mod drive;
pub mod forced;
pub mod goal;
pub mod grasp_candidate;
pub mod habits;
pub mod hand;
pub mod log;
pub mod observation;
pub mod operator;
pub mod pace;
pub mod profile;
pub mod run;
pub mod scene;
pub mod shake;
pub mod skill;
pub mod tool_path;

#[cfg(test)]
mod tests;
