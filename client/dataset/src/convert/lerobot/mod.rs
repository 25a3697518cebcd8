//! A LeRobot data set, version 3.0: pictures in Parquet, tasks, episodes,
//! statistics. The whole set is made under another name and renamed at the end.
//!
//! An episode's pictures are encoded into a scratch file first, so that a
//! recording that turns out unreadable leaves nothing behind in the set.

mod statistics;
mod table;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhow::Context;
use serde_json::{Value, json};

use self::statistics::{Gathered, NAMES};
use self::table::{Cells, Element, Field, Table};
use super::batch::parallel;
use super::learning::{self, Learning};
use super::{Format, PendingFolder, Recording, Size, Written, png_rgb, scaled};
use crate::label;

/// Rows that are encoded, and written as one row group, together.
const BLOCK: usize = 32;
/// A data file is closed after the episode with which it passes this size.
const FILE_BYTES: usize = 100 << 20;
/// Files in one folder.
const FOLDER_FILES: usize = 1000;
/// About this many pixels of a picture are counted in the statistics.
const COUNTED_PIXELS: usize = 20_000;

/// Writes one data set.
pub struct LeRobot {
    size: Option<Size>,
    threads: usize,
    state: Mutex<Set>,
}

/// What grows while episodes come.
struct Set {
    folder: Option<PendingFolder>,
    /// Pictures per second and cameras with their sizes; the first episode
    /// decides, the others must have the same.
    layout: Option<Layout>,
    data: Option<Table>,
    file: usize,
    tasks: Vec<String>,
    episodes: Vec<EpisodeRow>,
    rows: usize,
    statistics: BTreeMap<String, Gathered>,
}

#[derive(Clone, Debug, PartialEq)]
struct Layout {
    rate: u32,
    cameras: BTreeMap<String, Size>,
}

struct EpisodeRow {
    task: String,
    length: usize,
    file: usize,
    from: usize,
    label: String,
    success: bool,
    statistics: BTreeMap<String, Gathered>,
}

impl LeRobot {
    /// A data set at `out`; pictures are scaled to `size` when it is given.
    ///
    /// # Errors
    /// When `out` exists already.
    pub fn new(out: &Path, size: Option<Size>, threads: usize) -> anyhow::Result<Self> {
        Ok(Self {
            size,
            threads,
            state: Mutex::new(Set {
                folder: Some(PendingFolder::new(out)?),
                layout: None,
                data: None,
                file: 0,
                tasks: Vec::new(),
                episodes: Vec::new(),
                rows: 0,
                statistics: BTreeMap::new(),
            }),
        })
    }

    fn layout(&self, recording: &Recording, rate: u32) -> Layout {
        let size = |camera: &crate::read::Camera| {
            let (width, height) = camera.size().unwrap_or((1, 1));
            self.size.unwrap_or(Size { width, height })
        };
        Layout {
            rate,
            cameras: recording
                .cameras
                .iter()
                .map(|(n, c)| (n.clone(), size(c)))
                .collect(),
        }
    }
}

fn image_key(camera: &str) -> String {
    format!("observation.images.{camera}")
}

/// Flat features beside state, action and pictures: name, type.
const FLAT: [(&str, Element); 11] = [
    ("next.reward", Element::F32),
    ("next.done", Element::Bool),
    ("next.success", Element::Bool),
    ("phase", Element::I64),
    ("subtask_index", Element::I64),
    ("simulation_time", Element::F64),
    ("timestamp", Element::F32),
    ("frame_index", Element::I64),
    ("episode_index", Element::I64),
    ("index", Element::I64),
    ("task_index", Element::I64),
];

fn dtype(element: Element) -> &'static str {
    match element {
        Element::F32 => "float32",
        Element::F64 => "float64",
        Element::I64 => "int64",
        Element::Bool => "bool",
        Element::Text => "string",
        Element::Image => "image",
    }
}

impl Layout {
    fn fields(&self) -> Vec<Field> {
        let field = |name: String, element, depth| Field {
            name,
            element,
            depth,
        };
        let mut out: Vec<Field> = self
            .cameras
            .keys()
            .map(|c| field(image_key(c), Element::Image, 0))
            .collect();
        out.push(field("observation.state".into(), Element::F32, 1));
        out.push(field("action".into(), Element::F32, 1));
        out.extend(FLAT.map(|(name, element)| field(name.into(), element, 0)));
        out
    }

    /// The features as `meta/info.json` lists them.
    fn features(&self) -> Value {
        let mut out = serde_json::Map::new();
        for (camera, size) in &self.cameras {
            let feature = json!({"dtype": "image", "shape": [size.height, size.width, 3],
                "names": ["height", "width", "channels"]});
            out.insert(image_key(camera), feature);
        }
        for (name, names) in [
            ("observation.state", learning::state_names()),
            ("action", learning::action_names()),
        ] {
            let feature = json!({"dtype": "float32", "shape": [names.len()], "names": names});
            out.insert(name.into(), feature);
        }
        for (name, element) in FLAT {
            let feature = json!({"dtype": dtype(element), "shape": [1], "names": null});
            out.insert(name.into(), feature);
        }
        Value::Object(out)
    }

