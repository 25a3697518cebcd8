//! Options of `wheelarm replay`.

use std::path::PathBuf;

use clap::Args;
use wheelarm_proto::settings::Quality;
use wheelarm_proto::v1;

use crate::choice::named;

/// Options of `wheelarm replay`.
#[derive(Args, Clone, Debug)]
pub struct ReplayArgs {
    /// Episode file.
    pub file: PathBuf,
    /// Records again into this folder; only compares when absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Width of the recorded cameras' new pictures, pixels.
    #[arg(long, requires = "out")]
    pub width: Option<u32>,
    /// Height of the recorded cameras' new pictures, pixels.
    #[arg(long, requires = "out")]
    pub height: Option<u32>,
    /// Another camera as NAME=WIDTHxHEIGHT@HZ; may be repeated. One of the
    /// recorded cameras' names replaces its setting.
    #[arg(
        long,
        requires = "out",
        value_parser = v1::CameraSetting::from_text,
        value_name = "NAME=WxH@HZ"
    )]
    pub camera: Vec<v1::CameraSetting>,
    /// Draws the recorded states anew instead of computing them, also those of
    /// another version of the physics: robot, objects, furniture, commands and
    /// evaluation as recorded, and new pictures.
    #[arg(long, requires = "out")]
    pub as_recorded: bool,
    /// Work per picture; the recording's when absent.
    #[arg(long, requires = "out", value_parser = named::<Quality>())]
    pub quality: Option<Quality>,
    /// Assets folder; the server looks for it when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
}
