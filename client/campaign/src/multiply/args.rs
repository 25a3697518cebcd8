//! Options of `wheelarm multiply`.

use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use wheelarm_proto::settings::Starts;

use crate::disturb::Disturb;
use wheelarm_options::choice::{named, patience, seed_range};
use wheelarm_options::packs::PackArgs;

/// First seed without `--seeds`: a seed for training (`wheelarm_proto::seeds`).
const FIRST_SEED: u64 = 500_000;
/// Distance of the first seeds of runs with different `--seed`.
const STRIDE: u64 = 10_000;
/// Number of runs with distinct scenes.
const RUNS: u64 = 50;

/// Options of `wheelarm multiply`.
#[derive(Args, Clone, Debug)]
pub struct MultiplyArgs {
    /// Folder with the recorded episodes, or the dataset that contains them.
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,
    /// Task.
    #[arg(long)]
    pub task: String,
    /// Episodes to make.
    #[arg(long, value_name = "N")]
    pub episodes: NonZeroU64,
    /// Seeds of the scenes, `FIRST..LAST` without the last; four training seeds per episode
    /// when absent.
    #[arg(long, value_parser = seed_range, value_name = "A..B")]
    pub seeds: Option<(u64, u64)>,
    /// Folder for the episodes; an interrupted run in it is resumed.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Workers that run at the same time.
    #[arg(long, default_value = "1", value_name = "N")]
    pub jobs: NonZeroUsize,
    /// Seed of the choice among the sources and of the noise; without --seeds also of the
    /// scenes.
    #[arg(long, default_value = "0", value_name = "S")]
    pub seed: u64,
    /// Deviation of the hand from the demonstrated path, metres along each axis (and ten times
    /// as many radians about it): standard deviation of smooth noise.
    #[arg(long, default_value = "0.002", value_name = "METRES", value_parser = noise)]
    pub noise: f64,
    /// Disturbances: strength of noise on applied commands, pushes and slips, 1 to 3, or each
    /// of them and the share of episodes, as noise=2,pushes=1,slips=1,share=0.8.
    #[arg(long, value_name = "STRENGTH|KEY=N,…", value_parser = disturb)]
    pub disturb: Option<Disturb>,
    /// Most sources to use; all when absent.
    #[arg(long, value_name = "N")]
    pub sources: Option<NonZeroUsize>,
    /// Start of the robot: `near` the target, or `anywhere` in the home with the arm in a
    /// sampled posture.
    #[arg(long, default_value = "near", value_parser = named::<Starts>())]
    pub starts: Starts,
    /// Wall seconds without a reply after which a worker is ended, at least 1.
    #[arg(long, default_value = "60", value_parser = patience::<1>, value_name = "SECONDS")]
    pub patience: Duration,
    /// Assets folder; found by the server when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
    /// World packs.
    #[command(flatten)]
    pub packs: PackArgs,
}

impl MultiplyArgs {
    /// First seed without `--seeds`.
    pub(super) fn first_seed(&self) -> u64 {
        FIRST_SEED + STRIDE * (self.seed % RUNS)
    }
}

/// Disturbances. Deliberate errors of the operator do not apply to demonstrations.
fn disturb(text: &str) -> Result<Disturb, String> {
    let disturb = Disturb::from_text(text)?;
    match disturb.error_share > 0.0 {
        true => Err("error_share does not apply to demonstrations; remove it".to_owned()),
        false => Ok(disturb),
    }
}

/// A deviation, metres.
fn noise(text: &str) -> Result<f64, String> {
    let noise = text.parse().ok().filter(|n| (0.0..=0.05).contains(n));
    noise.ok_or_else(|| format!("{text:?} is not a deviation in metres, 0 to 0.05"))
}
