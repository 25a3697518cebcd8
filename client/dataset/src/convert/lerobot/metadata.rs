//! Content of `meta/`: tasks, phases, episodes, statistics, features.

use std::path::Path;

use serde_json::{Value, json};

use super::layout::{FILE_BYTES, FOLDER_FILES, Layout, VIDEO_BYTES};
use super::set::{EpisodeRow, Set};
use super::statistics::{Gathered, NAMES};
use super::table::{Cells, Column, Table};
use crate::convert::learning::LEAST_DEVIATION;
use crate::label;

/// Path template of videos, as LeRobot fills it in.
const VIDEO_PATH: &str = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4";

fn column(name: &str, cells: Cells) -> Column {
    Column {
        name: name.to_owned(),
        cells,
    }
}

/// A table of names whose index pandas restores: `name` column, `index` column.
fn names_table(path: &Path, name: &str, index: &str, names: &[String]) -> anyhow::Result<()> {
    let described = |name: &str, kind: &str, numpy: &str| json!({"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": null});
    let pandas = json!({
        "index_columns": [name],
        "column_indexes": [{"name": null, "field_name": null, "pandas_type": "unicode",
            "numpy_type": "object", "metadata": {"encoding": "UTF-8"}}],
        "columns": [described(index, "int64", "int64"), described(name, "unicode", "object")],
        "creator": {"library": "wheelarm", "version": env!("CARGO_PKG_VERSION")},
        "pandas_version": "2.2.3",
    });
    let numbers = (0..names.len() as i64).collect();
    let columns = vec![
        column(index, Cells::I64(vec![], numbers)),
        column(name, Cells::Text(vec![], names.to_vec())),
    ];
    Table::create(path, columns, &[("pandas", pandas.to_string())])?.close()
}

/// Writes everything below `meta/`.
pub(super) fn metadata(folder: &Path, set: &Set, layout: &Layout) -> anyhow::Result<()> {
    let meta = folder.join("meta");
    std::fs::create_dir_all(&meta)?;
    names_table(
        &meta.join("tasks.parquet"),
        "task",
        "task_index",
        &set.tasks,
    )?;
    let phases = label::NAMES.map(String::from);
    names_table(
        &meta.join("subtasks.parquet"),
        "subtask",
        "subtask_index",
        &phases,
    )?;
    let statistics: serde_json::Map<String, Value> = set
        .statistics
        .iter()
        .map(|(name, values)| {
            let mut summary = values.summary();
            // A nearly constant value must not be scaled up by a reader that divides by it.
            if ["observation.state", "action"].contains(&name.as_str()) {
                summary.widen(LEAST_DEVIATION);
            }
            (name.clone(), summary.json())
        })
        .collect();
    let write = |name: &str, value: &Value| std::fs::write(meta.join(name), format!("{value:#}\n"));
    write("stats.json", &Value::Object(statistics))?;
    let info = json!({
        "codebase_version": "v3.0",
        "robot_type": layout.body.robot,
        "total_episodes": set.episodes.len(),
        "total_frames": set.rows,
        "total_tasks": set.tasks.len(),
        "chunks_size": FOLDER_FILES,
        "data_files_size_in_mb": FILE_BYTES >> 20,
        "video_files_size_in_mb": VIDEO_BYTES >> 20,
        "fps": layout.rate,
        "splits": {"train": format!("0:{}", set.episodes.len())},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": layout.colour.map(|_| VIDEO_PATH),
        "features": layout.features(),
    });
    write("info.json", &info)?;
    write("cameras.json", &cameras(&set.calibrations))?;
    let episodes = meta.join("episodes/chunk-000/file-000.parquet");
    episodes_table(&episodes, set, layout.rate)
}

/// Intrinsics: those of the first episode, and all with their episodes.
fn cameras(calibrations: &[(Value, Vec<usize>)]) -> Value {
    let mut features = calibrations
        .first()
        .map_or(Value::Null, |(first, _)| first.clone());
    let all: Vec<Value> = calibrations
        .iter()
        .map(|(of, episodes)| json!({"episodes": episodes, "cameras": of["cameras"]}))
        .collect();
    if let Some(features) = features.as_object_mut() {
        features.insert("by_episode".to_owned(), all.into());
    }
    features
}

