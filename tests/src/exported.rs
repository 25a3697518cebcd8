//! Reads the action rows of an exported LeRobot set.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{Field, Row};

/// Actions of a set.
#[derive(Debug)]
pub struct Exported {
    /// Names of the numbers of an action.
    pub names: Vec<String>,
    /// By the label of the recording: simulated time (s) and action of each row.
    pub episodes: BTreeMap<String, Vec<(f64, Vec<f64>)>>,
}

impl Exported {
    /// Reads the set in `folder`.
    ///
    /// # Errors
    /// When a file is missing or lacks a column.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        let info = folder.join("meta/info.json");
        let text = std::fs::read(&info).with_context(|| info.display().to_string())?;
        let info: serde_json::Value = serde_json::from_slice(&text)?;
        let names = info["features"]["action"]["names"].as_array();
        let names = names.context("meta/info.json names no action")?.iter();
        let mut labels = BTreeMap::new();
        for path in tables(&folder.join("meta/episodes"))? {
            for row in rows(&path)? {
                let episode = number(field(&row, "episode_index")?)?;
                let Field::Str(label) = field(&row, "recording")? else {
                    anyhow::bail!("{}: recording is not a string", path.display());
                };
                labels.insert(episode as i64, label.clone());
            }
        }
        let mut episodes: BTreeMap<String, Vec<_>> = BTreeMap::new();
        for path in tables(&folder.join("data"))? {
            for row in rows(&path)? {
                let episode = number(field(&row, "episode_index")?)?;
                let label = labels.get(&(episode as i64)).context("an episode's name")?;
                let Field::ListInternal(action) = field(&row, "action")? else {
                    anyhow::bail!("{}: action is not a list", path.display());
                };
                let action: anyhow::Result<_> = action.elements().iter().map(number).collect();
                let time = number(field(&row, "simulation_time")?)?;
                let all = episodes.entry(label.clone()).or_default();
                all.push((time, action?));
            }
        }
        ensure!(!episodes.is_empty(), "{} has no rows", folder.display());
        Ok(Self {
            names: names
                .filter_map(|n| n.as_str().map(str::to_owned))
                .collect(),
            episodes,
        })
    }
}

/// The tables below a folder, in their order.
fn tables(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    let chunks = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    for chunk in chunks {
        for file in std::fs::read_dir(chunk?.path())? {
            all.push(file?.path());
        }
    }
    all.sort();
    Ok(all)
}

fn rows(path: &Path) -> anyhow::Result<Vec<Row>> {
    let reader = SerializedFileReader::new(File::open(path)?)?;
    let all: Result<Vec<_>, _> = reader.get_row_iter(None)?.collect();
    all.with_context(|| path.display().to_string())
}

fn field<'a>(row: &'a Row, name: &str) -> anyhow::Result<&'a Field> {
    let found = row.get_column_iter().find(|(column, _)| *column == name);
    Ok(found.with_context(|| format!("no column {name}"))?.1)
}

fn number(field: &Field) -> anyhow::Result<f64> {
    Ok(match field {
        Field::Float(value) => f64::from(*value),
        Field::Double(value) => *value,
        Field::Long(value) => *value as f64,
        other => anyhow::bail!("{other} is not a number"),
    })
}
