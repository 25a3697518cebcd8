//! What a plan's file may say, with its defaults, before anything is checked.

use std::path::PathBuf;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use toml::Spanned;
use wheelarm_proto::look::LookText;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::{Depth, Named, Quality, Starts, Style};
use wheelarm_proto::v1;

use crate::disturb::Disturb;
use crate::sentences::LanguageFile;
use crate::variation::{read_person, read_sensors};

/// What differs between episodes beside what the task files draw.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct Randomise {
    /// The operator's speed and ways vary with the seed, as a person's do.
    #[serde(default = "yes")]
    pub operator: bool,
    /// Adds the noise of the robot description to the IMU.
    #[serde(default)]
    pub imu_noise: bool,
    /// Specimens of the robot, each with lenses and camera places of its own
    /// within the tolerances of its description; 0 for the one that it describes.
    #[serde(default)]
    pub robots: u32,
}

fn yes() -> bool {
    true
}

impl Default for Randomise {
    fn default() -> Self {
        Self {
            operator: true,
            imu_noise: false,
            robots: 0,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlanFile {
    pub(super) name: Spanned<String>,
    pub(super) out: Option<PathBuf>,
    #[serde(default = "home")]
    pub(super) scene: String,
    #[serde(default = "wheelarm")]
    pub(super) robot: String,
    #[serde(default)]
    pub(super) first_seed: u64,
    #[serde(default = "five")]
    pub(super) attempts: Spanned<u32>,
    #[serde(default, deserialize_with = "named")]
    pub(super) depth: Depth,
    #[serde(default, deserialize_with = "named")]
    pub(super) quality: Quality,
    #[serde(default, deserialize_with = "named")]
    pub(super) starts: Starts,
    #[serde(default = "apache")]
    pub(super) license: Spanned<String>,
    #[serde(default, deserialize_with = "purpose")]
    pub(super) purpose: Option<Purpose>,
    pub(super) bear_share: Option<Spanned<f64>>,
    pub(super) look: Option<LookText>,
    #[serde(default)]
    pub(super) keep_failed: bool,
    pub(super) disturb: Option<Disturb>,
    #[serde(default, deserialize_with = "named")]
    pub(super) style: Style,
    #[serde(default)]
    pub(super) time_limits: bool,
    #[serde(default = "none")]
    pub(super) start_in_view: Spanned<f64>,
    #[serde(default = "none")]
    pub(super) look_around: Spanned<f64>,
    #[serde(default, deserialize_with = "read_person")]
    pub(super) person: Option<v1::Person>,
    #[serde(default, deserialize_with = "read_sensors")]
    pub(super) sensors: Vec<v1::SensorSetting>,
    #[serde(default = "sixty")]
    pub(super) state_rate: Spanned<f64>,
    #[serde(default = "imu")]
    pub(super) imu_rate: Spanned<f64>,
    #[serde(default = "ten")]
    pub(super) sample_rate: Spanned<f64>,
    #[serde(default)]
    pub(super) randomise: Randomise,
    pub(super) language: Option<LanguageFile>,
    #[serde(default)]
    pub(super) camera: Vec<CameraFile>,
    #[serde(default)]
    pub(super) task: Vec<TaskFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraFile {
    pub(super) name: Spanned<String>,
    pub(super) size: Spanned<[u32; 2]>,
    #[serde(default = "ten")]
    pub(super) rate: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TaskFile {
    pub(super) name: Spanned<String>,
    pub(super) episodes: Spanned<u32>,
    pub(super) first_seed: Option<u64>,
    pub(super) seconds: Option<Spanned<f64>>,
    pub(super) reference_samples: Option<Spanned<f64>>,
}

fn named<'de, T: Named, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    let name = String::deserialize(from)?;
    T::from_name(&name).map_err(D::Error::custom)
}
fn purpose<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Purpose>, D::Error> {
    named(from).map(Some)
}
fn apache() -> Spanned<String> {
    Spanned::new(0..0, "apache-2.0".to_owned())
}
fn home() -> String {
    "home".to_owned()
}
fn wheelarm() -> String {
    "wheelarm".to_owned()
}
fn five() -> Spanned<u32> {
    Spanned::new(0..0, 5)
}
fn none() -> Spanned<f64> {
    Spanned::new(0..0, 0.0)
}
fn sixty() -> Spanned<f64> {
    Spanned::new(0..0, 60.0)
}
fn imu() -> Spanned<f64> {
    Spanned::new(0..0, 240.0)
}
fn ten() -> Spanned<f64> {
    Spanned::new(0..0, 10.0)
}