    /// The features as Hugging Face's `datasets` writes them into the footer.
    fn footer(&self) -> String {
        let mut out = serde_json::Map::new();
        for camera in self.cameras.keys() {
            out.insert(image_key(camera), json!({"_type": "Image"}));
        }
        let list = |n: usize| json!({"feature": {"dtype": "float32", "_type": "Value"}, "length": n, "_type": "Sequence"});
        out.insert(
            "observation.state".into(),
            list(learning::state_names().len()),
        );
        out.insert("action".into(), list(learning::action_names().len()));
        for (name, element) in FLAT {
            out.insert(
                name.into(),
                json!({"dtype": dtype(element), "_type": "Value"}),
            );
        }
        json!({"info": {"features": out}}).to_string()
    }
}

/// Pictures of one episode, encoded, in a file that has no name for long.
struct Scratch {
    file: File,
    lengths: Vec<usize>,
}

impl Scratch {
    fn new(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join(".pictures");
        let file = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(true)
            .open(&path)?;
        // It goes with its handle, whatever happens.
        std::fs::remove_file(&path)?;
        Ok(Self {
            file,
            lengths: Vec::new(),
        })
    }

    fn put(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.lengths.push(bytes.len());
        self.file.write_all(bytes)
    }
}

impl Format for LeRobot {
    fn wants(&self, stream: &str) -> bool {
        learning::STREAMS.contains(&stream)
    }

    fn collects(&self) -> bool {
        true
    }

    fn add(&self, recording: &Recording, tick: &(dyn Fn() + Sync)) -> anyhow::Result<Written> {
        let (rate, rows, notes) = learning::grid(recording)?;
        let layout = self.layout(recording, rate);
        anyhow::ensure!(!layout.cameras.is_empty(), "the episode has no pictures");
        let mut set = self
            .state
            .lock()
            .map_err(|_| anyhow::anyhow!("an earlier episode failed"))?;
        let set = &mut *set;
        if let Some(first) = &set.layout {
            anyhow::ensure!(
                *first == layout,
                "rate or pictures differ from those of the first episode ({first:?}, here {layout:?}); --size makes sizes equal"
            );
        }
        let folder = set
            .folder
            .as_ref()
            .context("the data set is finished already")?;

        // Everything that can fail because of the recording comes first.
        let learning = Learning::of(recording)?;
        let mut gathered: BTreeMap<String, Gathered> = layout
            .cameras
            .keys()
            .map(|c| (image_key(c), Gathered::colours()))
            .collect();
        let mut scratch = Scratch::new(folder.path())?;
        for block in rows.chunks(BLOCK) {
            for (camera, &size) in &layout.cameras {
                let encoded = parallel(block.len(), self.threads, |i| {
                    let (source, index) = recording.picture(camera, block[i])?;
                    let (width, height) = source.size().context("a size")?;
                    let rgb = source.rgb(&recording.episode, index)?;
                    let rgb = scaled(rgb, Size { width, height }, size);
                    let mut counts = Gathered::colours();
                    counts.picture(&rgb, size.width * size.height / COUNTED_PIXELS);
                    Ok((png_rgb(&rgb, size)?, counts))
                })?;
                for (png, counts) in &encoded {
                    scratch.put(png)?;
                    if let Some(all) = gathered.get_mut(&image_key(camera)) {
                        all.merge(counts);
                    }
                }
            }
            block.iter().for_each(|_| tick());
        }

        let table = match set.data.take() {
            Some(table) => table,
            None => {
                let (folder_number, file) = (set.file / FOLDER_FILES, set.file % FOLDER_FILES);
                let name = format!("data/chunk-{folder_number:03}/file-{file:03}.parquet");
                let footer = [("huggingface", layout.footer())];
                Table::create(&folder.path().join(name), layout.fields(), &footer)?
            }
        };
        set.data = Some(table);
        set.layout = Some(layout);
        let instruction = recording.summary.instruction.clone();
        let task = set
            .tasks
            .iter()
            .position(|t| *t == instruction)
            .unwrap_or_else(|| {
                set.tasks.push(instruction.clone());
                set.tasks.len() - 1
            });
        let episode = set.episodes.len();
        let numbers = write_rows(
            set,
            recording,
            &learning,
            &rows,
            (episode, task),
            &mut scratch,
        )?;
        gathered.extend(numbers);
        for (name, values) in &gathered {
            match set.statistics.get_mut(name) {
                Some(all) => all.merge(values),
                None => {
                    set.statistics.insert(name.clone(), values.clone());
                }
            }
        }
        set.episodes.push(EpisodeRow {
            task: instruction,
            length: rows.len(),
            file: set.file,
            from: set.rows,
            label: recording.summary.label.clone(),
            success: recording.summary.success,
            statistics: gathered,
        });
        set.rows += rows.len();
        if set.data.as_ref().is_some_and(|t| t.bytes() > FILE_BYTES)
            && let Some(table) = set.data.take()
        {
            table.close()?;
            set.file += 1;
        }
        Ok(Written {
            path: PathBuf::from(format!("episode {episode}")),
            samples: rows.len(),
            notes,
        })
    }

