//! The scripted operator: small skills that drive the chair and use the arm.
//!
//! It uses only what every client sees: streams, queries and commands. The
//! skills are pure; `run` alone speaks to the network.

pub mod block;
pub mod clearance;
pub mod dock;
pub mod drive;
pub mod goal;
pub mod ground;
pub mod hand;
pub mod observation;
pub mod operator;
pub mod route;
pub mod run;
pub mod scene;
pub mod skill;
pub mod style;
pub mod tool_path;
pub mod way;

#[cfg(test)]
mod toy;
