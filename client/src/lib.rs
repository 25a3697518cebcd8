//! The thin clients of WheelArm.
//!
//! Everything here speaks to a server through messages only; no client shares
//! memory, files or code with it. What makes or reads episode files needs the
//! feature `hdf5`, teleoperation the feature `terminal`; both are on.

pub mod access;
#[cfg(feature = "hdf5")]
mod adapters;
#[cfg(feature = "hdf5")]
mod axis;
mod choice;
#[cfg(feature = "hdf5")]
pub mod collect;
pub mod connect;
pub mod control;
#[cfg(feature = "hdf5")]
pub mod demo;
mod disturb;
pub mod doctor;
pub mod drive;
#[cfg(all(test, feature = "hdf5"))]
mod earlier_logs;
mod episode_seed;
#[cfg(feature = "hdf5")]
pub mod evaluate;
#[cfg(feature = "hdf5")]
mod language;
#[cfg(feature = "hdf5")]
pub mod multiply;
pub mod operate;
#[cfg(feature = "hdf5")]
pub mod policy;
pub mod preview;
#[cfg(feature = "hdf5")]
pub mod record;
#[cfg(feature = "hdf5")]
pub mod replay;
#[cfg(feature = "terminal")]
pub mod teleop;
#[cfg(feature = "hdf5")]
mod text_file;
#[cfg(feature = "hdf5")]
mod variation;
pub mod watch;
#[cfg(feature = "hdf5")]
mod worker_mode;
