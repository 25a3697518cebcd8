//! `wheelarm replay FILE`: repeats an episode from its snapshot and its applied commands, and
//! compares the state hashes. With `--out` it also records, optionally with other cameras.

mod args;
mod assets;
mod calibration;
mod computed;
pub(crate) mod packs;
mod recorded;
mod recording;
mod script;

use std::process::ExitCode;

use wheelarm_dataset::read::Episode;

pub use args::ReplayArgs;
use packs::RecordedPacks;
pub use packs::extract_packs;

/// Replays and prints the result; exit code 1 when a state differs, 3 when the
/// new recording is not complete.
///
/// # Errors
/// When the file cannot be replayed or a program does not reply.
pub fn run(args: &ReplayArgs) -> anyhow::Result<ExitCode> {
    let episode = Episode::open(&args.file)?;
    let packs = RecordedPacks::unpack(&episode)?;
    let mut args = args.clone();
    args.packs.packs = packs.before(&args.packs.packs);
    let args = &args;
    match (args.as_recorded, &args.out) {
        (true, Some(out)) => recorded::run(args, out, &episode),
        _ => computed::run(args, &episode),
    }
}
