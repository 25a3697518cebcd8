//! A LeRobot data set, version 3.0: images as video or in Parquet, tasks,
//! episodes, statistics. The whole set is made under another name and renamed at
//! the end.
//!
//! An episode's images are encoded into scratch files first, so that an
//! unreadable recording leaves no data in the set.

mod card;
mod depth_code;
mod language;
mod layout;
mod metadata;
mod set;
mod statistics;
mod table;
mod video;
mod video_concat;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use parking_lot::Mutex;

use self::language::Spoken;
use self::layout::{Block, ImageFeature, Layout, Streams, numbers};
use self::metadata::metadata;
use self::set::{EpisodeRow, Set};
use self::statistics::Gathered;
use self::table::{Cells, Column};
use self::video::Ffmpeg;
pub use self::video::ImageFormat;
use super::batch::parallel;
use super::ffmpeg::Stream;
use super::intrinsics;
use super::learning::{self, Learning, RowOptions};
use super::{Format, PendingFolder, Recording, Sees, Size, Written, png_depth, png_rgb, scaled};
use crate::credits::PackCredits;

/// Rows that are encoded, and written as one row group, together.
const BLOCK: usize = 32;
/// About this many pixels of an image are counted in the statistics.
const COUNTED_PIXELS: usize = 20_000;

/// And this many of a depth image: its values are kept.
const COUNTED_DEPTHS: usize = 300;

/// Options of a data set.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeRobotOptions {
    /// Size of colour images; as recorded without it.
    pub size: Option<Size>,
    /// Rows of state and action.
    pub rows: RowOptions,
    /// With the columns `language_persistent` and `language_events`, which LeRobot
    /// reads from 0.6 on and older versions reject.
    pub language: bool,
    /// How images are stored.
    pub image_format: ImageFormat,
    /// With the depth sensors' images; exact depth is never exported.
    pub depth: bool,
}

/// Writes one data set.
pub struct LeRobot {
    options: LeRobotOptions,
    ffmpeg: Option<Ffmpeg>,
    threads: usize,
    set: Mutex<Set>,
}

impl LeRobot {
    /// A data set at `out`.
    ///
    /// # Errors
    /// When `out` exists already, or no ffmpeg makes such videos.
    pub fn new(out: &Path, options: LeRobotOptions, threads: usize) -> anyhow::Result<Self> {
        Ok(Self {
            options,
            ffmpeg: Ffmpeg::find(options.image_format, options.depth)?,
            threads,
            set: Mutex::new(Set::new(PendingFolder::new(out)?)),
        })
    }
}

/// Statistics of features, by name.
type Statistics = BTreeMap<String, Gathered>;

/// PNG images of one episode in a file whose name is removed at once.
struct Scratch {
    file: File,
    lengths: Vec<usize>,
}

impl Scratch {
    fn new(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join(".images");
        let file = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(true)
            .open(&path)?;
        // The system removes it with its last handle.
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
        learning::reads(stream)
    }

    fn collects(&self) -> bool {
        true
    }

