//! The thin clients of WheelArm.
//!
//! Everything here speaks to a server through messages only; no client shares
//! memory, files or code with it.

pub mod collect;
pub mod control;
pub mod demo;
pub mod link;
pub mod local;
pub mod operate;
pub mod record;
pub mod replay;
