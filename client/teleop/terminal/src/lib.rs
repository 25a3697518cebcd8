//! `wheelarm teleop`: a person drives chair, arm and gripper by keys.
//!
//! [`model`] decides and is pure, `view` draws it, `run` wires it to the
//! terminal and to the server. Nothing here looks at the wall clock but `run`.

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
/// When there is no terminal, or the page's address cannot be used.
pub fn run(connect: &Connect, args: &TeleopArgs) -> anyhow::Result<ExitCode> {
    Ok(match run::run(connect, args)? {
        Ended::Left => ExitCode::SUCCESS,
        Ended::Cut(why) => {
            // The terminal may be gone, and then nobody reads it.
            let _ = writeln!(
                std::io::stderr(),
                "ended by {why}: the chair was told to stop and the arm to hold; a running episode continues (wheelarm status)"
            );
            ExitCode::FAILURE
        }
    })
}
