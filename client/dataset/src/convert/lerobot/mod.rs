//! A LeRobot data set, version 3.0: pictures in Parquet, tasks, episodes,
//! statistics. The whole set is made under another name and renamed at the end.
//!
//! An episode's pictures are encoded into a scratch file first, so that a
//! recording that turns out unreadable leaves nothing behind in the set.

mod language;
mod layout;
mod metadata;
mod set;
mod statistics;
mod table;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use parking_lot::Mutex;

use self::language::Spoken;
use self::layout::{Block, Layout, numbers};
use self::metadata::metadata;
use self::set::{EpisodeRow, Set};
use self::statistics::Gathered;
use self::table::{Cells, Column};
use super::batch::parallel;
use super::intrinsics;
use super::learning::{self, Learning, RowOptions};
use super::{Format, PendingFolder, Recording, Size, Written, png_depth, png_rgb, scaled};

/// Rows that are encoded, and written as one row group, together.
const BLOCK: usize = 32;
/// About this many pixels of a picture are counted in the statistics.
const COUNTED_PIXELS: usize = 20_000;

/// And this many of a depth picture: its values are kept.
const COUNTED_DEPTHS: usize = 300;

/// Writes one data set.
pub struct LeRobot {
    size: Option<Size>,
    rows: RowOptions,
    language: bool,
    threads: usize,
    set: Mutex<Set>,
}

impl LeRobot {
    /// A data set at `out`; pictures are scaled to `size` when it is given.
    ///
    /// # Errors
    /// When `out` exists already.
    pub fn new(
        out: &Path,
        size: Option<Size>,
        rows: RowOptions,
        threads: usize,
    ) -> anyhow::Result<Self> {
        Ok(Self {
            size,
            rows,
            language: false,
            threads,
            set: Mutex::new(Set::new(PendingFolder::new(out)?)),
        })
    }
}

impl LeRobot {
    /// With the columns `language_persistent` and `language_events`, which LeRobot
    /// reads from 0.6 on and older ones refuse.
    #[must_use]
    pub fn with_language(mut self, language: bool) -> Self {
        self.language = language;
        self
    }
}

/// Statistics of features, by name.
type Statistics = BTreeMap<String, Gathered>;

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
        let (rate, learning) = Learning::on_grid(recording, &self.rows)?;
        let cameras = learning::cameras(recording, self.size);
        let depths = recording.depth_sensors();
        let mut layout = Layout::of(recording, rate, cameras, depths, self.rows.action);
        layout.language = self.language;
        anyhow::ensure!(!layout.cameras.is_empty(), "the episode has no pictures");
        let set = &mut *self.set.lock();
        if let Some(first) = &set.layout {
            first.body.ensure_same(&layout.body)?;
            anyhow::ensure!(
                (first.rate, &first.cameras, &first.depths)
                    == (layout.rate, &layout.cameras, &layout.depths),
                "rate or pictures differ from those of the first episode ({} Hz, {:?}, here {} Hz, {:?}); --size makes sizes equal",
                first.rate,
                first.cameras,
                layout.rate,
                layout.cameras
            );
        }

        // Everything that can fail because of the recording comes first.
        let spoken = match self.language {
            true => Some(Spoken::of(recording, &learning, &layout.cameras, rate)?),
            false => None,
        };
        let rows = &learning.rows;
        let mut scratch = Scratch::new(set.folder.path())?;
        let mut statistics = self.encode(recording, &layout, rows, &mut scratch, tick)?;

        if set.layout.is_none() {
            set.calibration = intrinsics::cameras(recording, self.size);
            set.layout = Some(layout.clone());
        }
        let task = set.task(&recording.summary.instruction);
        let episode = set.episodes.len();
        let whole = Block {
            recording,
            learning: &learning,
            part: (0, 0),
            rate,
            episode,
            task,
            before: set.rows,
        };
        statistics.extend(write_rows(
            set,
            &layout,
            &whole,
            &mut scratch,
            spoken.as_ref(),
        )?);
        set.finish_episode(EpisodeRow {
            task: recording.summary.instruction.clone(),
            length: rows.len(),
            file: set.file,
            from: set.rows,
            label: recording.summary.label.clone(),
            success: recording.summary.success,
            statistics,
        })?;
        Ok(Written {
            path: PathBuf::from(format!("episode {episode}")),
            samples: rows.len(),
            notes: learning.notes.clone(),
        })
    }

    fn finish(self: Box<Self>) -> anyhow::Result<Option<Written>> {
        let mut set = self.set.into_inner();
        if let Some(table) = set.data.take() {
            table.close()?;
        }
        let Some(layout) = &set.layout else {
            anyhow::bail!("no episode could be taken: there is no data set");
        };
        metadata(set.folder.path(), &set, layout)?;
        Ok(Some(Written {
            samples: set.rows,
            path: set.folder.commit()?,
            notes: Vec::new(),
        }))
    }
}

