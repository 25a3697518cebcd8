//! Commands that send one query and print its reply.

mod episode;
mod external;
mod lease;
pub mod manual;
mod port;
mod print;
mod tasks;

use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use clap::Args;
use wheelarm_proto::settings::Starts;
use wheelarm_proto::v1;

use wheelarm_sdk::{Client, ClientError, Connect};

use wheelarm_options::choice::named;

pub use episode::{EpisodeCommand, EpisodeStartArgs, EpisodeStopArgs, episode};
pub use external::{SERVER, run_external};
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
    /// Start of the robot: `near` the target, or `anywhere` in the home with the arm in a
    /// sampled posture; unchanged when absent.
    #[arg(long, value_parser = named::<Starts>())]
    pub starts: Option<Starts>,
    /// Instruction; sampled from the task's by seed when absent.
    #[arg(long)]
    pub instruction: Option<String>,
    /// Also while another client is in control, which keeps control.
    #[arg(long, alias = "take")]
    pub force: bool,
}

/// Options of `wheelarm shutdown`.
#[derive(Args, Clone, Copy, Debug)]
pub struct ShutdownArgs {
    /// Also while another client is in control, which keeps control.
    #[arg(long, alias = "take")]
    pub force: bool,
}

/// Time after which a wait is announced, so that a quick reply prints nothing.
const SILENCE: Duration = Duration::from_secs(1);

/// Runs `work`; after a second prints on standard error for what it waits.
pub fn announced<T>(what: &str, work: impl FnOnce() -> T) -> T {
    std::thread::scope(|scope| {
        let (done, end) = mpsc::channel::<()>();
        scope.spawn(move || {
            if end.recv_timeout(SILENCE) == Err(RecvTimeoutError::Timeout) {
                eprintln!("waiting for {what}");
            }
        });
        let result = work();
        drop(done);
        result
    })
}

/// Connects. A closed port of this host fails at once; a longer wait names the server.
///
/// # Errors
/// [`ClientError`].
pub fn open(connect: &Connect) -> Result<Client, ClientError> {
    refuse_closed(&connect.endpoint)?;
    let what = format!(
        "the server {:?} at {}, at most {} s",
        connect.sim, connect.endpoint, connect.timeout_secs
    );
    announced(&what, || Client::open(connect))
}

/// Prints the status of the server. A closed port of this host fails at once.
///
/// # Errors
/// [`ClientError`].
pub fn status(connect: &Connect) -> Result<(), ClientError> {
    let client = open(connect)?;
    let status: v1::Status = client.request(&v1::StatusRequest {})?;
    print!("{}", print::status_text(client.keys().sim(), &status));
    Ok(())
}

/// Sets up the scenario that `args` name.
///
/// # Errors
/// [`ClientError`].
pub fn reset(client: &Client, args: &ResetArgs) -> Result<v1::Scenario, ClientError> {
    let scenario = v1::Scenario {
        scene: args.scene.clone().unwrap_or_default(),
        task: args.task.clone(),
        seed: args.seed,
        instruction: args.instruction.clone(),
        starts: args.starts.map_or(0, |starts| starts.code().into()),
        ..v1::Scenario::default()
    };
    client.reset(scenario, args.force)
}

/// Pauses or resumes simulation time.
///
/// # Errors
/// [`ClientError`].
pub fn pause(client: &Client, pause: bool) -> Result<(), ClientError> {
    let done = match pause {
        true => client.request(&v1::PauseRequest {}),
        false => client.request(&v1::ResumeRequest {}),
    };
    done.map(|_| ())
}
