//! The programs that an episode needs: [`Server`], [`Recorder`] and others.
//!
//! Every one is a [`Process`]: started, watched and ended in the same way, within the same
//! time limits. None outlives this process. [`Work`] is work of this process that may
//! panic or hang without taking the process along.

mod listed_tasks;
pub mod process;
mod program;
mod recorder;
mod server;
mod socket;
mod work;

pub use listed_tasks::{TaskSources, refusal_of_program, tasks_of_program};
pub use process::{Input, Launch, Process, Program, end_with_parent};
pub use program::{find_program, programs_named, required_program};
pub use recorder::{Lifetime, Record, Recorder};
pub use server::{Server, ServerOptions, StartError, all_cameras};
pub use socket::remove_socket;
pub use work::{Panicked, Work};
