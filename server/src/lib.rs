//! The headless WheelArm server: a wheelchair with an arm in a furnished home.
//!
//! Modules in reading order, each behind a wall that a test checks
//! (ARCHITECTURE.md names the walls). The core below `sim` knows no network
//! and no wall clock: the same scenario and the same commands give the same
//! bits. `service` and `main.rs` alone name zenoh and tokio, `world` alone
//! names rapier, `sensors::camera` alone names wgpu.

#![warn(missing_docs)]
#![cfg_attr(
    test,
    allow(clippy::disallowed_methods, reason = "tests reckon freely")
)]

pub mod environment;
pub mod geometry;
pub mod look;
pub mod people;
pub mod robot;
pub mod scene;
pub mod sensors;
pub mod service;
pub mod sim;
pub mod snapshot;
pub mod tasks;
pub mod world;
