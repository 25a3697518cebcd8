//! Options of `wheelarm multiply`.

use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use wheelarm_proto::settings::Starts;

use crate::disturb::Disturb;
use wheelarm_options::choice::{named, patience, seed_range};

/// First of the seeds that are tried where nothing says them: one of those to train on
/// (`wheelarm_proto::seeds`).
const FIRST_SEED: u64 = 500_000;
/// Runs with other seeds of their own try other scenes, as long as they try no more.
const STRIDE: u64 = 10_000;
/// Runs that have scenes of their own.
const RUNS: u64 = 50;

/// Options of `wheelarm multiply`.
#[derive(Args, Clone, Debug)]
pub struct MultiplyArgs {
    /// Folder with the recorded episodes, or the dataset that holds them.
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,
    /// Task.
    #[arg(long)]
    pub task: String,
    /// Episodes to make.
    #[arg(long, value_name = "N")]
    pub episodes: NonZeroU64,
    /// Seeds of the scenes that are tried, `FIRST..LAST` without the last; without it
    /// four for each episode, of those that are for training.
    #[arg(long, value_parser = seed_range, value_name = "A..B")]
    pub seeds: Option<(u64, u64)>,
    /// Folder for the episodes; an interrupted run in it is resumed.
    #[arg(long)]
    pub out: PathBuf,
    /// Workers at one time.
    #[arg(long, default_value = "1", value_name = "J")]
    pub jobs: NonZeroUsize,
    /// Seed of the choice among the sources and of the noise, and where nothing says
    /// them of the scenes.
    #[arg(long, default_value = "0", value_name = "S")]
    pub seed: u64,
    /// How much the hand is off the way that was shown, metres along each axis (and ten
    /// times as many radians about it): the deviation of smooth noise.
    #[arg(long, default_value = "0.002", value_name = "METRES", value_parser = noise)]
    pub noise: f64,
    /// Hinders the robot: strength of noise on what is applied, pushes and slips, 1 to 3,
    /// or each of them and the share of episodes, as noise=2,pushes=1,slips=1,share=0.8.
    #[arg(long, value_name = "STRENGTH|KEY=N,…", value_parser = disturb)]
    pub disturb: Option<Disturb>,
    /// Most sources that are used; all without it.
    #[arg(long, value_name = "N")]
    pub sources: Option<NonZeroUsize>,
    /// Where the robot starts: `near` by, or `anywhere` in the home with the arm in
    /// any of its postures.
    #[arg(long, default_value = "near", value_parser = named::<Starts>())]
    pub starts: Starts,
    /// Wall seconds without a sign of life after which a worker is ended, 1 at least.
    #[arg(long, default_value = "60", value_parser = patience::<1>, value_name = "SECONDS")]
    pub patience: Duration,
    /// Assets folder; the server looks for it when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
}

impl MultiplyArgs {
    /// First seed where nothing says the seeds.
    pub(super) fn first_seed(&self) -> u64 {
        FIRST_SEED + STRIDE * (self.seed % RUNS)
    }
}

/// What hinders the robot; the operator's errors on purpose are none of a demonstration.
fn disturb(text: &str) -> Result<Disturb, String> {
    let disturb = Disturb::from_text(text)?;
    match disturb.error_share > 0.0 {
        true => Err("a demonstration errs where it did; leave error_share out".to_owned()),
        false => Ok(disturb),
    }
}

/// A deviation, metres.
fn noise(text: &str) -> Result<f64, String> {
    let noise = text.parse().ok().filter(|n| (0.0..=0.05).contains(n));
    noise.ok_or_else(|| format!("{text:?} is no deviation in metres, 0 to 0.05"))
}
