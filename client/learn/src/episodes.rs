//! Reads episodes of `wheelarm dataset export --format tensors`.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use safetensors::SafeTensors;
use safetensors::tensor::Dtype;
use serde::Deserialize;

use wheelarm_policy::worlds::{SHIPPED, Used, Worlds};
use wheelarm_proto::installed::file_or_asset;

use crate::card::KEY;

/// Supported version of the layout.
const LAYOUT: &str = "wheelarm-tensors/1";
/// Least deviation of a number, in its own unit, so that nearly constant numbers are not
/// amplified.
pub const LEAST_DEVIATION: f32 = 0.01;

/// Metadata of an episode.
#[derive(Clone, Debug, Deserialize)]
pub struct About {
    layout: String,
    /// Label of the episode.
    pub label: String,
    /// The instruction.
    pub instruction: String,
    /// Task.
    pub task: String,
    /// Seed of the scenario.
    pub seed: u64,
    /// Whether the task succeeded.
    pub success: bool,
    /// Rows per second.
    pub rate_hz: f64,
    /// Name of the robot.
    pub robot: String,
    /// Kind of action.
    pub action: String,
    /// Names of the numbers of a state.
    pub state_names: Vec<String>,
    /// Names of the numbers of an action.
    pub action_names: Vec<String>,
    /// Units of the numbers of an action.
    pub action_units: Vec<String>,
    /// Names of WheelArm-Sim's columns; `None` without an IMU in the recording.
    pub table_names: Option<Vec<String>>,
    /// What it uses of homes, objects, words and looks; `None` in exports of earlier versions.
    #[serde(default)]
    pub world: Option<Used>,
}

/// A table of numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Numbers of a row.
    pub width: usize,
    /// Values, row by row.
    pub values: Vec<f32>,
}

impl Table {
    /// One row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.width..(row + 1) * self.width]
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.values.len() / self.width.max(1)
    }
}

/// Position and size of one camera's images in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraImages {
    /// Height, pixels.
    pub height: usize,
    /// Width, pixels.
    pub width: usize,
    bytes: Range<usize>,
}

/// One episode.
#[derive(Clone, Debug)]
pub struct Episode {
    /// Its metadata.
    pub about: About,
    /// Rows of state.
    pub states: Table,
    /// Rows of action.
    pub actions: Table,
    /// WheelArm-Sim's columns, where the recording has an IMU; NaN in rows without a sample.
    pub table: Option<Table>,
    /// Color images by camera.
    pub cameras: BTreeMap<String, CameraImages>,
    /// Depth by camera, where it was exported (`--depth`).
    pub depths: BTreeMap<String, CameraImages>,
    file: Vec<u8>,
}

impl Episode {
    /// Reads a file.
    ///
    /// # Errors
    /// When the file is not an episode, or damaged.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let name = || path.display().to_string();
        let file = std::fs::read(path).with_context(name)?;
        let (header, metadata) = SafeTensors::read_metadata(&file).with_context(name)?;
        let about = metadata.metadata().as_ref().and_then(|m| m.get(KEY));
        let about = about.with_context(|| {
            format!(
                "{} is not an episode: write one with `wheelarm dataset export --format tensors`",
                path.display()
            )
        })?;
        let about: About = serde_json::from_str(about).with_context(name)?;
        ensure!(
            about.layout == LAYOUT,
            "{} has the layout {:?}, expected {LAYOUT:?}: export it again",
            path.display(),
            about.layout
        );
        let tensors = SafeTensors::deserialize(&file).with_context(name)?;
        let table = |what: &str| -> anyhow::Result<Table> {
            let view = tensors.tensor(what).with_context(name)?;
            let &[_, width] = view.shape() else {
                bail!("{}: {what} is not a table", path.display())
            };
            ensure!(
                view.dtype() == Dtype::F32 && width > 0,
                "{}: {what} is not of single precision",
                path.display()
            );
            let numbers = view.data().chunks_exact(4);
            let numbers = numbers.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
            let values: Vec<f32> = numbers.collect();
            ensure!(
                what == "table" || values.iter().all(|v| v.is_finite()),
                "{}: {what} has numbers that are not finite",
                path.display()
            );
            Ok(Table { width, values })
        };
        let (states, actions) = (table("states")?, table("actions")?);
        let has_table = about.table_names.is_some();
        let table = has_table.then(|| table("table")).transpose()?;
        let (mut cameras, mut depths) = (BTreeMap::new(), BTreeMap::new());
        for name in tensors.names() {
            if let Some(camera) = name.strip_prefix("depth.") {
                let info = metadata.info(name).context("a tensor")?;
                let &[count, height, width] = info.shape.as_slice() else {
                    bail!("{}: {name} is not depth", path.display())
                };
                ensure!(
                    info.dtype == Dtype::U16 && count == states.rows() && height * width > 0,
                    "{}: {count} depths of {camera} and {} rows",
                    path.display(),
                    states.rows()
                );
                let (from, to) = info.data_offsets;
                let images = CameraImages {
                    height,
                    width,
                    bytes: header + 8 + from..header + 8 + to,
                };
                depths.insert(camera.to_owned(), images);
                continue;
            }
            let Some(camera) = name.strip_prefix("pictures.") else {
                continue;
            };
            let info = metadata.info(name).context("a tensor")?;
            let &[count, height, width, 3] = info.shape.as_slice() else {
                bail!("{}: {name} is not color images", path.display())
            };
            ensure!(
                info.dtype == Dtype::U8 && count == states.rows(),
                "{}: {count} images of {camera} and {} rows",
                path.display(),
                states.rows()
            );
            let (from, to) = info.data_offsets;
            // After the length of the header and the header.
            let bytes = header + 8 + from..header + 8 + to;
            let images = CameraImages {
                height,
                width,
                bytes,
            };
            cameras.insert(camera.to_owned(), images);
        }
        let rows = [Some(actions.rows()), table.as_ref().map(Table::rows)];
        ensure!(
            rows.into_iter().flatten().all(|r| r == states.rows()) && states.rows() > 0,
            "{}: its tables are empty or differ in their number of rows",
            path.display()
        );
        ensure!(
            states.width == about.state_names.len() && actions.width == about.action_names.len(),
            "{}: the width of a table differs from its number of names",
            path.display()
        );
        Ok(Self {
            about,
            states,
            actions,
            table,
            cameras,
            depths,
            file,
        })
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.states.rows()
    }

    /// A color image: bytes of red, green, blue from the top left.
    ///
    /// # Panics
    /// Without that camera or row.
    #[must_use]
    pub fn image(&self, camera: &str, row: usize) -> &[u8] {
        let images = &self.cameras[camera];
        let size = images.height * images.width * 3;
        let from = images.bytes.start + row * size;
        &self.file[from..from + size]
    }

    /// Depth of a row from the top left, millimetres; 0 without a surface.
    ///
    /// # Panics
    /// Without depth of that camera or that row.
    pub fn depth(&self, camera: &str, row: usize) -> impl Iterator<Item = u16> {
        let images = &self.depths[camera];
        let size = images.height * images.width * 2;
        let from = images.bytes.start + row * size;
        let pairs = self.file[from..from + size].chunks_exact(2);
        pairs.map(|b| u16::from_le_bytes([b[0], b[1]]))
    }
}

