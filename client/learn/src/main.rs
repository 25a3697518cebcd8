//! The program `wheelarm-learn`; `wheelarm learn …` runs it.
//!
//! Exit codes: 0 ok, 1 failed, 2 wrong usage, 4 steps are left: the same command continues.

mod commands;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    wheelarm_proto::output::end_with_output();
    wheelarm_proto::signals::end_as_first_process();
    wheelarm_proto::log::start("error", false, std::io::stderr);
    match commands::run(commands::Cli::parse()) {
        Ok(code) => ExitCode::from(code),
        Err(problem) => {
            eprintln!("{}", wheelarm_proto::program::error_chain(problem.as_ref()));
            ExitCode::FAILURE
        }
    }
}
