//! How a task file looks; nothing checked but the keys.
//!
//! Lengths are metres, times seconds, angles degrees in keys with `_deg`.

use serde::Deserialize;

use super::goal::Goal;
use super::predicates::AnyPredicate;

/// `assets/tasks/NAME.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TaskFile {
    pub origin: String,
    pub license: String,
    pub scene: String,
    pub activity: String,
    pub area: String,
    pub target: Target,
    pub goal: Goal,
    pub instructions: Vec<String>,
    pub time_limit: f64,
    pub start: StartEntry,
    #[serde(default)]
    pub place: Vec<PlaceEntry>,
    #[serde(default)]
    pub slide: Vec<SlideEntry>,
    pub condition: Vec<ConditionEntry>,
    pub failure: FailureEntry,
}

/// What the task is about: one body, or several of which the seed takes one.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum Target {
    One(String),
    OneOf(Vec<String>),
}

/// Where the chair starts: ranges, least and greatest value.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StartEntry {
    pub x: [f64; 2],
    pub y: [f64; 2],
    pub yaw_deg: [f64; 2],
}

/// Where one object starts: ranges in the frame of the surface's approach edge.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlaceEntry {
    pub object: String,
    pub on: String,
    pub surface: Option<String>,
    /// From the edge inwards.
    pub inwards: [f64; 2],
    /// Along the edge from its middle.
    pub along: [f64; 2],
    /// Turn against the inward direction.
    pub yaw_deg: [f64; 2],
    pub mass: Option<[f64; 2]>,
    pub friction: Option<[f64; 2]>,
    /// How often it is there at all, 0 to 1.
    pub chance: Option<f64>,
}

/// How hard furniture slides: ranges.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SlideEntry {
    /// For example `drawer_1_joint`.
    pub joint: String,
    /// N.
    pub friction: [f64; 2],
    /// N·s/m.
    pub damping: [f64; 2],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConditionEntry {
    pub required: bool,
    pub predicate: AnyPredicate,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FailureEntry {
    pub drop: f64,
    pub tilt_deg: f64,
    /// From the approach edge inwards.
    pub reach: Option<f64>,
    /// N.
    pub force: f64,
}
