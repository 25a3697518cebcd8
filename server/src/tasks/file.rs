//! Layout of a task file; only the keys are checked here.

use serde::Deserialize;

use super::place_query::PlaceQuery;
use super::query::Query;
use crate::scene::{Place, SceneError};

/// `assets/tasks/NAME.toml`: verb × object query × place query, and the sentences.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TaskFile {
    pub origin: String,
    pub license: String,
    pub activity: String,
    /// Below assets/areas; without it the task is a query over the places of a home.
    pub area: Option<String>,
    /// Below assets/templates.
    pub template: String,
    pub object: Query,
    /// Where the object is, without an area.
    pub from: Option<PlaceQuery>,
    pub place: Option<DestinationEntry>,
    pub instructions: Vec<String>,
    /// s; the template's when absent.
    pub time_limit: Option<f64>,
    /// Thresholds that differ from the template's, by the name of a predicate.
    #[serde(default)]
    pub thresholds: toml::Table,
}

/// Where the object is put: a region of the area, or a place of the home.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DestinationEntry {
    name: Option<String>,
    category: Option<String>,
    colour: Option<String>,
    kind: Option<String>,
    room: Option<String>,
}

impl DestinationEntry {
    /// The query for a region of an area.
    pub(super) fn region_query(&self, place: &Place) -> Result<Query, SceneError> {
        if let Some(given) = self.kind.as_ref().or(self.room.as_ref()) {
            return Err(place.wrong(
                format!("{given:?}"),
                "name, category or colour of a region of the area",
                "leave out kind and room, or the area",
            ));
        }
        let [name, category, colour] = [&self.name, &self.category, &self.colour];
        Ok(Query {
            name: name.clone(),
            category: category.clone(),
            colour: colour.clone(),
        })
    }

    /// The query for a place of a home.
    pub(super) fn place_query(&self, place: &Place) -> Result<PlaceQuery, SceneError> {
        if let Some(given) = self.category.as_ref().or(self.colour.as_ref()) {
            return Err(place.wrong(
                format!("{given:?}"),
                "kind, room or name of furniture",
                "leave out category and colour, or name an area",
            ));
        }
        Ok(PlaceQuery {
            name: self.name.clone(),
            kind: self.kind.clone(),
            room: self.room.clone(),
        })
    }
}
