//! Options of `wheelarm replay`.

use std::path::PathBuf;

use clap::Args;
use wheelarm_proto::appearance::AppearanceText;
use wheelarm_proto::settings::Quality;
use wheelarm_proto::v1;

use crate::adapters::AdapterArgs;
use wheelarm_options::choice::{camera, named};
use wheelarm_options::packs::PackArgs;

/// Options of `wheelarm replay`.
#[derive(Args, Clone, Debug)]
pub struct ReplayArgs {
    /// Episode file.
    pub file: PathBuf,
    /// Folder for a new recording; only compares when absent.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Width of the new images of the recorded cameras, pixels.
    #[arg(long, requires = "out")]
    pub width: Option<u32>,
    /// Height of the new images of the recorded cameras, pixels.
    #[arg(long, requires = "out")]
    pub height: Option<u32>,
    /// Another camera, NAME=WIDTHxHEIGHT@HZ, or WIDTHxHEIGHT@HZ for every camera of the robot.
    /// May be repeated. One of the recorded cameras' names replaces its setting.
    #[arg(
        long,
        requires = "out",
        value_parser = camera,
        value_name = "CAMERA"
    )]
    pub camera: Vec<v1::CameraSetting>,
    /// Records the run this many times, each with another appearance and into its own file,
    /// with consecutive seeds from --appearance-seed.
    #[arg(long, alias = "looks", requires = "out", conflicts_with = "as_recorded", value_name = "K",
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub appearances: Option<u32>,
    /// Seed of the first appearance.
    #[arg(
        long,
        alias = "look-seed",
        requires = "appearances",
        default_value_t = 1,
        value_name = "SEED"
    )]
    pub appearance_seed: u64,
    /// Axes of the appearances as AXIS=STRENGTH,…, for example light=3,camera=1; the
    /// usual ones when absent.
    #[arg(long, alias = "look-axes", requires = "appearances", value_name = "AXIS=N,…", value_parser = axes)]
    pub appearance_axes: Option<AppearanceText>,
    /// Runs at the same time; half the number of cores when absent.
    #[arg(long, requires = "appearances", value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..=256))]
    pub jobs: Option<u32>,
    /// Renders the recorded states instead of computing them, also those of another version
    /// of the physics: robot, objects, furniture, commands and evaluation as recorded, with
    /// new images.
    #[arg(long, requires = "out")]
    pub as_recorded: bool,
    /// Rendering quality; the recording's when absent.
    #[arg(long, requires = "out", value_parser = named::<Quality>())]
    pub quality: Option<Quality>,
    /// Graphics adapters for rendering; several for --appearances.
    #[command(flatten)]
    pub graphics: AdapterArgs,
    /// Assets folder; found by the server when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
    /// World packs.
    #[command(flatten)]
    pub packs: PackArgs,
}

impl ReplayArgs {
    /// The requested appearances.
    pub(super) fn requested_appearances(&self) -> Vec<v1::Appearance> {
        let usual = |seed| match &self.appearance_axes {
            Some(axes) => axes.seeded(seed),
            None => v1::Appearance::usual(seed),
        };
        let count = u64::from(self.appearances.unwrap_or(0));
        (0..count)
            .map(|i| usual(self.appearance_seed.wrapping_add(i)))
            .collect()
    }
}

/// Reads the axes of an appearance without its seed.
fn axes(text: &str) -> Result<AppearanceText, String> {
    AppearanceText::read(&format!("0:{text}"))
}
