//! `wheelarm doctor`: looks at everything that WheelArm needs here and at the
//! server, and names the cure of what is wrong. It changes nothing.

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
    /// Folder that recordings will go to.
    #[arg(long, default_value = "data", value_name = "DIR")]
    pub out: PathBuf,
    /// A server must answer: without one the result is a failure.
    #[arg(long)]
    pub server: bool,
    /// One JSON list instead of lines.
    #[arg(long)]
    pub json: bool,
}

/// Looks at everything and prints it. Exit code 1 when something does not work.
///
/// # Errors
/// When the result cannot be written.
pub fn run(connect: &Connect, args: &DoctorArgs) -> anyhow::Result<ExitCode> {
    let mut worst = Level::Ok;
    let mut all = Vec::new();
    let mut tell = |finding: Finding| {
        worst = worst.max(finding.level);
        if !args.json {
            println!("{finding}");
        }
        all.push(finding);
    };
    this_host::appearance(&args.out, &mut tell);
    server::appearance(connect, args.server, &mut tell);
    if args.json {
        println!("{}", serde_json::to_string_pretty(&all)?);
    }
    Ok(if worst == Level::Fail {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}
