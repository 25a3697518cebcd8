//! The file of a plan with its defaults, before it is checked.

use std::path::PathBuf;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use toml::Spanned;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::{Depth, Named};
use wheelarm_proto::v1;

use crate::variation::VariationFile;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlanFile {
    pub(super) name: Spanned<String>,
    pub(super) out: Option<PathBuf>,
    #[serde(default)]
    pub(super) first_seed: u64,
    #[serde(default = "five")]
    pub(super) attempts: Spanned<u32>,
    #[serde(default, deserialize_with = "named")]
    pub(super) depth: Depth,
    #[serde(default = "apache")]
    pub(super) license: Spanned<String>,
    /// Use that the licenses of world packs have to permit.
    pub(super) pack_license: Option<Spanned<String>>,
    #[serde(default, deserialize_with = "purpose")]
    pub(super) purpose: Option<Purpose>,
    #[serde(default)]
    pub(super) keep_failed: bool,
    #[serde(default = "ten")]
    pub(super) sample_rate_hz: Spanned<f64>,
    #[serde(default = "empty")]
    pub(super) scenario: Spanned<v1::Scenario>,
    #[serde(default)]
    pub(super) variation: VariationFile,
    #[serde(default)]
    pub(super) task: Vec<TaskFile>,
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
fn five() -> Spanned<u32> {
    Spanned::new(0..0, 5)
}
fn ten() -> Spanned<f64> {
    Spanned::new(0..0, 10.0)
}
fn empty() -> Spanned<v1::Scenario> {
    Spanned::new(0..0, v1::Scenario::default())
}
