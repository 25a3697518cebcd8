//! Rows of state and action at every image, for exports, training and control alike.
//!
//! No I/O: recorded values in, rows out; a row in, one command for all control ticks until the
//! next image out. The server interpolates between two rows (`Command.over_ticks`), the
//! player never does. The crate has no network and no files.

#![warn(missing_docs)]

mod action;
mod applied;
mod chunk_executor;
pub mod frozen;
pub mod ledger;
mod player;
mod rotation;
mod state;
pub mod worlds;

pub use action::{ActionKind, NoKind};
pub use applied::{Applied, NEAR_ANGLE, NEAR_DISTANCE};
pub use chunk_executor::{ChunkError, ChunkExecutor, ExecutorOptions};
pub use player::{Player, RowError};
pub use rotation::{from_six, to_six};
pub use state::{Observed, STATE, state, state_names, state_units};
