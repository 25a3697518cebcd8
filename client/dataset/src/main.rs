//! The `wheelarm-dataset` program; `wheelarm dataset …` runs it.
//!
//! Exit codes: 0 ok and complete, 1 failed or unreadable, 2 wrong usage,
//! 3 readable but partial.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use wheelarm_dataset::finish::finish;
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::{info, sheet};

/// Looks at recorded episodes and rescues interrupted ones.
#[derive(Parser)]
#[command(name = "wheelarm-dataset", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Prints what an episode file holds.
    Info {
        /// The episode file.
        file: PathBuf,
    },
    /// Turns the log of an interrupted recording into an episode file.
    Recover {
        /// The log, LABEL.h5.wal.
        log: PathBuf,
        /// Folder for the file; beside the log without it.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Draws a contact sheet: both cameras over time, and plots.
    Sheet {
        /// The episode file.
        file: PathBuf,
        /// The picture; FILE with the ending .png without it.
        #[arg(long, value_name = "PNG")]
        out: Option<PathBuf>,
    },
}

const PARTIAL: u8 = 3;

fn main() -> ExitCode {
    match run(Cli::parse().command) {
        Ok(code) => ExitCode::from(code),
        Err(problem) => {
            eprintln!("{problem:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<u8> {
    match command {
        Command::Info { file } => {
            let episode = Episode::open(&file)?;
            print!("{}", info::info(&episode)?);
            Ok(code(episode.summary()?.complete))
        }
        Command::Recover { log, out } => recover(&log, out.as_deref()),
        Command::Sheet { file, out } => {
            let out = out.unwrap_or_else(|| file.with_extension("png"));
            sheet::sheet(&Episode::open(&file)?, &out)?;
            println!("{}", out.display());
            Ok(0)
        }
    }
}

fn recover(log: &Path, out: Option<&Path>) -> anyhow::Result<u8> {
    let finished = finish(log, out)?;
    let account = &finished.account;
    println!(
        "{}: {} samples of {} streams",
        finished.path.display(),
        account.total(|s| s.received),
        account.streams.len()
    );
    for problem in &account.problems {
        println!("  {problem}");
    }
    Ok(code(account.complete()))
}

fn code(complete: bool) -> u8 {
    if complete { 0 } else { PARTIAL }
}
