//! `wheelarm doctor`: looks at everything that WheelArm needs here and at the
//! server, and names the cure of what is wrong. It changes nothing.

mod server;
mod this_host;

use std::fmt;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;

use wheelarm_link::Connect;

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

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// As it should be.
    Ok,
    /// It works, but not well, or not for everything.
    Warn,
    /// It does not work.
    Fail,
}

/// What one look found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub level: Level,
    /// What was looked at.
    pub what: &'static str,
    /// What was found.
    pub found: String,
    /// What to do; empty when nothing is wrong.
    pub cure: String,
}

impl Finding {
    fn ok(what: &'static str, found: impl Into<String>) -> Self {
        Self {
            level: Level::Ok,
            what,
            found: found.into(),
            cure: String::new(),
        }
    }

    fn warn(what: &'static str, found: impl Into<String>, cure: impl Into<String>) -> Self {
        Self {
            level: Level::Warn,
            what,
            found: found.into(),
            cure: cure.into(),
        }
    }

    fn fail(what: &'static str, found: impl Into<String>, cure: impl Into<String>) -> Self {
        Self {
            level: Level::Fail,
            ..Self::warn(what, found, cure)
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = match self.level {
            Level::Ok => "ok  ",
            Level::Warn => "warn",
            Level::Fail => "FAIL",
        };
        write!(f, "{word}  {:<18} {}", self.what, self.found)?;
        if !self.cure.is_empty() {
            write!(f, "\n      {:<18} → {}", "", self.cure)?;
        }
        Ok(())
    }
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
    this_host::look(&args.out, &mut tell);
    server::look(connect, args.server, &mut tell);
    if args.json {
        println!("{}", serde_json::to_string_pretty(&all)?);
    }
    Ok(if worst == Level::Fail {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}
