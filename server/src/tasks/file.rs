//! Layout of a task file; only the keys are checked here.

use serde::Deserialize;

use super::query::Query;

/// `assets/tasks/NAME.toml`: verb × object query × place query, and the sentences.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TaskFile {
    pub origin: String,
    pub license: String,
    pub activity: String,
    /// Below assets/areas.
    pub area: String,
    /// Below assets/templates.
    pub template: String,
    pub object: Query,
    pub place: Option<Query>,
    pub instructions: Vec<String>,
    /// s; the template's when absent.
    pub time_limit: Option<f64>,
    /// Thresholds that differ from the template's, by the name of a predicate.
    #[serde(default)]
    pub thresholds: toml::Table,
}
