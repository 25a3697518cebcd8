//! Table `pack.toml`.

use serde::{Deserialize, Serialize};

use super::part::is_default;

/// Value of the key `format` that this program writes and reads.
pub const FORMAT: u32 = 1;

/// License of a source that is not known.
pub const UNKNOWN: &str = "unknown";

/// `pack.toml`: name, version and sources of a pack.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the form of the files: [`FORMAT`].
    pub format: u32,
    /// Name of the pack: 1 to 64 letters, digits, `-` or `_`.
    pub name: String,
    /// Version of the content: 1 to 64 letters, digits, `-`, `_`, `.` or `+`.
    pub version: String,
    /// For tests only: campaigns for training refuse the pack.
    #[serde(default, skip_serializing_if = "is_default")]
    pub held_out: bool,
    /// A part of a program, which lists of homes leave out.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hidden: bool,
    /// Authors and licenses.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub source: Vec<SourceEntry>,
}

/// Author and license of a part of a pack.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SourceEntry {
    /// Name of a kind or an object, or `home`.
    pub of: String,
    /// Author; empty when not known.
    #[serde(default)]
    pub author: String,
    /// SPDX identifier, or [`UNKNOWN`].
    pub license: String,
    /// Origin.
    #[serde(default)]
    pub origin: String,
}
