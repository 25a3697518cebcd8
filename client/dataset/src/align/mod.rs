//! Every stream at the stamps of one camera: cubics with the recorded velocities
//! for the robot's poses and joints, otherwise (or everywhere on request)
//! linear for vectors, slerp for orientations, unwrapped for angles; nearest for
//! everything that does not move continuously. A row that is not enclosed by
//! samples near enough is marked, never made up. One column is in memory at a
//! time beside the result.

pub mod accuracy;
mod curve;
mod file;
pub mod hermite;
pub mod interpolate;
#[cfg(test)]
mod laws;

pub use curve::{Interpolation, Rule};
pub use file::write;

use std::collections::BTreeMap;
use wheelarm_proto::StreamId;

use crate::read::{ColumnMeta, ElementKind, Episode, ReadError, Values};
use curve::{Curve, Slopes};
use interpolate::{Place, nearest, place, unwrap};

/// Samples may be this many usual distances apart before a row between them
/// counts as a gap. One lost sample is bridged, two are not.
const GAP: f64 = 2.5;

/// Options of an alignment.
#[derive(Clone, Debug, Default)]
pub struct AlignOptions {
    /// Camera whose stamps are the rows; [`Episode::reference`] when absent.
    pub reference: Option<String>,
    /// Greatest distance of the two samples around a row by stream, seconds;
    /// 2.5 times the stream's usual distance for streams without an entry.
    pub limits: BTreeMap<String, f64>,
    /// Curve between two samples.
    pub interpolation: Interpolation,
}

/// A column at the rows' stamps.
#[derive(Clone, Debug)]
pub struct Signal {
    /// Metadata of the column; `count` is the number of rows.
    pub meta: ColumnMeta,
    /// How its values were interpolated.
    pub rule: Rule,
    /// Whether that was with the recorded velocities.
    pub hermite: bool,
    /// The values; NaN, 0 or empty in rows that are not valid.
    pub values: Values,
}

impl Signal {
    /// How its values were interpolated, as text.
    #[must_use]
    pub fn how(&self) -> &'static str {
        if self.hermite {
            "cubic Hermite with recorded velocities"
        } else {
            self.rule.name()
        }
    }

    /// The numbers of one row; empty for a column of another kind.
    #[must_use]
    pub fn row(&self, index: usize) -> &[f64] {
        let width = self.meta.width();
        match &self.values {
            Values::F64(all) => all.get(index * width..(index + 1) * width).unwrap_or(&[]),
            _ => &[],
        }
    }
}

/// A stream's share in the alignment.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    /// First and last stamp, nanoseconds.
    pub span: (u64, u64),
    /// Samples.
    pub samples: usize,
    /// Age limit, nanoseconds.
    pub limit: u64,
    /// Which rows have a value.
    pub valid: Vec<bool>,
    /// Distance of every row to its nearest sample, nanoseconds.
    pub age: Vec<u64>,
}

/// An episode at the stamps of one camera.
#[derive(Clone, Debug)]
pub struct Aligned {
    /// The camera.
    pub reference: String,
    /// Stamps of the rows, nanoseconds of simulation time.
    pub stamps: Vec<u64>,
    /// The columns.
    pub signals: Vec<Signal>,
    /// By stream: which rows are valid, and why not.
    pub coverage: BTreeMap<String, Coverage>,
    /// By camera: the image of every row.
    pub frames: BTreeMap<String, Vec<Option<usize>>>,
    /// By image sensor: the newest image that had arrived by then.
    pub sensors: BTreeMap<String, Vec<Option<usize>>>,
}

impl Aligned {
    /// A column.
    #[must_use]
    pub fn signal(&self, stream: &str, column: &str) -> Option<&Signal> {
        self.signals
            .iter()
            .find(|s| s.meta.stream == stream && s.meta.name == column)
    }

    /// Rows in which all the named streams and all the cameras have a value.
    #[must_use]
    pub fn whole_rows(&self, streams: &[&str], cameras: &[String]) -> Vec<usize> {
        (0..self.stamps.len())
            .filter(|&row| {
                let stream = |s: &&str| self.coverage.get(*s).is_some_and(|c| c.valid[row]);
                let camera = |c: &String| self.frames.get(c).is_some_and(|f| f[row].is_some());
                streams.iter().all(stream) && cameras.iter().all(camera)
            })
            .collect()
    }
}

/// Whether the samples of a stream come at a rate of their own, each later than
/// the one before. Commands arrive irregularly: several at one stamp,
/// of which the last counts, or none for a while.
#[must_use]
pub fn is_periodic(stream: &str) -> bool {
    stream != "command"
}

/// Usual distance of two samples with different stamps, nanoseconds: the median,
/// of an even number the lower one.
#[must_use]
pub fn usual_distance(stamps: &[u64]) -> Option<u64> {
    let mut all: Vec<u64> = stamps
        .windows(2)
        .map(|w| w[1].saturating_sub(w[0]))
        .filter(|&distance| distance > 0)
        .collect();
    let middle = all.len().checked_sub(1)? / 2;
    Some(*all.select_nth_unstable(middle).1)
}

