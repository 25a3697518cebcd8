//! Which policy does the tasks, as a command line says it: `--policy` and what goes
//! with it.

mod choice;
mod driver;
pub mod files;
mod nearest;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use wheelarm_options::choice::patience;

pub use choice::Choice;
pub use driver::{DriverChoice, Start};

/// Options that name a policy and say how its answers are carried out.
#[derive(Args, Clone, Debug)]
pub struct PolicyArgs {
    /// Who does the tasks: `operator`, the scripted one; `hold` and `repeat`, which know
    /// nothing; `replay:DIR`, the recording in DIR whose first pictures are nearest;
    /// `act:FILE`, a network for `wheelarm-learn serve`; `exec:COMMAND`, a program that
    /// answers as a policy; `zenoh:NAME`, one that runs behind --policy-connect;
    /// `openpi:ws://HOST:PORT`, one that speaks openpi's protocol or RoboArena's, named
    /// by --policy-map; `lerobot:DIR`, a checkpoint of LeRobot, in the Python of
    /// WHEELARM_PYTHON (or python3), which has lerobot and wheelarm.
    #[arg(long, default_value = "operator", value_name = "POLICY", value_parser = Choice::read)]
    pub policy: Choice,
    /// Endpoint behind which the policy of `zenoh:NAME` is found.
    #[arg(long, default_value = wheelarm_sdk::DEFAULT_ENDPOINT, value_name = "ENDPOINT")]
    pub policy_connect: String,
    /// What is named how to a policy of `openpi:`: pictures, numbers, columns of an
    /// answer.
    #[arg(
        long,
        default_value = "assets/policies/openpi.toml",
        value_name = "FILE"
    )]
    pub policy_map: PathBuf,
    /// Rows of an answer that are carried out; the policy's own number without it.
    #[arg(long, value_name = "ROWS", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub execute: Option<u32>,
    /// Ticks (1/240 s) between a question and the use of its answer; in whole rows. With
    /// 0 time waits while the policy thinks.
    #[arg(long, default_value = "0", value_name = "TICKS", value_parser = clap::value_parser!(u32).range(..=2400))]
    pub latency: u32,
    /// Asks at every row and takes the mean of all answers about it, the one of i rows
    /// ago weighted by exp(-K·age), the oldest counting most.
    #[arg(long, value_name = "K", value_parser = weight, conflicts_with_all = ["execute", "latency"])]
    pub ensemble: Option<f64>,
    /// Lets it do seeds that it was trained on all the same.
    #[arg(long)]
    pub training_seeds: bool,
    /// Wall seconds that the policy has for an answer; to start it has 180, or so many
    /// where these are more.
    #[arg(long, default_value = "30", value_parser = patience::<1>, value_name = "SECONDS")]
    pub policy_patience: Duration,
}

/// A weight, 0 or more.
fn weight(text: &str) -> Result<f64, String> {
    let weight = text.parse().ok().filter(|k| (0.0..=100.0).contains(k));
    weight.ok_or_else(|| format!("{text:?} is no weight, 0 to 100"))
}