/// One row per episode: its place in the data files and videos, and its
/// statistics.
fn episodes_table(path: &Path, set: &Set, rate: u32) -> anyhow::Result<()> {
    type Number = fn(usize, &EpisodeRow) -> usize;
    let all = &set.episodes;
    let integers = |(name, of): (&str, Number)| {
        let values = all.iter().enumerate().map(|(i, e)| of(i, e) as i64);
        column(name, Cells::I64(vec![], values.collect()))
    };
    let mut columns = vec![integers(("episode_index", |i, _| i))];
    let tasks = all.iter().map(|e| e.task.clone()).collect();
    columns.push(column("tasks", Cells::Text(vec![1], tasks)));
    let places: [(&str, Number); 7] = [
        ("length", |_, e| e.length),
        ("data/chunk_index", |_, e| e.file / FOLDER_FILES),
        ("data/file_index", |_, e| e.file % FOLDER_FILES),
        ("dataset_from_index", |_, e| e.from),
        ("dataset_to_index", |_, e| e.from + e.length),
        ("meta/episodes/chunk_index", |_, _| 0),
        ("meta/episodes/file_index", |_, _| 0),
    ];
    columns.extend(places.map(integers));
    for key in set.video_concats.keys() {
        let videos = all.iter().map(|e| (e.videos.get(key), e.length));
        let places: Vec<_> = videos.filter_map(|(p, n)| p.map(|p| (p, n))).collect();
        let number = |name: &str, of: fn(usize) -> usize| {
            let values = places.iter().map(|(p, _)| of(p.file) as i64).collect();
            column(&format!("videos/{key}/{name}"), Cells::I64(vec![], values))
        };
        columns.push(number("chunk_index", |file| file / FOLDER_FILES));
        columns.push(number("file_index", |file| file % FOLDER_FILES));
        let seconds = |name: &str, frames: Vec<usize>| {
            let values = frames.into_iter().map(|n| n as f64 / f64::from(rate));
            let cells = Cells::F64(vec![], values.collect());
            column(&format!("videos/{key}/{name}"), cells)
        };
        let from = places.iter().map(|(p, _)| p.from).collect();
        let to = places.iter().map(|(p, n)| p.from + n).collect();
        columns.push(seconds("from_timestamp", from));
        columns.push(seconds("to_timestamp", to));
    }
    let labels = all.iter().map(|e| e.label.clone()).collect();
    columns.push(column("recording", Cells::Text(vec![], labels)));
    let success = all.iter().map(|e| e.success).collect();
    columns.push(column("success", Cells::Bool(success)));
    for feature in set.statistics.keys() {
        let summaries: Vec<_> = all
            .iter()
            .filter_map(|e| e.statistics.get(feature).map(Gathered::summary))
            .collect();
        let Some(shape) = summaries.first().map(|s| s.shape.clone()) else {
            continue;
        };
        for (k, name) in NAMES.iter().enumerate() {
            let values = summaries.iter().flat_map(|s| s.lists[k].iter().copied());
            let cells = Cells::F64(shape.clone(), values.collect());
            columns.push(column(&format!("stats/{feature}/{name}"), cells));
        }
        let counts = summaries.iter().map(|s| s.count as i64).collect();
        let name = format!("stats/{feature}/count");
        columns.push(column(&name, Cells::I64(vec![1], counts)));
    }
    Table::create(path, columns, &[])?.close()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_listed_for_every_specimen() {
        let of = |fx: f64| json!({"units": "pixels", "cameras": {"gen3": {"fx": fx}}});
        let features = cameras(&[(of(600.0), vec![0, 2]), (of(610.0), vec![1])]);
        assert_eq!(features["cameras"]["gen3"]["fx"], 600.0);
        assert_eq!(features["by_episode"][1]["episodes"], json!([1]));
        assert_eq!(features["by_episode"][1]["cameras"]["gen3"]["fx"], 610.0);
    }
}
