//! The small commands: one query each, its answer printed.

mod episode;
mod external;
mod lease;
pub mod manual;
mod port;
mod print;
mod tasks;

use clap::Args;
use wheelarm_proto::settings::Starts;
use wheelarm_proto::v1;

use wheelarm_sdk::{Client, ClientError, Connect};

use wheelarm_options::choice::named;

pub use episode::{EpisodeCommand, EpisodeStartArgs, EpisodeStopArgs, episode};
pub use external::run_external;
pub use lease::{LeaseCommand, LeaseHoldArgs, lease};
pub use port::refuse_closed;
pub use print::{episode_line, evaluation_lines};
pub use tasks::tasks;

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
    /// Where the robot starts: `near` by, or `anywhere` in the home with the arm in
    /// any of its postures; as before when absent.
    #[arg(long, value_parser = named::<Starts>())]
    pub starts: Option<Starts>,
    /// Instruction sentence; drawn from the task's by seed when absent.
    #[arg(long)]
    pub instruction: Option<String>,
    /// Also while somebody else is in control.
    #[arg(long)]
    pub force: bool,
}

/// Options of `wheelarm shutdown`.
#[derive(Args, Clone, Copy, Debug)]
pub struct ShutdownArgs {
    /// Also while somebody else is in control.
    #[arg(long)]
    pub force: bool,
}

/// Connects; where nothing listens on this host it says so at once.
///
/// # Errors
/// [`ClientError`].
pub fn link(connect: &Connect) -> Result<Client, ClientError> {
    refuse_closed(&connect.endpoint)?;
    Client::open(connect)
}

/// Prints what the server does. Where nothing listens on this host it says so at
/// once.
///
/// # Errors
/// [`ClientError`].
pub fn status(connect: &Connect) -> Result<(), ClientError> {
    let link = link(connect)?;
    let status: v1::Status = link.request(&v1::StatusRequest {})?;
    print!("{}", print::status_text(link.keys().sim(), &status));
    Ok(())
}

/// Sets up the scenario that `args` name.
///
/// # Errors
/// [`ClientError`].
pub fn reset(link: &Client, args: &ResetArgs) -> Result<v1::Scenario, ClientError> {
    let scenario = v1::Scenario {
        scene: args.scene.clone().unwrap_or_default(),
        task: args.task.clone(),
        seed: args.seed,
        instruction: args.instruction.clone(),
        starts: args.starts.map_or(0, |starts| starts.code().into()),
        ..v1::Scenario::default()
    };
    link.reset(scenario, args.force)
}

/// Pauses simulation time, or lets it go on.
///
/// # Errors
/// [`ClientError`].
pub fn pause(link: &Client, pause: bool) -> Result<(), ClientError> {
    let done = match pause {
        true => link.request(&v1::PauseRequest {}),
        false => link.request(&v1::ResumeRequest {}),
    };
    done.map(|_| ())
}
