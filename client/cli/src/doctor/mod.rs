//! `wheelarm doctor`: checks this host and the server and prints the fix of each problem.
//! It changes nothing.

mod finding;
mod rights;
mod server;
mod this_host;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use wheelarm_sdk::Connect;

use finding::{Finding, Level};

/// Options of `wheelarm doctor`.
#[derive(Args, Clone, Debug)]
pub struct DoctorArgs {
    /// Folder for recordings.
    #[arg(long, default_value = "data", value_name = "DIR")]
    pub out: PathBuf,
    /// Fails when no server replies.
    #[arg(long)]
    pub server: bool,
    /// Prints one JSON list instead of lines.
    #[arg(long)]
    pub json: bool,
}

/// Runs all checks and prints the findings. Exit code 1 when a check fails.
///
/// # Errors
/// When the result cannot be written.
pub fn run(connect: &Connect, args: &DoctorArgs) -> anyhow::Result<ExitCode> {
    let mut worst = Level::Ok;
    let mut all = Vec::new();
    let mut report = |finding: Finding| {
        worst = worst.max(finding.level);
        if !args.json {
            println!("{finding}");
        }
        all.push(finding);
    };
    this_host::inspect(&args.out, &mut report);
    server::inspect(connect, args.server, &mut report);
    if args.json {
        println!("{}", serde_json::to_string_pretty(&all)?);
    }
    Ok(if worst == Level::Fail {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}
