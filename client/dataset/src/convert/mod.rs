//! From recordings to files that other programs read: one [`Recording`] (the
//! native file, aligned and labelled), one [`Format`] per target. Everything
//! streams image by image; no partial file has a final name.

mod atomic;
pub mod batch;
pub mod csv_table;
mod deflate_int64;
pub(crate) mod ffmpeg;
mod format_name;
mod image;
mod intrinsics;
pub mod keypoint_targets;
pub mod learning;
pub mod lerobot;
mod links;
pub mod mcap_log;
pub mod robomimic;
mod ros2;
pub mod rosbag2;
mod series;
pub mod tensors;
pub mod wheelarm_sim;

pub use atomic::{AlreadyThere, PendingFile, PendingFolder, begin, change, hold};
pub use format_name::{Capabilities, FormatName};
pub use image::{Size, png_depth, png_grey, png_rgb, scaled};

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::{check, v1};

use crate::align::{AlignError, AlignOptions, Aligned, align};
use crate::label::{self, Corrections};
use crate::pose::Pose;
use crate::read::{Camera, Episode, Summary};

/// Options for reading recordings, for every format.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Rows and age limits.
    pub align: AlignOptions,
    /// Labels corrected by people.
    pub corrections: Corrections,
}

/// An episode, aligned and labelled.
#[derive(Debug)]
pub struct Recording {
    /// The native file.
    pub episode: Episode,
    /// Its summary.
    pub summary: Summary,
    /// Its streams at the reference camera's stamps.
    pub aligned: Aligned,
    /// Its robot.
    pub robot: v1::RobotDescription,
    /// Indices of the robot's joints and frames in the streams.
    pub roles: Roles,
    /// Label 0 to 3 of every row.
    pub labels: Vec<u8>,
    /// Its cameras that have images.
    pub cameras: BTreeMap<String, Camera>,
    /// Its image sensors that have images.
    pub sensors: BTreeMap<String, Camera>,
    /// Its place among the files, from 1: WheelArm-Sim's trial number.
    pub number: usize,
}

impl Recording {
    /// Opens a file and aligns the streams that `wanted` accepts.
    ///
    /// # Errors
    /// When it is not an episode or cannot be aligned.
    pub fn open(
        path: &Path,
        options: &ReadOptions,
        wanted: &dyn Fn(&str) -> bool,
    ) -> anyhow::Result<Self> {
        Self::open_for(path, options, wanted, true)
    }

