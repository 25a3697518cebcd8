//! `wheelarm operate`: the scripted operator with options and words.

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
    /// Task; the one in force when absent, else the scenario is reset to it.
    #[arg(long)]
    pub task: Option<String>,
    /// Label of the episode; task and seed when absent.
    #[arg(long)]
    pub label: Option<String>,
    /// Instruction sentence; the scenario's when absent.
    #[arg(long, default_value = "")]
    pub instruction: String,
    /// Recorders that must be ready before time goes on.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub require_recorders: u32,
    /// Name under which the operator commands.
    #[arg(long, default_value = "operator", value_parser = choice::name)]
    pub commander: String,
    /// Takes control over from whoever holds it.
    #[arg(long)]
    pub take: bool,
    /// Seed of the operator profile; the scenario's when absent.
    #[arg(long)]
    pub profile_seed: Option<u64>,
    /// Makes an error on purpose and corrects it: `wrong-grasp`, `wrong-object` or
    /// `drop`.
    #[arg(long, value_name = "ERROR", value_parser = choice::named::<ForcedError>())]
    pub error: Option<ForcedError>,
    /// Goes on from wherever chair and hand are, instead of bringing the arm home first.
    #[arg(long)]
    pub on_the_spot: bool,
    /// Writes how it went as JSON: `outcome` (`done`, `not_done` or `broken`) and `why`.
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

/// What `--report` holds.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Told {
    /// How it went.
    pub outcome: ToldOutcome,
    /// Why it was not done, for people.
    pub why: String,
}

/// How an operator's work went, for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToldOutcome {
    /// The task was done.
    Done,
    /// It was tried and not done.
    NotDone,
    /// The simulation broke.
    Broken,
}

impl From<&Report> for Told {
    fn from(report: &Report) -> Self {
        let (outcome, why) = match &report.outcome {
            _ if report.succeeded() => (ToldOutcome::Done, ""),
            Outcome::Success => (ToldOutcome::NotDone, ""),
            Outcome::Failure(why) => (ToldOutcome::NotDone, why.as_str()),
            Outcome::Broken(why) => (ToldOutcome::Broken, why.as_str()),
        };
        let why = why.to_owned();
        Self { outcome, why }
    }
}

/// Writes a line. Who listens no longer ends no work: the episode would run on
/// without its operator.
fn say(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Does the task and prints how it goes.
///
/// # Errors
/// When the operator cannot work, or the report cannot be written.
pub fn run(link: &Client, args: &OperateArgs) -> anyhow::Result<ExitCode> {
    let mut phase = String::new();
    let report = operate::run(link, &args.into(), &mut |progress| {
        if progress.phase != phase {
            progress.phase.clone_into(&mut phase);
            say(format_args!("{:7.2} s  {phase}", progress.time));
        }
        for note in progress.notes {
            say(format_args!("{:7.2} s  {note}", progress.time));
        }
    })?;
    let told = Told::from(&report);
    if let Outcome::Failure(why) | Outcome::Broken(why) = &report.outcome {
        println!("gave up: {why}");
    }
    print!("{}", evaluation_lines(&report.evaluation));
    if let Some(file) = &args.report {
        std::fs::write(file, serde_json::to_string(&told)?)
            .with_context(|| format!("the report cannot be written to {}", file.display()))?;
    }
    Ok(match told.outcome {
        ToldOutcome::Done => ExitCode::SUCCESS,
        ToldOutcome::NotDone | ToldOutcome::Broken => ExitCode::from(EXIT_NOT_DONE),
    })
}
