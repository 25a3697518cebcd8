//! What stands below `meta/`: tasks, phases, episodes, statistics, features.

use std::path::Path;

use serde_json::{Value, json};

use super::layout::Layout;
use super::statistics::{Gathered, NAMES};
use super::table::{Cells, Element, Field, Table};
use super::{EpisodeRow, FILE_BYTES, FOLDER_FILES, Set};
use crate::label;

/// A table of names whose index pandas restores: `name` column, `index` column.
fn names_table(path: &Path, name: &str, index: &str, names: &[String]) -> anyhow::Result<()> {
    let column = |name: &str, kind: &str, numpy: &str| json!({"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": null});
    let pandas = json!({
        "index_columns": [name],
        "column_indexes": [{"name": null, "field_name": null, "pandas_type": "unicode",
            "numpy_type": "object", "metadata": {"encoding": "UTF-8"}}],
        "columns": [column(index, "int64", "int64"), column(name, "unicode", "object")],
        "creator": {"library": "wheelarm", "version": env!("CARGO_PKG_VERSION")},
        "pandas_version": "2.2.3",
    });
    let field = |name: &str, element| Field {
        name: name.to_owned(),
        element,
        depth: 0,
    };
    let fields = vec![field(index, Element::I64), field(name, Element::Text)];
    let mut table = Table::create(path, fields, &[("pandas", pandas.to_string())])?;
    let numbers = (0..names.len() as i64).collect();
    table.append(vec![
        Cells::I64(vec![], numbers),
        Cells::Text(names.to_vec()),
    ])?;
    table.close()
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
        .map(|(name, values)| (name.clone(), values.summary().json()))
        .collect();
    let write = |name: &str, value: &Value| std::fs::write(meta.join(name), format!("{value:#}\n"));
    write("stats.json", &Value::Object(statistics))?;
    let info = json!({
        "codebase_version": "v3.0",
        "robot_type": "whill_gen3",
        "total_episodes": set.episodes.len(),
        "total_frames": set.rows,
        "total_tasks": set.tasks.len(),
        "chunks_size": FOLDER_FILES,
        "data_files_size_in_mb": FILE_BYTES >> 20,
        "video_files_size_in_mb": 200,
        "fps": layout.rate,
        "splits": {"train": format!("0:{}", set.episodes.len())},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": null,
        "features": layout.features(),
    });
    write("info.json", &info)?;
    write("cameras.json", &set.calibration)?;
    episodes_table(&meta.join("episodes/chunk-000/file-000.parquet"), set)
}

fn episodes_table(path: &Path, set: &Set) -> anyhow::Result<()> {
    let mut fields = Vec::new();
    let mut cells = Vec::new();
    let mut add = |name: String, element, depth, values| {
        fields.push(Field {
            name,
            element,
            depth,
        });
        cells.push(values);
    };
    let all = &set.episodes;
    let integers = |f: &dyn Fn(usize, &EpisodeRow) -> usize| {
        let values = all.iter().enumerate().map(|(i, e)| f(i, e) as i64);
        Cells::I64(vec![], values.collect())
    };
    add("episode_index".into(), Element::I64, 0, integers(&|i, _| i));
    let tasks = all.iter().map(|e| e.task.clone()).collect();
    add("tasks".into(), Element::Text, 1, Cells::Text(tasks));
    add("length".into(), Element::I64, 0, integers(&|_, e| e.length));
    add(
        "data/chunk_index".into(),
        Element::I64,
        0,
        integers(&|_, e| e.file / FOLDER_FILES),
    );
    add(
        "data/file_index".into(),
        Element::I64,
        0,
        integers(&|_, e| e.file % FOLDER_FILES),
    );
    add(
        "dataset_from_index".into(),
        Element::I64,
        0,
        integers(&|_, e| e.from),
    );
    add(
        "dataset_to_index".into(),
        Element::I64,
        0,
        integers(&|_, e| e.from + e.length),
    );
    add(
        "meta/episodes/chunk_index".into(),
        Element::I64,
        0,
        integers(&|_, _| 0),
    );
    add(
        "meta/episodes/file_index".into(),
        Element::I64,
        0,
        integers(&|_, _| 0),
    );
    let labels = all.iter().map(|e| e.label.clone()).collect();
    add("recording".into(), Element::Text, 0, Cells::Text(labels));
    let success = all.iter().map(|e| e.success).collect();
    add("success".into(), Element::Bool, 0, Cells::Bool(success));
    for feature in set.statistics.keys() {
        let summaries: Vec<_> = all
            .iter()
            .filter_map(|e| e.statistics.get(feature).map(Gathered::summary))
            .collect();
        let Some(shape) = summaries.first().map(|s| s.shape.clone()) else {
            continue;
        };
        for (k, name) in NAMES.iter().enumerate() {
            let values = summaries
                .iter()
                .flat_map(|s| s.lists[k].iter().copied())
                .collect();
            let name = format!("stats/{feature}/{name}");
            add(
                name,
                Element::F64,
                shape.len(),
                Cells::F64(shape.clone(), values),
            );
        }
        let counts = summaries.iter().map(|s| s.count as i64).collect();
        add(
            format!("stats/{feature}/count"),
            Element::I64,
            1,
            Cells::I64(vec![1], counts),
        );
    }
    let mut table = Table::create(path, fields, &[])?;
    table.append(cells)?;
    table.close()
}
