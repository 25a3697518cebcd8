//! What a policy sees and answers, once for exports, training and control: a row
//! of state and a row of action at every picture.
//!
//! Pure: recorded values in, rows out; a row in, one command for all control
//! ticks until the next picture out. Between the two the server interpolates
//! (`Command.over_ticks`), the player never does. No network, no file.

#![warn(missing_docs)]

mod action;
mod applied;
mod pilot;
mod player;
mod rotation;
mod state;

pub use action::{ActionKind, NoKind};
pub use applied::{Applied, NEAR_ANGLE, NEAR_DISTANCE};
pub use pilot::{ChunkError, Pilot, PilotOptions};
pub use player::{Player, RowError};
pub use rotation::{from_six, to_six};
pub use state::{Observed, STATE, state, state_names, state_units};
