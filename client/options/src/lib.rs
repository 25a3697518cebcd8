//! Command-line values and connection options that several commands share.
//!
//! Depends on the SDK for [`wheelarm_sdk::Connect`]; commands are elsewhere.

pub mod choice;
pub mod connect;
pub mod packs;