    fn add(&self, recording: &Recording, tick: &(dyn Fn() + Sync)) -> anyhow::Result<Written> {
        let options = &self.options;
        let sees = match options.depth {
            true => Sees::ColourAndDepth,
            false => Sees::Colour,
        };
        let (rate, learning) = Learning::on_grid(recording, &options.rows, sees)?;
        let streams = Streams::from_recording(recording, options.size, options.depth)?;
        let mut layout = Layout::for_recording(recording, rate, streams, options.rows.action);
        layout.language = options.language;
        layout.colour = self.ffmpeg.as_ref().map(|ffmpeg| ffmpeg.colour);
        let set = &mut *self.set.lock();
        if let Some(first) = &set.layout {
            first.body.ensure_same(&layout.body)?;
            anyhow::ensure!(
                (first.rate, &first.streams) == (layout.rate, &layout.streams),
                "rate or images differ from those of the first episode ({} Hz, {:?}, here {} Hz, {:?}); --size makes sizes equal",
                first.rate,
                first.streams,
                layout.rate,
                layout.streams
            );
        }

        // Everything that can fail because of the recording is done first.
        let spoken = match options.language {
            true => Some(Spoken::read(
                recording,
                &learning,
                &layout.streams.cameras,
                rate,
            )?),
            false => None,
        };
        let rows = &learning.rows;
        let packs = PackCredits::of_episode(&recording.episode)?;
        let mut scratch = Scratch::new(set.folder.path())?;
        let mut films = self.films(set, &layout)?;
        let mut statistics =
            self.encode(recording, &layout, rows, &mut scratch, &mut films, tick)?;
        let mut filmed = Vec::new();
        for Film { key, name, stream } in films {
            filmed.push((key, name, stream.finish()?));
        }

        if set.layout.is_none() {
            set.layout = Some(layout.clone());
        }
        let task = set.task(&recording.summary.instruction);
        let episode = set.episodes.len();
        let calibration = intrinsics::cameras(recording, options.size);
        let known = set.calibrations.iter_mut();
        match { known }.find(|(known, _)| *known == calibration) {
            Some((_, episodes)) => episodes.push(episode),
            None => set.calibrations.push((calibration, vec![episode])),
        }
        for pack in packs {
            if !set.packs.contains(&pack) {
                set.packs.push(pack);
            }
        }
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
        let mut videos = BTreeMap::new();
        for (key, name, bytes) in filmed {
            let videos_of_feature = set.video_concats.entry(key.clone()).or_default();
            videos.insert(key, videos_of_feature.add(name, rows.len(), bytes));
        }
        set.finish_episode(EpisodeRow {
            task: recording.summary.instruction.clone(),
            length: rows.len(),
            file: set.file,
            from: set.rows,
            label: recording.summary.label.clone(),
            success: recording.summary.success,
            videos,
            statistics,
        })?;
        self.close_reels(set, &layout, false)?;
        Ok(Written {
            path: PathBuf::from(format!("episode {episode}")),
            samples: rows.len(),
            notes: learning.notes.clone(),
        })
    }

    fn finish(self: Box<Self>) -> anyhow::Result<Option<Written>> {
        let mut set = self.set.lock();
        if let Some(table) = set.data.take() {
            table.close()?;
        }
        let Some(layout) = set.layout.clone() else {
            anyhow::bail!("no episode could be exported: no data set was written");
        };
        self.close_reels(&mut set, &layout, true)?;
        metadata(set.folder.path(), &set, &layout)?;
        card::write(set.folder.path(), &set)?;
        drop(set);
        let set = self.set.into_inner();
        Ok(Some(Written {
            samples: set.rows,
            path: set.folder.commit()?,
            notes: Vec::new(),
        }))
    }
}

impl LeRobot {
    /// Begins a video of every feature that becomes one.
    fn films(&self, set: &mut Set, layout: &Layout) -> anyhow::Result<Vec<Film>> {
        let mut films = Vec::new();
        let Some(ffmpeg) = &self.ffmpeg else {
            return Ok(films);
        };
        let folder = set.scratch();
        std::fs::create_dir_all(&folder)?;
        for feature in layout.image_features() {
            let Some(codec) = feature.codec else {
                continue;
            };
            let name = format!("{}.mp4", set.films);
            set.films += 1;
            let stream = ffmpeg.begin(codec, feature.size, layout.rate, &folder.join(&name))?;
            films.push(Film {
                key: feature.key,
                name,
                stream,
            });
        }
        Ok(films)
    }

    /// Puts the videos that are full, or all of them, into the set.
    fn close_reels(&self, set: &mut Set, layout: &Layout, all: bool) -> anyhow::Result<()> {
        let Some(ffmpeg) = &self.ffmpeg else {
            return Ok(());
        };
        let (scratch, folder) = (set.scratch(), set.folder.path());
        for (key, videos_of_feature) in &mut set.video_concats {
            if all || videos_of_feature.is_full() {
                videos_of_feature.close(ffmpeg, &scratch, folder, key, layout.rate)?;
            }
        }
        if all {
            std::fs::remove_dir_all(&scratch)?;
        }
        Ok(())
    }

