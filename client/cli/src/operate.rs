//! `wheelarm operate`: options and output of the scripted operator.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use wheelarm_expert::forced::ForcedError;
use wheelarm_expert::operator::Outcome;
use wheelarm_expert::run::{self as operate, OperateOptions, Report};
use wheelarm_proto::program::EXIT_NOT_DONE;
use wheelarm_sdk::Client;

use crate::control::evaluation_lines;
use wheelarm_options::choice;

/// Options of `wheelarm operate`.
#[derive(Args, Clone, Debug)]
pub struct OperateArgs {
    /// Task, to which the scenario is reset; the current one when absent.
    #[arg(long)]
    pub task: Option<String>,
    /// Label of the episode; task and seed when absent.
    #[arg(long)]
    pub label: Option<String>,
    /// Instruction; the scenario's when absent.
    #[arg(long, default_value = "")]
    pub instruction: String,
    /// Recorders that must be ready before time runs.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub require_recorders: u32,
    /// Commander name of the operator.
    #[arg(long, default_value = "operator", value_parser = choice::name, value_name = "NAME")]
    pub commander: String,
    /// Takes control over from the commander that holds it.
    #[arg(long, alias = "force")]
    pub take: bool,
    /// Seed of the operator profile; the scenario's when absent.
    #[arg(long)]
    pub profile_seed: Option<u64>,
    /// Makes a deliberate error and corrects it: `wrong-grasp`, `wrong-object` or
    /// `drop`.
    #[arg(long, value_name = "ERROR", value_parser = choice::named::<ForcedError>())]
    pub error: Option<ForcedError>,
    /// Starts from the current pose of chair and hand, instead of moving the arm home first.
    #[arg(long)]
    pub on_the_spot: bool,
    /// Writes the result as JSON: `outcome` (`done`, `not_done` or `broken`) and `why`.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

impl From<&OperateArgs> for OperateOptions {
    fn from(args: &OperateArgs) -> Self {
        Self {
            task: args.task.clone(),
            label: args.label.clone(),
            instruction: args.instruction.clone(),
            require_recorders: args.require_recorders,
            commander: args.commander.clone(),
            take: args.take,
            profile_seed: args.profile_seed,
            forced: args.error,
            on_the_spot: args.on_the_spot,
            ..Self::default()
        }
    }
}

/// Content of the file of `--report`.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct OperateReport {
    /// Outcome.
    pub outcome: ReportedOutcome,
    /// Reason of a failure; empty after success.
    pub why: String,
}

/// Outcome of the operator's work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReportedOutcome {
    /// The task was done.
    Done,
    /// The task failed.
    NotDone,
    /// The simulation failed.
    Broken,
}

impl From<&Report> for OperateReport {
    fn from(report: &Report) -> Self {
        let (outcome, why) = match &report.outcome {
            _ if report.succeeded() => (ReportedOutcome::Done, ""),
            Outcome::Success => (ReportedOutcome::NotDone, ""),
            Outcome::Failure(why) => (ReportedOutcome::NotDone, why.as_str()),
            Outcome::Broken(why) => (ReportedOutcome::Broken, why.as_str()),
        };
        let why = why.to_owned();
        Self { outcome, why }
    }
}

/// Writes a line. A closed pipe is ignored: otherwise the episode would continue without
/// its operator.
fn print_line(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Runs the task and prints its progress.
///
/// # Errors
/// When the operator cannot start, or the report cannot be written.
pub fn run(client: &Client, args: &OperateArgs) -> anyhow::Result<ExitCode> {
    let mut phase = String::new();
    let report = operate::run(client, &args.into(), &mut |progress| {
        if progress.phase != phase {
            progress.phase.clone_into(&mut phase);
            print_line(format_args!("{:7.2} s  {phase}", progress.time));
        }
        for note in progress.notes {
            print_line(format_args!("{:7.2} s  {note}", progress.time));
        }
    })?;
    let written = OperateReport::from(&report);
    if let Outcome::Failure(why) | Outcome::Broken(why) = &report.outcome {
        println!("gave up: {why}");
    }
    print!("{}", evaluation_lines(&report.evaluation));
    if let Some(file) = &args.report {
        std::fs::write(file, serde_json::to_string(&written)?)
            .with_context(|| format!("cannot write the report {}", file.display()))?;
    }
    Ok(match written.outcome {
        ReportedOutcome::Done => ExitCode::SUCCESS,
        ReportedOutcome::NotDone | ReportedOutcome::Broken => ExitCode::from(EXIT_NOT_DONE),
    })
}
