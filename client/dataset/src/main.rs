//! The `wheelarm-dataset` program; `wheelarm dataset …` runs it.
//!
//! Exit codes: 0 ok and complete, 1 failed or unreadable, 2 wrong usage,
//! 3 readable but partial or with problems, 128 and the number of the signal that ended it.

mod commands;

use std::process::ExitCode;

fn main() -> ExitCode {
    wheelarm_proto::output::end_with_output();
    wheelarm_proto::signals::end_as_first_process();
    match commands::main(commands::Cli::read()) {
        Ok(code) => ExitCode::from(code),
        Err(problem) => {
            eprintln!("{}", wheelarm_proto::program::error_chain(problem.as_ref()));
            ExitCode::FAILURE
        }
    }
}