/// Why an episode cannot be aligned.
#[derive(Debug, thiserror::Error)]
pub enum AlignError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The recording has no images for rows.
    #[error(
        "{file} has no images, and rows are those of a camera: it was recorded without cameras. `wheelarm replay {file} --out DIR --camera 'NAME=640x360@10'` records it again with one; `export --format mcap` and `label` need none"
    )]
    NoImages {
        /// The file.
        file: String,
    },
    /// The rows.
    #[error(
        "{file} has no images of the camera {camera:?} to align to; it has {there:?}: choose one with --reference"
    )]
    NoReference {
        /// The file.
        file: String,
        /// Requested reference camera.
        camera: String,
        /// Cameras in the file.
        there: Vec<String>,
    },
    /// A limit of nothing.
    #[error("{file} has no stream {stream:?} that --max-age could limit; it has {}", there.join(", "))]
    NoStream {
        /// The file.
        file: String,
        /// The stream that the limit is for.
        stream: String,
        /// Streams in the file.
        there: Vec<String>,
    },
    /// Interpolation needs rising stamps.
    #[error(
        "{file}: the stamps of {stream} do not rise at sample {sample}; `wheelarm dataset validate` says more"
    )]
    Disorder {
        /// The file.
        file: String,
        /// The stream.
        stream: String,
        /// First sample that follows the previous one too early.
        sample: usize,
    },
    /// A file that was changed or damaged.
    #[error(
        "{file}: {stream}/{column} has {samples} samples and {stamps} stamps: the file is damaged; `wheelarm dataset validate` says more"
    )]
    Uneven {
        /// The file.
        file: String,
        /// The stream.
        stream: String,
        /// The column.
        column: String,
        /// Samples of the column.
        samples: usize,
        /// Stamps of the stream.
        stamps: usize,
    },
}

/// Aligns the streams that `wanted` accepts (all state streams of the file are
/// offered) and every camera.
///
/// # Errors
/// When the reference camera has no images, a column cannot be read, stamps do not
/// rise, or there is a limit for a stream of no known kind.
pub fn align(
    episode: &Episode,
    options: &AlignOptions,
    wanted: &dyn Fn(&str) -> bool,
) -> Result<Aligned, AlignError> {
    let cameras = episode.cameras()?;
    let camera = match &options.reference {
        Some(name) => name.clone(),
        None => episode.reference()?.unwrap_or_default(),
    };
    let stamps = if cameras.contains(&camera) {
        rising(episode, &StreamId::camera(&camera).to_string())?
    } else {
        Vec::new()
    };
    if stamps.is_empty() && cameras.is_empty() {
        return Err(AlignError::NoImages {
            file: episode.path().display().to_string(),
        });
    }
    if stamps.is_empty() {
        return Err(AlignError::NoReference {
            file: episode.path().display().to_string(),
            camera,
            there: cameras,
        });
    }
    let mut aligned = Aligned {
        reference: camera,
        stamps,
        signals: Vec::new(),
        coverage: BTreeMap::new(),
        frames: BTreeMap::new(),
        sensors: BTreeMap::new(),
    };
    let streams = episode.streams()?;
    // What has a known kind may be in other episodes only.
    let unknown =
        |s: &&String| !streams.contains(s) && matches!(StreamId::parse(s), StreamId::Other(_));
    if let Some(stream) = options.limits.keys().find(unknown) {
        return Err(AlignError::NoStream {
            file: episode.path().display().to_string(),
            stream: stream.clone(),
            there: streams,
        });
    }
    for stream in streams {
        let own = options.limits.get(&stream).copied();
        let id = StreamId::parse(&stream);
        if let Some(camera) = id.camera_name() {
            let times = rising(episode, &stream)?;
            let usual = usual_distance(&times).unwrap_or(0);
            let limit = own.map_or(usual / 2, nanos);
            let frames = aligned.stamps.iter().map(|&t| nearest(&times, t, limit));
            aligned.frames.insert(camera.to_owned(), frames.collect());
        } else if let Some(sensor) = id.sensor_name() {
            let times = rising(episode, &stream)?;
            // A robot has the newest image, however old; `exposure_nanos` gives its time.
            let limit = own.map_or(u64::MAX, nanos);
            let frames = aligned.stamps.iter();
            let frames = frames.map(|&t| newest(&times, t, limit));
            aligned.sensors.insert(sensor.to_owned(), frames.collect());
        } else if id != StreamId::EVENTS && wanted(&stream) {
            let times = rising(episode, &stream)?;
            let usual = usual_distance(&times).unwrap_or(0) as f64;
            let limit = own.map_or((GAP * usual) as u64, nanos);
            let coverage = cover(&times, &aligned.stamps, limit);
            for meta in episode.columns(&stream)? {
                if meta.kind != ElementKind::Other && meta.width() > 0 {
                    if meta.count != times.len() {
                        return Err(AlignError::Uneven {
                            file: episode.path().display().to_string(),
                            stream,
                            column: meta.name,
                            samples: meta.count,
                            stamps: times.len(),
                        });
                    }
                    let values = episode.values(&meta)?;
                    let rule = Rule::for_column(&meta);
                    let slopes = match options.interpolation {
                        Interpolation::Linear => None,
                        Interpolation::Hermite => Slopes::of(episode, &meta)?,
                    };
                    let curve = Curve {
                        rule,
                        width: meta.width(),
                        slopes: slopes.as_ref(),
                    };
                    aligned.signals.push(Signal {
                        values: resample(curve, values, &times, &aligned.stamps, &coverage),
                        hermite: slopes.is_some(),
                        meta: ColumnMeta {
                            count: aligned.stamps.len(),
                            ..meta
                        },
                        rule,
                    });
                }
            }
            aligned.coverage.insert(stream, coverage);
        }
    }
    Ok(aligned)
}

