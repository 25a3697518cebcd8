//! The features of a set, each defined once: its name, its type and shape, and how
//! its values are read from an episode.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use wheelarm_policy::{ActionKind, state_names};

use super::table::{Cells, Column};
use super::video::Codec;
use crate::convert::learning::{self, Body, Learning};
use crate::convert::{Recording, Size};

/// A data file is closed after the episode with which it passes this size.
pub(super) const FILE_BYTES: usize = 100 << 20;
/// And a video.
pub(super) const VIDEO_BYTES: u64 = 200 << 20;
/// Files in one folder.
pub(super) const FOLDER_FILES: usize = 1000;

/// Rate, cameras and robot of the set.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    /// Rows per second.
    pub rate: u32,
    /// Cameras and depth sensors.
    pub streams: Streams,
    /// Codec of colour; without it images are stored in Parquet.
    pub colour: Option<Codec>,
    /// The robot.
    pub body: Body,
    /// Names of the values of [`VECTORS`].
    pub names: [Vec<String>; 3],
    /// Rays of the laser scans; 0 without.
    pub rays: usize,
    /// With the two columns of language.
    pub language: bool,
}

/// Images of the set.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Streams {
    /// Cameras with the size of their images.
    pub cameras: BTreeMap<String, Size>,
    /// Cameras with a depth sensor, and the size of its images.
    pub depths: BTreeMap<String, Size>,
}

impl Streams {
    /// The one place that decides which images of a recording are observed: of
    /// every camera the colour that the robot saw (`Recording::observed`), and with
    /// `depth` images of depth sensors, never exact depth.
    ///
    /// # Errors
    /// When no image exists, or no depth sensor where depth is requested.
    pub fn from_recording(
        recording: &Recording,
        size: Option<Size>,
        depth: bool,
    ) -> anyhow::Result<Self> {
        let cameras = learning::cameras(recording, size);
        anyhow::ensure!(!cameras.is_empty(), "the episode has no images");
        let mut depths = BTreeMap::new();
        if depth {
            depths = recording.depth_sensors();
            anyhow::ensure!(
                !depths.is_empty(),
                "{}: no depth sensor was on, and exact depth is never exported, since no robot has it: record with --sensor kinova_vision@gen3 (or another model of assets/sensors), or leave --depth out",
                recording.summary.label
            );
        }
        Ok(Self { cameras, depths })
    }
}

/// A feature of images.
pub(super) struct ImageFeature<'a> {
    /// Its name.
    pub key: String,
    /// The camera that it is of.
    pub camera: &'a str,
    /// Size of its images.
    pub size: Size,
    /// Depth by the camera's depth sensor, millimetres; else colour.
    pub is_depth: bool,
    /// Its codec; PNG in Parquet without it.
    pub codec: Option<Codec>,
}

impl ImageFeature<'_> {
    /// Colours or grey levels of a pixel.
    fn channels(&self) -> usize {
        if self.is_depth { 1 } else { 3 }
    }
}

/// Some rows of an episode, with what they are in the set.
pub(super) struct Block<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// All rows that the episode has in the set: state and action.
    pub learning: &'a Learning<'a>,
    /// The first row and the number of rows.
    pub part: (usize, usize),
    /// Rows per second.
    pub rate: u32,
    /// Number of the episode.
    pub episode: usize,
    /// Number of its task.
    pub task: usize,
    /// Rows of the set before the episode.
    pub before: usize,
}

impl Block<'_> {
    /// Number of a row within the episode.
    fn frame(&self, i: usize) -> usize {
        self.part.0 + i
    }

    /// The row of the alignment.
    fn row(&self, i: usize) -> usize {
        self.learning.rows[self.frame(i)]
    }

    /// The row after it; the last one is its own.
    fn next(&self, i: usize) -> usize {
        let rows = &self.learning.rows;
        rows[(self.frame(i) + 1).min(rows.len() - 1)]
    }

    fn is_last(&self, i: usize) -> bool {
        self.frame(i) + 1 == self.learning.rows.len()
    }

    fn incident(&self, i: usize) -> usize {
        self.learning.incidents[self.frame(i)]
    }

    fn label(&self, i: usize) -> usize {
        usize::from(self.recording.labels[self.row(i)])
    }
}

