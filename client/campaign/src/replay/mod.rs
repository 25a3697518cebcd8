//! `wheelarm replay FILE`: repeats an episode from its snapshot and its applied commands, and
//! compares the state hashes. With `--out` it also records, optionally with other cameras.

mod args;
mod assets;
mod calibration;
mod computed;
mod recorded;
mod recording;
mod script;

use std::process::ExitCode;

use wheelarm_dataset::read::Episode;

pub use args::ReplayArgs;

/// Replays and prints the result; exit code 1 when a state differs, 3 when the
/// new recording is not complete.
///
/// # Errors
/// When the file cannot be replayed or a program does not reply.
pub fn run(args: &ReplayArgs) -> anyhow::Result<ExitCode> {
    let episode = Episode::open(&args.file)?;
    match (args.as_recorded, &args.out) {
        (true, Some(out)) => recorded::run(args, out, &episode),
        _ => computed::run(args, &episode),
    }
}