    /// As [`Recording::open`]; one that was recorded without cameras has no rows
    /// unless that `needs_images`.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn open_for(
        path: &Path,
        options: &ReadOptions,
        wanted: &dyn Fn(&str) -> bool,
        needs_images: bool,
    ) -> anyhow::Result<Self> {
        let episode = Episode::open(path)?;
        let summary = episode.summary()?;
        let aligned = match align(&episode, &options.align, wanted) {
            Err(AlignError::NoImages { .. }) if !needs_images => Aligned::empty(),
            aligned => aligned?,
        };
        let (robot, roles) = episode.roles()?;
        let found = label::segments(&episode)?;
        let start = summary.span_nanos.0;
        let segments = options.corrections.apply(&summary.label, start, found);
        let labels = label::labels_at(&segments, &aligned.stamps);
        let mut cameras = BTreeMap::new();
        for name in episode.cameras()? {
            let camera = episode.camera(&name)?;
            if camera.size().is_some() {
                cameras.insert(name, camera);
            }
        }
        let mut sensors = BTreeMap::new();
        for name in episode.sensors()? {
            let sensor = episode.sensor(&name)?;
            if sensor.size().is_some() {
                sensors.insert(name, sensor);
            }
        }
        Ok(Self {
            episode,
            summary,
            aligned,
            robot,
            roles,
            labels,
            cameras,
            sensors,
            number: 1,
        })
    }

    /// Scans per second of the scenario, Hz; 0 without a laser scanner.
    #[must_use]
    pub fn scan_rate_hz(&self) -> f64 {
        let scenario = self.episode.scenario();
        scenario.map_or(0.0, |scenario| scenario.scan_rate_hz())
    }

    /// The laser scanner, where it was on.
    #[must_use]
    pub fn scanner(&self) -> Option<&v1::ScannerDescription> {
        let scanner = self.robot.scanner.as_ref();
        scanner.filter(|_| self.scan_rate_hz() > 0.0)
    }

    /// Names of the cameras.
    #[must_use]
    pub fn camera_names(&self) -> Vec<String> {
        self.cameras.keys().cloned().collect()
    }

    /// An image of a row.
    ///
    /// # Errors
    /// When the row has none or it cannot be read.
    pub fn rgb(&self, camera: &str, row: usize) -> anyhow::Result<Vec<u8>> {
        let (camera, index) = self.image(camera, row)?;
        Ok(camera.rgb(&self.episode, index)?)
    }

    /// Depth of a row, metres.
    ///
    /// # Errors
    /// When the row has none or it cannot be read.
    pub fn depth(&self, camera: &str, row: usize) -> anyhow::Result<Vec<f32>> {
        let (camera, index) = self.image(camera, row)?;
        Ok(camera.depth(&self.episode, index)?)
    }

    /// The camera and the number of its image in a row.
    ///
    /// # Errors
    /// When it does not exist.
    pub fn image(&self, camera: &str, row: usize) -> anyhow::Result<(&Camera, usize)> {
        let frames = self.aligned.frames.get(camera);
        match (
            self.cameras.get(camera),
            frames.and_then(|f| f.get(row).copied().flatten()),
        ) {
            (Some(camera), Some(index)) => Ok((camera, index)),
            _ => anyhow::bail!("{}: row {row} has no image of {camera}", self.summary.label),
        }
    }

    /// The robot's observation of a camera in a row: the newest image of its colour
    /// sensor where there is one, else the exact image.
    ///
    /// # Errors
    /// When it does not exist.
    pub fn observed(&self, camera: &str, row: usize) -> anyhow::Result<(&Camera, usize)> {
        match self.sensor_of(camera, Camera::has_rgb) {
            Some(name) => self.sensed(name, row),
            None => self.image(camera, row),
        }
    }

    /// The exact image behind the robot's observation of a camera in a row: that of
    /// the exposure where a colour sensor gave the row's image. `None` where the
    /// recording does not have it.
    ///
    /// # Errors
    /// When the row has no image.
    pub fn shown(&self, camera: &str, row: usize) -> anyhow::Result<Option<(&Camera, usize)>> {
        let (observed, index) = self.observed(camera, row)?;
        let exact = self.cameras.get(camera);
        let Some((exact, exposed)) = exact.zip(observed.exposures().get(index)) else {
            return Ok(Some((observed, index)));
        };
        let at = exact.stamps().binary_search(exposed);
        Ok(at.ok().map(|index| (exact, index)))
    }

    /// The newest image of a camera's depth sensor in a row.
    ///
    /// # Errors
    /// When it does not exist.
    pub fn sensed_depth(&self, camera: &str, row: usize) -> anyhow::Result<(&Camera, usize)> {
        let name = self.sensor_of(camera, Camera::has_depth);
        self.sensed(name.unwrap_or_default(), row)
    }

    /// Cameras that have a depth sensor, with the size of its images.
    #[must_use]
    pub fn depth_sensors(&self) -> BTreeMap<String, Size> {
        let sensors = self.sensors.values().filter(|sensor| sensor.has_depth());
        let sized = sensors.filter_map(|sensor| {
            let (width, height) = sensor.size()?;
            Some((sensor.made_from()?.to_owned(), Size { width, height }))
        });
        sized.collect()
    }

    fn sensor_of(&self, camera: &str, has: fn(&Camera) -> bool) -> Option<&str> {
        let mut all = self.sensors.iter();
        let found = all.find(|(_, s)| s.made_from() == Some(camera) && has(s));
        found.map(|(name, _)| name.as_str())
    }

    fn sensed(&self, sensor: &str, row: usize) -> anyhow::Result<(&Camera, usize)> {
        let frames = self.aligned.sensors.get(sensor);
        match (
            self.sensors.get(sensor),
            frames.and_then(|f| f.get(row).copied().flatten()),
        ) {
            (Some(camera), Some(index)) => Ok((camera, index)),
            _ => anyhow::bail!(
                "{}: row {row} has no image of the sensor {sensor:?}",
                self.summary.label
            ),
        }
    }

    /// A column of the alignment that the format cannot do without.
    ///
    /// # Errors
    /// When the file does not have it.
    pub fn need(&self, stream: &str, column: &str) -> anyhow::Result<&crate::align::Signal> {
        self.aligned.signal(stream, column).ok_or_else(|| {
            anyhow::anyhow!(
                "{} has no column {stream}/{column}, which this format needs",
                self.episode.path().display()
            )
        })
    }

    /// The arm's base in the chair, by the robot's description.
    ///
    /// # Errors
    /// When it has none.
    pub fn arm_mount(&self) -> anyhow::Result<Pose> {
        let ([x, y, z], [qx, qy, qz, qw]) = check::pose("arm mount", self.robot.arm_mount.as_ref())
            .with_context(|| self.episode.path().display().to_string())?;
        Ok([x, y, z, qx, qy, qz, qw])
    }

    /// Rows that have all of `streams`, every camera, and an image of every sensor
    /// that the format uses, and notes about those that do not.
    ///
    /// # Errors
    /// When no row is left.
    pub fn rows(&self, streams: &[&str], sees: Sees) -> anyhow::Result<(Vec<usize>, Vec<String>)> {
        let cameras = self.camera_names();
        let mut rows = self.aligned.whole_rows(streams, &cameras);
        let used = self.sensors.iter().filter(|(_, sensor)| match sees {
            Sees::Exact => false,
            Sees::Colour => sensor.has_rgb(),
            Sees::ColourAndDepth => true,
        });
        let arrived: Vec<_> = used
            .filter_map(|(name, _)| self.aligned.sensors.get(name))
            .collect();
        let before = rows.len();
        rows.retain(|&row| arrived.iter().all(|frames| frames[row].is_some()));
        let early = before - rows.len();
        let all = self.aligned.stamps.len();
        let mut notes = Vec::new();
        if rows.len() < all {
            notes.push(format!("{} of {all} rows are left out", all - rows.len()));
            if early > 0 {
                notes.push(format!("{early} before every sensor had an image"));
            }
            for stream in streams {
                let lost = self
                    .aligned
                    .coverage
                    .get(*stream)
                    .map_or(all, |c| c.valid.iter().filter(|v| !**v).count());
                if lost > 0 {
                    notes.push(format!("{lost} without {stream}"));
                }
            }
        }
        if rows.is_empty() {
            anyhow::bail!(
                "{}: no row has all of {streams:?} and the cameras {cameras:?}: {}",
                self.episode.path().display(),
                notes.join(", ")
            );
        }
        Ok((rows, notes))
    }
}

/// The images that a format uses where sensors exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sees {
    /// The exact ones.
    Exact,
    /// Those of colour sensors.
    Colour,
    /// Those of colour and of depth sensors.
    ColourAndDepth,
}

/// Result of one recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Written {
    /// File or folder.
    pub path: PathBuf,
    /// Rows, samples or messages.
    pub samples: usize,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// A target format.
pub trait Format: Sync {
    /// Streams that it reads, as [`Recording::open`] aligns them.
    fn wants(&self, stream: &str) -> bool;
    /// Whether it makes rows, which are those of a camera.
    fn needs_images(&self) -> bool {
        true
    }
    /// Whether all recordings become one data set, in their order.
    fn collects(&self) -> bool {
        false
    }
    /// Adds a recording; `tick` is called for every row.
    ///
    /// # Errors
    /// When it cannot be read or written; then no partial output is left.
    fn add(&self, recording: &Recording, tick: &(dyn Fn() + Sync)) -> anyhow::Result<Written>;
    /// Publishes a collected data set; `None` without one.
    ///
    /// # Errors
    /// When it cannot be written.
    fn finish(self: Box<Self>) -> anyhow::Result<Option<Written>> {
        Ok(None)
    }
}
