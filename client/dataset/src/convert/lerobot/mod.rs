//! A LeRobot data set, version 3.0: pictures in Parquet, tasks, episodes,
//! statistics. The whole set is made under another name and renamed at the end.
//!
//! An episode's pictures are encoded into a scratch file first, so that a
//! recording that turns out unreadable leaves nothing behind in the set.

mod layout;
mod metadata;
mod statistics;
mod table;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhow::Context;

use self::layout::{Layout, image_key};
use self::metadata::metadata;
use self::statistics::Gathered;
use self::table::{Cells, Table};
use super::batch::parallel;
use super::intrinsics;
use super::learning::{self, Learning};
use super::{Format, PendingFolder, Recording, Size, Written, png_rgb, scaled};

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
    /// Intrinsics of the first episode's cameras, for pictures of the set's size.
    calibration: serde_json::Value,
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
                calibration: serde_json::Value::Null,
            }),
        })
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
        let cameras = learning::cameras(recording, self.size);
        let layout = Layout { rate, cameras };
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
        if set.layout.is_none() {
            set.calibration = intrinsics::cameras(recording, self.size);
        }
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
