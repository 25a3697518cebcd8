//! The thin clients of WheelArm.
//!
//! Everything here speaks to a server through messages only; no client shares
//! memory, files or code with it.

pub mod collect;
pub mod connect;
pub mod control;
pub mod demo;
pub mod doctor;
pub mod evaluate;
pub mod operate;
pub mod preview;
pub mod record;
pub mod replay;
pub mod teleop;
pub mod watch;
