//! The small commands: one query each, its answer printed.

mod external;
mod lease;
pub mod manual;
mod port;
mod print;
mod tasks;

use clap::{Args, Subcommand};
use wheelarm_proto::v1;

use wheelarm_link::{Connect, Link, LinkError};

pub use external::run_external;
pub use lease::{LeaseCommand, LeaseHoldArgs, lease};
pub use print::{episode_line, evaluation_lines};
pub use tasks::{tasks, tasks_of_program};

/// Options of `wheelarm reset`.
#[derive(Args, Clone, Debug, Default)]
pub struct ResetArgs {
    /// Scene; the one in force when absent.
    #[arg(long)]
    pub scene: Option<String>,
    /// Task; the one in force when absent.
    #[arg(long)]
    pub task: Option<String>,
    /// Seed of every random choice.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Instruction sentence; drawn from the task's by seed when absent.
    #[arg(long)]
    pub instruction: Option<String>,
    /// Also while somebody else is in control.
    #[arg(long)]
    pub force: bool,
}

/// `wheelarm episode …`.
#[derive(Subcommand, Clone, Debug)]
pub enum EpisodeCommand {
    /// Starts an episode; connected recorders open a file.
    Start(EpisodeStartArgs),
    /// Ends the running episode; recorders finish their files.
    Stop(EpisodeStopArgs),
}

/// Options of `wheelarm episode start`.
#[derive(Args, Clone, Debug)]
pub struct EpisodeStartArgs {
    /// Label: letters, digits, `-`, `_`, `.`; names the file.
    #[arg(long)]
    pub label: String,
    /// Instruction sentence, stored exactly; the scenario's when absent.
    #[arg(long, default_value = "")]
    pub instruction: String,
    /// Recorders that must be ready before time goes on.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub require_recorders: u32,
    /// In lock-step: the commander that the simulation waits for; it must hold
    /// control. Whoever does when absent.
    #[arg(long, default_value = "")]
    pub commander: String,
}

/// Options of `wheelarm episode stop`.
#[derive(Args, Clone, Copy, Debug)]
pub struct EpisodeStopArgs {
    /// Recorders throw the episode away.
    #[arg(long)]
    pub discard: bool,
    /// Discards also while somebody else is in control.
    #[arg(long, requires = "discard")]
    pub force: bool,
}

/// Options of `wheelarm shutdown`.
#[derive(Args, Clone, Copy, Debug)]
pub struct ShutdownArgs {
    /// Also while somebody else is in control.
    #[arg(long)]
    pub force: bool,
}

/// Prints what the server does. Where nothing listens on this host it says so at
/// once.
///
/// # Errors
/// [`LinkError`].
pub fn status(connect: &Connect) -> Result<(), LinkError> {
    port::refuse_closed(&connect.endpoint)?;
    let link = Link::open(connect)?;
    let status: v1::Status = link.ask(&v1::StatusRequest {})?;
    print!("{}", print::status_text(link.keys().sim(), &status));
    Ok(())
}

/// Sets up the scenario that `args` name.
///
/// # Errors
/// [`LinkError`].
pub fn reset(link: &Link, args: &ResetArgs) -> Result<v1::Scenario, LinkError> {
    let scenario = v1::Scenario {
        scene: args.scene.clone().unwrap_or_default(),
        task: args.task.clone(),
        seed: args.seed,
        instruction: args.instruction.clone(),
        ..v1::Scenario::default()
    };
    link.reset(scenario, args.force)
}

/// Lets time stand still, or go on.
///
/// # Errors
/// [`LinkError`].
pub fn pause(link: &Link, pause: bool) -> Result<(), LinkError> {
    let done = match pause {
        true => link.ask(&v1::PauseRequest {}),
        false => link.ask(&v1::ResumeRequest {}),
    };
    done.map(|_| ())
}

/// Runs `wheelarm episode …` and prints the result.
///
/// # Errors
/// [`LinkError`].
pub fn episode(link: &Link, command: &EpisodeCommand) -> Result<(), LinkError> {
    match command {
        EpisodeCommand::Start(args) => {
            let instruction = &args.instruction;
            let started = link.ask(&v1::EpisodeStartRequest {
                label: args.label.clone(),
                instruction: (!instruction.is_empty()).then(|| instruction.clone()),
                require_recorders: args.require_recorders,
                commander: args.commander.clone(),
                ..Default::default()
            })?;
            println!("started {}", episode_line(&started));
        }
        EpisodeCommand::Stop(args) => {
            let stopped = link.ask(&v1::EpisodeStopRequest {
                discard: args.discard,
                force: args.force,
                secret: link.secret(),
            })?;
            print!("{}", print::stopped_text(&stopped));
        }
    }
    Ok(())
}
