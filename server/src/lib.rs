//! The headless WheelArm server: a wheelchair with an arm in a furnished home.
//!
//! Modules in reading order; their dependencies are checked by a test (ARCHITECTURE.md
//! lists the rules). The core below `sim` uses no network and no wall clock: the same
//! scenario and the same commands give the same bits. Only `service` and `main.rs` use
//! zenoh and tokio, only `world` uses rapier, only `sensors::camera` uses wgpu.

#![warn(missing_docs)]
#![cfg_attr(
    test,
    allow(clippy::disallowed_methods, reason = "tests compute freely")
)]

pub mod appearance;
pub mod environment;
pub mod geometry;
pub mod people;
pub mod robot;
pub mod scene;
pub mod sensors;
pub mod service;
pub mod sim;
pub mod snapshot;
pub mod tasks;
pub mod world;