    fn finish(&self) -> anyhow::Result<Option<Written>> {
        let mut set = self
            .state
            .lock()
            .map_err(|_| anyhow::anyhow!("an episode failed"))?;
        if let Some(table) = set.data.take() {
            table.close()?;
        }
        let Some(layout) = set.layout.clone() else {
            anyhow::bail!("no episode could be taken: there is no data set");
        };
        let folder = set
            .folder
            .take()
            .context("the data set is finished already")?;
        metadata(folder.path(), &set, &layout)?;
        Ok(Some(Written {
            path: folder.commit()?,
            samples: set.rows,
            notes: Vec::new(),
        }))
    }
}

/// Appends an episode's rows and returns the values of its numeric features.
fn write_rows(
    set: &mut Set,
    recording: &Recording,
    learning: &Learning<'_>,
    rows: &[usize],
    (episode, task): (usize, usize),
    scratch: &mut Scratch,
) -> anyhow::Result<BTreeMap<String, Gathered>> {
    let layout = set.layout.clone().context("a layout")?;
    let rate = f64::from(layout.rate);
    let narrow = |values: Vec<f64>| values.into_iter().map(|v| v as f32).collect::<Vec<f32>>();
    let mut gathered: BTreeMap<String, Gathered> = BTreeMap::new();
    scratch.file.rewind()?;
    let mut reader = std::io::BufReader::new(&scratch.file);
    let mut picture = 0;
    for (number, block) in rows.chunks(BLOCK).enumerate() {
        let mut cells = Vec::new();
        for camera in layout.cameras.keys() {
            let mut images = Vec::with_capacity(block.len());
            for i in 0..block.len() {
                let mut bytes = vec![0; scratch.lengths[picture]];
                reader.read_exact(&mut bytes)?;
                picture += 1;
                let frame = number * BLOCK + i;
                images.push((bytes, format!("{camera}-{episode:06}-{frame:06}.png")));
            }
            cells.push(Cells::Image(images));
        }
        let state: Vec<f32> = block
            .iter()
            .flat_map(|&r| narrow(learning.state(r)))
            .collect();
        let action: Vec<f32> = block
            .iter()
            .flat_map(|&r| narrow(learning.action(r)))
            .collect();
        cells.push(Cells::F32(vec![learning::state_names().len()], state));
        cells.push(Cells::F32(vec![learning::action_names().len()], action));
        let frame = |i: usize| number * BLOCK + i;
        let next = |i: usize| rows[(frame(i) + 1).min(rows.len() - 1)];
        let n = block.len();
        let flags = |f: &dyn Fn(usize) -> bool| Cells::Bool((0..n).map(f).collect());
        let integers =
            |f: &dyn Fn(usize) -> usize| Cells::I64(vec![], (0..n).map(|i| f(i) as i64).collect());
        let label = |i: usize| usize::from(recording.labels[block[i]]);
        let reward = |i: usize| f32::from(u8::from(learning.success(next(i))));
        cells.push(Cells::F32(vec![], (0..n).map(reward).collect()));
        cells.push(flags(&|i| frame(i) + 1 == rows.len()));
        cells.push(flags(&|i| learning.success(next(i))));
        cells.push(integers(&label));
        cells.push(integers(&label));
        let stamps = &recording.aligned.stamps;
        cells.push(Cells::F64(
            vec![],
            block.iter().map(|&r| stamps[r] as f64 * 1e-9).collect(),
        ));
        let timestamps = (0..n).map(|i| (frame(i) as f64 / rate) as f32).collect();
        cells.push(Cells::F32(vec![], timestamps));
        cells.push(integers(&frame));
        cells.push(integers(&|_| episode));
        let start = set.rows;
        cells.push(integers(&|i| start + frame(i)));
        cells.push(integers(&|_| task));
        for (field, cell) in layout.fields().iter().zip(&cells) {
            let (width, values): (usize, Vec<f32>) = match cell {
                Cells::F32(shape, v) => (shape.first().copied().unwrap_or(1), v.clone()),
                Cells::F64(_, v) => (1, v.iter().map(|&v| v as f32).collect()),
                Cells::I64(_, v) => (1, v.iter().map(|&v| v as f32).collect()),
                Cells::Bool(v) => (1, v.iter().map(|&v| f32::from(u8::from(v))).collect()),
                Cells::Text(_) | Cells::Image(_) => continue,
            };
            gathered
                .entry(field.name.clone())
                .or_insert_with(|| Gathered::numbers(width))
                .merge(&Gathered::Numbers(width, values));
        }
        set.data.as_mut().context("a data file")?.append(cells)?;
    }
    Ok(gathered)
}

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

fn metadata(folder: &Path, set: &Set, layout: &Layout) -> anyhow::Result<()> {
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