impl Aligned {
    /// Without rows, for formats that need none.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            reference: String::new(),
            stamps: Vec::new(),
            signals: Vec::new(),
            coverage: BTreeMap::new(),
            frames: BTreeMap::new(),
            sensors: BTreeMap::new(),
        }
    }
}

/// The last of rising `times` that is not later than `t` and at most `limit`
/// earlier.
fn newest(times: &[u64], t: u64, limit: u64) -> Option<usize> {
    let last = times.partition_point(|&time| time <= t).checked_sub(1)?;
    (t - times[last] <= limit).then_some(last)
}

fn nanos(seconds: f64) -> u64 {
    (seconds * 1e9) as u64
}

fn rising(episode: &Episode, stream: &str) -> Result<Vec<u64>, AlignError> {
    let stamps = episode.stamps(stream)?;
    let falls = |w: &[u64]| w[0] > w[1] || is_periodic(stream) && w[0] == w[1];
    match stamps.windows(2).position(falls) {
        None => Ok(stamps),
        Some(before) => Err(AlignError::Disorder {
            file: episode.path().display().to_string(),
            stream: stream.to_owned(),
            sample: before + 1,
        }),
    }
}

fn cover(times: &[u64], rows: &[u64], limit: u64) -> Coverage {
    let valid = rows.iter().map(|&t| match place(times, t) {
        Place::At(_) => true,
        Place::Between(i, _) => times[i + 1] - times[i] <= limit,
        Place::Outside => false,
    });
    let age = |&t: &u64| nearest(times, t, u64::MAX).map_or(u64::MAX, |i| times[i].abs_diff(t));
    Coverage {
        span: (
            times.first().copied().unwrap_or(0),
            times.last().copied().unwrap_or(0),
        ),
        samples: times.len(),
        limit,
        valid: valid.collect(),
        age: rows.iter().map(age).collect(),
    }
}

fn resample(
    curve: Curve<'_>,
    values: Values,
    times: &[u64],
    rows: &[u64],
    coverage: &Coverage,
) -> Values {
    let Curve { rule, width, .. } = curve;
    let index = |row: usize| nearest(times, rows[row], u64::MAX).filter(|_| coverage.valid[row]);
    match values {
        Values::F64(mut all) => {
            if rule == Rule::Angle {
                unwrap(&mut all, width);
            }
            let mut out = Vec::with_capacity(rows.len() * width);
            for (row, &time) in rows.iter().enumerate() {
                if rule == Rule::Nearest {
                    match index(row) {
                        Some(i) => out.extend_from_slice(&all[i * width..(i + 1) * width]),
                        None => out.extend(std::iter::repeat_n(f64::NAN, width)),
                    }
                } else if coverage.valid[row] {
                    curve.append(times, &all, place(times, time), &mut out);
                } else {
                    out.extend(std::iter::repeat_n(f64::NAN, width));
                }
            }
            Values::F64(out)
        }
        Values::U64(all) => Values::U64(pick(&all, width, rows.len(), index)),
        Values::Flag(all) => Values::Flag(pick(&all, width, rows.len(), index)),
        Values::Text(all) => Values::Text(pick(&all, width, rows.len(), index)),
    }
}

fn pick<T: Clone + Default>(
    all: &[T],
    width: usize,
    rows: usize,
    index: impl Fn(usize) -> Option<usize>,
) -> Vec<T> {
    let mut out = Vec::with_capacity(rows * width);
    for row in 0..rows {
        match index(row) {
            Some(i) => out.extend_from_slice(&all[i * width..(i + 1) * width]),
            None => out.extend(std::iter::repeat_n(T::default(), width)),
        }
    }
    out
}
