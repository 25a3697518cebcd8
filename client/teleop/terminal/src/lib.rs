//! `wheelarm teleop`: a person drives chair, arm and gripper by keys.
//!
//! [`model`] decides and is pure, `view` renders it, `run` connects it to the
//! terminal and to the server. Only `run` reads the wall clock.

mod args;
#[cfg(test)]
mod described;
pub mod drive;
pub mod form;
pub mod keys;
pub mod model;
mod quiet;
mod run;
mod terminal;
pub mod view;

use std::io::Write;
use std::process::ExitCode;

pub use args::TeleopArgs;
pub use run::Ended;
use wheelarm_sdk::Connect;

/// Runs `wheelarm teleop`.
///
/// # Errors
/// When standard input is not a terminal, or the page's address cannot be bound.
pub fn run(connect: &Connect, args: &TeleopArgs) -> anyhow::Result<ExitCode> {
    Ok(match run::run(connect, args)? {
        Ended::Left => ExitCode::SUCCESS,
        Ended::Cut(why) => {
            // The terminal may be gone, so a write error is ignored.
            let _ = writeln!(
                std::io::stderr(),
                "ended by {why}: the chair was stopped and the arm holds; a running episode continues (wheelarm status)"
            );
            ExitCode::FAILURE
        }
    })
}
