//! Commands of the program `wheelarm` that are not campaigns.
//!
//! They reach a server through messages only. What makes or reads episode files needs the
//! feature `hdf5`, teleoperation in a terminal the feature `terminal`; both are on.

pub mod accounts;
pub mod cache;
pub mod control;
#[cfg(feature = "hdf5")]
pub mod demo;
pub mod doctor;
pub mod drive;
pub mod help;
pub mod home;
pub mod home_make;
pub mod home_report;
pub mod map;
pub mod new;
pub mod object;
pub mod operate;
#[cfg(feature = "hdf5")]
pub mod record;
pub mod watch;
pub mod world_pack;
