//! A rig: the programs that a command starts beside itself to make episodes.
//!
//! [`Server`], [`Recorder`] and [`Worker`], which is both and the operator in one,
//! are [`Process`]es, and every one is started, watched and ended in the same way,
//! within the same time limits. None outlives
//! the command that started it. Work that calls into libraries of this process
//! runs as [`Work`], which may panic or stall without taking the command along.

#![warn(missing_docs)]

mod label;
pub mod limits;
pub mod order;
mod process;
mod program;
mod recorder;
mod server;
mod socket;
mod work;
mod worker;

pub use label::free_label;
pub use process::{Input, Launch, Process, Program, end_with_parent};
pub use program::{find_program, programs_named, required_program};
pub use recorder::{Recorder, RecorderOptions};
pub use server::{Server, ServerOptions, StartError, all_cameras};
pub use socket::remove_socket;
pub use work::{Panicked, Work};
pub use worker::{Ongoing, Worker, WorkerOptions};
