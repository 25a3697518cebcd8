//! Command-line values and connection options that several commands share.
//!
//! Depends on the SDK for [`wheelarm_sdk::Connect`]; no command lives here.

pub mod choice;
pub mod connect;
