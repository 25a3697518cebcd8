//! Templates: `assets/templates/VERB.toml` contains the conditions of all tasks with a
//! verb. A task file may override thresholds, key by key.

use std::path::Path;

use serde::Deserialize;
use toml::{Table, Value};

use super::condition_spec::ConditionSpec;
use super::context::TARGET;
use super::predicates::AnyPredicate;
use crate::scene::{Place, SceneError, names, parse, provenance};

/// Placeholder in a template for the place of the task.
const REGION: &str = "region";

/// Verb of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Verb {
    Lift,
    Put,
    Give,
    Bring,
    Open,
    Close,
}

/// A template with the thresholds of one task, before validation.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct Template {
    origin: String,
    license: String,
    pub goal: Verb,
    pub time_limit: f64,
    condition: Vec<ConditionEntry>,
    pub failure: FailureEntry,
    /// Behaviour of the person.
    pub person: Option<PersonEntry>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct PersonEntry {
    pub motion: f64,
    pub mouth_open: bool,
}

#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct ConditionEntry {
    required: bool,
    /// Only when the task has several possible targets.
    #[serde(default)]
    when_several: bool,
    /// Only with a person in the chair.
    #[serde(default)]
    with_person: bool,
    predicate: Table,
}

#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct FailureEntry {
    pub drop: f64,
    pub tilt_deg: f64,
    /// From the approach edge inwards.
    pub reach: Option<f64>,
    /// N.
    pub force: f64,
}

impl Template {
    /// Reads `assets/templates/NAME.toml` and overrides it with a task's `thresholds`:
    /// tables by predicate name, and one for `failure`.
    pub(super) fn read(
        assets: &Path,
        task: &Place,
        name: &str,
        thresholds: &Table,
    ) -> Result<Self, SceneError> {
        let known = names(assets, "templates")?;
        if !known.iter().any(|known| known == name) {
            return Err(task.key("template").wrong(
                format!("{name:?}"),
                format!("one of {}", known.join(", ")),
                "correct the name or add the template in assets/templates",
            ));
        }
        let path = format!("templates/{name}.toml");
        let mut template: Self = parse(assets, &path)?;
        provenance(&Place::file(&path), &template.origin, &template.license)?;
        for (word, over) in thresholds {
            let place = task.key("thresholds").key(word);
            let Value::Table(over) = over else {
                return Err(place.wrong(
                    over,
                    "a table of thresholds",
                    "for example inside.above = 0.05",
                ));
            };
            if word == "failure" {
                template.failure.take(&place, over)?;
            } else {
                template.take(&place, word, over)?;
            }
        }
        Ok(template)
    }

    /// Overrides thresholds of one predicate.
    fn take(&mut self, place: &Place, word: &str, over: &Table) -> Result<(), SceneError> {
        let mut conditions = self.condition.iter_mut();
        let found = conditions.find_map(|entry| entry.predicate.get_mut(word));
        let Some(Value::Table(own)) = found else {
            let words = self.condition.iter().flat_map(|c| c.predicate.keys());
            let words: Vec<_> = words.map(String::as_str).chain(["failure"]).collect();
            return Err(place.wrong(
                "not in the template",
                format!("one of {}", words.join(", ")),
                "give thresholds of predicates that the template has",
            ));
        };
        for (key, value) in over {
            let number = own.get(key).is_some_and(is_number) && is_number(value);
            if !number {
                let keys = own.iter().filter(|(_, value)| is_number(value));
                let keys: Vec<_> = keys.map(|(key, _)| key.as_str()).collect();
                return Err(place.key(key).wrong(
                    value,
                    format!("a number for one of {}", keys.join(", ")),
                    "correct the key or the value",
                ));
            }
            own.insert(key.clone(), value.clone());
        }
        Ok(())
    }

    /// The conditions of a task with these targets and this `region`. A single target
    /// is named.
    pub(super) fn conditions(
        &self,
        name: &str,
        target: Option<[&str; 2]>,
        region: Option<&str>,
    ) -> Result<Vec<ConditionSpec>, SceneError> {
        let entries = self.condition.iter();
        entries
            .filter(|entry| !entry.when_several || target.is_none())
            .map(|entry| {
                let mut predicate = entry.predicate.clone();
                for (_, keys) in predicate.iter_mut() {
                    let keys = keys.as_table_mut().into_iter().flatten();
                    for (key, value) in keys {
                        let [object, joint] = target.unwrap_or([TARGET; 2]);
                        let named = match (key.as_str(), value.as_str()) {
                            ("object", Some(TARGET)) => object,
                            ("joint", Some(TARGET)) => joint,
                            ("on", Some(REGION)) => region.unwrap_or(REGION),
                            _ => continue,
                        };
                        *value = Value::String(named.to_owned());
                    }
                }
                let predicate: AnyPredicate =
                    predicate.try_into().map_err(|source| SceneError::Parse {
                        file: format!("templates/{name}.toml"),
                        source: Box::new(source),
                        cure: "correct the key or the value of the condition".to_owned(),
                    })?;
                Ok(ConditionSpec {
                    predicate,
                    required: entry.required,
                    with_person: entry.with_person,
                })
            })
            .collect()
    }
}

impl FailureEntry {
    fn take(&mut self, place: &Place, over: &Table) -> Result<(), SceneError> {
        for (key, value) in over {
            let number = value.as_float().or(value.as_integer().map(|i| i as f64));
            let (Some(number), Some(own)) = (number, self.key(key)) else {
                return Err(place.key(key).wrong(
                    value,
                    "a number for one of drop, tilt_deg, reach, force",
                    "correct the key or the value",
                ));
            };
            own(number);
        }
        Ok(())
    }

    fn key(&mut self, key: &str) -> Option<Box<dyn FnOnce(f64) + '_>> {
        Some(match key {
            "drop" => Box::new(|value| self.drop = value),
            "tilt_deg" => Box::new(|value| self.tilt_deg = value),
            "reach" => Box::new(|value| self.reach = Some(value)),
            "force" => Box::new(|value| self.force = value),
            _ => return None,
        })
    }
}

fn is_number(value: &Value) -> bool {
    value.is_float() || value.is_integer()
}
