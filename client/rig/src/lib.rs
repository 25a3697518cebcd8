//! Programs that a command starts beside itself: a server of its own, a
//! recorder, the dataset tools. They end with the command, however it ends.

#![warn(missing_docs)]

pub mod local;
pub mod process;
mod program;

pub use program::find_program;