/// Episode files below the folders, sorted.
///
/// # Errors
/// When a folder cannot be read, or no file exists.
pub fn files(folders: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut open: Vec<PathBuf> = folders.to_vec();
    while let Some(path) = open.pop() {
        let is_episode = path.extension().is_some_and(|e| e == "safetensors");
        if path.is_dir() {
            let entries = std::fs::read_dir(&path).with_context(|| path.display().to_string())?;
            for entry in entries {
                open.push(entry?.path());
            }
        } else if is_episode {
            found.push(path);
        }
    }
    found.sort();
    ensure!(
        !found.is_empty(),
        "no *.safetensors in {folders:?}: write them with `wheelarm dataset export --format tensors RECORDINGS --out FOLDER`"
    );
    Ok(found)
}

/// Reads the shipped file of what is kept for tests.
///
/// # Errors
/// When it is missing, or was changed.
pub fn shipped_worlds() -> anyhow::Result<Worlds> {
    let path = file_or_asset(Path::new(SHIPPED));
    let read =
        || -> anyhow::Result<Worlds> { Ok(Worlds::parse(&std::fs::read_to_string(&path)?)?) };
    read().with_context(|| format!("cannot read {}", path.display()))
}

/// Rejects episodes that no training may use: of homes, objects, words, looks or seeds that are
/// kept for tests.
///
/// # Errors
/// With the episode and the fix.
pub fn check_training(episodes: &[Episode], worlds: &Worlds) -> anyhow::Result<()> {
    for episode in episodes {
        let about = &episode.about;
        // Of earlier exports only the seed is known.
        let used = about.world.clone().unwrap_or_default();
        let used = Used {
            seed: Some(about.seed),
            ..used
        };
        if let Err(reason) = worlds.check_episode(&used) {
            bail!(
                "{}: {reason} ({SHIPPED}, {}), and this is training; leave out this episode, or train on episodes of a plan with purpose = \"train\"",
                about.label,
                worlds.hash()
            );
        }
    }
    Ok(())
}

/// Reads all successful episodes.
///
/// # Errors
/// When a file is not an episode, or episodes differ in columns, rate or images.
pub fn read(folders: &[PathBuf]) -> anyhow::Result<Vec<Episode>> {
    let mut all: Vec<Episode> = Vec::new();
    for path in files(folders)? {
        let episode = Episode::read(&path)?;
        if !episode.about.success {
            continue;
        }
        if let Some(first) = all.first() {
            let (a, b) = (&first.about, &episode.about);
            let sizes = |e: &Episode| -> Vec<_> {
                let cameras = e.cameras.iter();
                cameras
                    .map(|(name, p)| (name.clone(), p.height, p.width))
                    .collect()
            };
            ensure!(
                a.action == b.action
                    && a.action_names == b.action_names
                    && a.state_names == b.state_names
                    && a.table_names == b.table_names
                    && a.rate_hz == b.rate_hz
                    && sizes(first) == sizes(&episode),
                "{} differs from {} in its columns, rate or images: export all with equal options",
                path.display(),
                a.label
            );
        }
        all.push(episode);
    }
    ensure!(!all.is_empty(), "no episode succeeded");
    Ok(all)
}