    /// Encodes an episode's images, block by block and camera by camera, and
    /// returns their statistics.
    fn encode(
        &self,
        recording: &Recording,
        layout: &Layout,
        rows: &[usize],
        scratch: &mut Scratch,
        films: &mut [Film],
        tick: &(dyn Fn() + Sync),
    ) -> anyhow::Result<Statistics> {
        let mut gathered: Statistics = layout
            .image_features()
            .map(|p| match p.is_depth {
                true => (p.key, Gathered::depths()),
                false => (p.key, Gathered::colours()),
            })
            .collect();
        for block in rows.chunks(BLOCK) {
            for feature in layout.image_features() {
                let encoded = parallel(block.len(), self.threads, |i| {
                    frame(recording, &feature, block[i])
                })?;
                let mut film = films.iter_mut().find(|film| film.key == feature.key);
                for (bytes, counts) in &encoded {
                    match &mut film {
                        Some(film) => film.stream.put(bytes)?,
                        None => scratch.put(bytes)?,
                    }
                    if let Some(all) = gathered.get_mut(&feature.key) {
                        all.merge(counts);
                    }
                }
            }
            block.iter().for_each(|_| tick());
        }
        Ok(gathered)
    }
}

/// A feature's images of one episode on their way into a video.
struct Film {
    key: String,
    name: String,
    stream: Stream,
}

/// An image as a video needs it, raw, or as PNG; and its part of the statistics.
fn frame(
    recording: &Recording,
    feature: &ImageFeature<'_>,
    row: usize,
) -> anyhow::Result<(Vec<u8>, Gathered)> {
    let size = feature.size;
    let pixels = size.width * size.height;
    if feature.is_depth {
        let (source, index) = recording.sensed_depth(feature.camera, row)?;
        let depth = source.depth(&recording.episode, index)?;
        let mut counts = Gathered::depths();
        let step = pixels / COUNTED_DEPTHS;
        let bytes = if feature.codec.is_some() {
            // The statistics are of the decoded values.
            let quantized: Vec<f32> = depth.iter().map(|&d| depth_code::quantized(d)).collect();
            counts.depth(&quantized, step);
            depth_code::frame(&depth)
        } else {
            counts.depth(&depth, step);
            png_depth(&depth, size)?
        };
        return Ok((bytes, counts));
    }
    let (source, index) = recording.observed(feature.camera, row)?;
    let (width, height) = source.size().context("a size")?;
    let rgb = source.rgb(&recording.episode, index)?;
    let rgb = scaled(rgb, Size { width, height }, size);
    let mut counts = Gathered::colours();
    counts.image(&rgb, pixels / COUNTED_PIXELS);
    let bytes = match feature.codec {
        Some(_) => rgb,
        None => png_rgb(&rgb, size)?,
    };
    Ok((bytes, counts))
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
        for feature in layout.image_features().filter(|p| p.codec.is_none()) {
            let mut images = Vec::with_capacity(count);
            for frame in first..first + count {
                let mut bytes = vec![0; *lengths.next().context("an image")?];
                reader.read_exact(&mut bytes)?;
                let what = ["", "-depth"][usize::from(feature.is_depth)];
                let camera = feature.camera;
                let name = format!("{camera}{what}-{:06}-{frame:06}.png", whole.episode);
                images.push((bytes, name));
            }
            columns.push(Column {
                name: feature.key,
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
        Cells::Text(..) | Cells::Image(_) | Cells::Annotation(..) => return,
    };
    gathered
        .entry(column.name.clone())
        .or_insert_with(|| Gathered::numbers(width))
        .merge(&Gathered::Numbers(width, values));
}
