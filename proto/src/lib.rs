//! The contract of WheelArm: messages, key expressions, names, units and frames.
//!
//! Data only: no transport, no simulation. Every process that speaks to a
//! server depends on this crate and on nothing else of the server.
//!
//! Conventions: right-handed frames, z up, x forward, y left; SI units and
//! radians; quaternions x y z w; `house` is the world frame.

pub mod check;
pub mod keys;
pub mod names;
pub mod preview;
mod time;

pub use time::{CONTROL_HZ, PHYSICS_HZ, TICKS_PER_CONTROL, stamp_nanos};

/// Messages of package `wheelarm.v1`.
#[allow(clippy::doc_markdown, reason = "generated from the .proto files")]
pub mod v1 {
    include!(concat!(env!("OUT_DIR"), "/wheelarm.v1.rs"));
}

pub use prost::{DecodeError, Message};

/// Version of the stored layout and of the messages.
pub const SCHEMA_VERSION: &str = "1";
