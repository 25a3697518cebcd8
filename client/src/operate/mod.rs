//! The scripted operator: small skills that drive the chair and use the arm.
//!
//! It uses only what every client sees: streams, queries and commands. The
//! skills are pure; `run` alone speaks to the network.

pub mod drive;
pub mod grasp;
pub mod ground;
pub mod observation;
pub mod operator;
pub mod route;
pub mod run;
pub mod scene;
pub mod style;
pub mod tool_path;

#[cfg(test)]
mod toy;
