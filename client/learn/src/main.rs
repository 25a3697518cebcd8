//! The program `wheelarm-learn`; `wheelarm learn …` runs it.
//!
//! Exit codes: 0 ok, 1 failed, 2 wrong usage.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use wheelarm_learn::serve::{ENDPOINT_VARIABLE, NAME_VARIABLE, serve};
use wheelarm_learn::trained::Trained;
use wheelarm_link::Connect;

/// Serves, trains and measures networks on the CPU.
#[derive(Parser)]
#[command(name = "wheelarm-learn", version = wheelarm_proto::program::version(), about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Serves a policy: answers whoever asks for it over Zenoh, until it is ended.
    Serve {
        /// The policy, a safetensors file with its card.
        file: PathBuf,
        /// Endpoint of whoever asks.
        #[arg(long, env = ENDPOINT_VARIABLE)]
        connect: String,
        /// Its name in the keys.
        #[arg(long, env = NAME_VARIABLE, default_value = "policy")]
        name: String,
    },
    /// Prints a policy's card.
    Card {
        /// The policy.
        file: PathBuf,
    },
}

fn main() -> ExitCode {
    wheelarm_proto::output::end_with_output();
    tracing_subscriber::fmt()
        .with_env_filter(tracing_subscriber::EnvFilter::from_default_env())
        .with_writer(std::io::stderr)
        .init();
    match run(Cli::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{}", wheelarm_proto::program::told(problem.as_ref()));
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Serve {
            file,
            connect,
            name,
        } => {
            let mut policy = Trained::read(&file)?;
            let connect = Connect::to(&connect, "");
            serve(&mut policy, &name, &connect, || {
                println!("ready {name} {}", file.display());
            })
        }
        Command::Card { file } => {
            let policy = Trained::read(&file)?;
            println!("{}", serde_json::to_string_pretty(policy.card())?);
            Ok(())
        }
    }
}