impl LeRobot {
    /// Encodes an episode's pictures, block by block and camera by camera, and
    /// returns their statistics.
    fn encode(
        &self,
        recording: &Recording,
        layout: &Layout,
        rows: &[usize],
        scratch: &mut Scratch,
        tick: &(dyn Fn() + Sync),
    ) -> anyhow::Result<Statistics> {
        let mut gathered: Statistics = layout
            .pictures()
            .map(|p| match p.is_depth {
                true => (p.key, Gathered::depths()),
                false => (p.key, Gathered::colours()),
            })
            .collect();
        for block in rows.chunks(BLOCK) {
            for pictures in layout.pictures() {
                let size = pictures.size;
                let encoded = parallel(block.len(), self.threads, |i| {
                    if pictures.is_depth {
                        let (source, index) = recording.sensed_depth(pictures.camera, block[i])?;
                        let depth = source.depth(&recording.episode, index)?;
                        let mut counts = Gathered::depths();
                        counts.depth(&depth, size.width * size.height / COUNTED_DEPTHS);
                        return Ok((png_depth(&depth, size)?, counts));
                    }
                    let (source, index) = recording.seen(pictures.camera, block[i])?;
                    let (width, height) = source.size().context("a size")?;
                    let rgb = source.rgb(&recording.episode, index)?;
                    let rgb = scaled(rgb, Size { width, height }, size);
                    let mut counts = Gathered::colours();
                    counts.picture(&rgb, size.width * size.height / COUNTED_PIXELS);
                    Ok((png_rgb(&rgb, size)?, counts))
                })?;
                for (png, counts) in &encoded {
                    scratch.put(png)?;
                    if let Some(all) = gathered.get_mut(&pictures.key) {
                        all.merge(counts);
                    }
                }
            }
            block.iter().for_each(|_| tick());
        }
        Ok(gathered)
    }
}

/// Appends an episode's rows and returns the statistics of its numeric features.
fn write_rows(
    set: &mut Set,
    layout: &Layout,
    whole: &Block<'_>,
    scratch: &mut Scratch,
    spoken: Option<&Spoken>,
) -> anyhow::Result<Statistics> {
    let mut gathered = Statistics::new();
    scratch.file.rewind()?;
    let mut reader = std::io::BufReader::new(&scratch.file);
    let mut lengths = scratch.lengths.iter();
    let all = whole.learning.rows.len();
    for first in (0..all).step_by(BLOCK) {
        let count = BLOCK.min(all - first);
        let mut columns = Vec::new();
        for pictures in layout.pictures() {
            let mut images = Vec::with_capacity(count);
            for frame in first..first + count {
                let mut bytes = vec![0; *lengths.next().context("a picture")?];
                reader.read_exact(&mut bytes)?;
                let what = ["", "-depth"][usize::from(pictures.is_depth)];
                let camera = pictures.camera;
                let name = format!("{camera}{what}-{:06}-{frame:06}.png", whole.episode);
                images.push((bytes, name));
            }
            columns.push(Column {
                name: pictures.key,
                cells: Cells::Image(images),
            });
        }
        let numbers = numbers(&Block {
            part: (first, count),
            ..*whole
        });
        for column in &numbers {
            gather(&mut gathered, column);
        }
        columns.extend(numbers);
        columns.extend(spoken.into_iter().flat_map(|s| s.columns((first, count))));
        set.append(layout, columns)?;
    }
    Ok(gathered)
}

/// Adds the values of a numeric column to the statistics.
fn gather(gathered: &mut Statistics, column: &Column) {
    let (width, values): (usize, Vec<f32>) = match &column.cells {
        Cells::F32(shape, v) => (shape.first().copied().unwrap_or(1), v.clone()),
        Cells::F64(_, v) => (1, v.iter().map(|&v| v as f32).collect()),
        Cells::I64(_, v) => (1, v.iter().map(|&v| v as f32).collect()),
        Cells::Bool(v) => (1, v.iter().map(|&v| f32::from(u8::from(v))).collect()),
        Cells::Text(..) | Cells::Image(_) | Cells::Said(..) => return,
    };
    gathered
        .entry(column.name.clone())
        .or_insert_with(|| Gathered::numbers(width))
        .merge(&Gathered::Numbers(width, values));
}