/// Type of a flat feature, and how its value is read from a row of a block.
enum Flat {
    F32(fn(&Block<'_>, usize) -> f32),
    F64(fn(&Block<'_>, usize) -> f64),
    I64(fn(&Block<'_>, usize) -> usize),
    Bool(fn(&Block<'_>, usize) -> bool),
}

impl Flat {
    fn dtype(&self) -> &'static str {
        match self {
            Self::F32(_) => "float32",
            Self::F64(_) => "float64",
            Self::I64(_) => "int64",
            Self::Bool(_) => "bool",
        }
    }

    fn cells(&self, block: &Block<'_>) -> Cells {
        let rows = 0..block.part.1;
        match self {
            Self::F32(of) => Cells::F32(vec![], rows.map(|i| of(block, i)).collect()),
            Self::F64(of) => Cells::F64(vec![], rows.map(|i| of(block, i)).collect()),
            Self::I64(of) => Cells::I64(vec![], rows.map(|i| of(block, i) as i64).collect()),
            Self::Bool(of) => Cells::Bool(rows.map(|i| of(block, i)).collect()),
        }
    }
}

/// Features with one value per row.
const FLAT: [(&str, Flat); 12] = [
    (
        "next.reward",
        Flat::F32(|b, i| f32::from(u8::from(b.learning.success(b.next(i))))),
    ),
    ("next.done", Flat::Bool(|b, i| b.is_last(i))),
    (
        "next.success",
        Flat::Bool(|b, i| b.learning.success(b.next(i))),
    ),
    ("phase", Flat::I64(|b, i| b.label(i))),
    ("subtask_index", Flat::I64(|b, i| b.label(i))),
    ("incident", Flat::I64(|b, i| b.incident(i))),
    (
        "simulation_time",
        Flat::F64(|b, i| b.recording.aligned.stamps[b.row(i)] as f64 * 1e-9),
    ),
    (
        "timestamp",
        Flat::F32(|b, i| (b.frame(i) as f64 / f64::from(b.rate)) as f32),
    ),
    ("frame_index", Flat::I64(|b, i| b.frame(i))),
    ("episode_index", Flat::I64(|b, _| b.episode)),
    ("index", Flat::I64(|b, i| b.before + b.frame(i))),
    ("task_index", Flat::I64(|b, _| b.task)),
];

/// A feature of several numbers, and those of a row of a block.
type Vector = (&'static str, fn(&Block<'_>, usize) -> Vec<f64>);

/// State, action, and what no robot knows of itself, which readers must not take
/// for an observation: LeRobot feeds whatever is called so to a policy.
pub(super) const VECTORS: [Vector; 3] = [
    ("observation.state", |b, i| {
        b.learning.states[b.frame(i)].clone()
    }),
    ("action", |b, i| b.learning.actions[b.frame(i)].clone()),
    ("privileged.chair_pose", |b, i| {
        b.learning.chair(b.row(i)).to_vec()
    }),
];

/// Columns of language: persistent annotations and events.
pub(super) const LANGUAGE: [&str; 2] = ["language_persistent", "language_events"];

/// Feature of a camera's images.
pub(super) fn image_key(camera: &str) -> String {
    format!("observation.images.{camera}")
}

/// Feature of a camera's depth sensor, named as in LeRobot 0.6. Exact
/// depth is never one.
fn depth_key(camera: &str) -> String {
    format!("observation.images.{camera}_depth")
}

/// The numeric columns of a block, in the order of [`Layout::features`], behind
/// the images.
pub(super) fn numbers(block: &Block<'_>) -> Vec<Column> {
    let vectors = VECTORS.iter().map(|(name, of)| {
        let rows: Vec<f32> = (0..block.part.1)
            .flat_map(|i| of(block, i))
            .map(|v| v as f32)
            .collect();
        let width = rows.len() / block.part.1.max(1);
        Column {
            name: (*name).to_owned(),
            cells: Cells::F32(vec![width], rows),
        }
    });
    let flat = FLAT.iter().map(|(name, flat)| Column {
        name: (*name).to_owned(),
        cells: flat.cells(block),
    });
    vectors.chain(scans(block)).chain(flat).collect()
}

/// Feature of the laser scans.
const SCAN: &str = "observation.scan";

/// The laser scans of a block, if the robot had a scanner.
fn scans(block: &Block<'_>) -> Option<Column> {
    let (signal, scanner) =
        learning::scan(block.recording).zip(block.recording.robot.scanner.as_ref())?;
    let rows = (0..block.part.1).map(|i| signal.row(block.row(i)));
    let rows = rows.flat_map(|row| learning::finite_ranges(row, scanner));
    Some(Column {
        name: SCAN.to_owned(),
        cells: Cells::F32(
            vec![signal.meta.width()],
            rows.map(|range| range as f32).collect(),
        ),
    })
}

impl Layout {
    /// The layout of a recording, with images of `streams`.
    pub fn for_recording(
        recording: &Recording,
        rate: u32,
        streams: Streams,
        action: ActionKind,
    ) -> Self {
        let robot = &recording.robot;
        let pose = ["x", "y", "z", "qx", "qy", "qz", "qw"].map(String::from);
        Self {
            rate,
            streams,
            colour: None,
            body: Body::from_description(robot),
            names: [state_names(robot), action.names(robot), pose.to_vec()],
            rays: learning::scan(recording).map_or(0, |scan| scan.meta.width()),
            language: false,
        }
    }

    /// The features of images, in their order.
    pub fn image_features(&self) -> impl Iterator<Item = ImageFeature<'_>> {
        let colour = self
            .streams
            .cameras
            .iter()
            .map(|(camera, &size)| ImageFeature {
                key: image_key(camera),
                camera,
                size,
                is_depth: false,
                codec: self.colour,
            });
        let depth = self
            .streams
            .depths
            .iter()
            .map(|(camera, &size)| ImageFeature {
                key: depth_key(camera),
                camera,
                size,
                is_depth: true,
                codec: self.colour.map(|_| Codec::Depth),
            });
        colour.chain(depth)
    }

    /// The features as `meta/info.json` lists them.
    pub fn features(&self) -> Value {
        let mut out = serde_json::Map::new();
        for images in self.image_features() {
            let Size { width, height } = images.size;
            let info = match images.codec {
                Some(codec) => Some(codec.info(images.size, self.rate)),
                None if images.is_depth => Some(json!({"is_depth_map": true, "depth_unit": "mm"})),
                None => None,
            };
            let dtype = images.codec.map_or("image", |_| "video");
            let mut feature = json!({"dtype": dtype, "shape": [height, width, images.channels()],
                "names": ["height", "width", "channels"]});
            if let Some(info) = info {
                feature["info"] = info;
            }
            out.insert(images.key, feature);
        }
        for ((name, _), names) in VECTORS.iter().zip(&self.names) {
            let feature = json!({"dtype": "float32", "shape": [names.len()], "names": names});
            out.insert((*name).into(), feature);
        }
        if self.rays > 0 {
            let feature = json!({"dtype": "float32", "shape": [self.rays], "names": null});
            out.insert(SCAN.into(), feature);
        }
        for (name, flat) in FLAT {
            let feature = json!({"dtype": flat.dtype(), "shape": [1], "names": null});
            out.insert(name.into(), feature);
        }
        for name in self.languages() {
            let feature = json!({"dtype": "language", "shape": [1], "names": null});
            out.insert(name.into(), feature);
        }
        Value::Object(out)
    }

    /// Names of the columns of language, if any.
    fn languages(&self) -> impl Iterator<Item = &'static str> {
        LANGUAGE.into_iter().filter(|_| self.language)
    }

    /// The features as Hugging Face's `datasets` writes them into the footer.
    pub fn footer(&self) -> String {
        let mut out = serde_json::Map::new();
        // A video has no column.
        for images in self.image_features().filter(|p| p.codec.is_none()) {
            out.insert(images.key, json!({"_type": "Image"}));
        }
        let vectors = VECTORS.iter().zip(&self.names);
        let vectors = vectors.map(|((name, _), names)| (*name, names.len()));
        let scans = (self.rays > 0).then_some((SCAN, self.rays));
        for (name, length) in vectors.chain(scans) {
            let feature = json!({"feature": {"dtype": "float32", "_type": "Value"},
                "length": length, "_type": "Sequence"});
            out.insert(name.into(), feature);
        }
        for (name, flat) in FLAT {
            let feature = json!({"dtype": flat.dtype(), "_type": "Value"});
            out.insert(name.into(), feature);
        }
        for name in self.languages() {
            out.insert(name.into(), language_footer(name));
        }
        json!({"info": {"features": out}}).to_string()
    }
}

/// The features of a column of language as Hugging Face's `datasets` writes them.
fn language_footer(column: &str) -> Value {
    let value = |dtype: &str| json!({"dtype": dtype, "_type": "Value"});
    let mut row = serde_json::Map::new();
    for name in ["role", "content", "style", "camera"] {
        row.insert(name.into(), value("string"));
    }
    if column == LANGUAGE[0] {
        row.insert("timestamp".into(), value("float32"));
    }
    row.insert(
        "tool_calls".into(),
        json!({"feature": value("string"), "_type": "List"}),
    );
    json!({"feature": row, "_type": "List"})
}
