//! Command-line options that select and configure a policy.

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

/// Options that select a policy and define how its action chunks are executed.
#[derive(Args, Clone, Debug)]
pub struct PolicyArgs {
    /// Driver of the tasks: `operator`, the scripted operator; `hold` and `repeat`, trivial
    /// baselines; `replay:DIR`, the recording in DIR with the most similar first images;
    /// `act:FILE`, a network for `wheelarm-learn serve`; `exec:COMMAND`, a program that
    /// implements the policy protocol; `zenoh:NAME`, a policy at --policy-connect;
    /// `openpi:ws://HOST:PORT`, a policy with the protocol of openpi or RoboArena, whose
    /// names --policy-map defines; `lerobot:DIR`, a LeRobot checkpoint, run by the Python
    /// of WHEELARM_PYTHON (or python3), which needs lerobot and wheelarm.
    #[arg(long, default_value = "operator", value_name = "POLICY", value_parser = Choice::read)]
    pub policy: Choice,
    /// Endpoint of the policy of `zenoh:NAME`.
    #[arg(long, default_value = wheelarm_sdk::DEFAULT_ENDPOINT, value_name = "ENDPOINT")]
    pub policy_connect: String,
    /// Names of images, state values and action columns of an `openpi:` policy.
    #[arg(
        long,
        default_value = "assets/policies/openpi.toml",
        value_name = "FILE"
    )]
    pub policy_map: PathBuf,
    /// Executed rows of an action chunk; the policy's own number when absent.
    #[arg(long, value_name = "ROWS", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub execute: Option<u32>,
    /// Ticks (1/240 s) between a request and the use of its action chunk, in whole rows. With
    /// 0, time waits during inference.
    #[arg(long, default_value = "0", value_name = "TICKS", value_parser = clap::value_parser!(u32).range(..=2400))]
    pub latency: u32,
    /// Temporal ensemble: requests a chunk at every row and averages all chunks for it, with
    /// weights exp(-K·i), where i = 0 is the oldest.
    #[arg(long, value_name = "K", value_parser = weight, conflicts_with_all = ["execute", "latency"])]
    pub ensemble: Option<f64>,
    /// Allows seeds that the policy was trained on.
    #[arg(long)]
    pub training_seeds: bool,
    /// Longest wall time of an inference, seconds. The start may take 180 s, or this if larger.
    #[arg(long, default_value = "30", value_parser = patience::<1>, value_name = "SECONDS")]
    pub policy_patience: Duration,
}

/// A weight, 0 or more.
fn weight(text: &str) -> Result<f64, String> {
    let weight = text.parse().ok().filter(|k| (0.0..=100.0).contains(k));
    weight.ok_or_else(|| format!("{text:?} is not a weight from 0 to 100"))
}
