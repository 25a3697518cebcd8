//! The file of WheelArm-Sim's recorder: one group per sample, 60 datasets each, names,
//! shapes, types, order and units as its scripts read them.
//!
//! Every topic's value is its last sample up to the row's stamp, with its own
//! stamp, as WheelArm-Sim's recorder kept. Values are not resampled:
//! WheelArm-Sim's scripts do that. Images are 64-bit integers, one per byte,
//! gzip with the level 4 in the file's filter; they are compressed here by
//! `super::deflate_int64` and written as whole chunks.

use std::path::{Path, PathBuf};

use hdf5::types::VarLenUnicode;
use hdf5::{Group, H5Type};
use wheelarm_proto::v1;

use super::batch::parallel;
use super::deflate_int64::DeflateInt64;
use super::{Format, PendingFile, Recording, Written};
use crate::hdf::{Chunked, Filters, unicode};
use crate::read::{Episode, Values, first_robot};

const LEVEL: u8 = 4;

/// Writes `LABEL.hdf5` per episode.
#[derive(Clone, Debug)]
pub struct WheelarmSim {
    /// Folder of the files.
    pub out: PathBuf,
    /// Threads that compress images.
    pub threads: usize,
}

/// A column with its stamps, read by "last sample up to".
struct Track {
    stamps: Vec<u64>,
    width: usize,
    values: Vec<f64>,
}

impl Track {
    fn read(episode: &Episode, stream: &str, column: &str) -> anyhow::Result<Self> {
        let metas = episode.columns(stream)?;
        let meta = metas.iter().find(|m| m.name == column).ok_or_else(|| {
            anyhow::anyhow!("{} has no {stream}/{column}", episode.path().display())
        })?;
        let Values::F64(values) = episode.values(meta)? else {
            anyhow::bail!("{stream}/{column} does not contain numbers");
        };
        Ok(Self {
            stamps: episode.stamps(stream)?,
            width: meta.width(),
            values,
        })
    }

    /// Stamp in seconds and values of the last sample up to `time`.
    fn at(&self, time: u64) -> Option<(f64, &[f64])> {
        let index = self.stamps.partition_point(|&s| s <= time).checked_sub(1)?;
        let row = self
            .values
            .get(index * self.width..(index + 1) * self.width)?;
        Some((self.stamps[index] as f64 * 1e-9, row))
    }
}

struct Tracks {
    position: Track,
    velocity: Track,
    pose: Track,
    twist: Track,
    orientation: Track,
    angular_velocity: Track,
    linear_acceleration: Track,
    desired: Track,
    clock: Vec<u64>,
}

impl Tracks {
    fn read(e: &Episode) -> anyhow::Result<Self> {
        Ok(Self {
            position: Track::read(e, "joint_state", "position")?,
            velocity: Track::read(e, "joint_state", "velocity")?,
            pose: Track::read(e, "pose", "pose")?,
            twist: Track::read(e, "pose", "twist")?,
            orientation: Track::read(e, "imu", "orientation")?,
            angular_velocity: Track::read(e, "imu", "angular_velocity")?,
            linear_acceleration: Track::read(e, "imu", "linear_acceleration")?,
            desired: Track::read(e, "applied", "desired_pose")?,
            clock: e.stamps("clock")?,
        })
    }

    /// Whether every topic has spoken by `time`; the desired pose must be one.
    fn ready(&self, time: u64) -> bool {
        let all = [
            &self.position,
            &self.velocity,
            &self.pose,
            &self.twist,
            &self.orientation,
            &self.angular_velocity,
            &self.linear_acceleration,
        ];
        all.iter().all(|t| t.at(time).is_some())
            && self
                .desired
                .at(time)
                .is_some_and(|d| d.1.iter().all(|v| v.is_finite()))
            && self.clock.first().is_some_and(|&c| c <= time)
    }
}

impl Format for WheelarmSim {
    fn wants(&self, _: &str) -> bool {
        false
    }

    fn add(&self, recording: &Recording, tick: &(dyn Fn() + Sync)) -> anyhow::Result<Written> {
        let name = format!("{}.hdf5", recording.summary.label);
        check_robot(&recording.robot)?;
        let pending = PendingFile::new(&self.out.join(name))?;
        let tracks = Tracks::read(&recording.episode)?;
        let cameras: Vec<String> = recording.camera_names();
        for needed in ["gen3", "wheelchair"] {
            anyhow::ensure!(
                cameras.iter().any(|c| c == needed),
                "the episode has no images of the camera {needed:?}, which WheelArm-Sim's layout needs"
            );
        }
        let samples = write(pending.path(), recording, &tracks, self.threads, tick)?;
        let rows = recording.aligned.stamps.len();
        let mut notes = Vec::new();
        if samples < rows {
            notes.push(format!(
                "{} of {rows} rows are left out: not every topic had a sample",
                rows - samples
            ));
        }
        // WheelArm-Sim's layout has no place for a calibration.
        let beside = format!("{}.cameras.json", recording.summary.label);
        let cameras = super::intrinsics::cameras(recording, None);
        super::hold(&self.out.join(beside), format!("{cameras:#}\n").as_bytes())?;
        Ok(Written {
            path: pending.commit()?,
            samples,
            notes,
        })
    }
}

/// Rejects a robot without the joints and frames in the names of
/// WheelArm-Sim's datasets.
fn check_robot(robot: &v1::RobotDescription) -> anyhow::Result<()> {
    let needed = first_robot()?;
    let joints = needed.joint_names();
    let lacking: Vec<&str> = joints
        .filter(|name| robot.joint_names().all(|own| own != *name))
        .chain(
            needed
                .frames
                .iter()
                .map(|frame| frame.name.as_str())
                .filter(|name| robot.frames.iter().all(|own| own.name != *name)),
        )
        .collect();
    anyhow::ensure!(
        lacking.is_empty(),
        "the robot {:?} lacks joints or frames of WheelArm-Sim's layout ({}): its scripts cannot \
         read such a file; choose another format",
        robot.name,
        lacking.join(", ")
    );
    Ok(())
}

fn write(
    path: &Path,
    recording: &Recording,
    tracks: &Tracks,
    threads: usize,
    tick: &(dyn Fn() + Sync),
) -> anyhow::Result<usize> {
    let without = recording.cameras.iter().find(|(_, c)| !c.has_depth());
    if let Some((name, _)) = without {
        anyhow::bail!(
            "{name} was recorded without depth, which this format has; record with --depth u16"
        );
    }
    let file = crate::hdf::unlocked().create_excl(path)?;
    let data = file.create_group("data")?;
    let stamps = &recording.aligned.stamps;
    let whole = |row: &usize| {
        let images = recording.aligned.frames.values().all(|f| f[*row].is_some());
        images && tracks.ready(stamps[*row])
    };
    let rows: Vec<usize> = (0..stamps.len()).filter(whole).collect();
    (rows.len()..stamps.len()).for_each(|_| tick());
    let mut number = 0;
    for block in rows.chunks(threads.max(2)) {
        // An image is read, widened and compressed by one thread.
        let mut images = parallel(IMAGES.len() * block.len(), threads, |i| {
            let (camera, kind) = IMAGES[i % IMAGES.len()];
            CompressedImage::read(recording, block[i / IMAGES.len()], camera, kind)
        })?
        .into_iter();
        for &row in block {
            number += 1;
            let group = data.create_group(&number.to_string())?;
            states(&group, &recording.robot, tracks, stamps[row])?;
            text(&group, "instructions", &recording.summary.instruction)?;
            for ((camera, kind), image) in IMAGES.iter().zip(images.by_ref()) {
                let name = format!("processed_data_cameras_{kind}_{camera}");
                image.write(&group, &name)?;
                scalar(&group, &format!("{name}time"), image.stamp)?;
            }
            tick();
        }
    }
    anyhow::ensure!(number > 0, "no row has every topic");
    file.flush()?;
    Ok(number)
}

/// The images of a sample: camera and kind.
const IMAGES: [(&str, &str); 4] = [
    ("gen3", "rgb"),
    ("gen3", "depth"),
    ("wheelchair", "rgb"),
    ("wheelchair", "depth"),
];

/// A compressed image.
struct CompressedImage {
    /// Seconds.
    stamp: f64,
    length: usize,
    chunk: usize,
    chunks: Vec<Vec<u8>>,
}

impl CompressedImage {
    /// One 64-bit integer per byte, in chunks of the length that h5py would
    /// choose.
    fn read(recording: &Recording, row: usize, camera: &str, kind: &str) -> anyhow::Result<Self> {
        let (source, index) = recording.image(camera, row)?;
        let (bytes, pixel) = if kind == "rgb" {
            (source.rgb(&recording.episode, index)?, 3)
        } else {
            let depth = source.depth(&recording.episode, index)?;
            (depth.iter().flat_map(|d| d.to_le_bytes()).collect(), 4)
        };
        let chunk = guessed_chunk(bytes.len());
        let mut wide = DeflateInt64::default();
        let compress = |part: &[u8]| {
            let mut out = Vec::new();
            wide.append(part, chunk, pixel, &mut out);
            out
        };
        Ok(Self {
            stamp: source.stamps()[index] as f64 * 1e-9,
            length: bytes.len(),
            chunk,
            chunks: bytes.chunks(chunk).map(compress).collect(),
        })
    }

    fn write(&self, group: &Group, name: &str) -> anyhow::Result<()> {
        let how = (Filters::Deflate, LEVEL);
        let data = Chunked::create_fixed::<i64>(group, name, self.length, self.chunk, how)?;
        for (index, part) in self.chunks.iter().enumerate() {
            data.write(index, part)?;
        }
        Ok(())
    }
}

fn states(
    group: &Group,
    robot: &v1::RobotDescription,
    tracks: &Tracks,
    time: u64,
) -> anyhow::Result<()> {
    // `ready` has looked: every track has a sample.
    let at = |track: &'_ Track| -> (f64, Vec<f64>) {
        track
            .at(time)
            .map_or((f64::NAN, Vec::new()), |(t, v)| (t, v.to_vec()))
    };
    let (stamp, position) = at(&tracks.position);
    let (_, velocity) = at(&tracks.velocity);
    for (i, joint) in robot.joint_names().enumerate() {
        let name = format!("processed_data_joint_state_{joint}");
        numbers(group, &name, &[stamp, position[i], velocity[i]])?;
        text(group, &format!("{name}_joint_name"), joint)?;
    }
    let (stamp, pose) = at(&tracks.pose);
    let (_, twist) = at(&tracks.twist);
    for (i, frame) in robot.frames.iter().enumerate() {
        let name = format!("processed_data_cartesian_pose_{}", frame.name);
        let row = [&[stamp], &pose[7 * i..7 * i + 7]].concat();
        numbers(group, &name, &row)?;
        let name = format!("processed_data_cartesian_velocity_{}", frame.name);
        let row = [&[stamp], &twist[6 * i..6 * i + 3]].concat();
        numbers(group, &name, &row)?;
    }
    for (name, track) in [
        ("orientation", &tracks.orientation),
        ("linear_acceleration", &tracks.linear_acceleration),
        ("angular_velocity", &tracks.angular_velocity),
    ] {
        let (stamp, values) = at(track);
        let row = [&[stamp][..], &values].concat();
        numbers(group, &format!("processed_data_imu_{name}"), &row)?;
    }
    let clock = tracks
        .clock
        .partition_point(|&c| c <= time)
        .saturating_sub(1);
    scalar(
        group,
        "processed_data_timesteps",
        tracks.clock[clock] as f64 * 1e-9,
    )?;
    let (_, mut desired) = at(&tracks.desired);
    desired.iter_mut().take(3).for_each(|v| *v *= 1e3);
    numbers(group, "processed_data_desired_pose", &desired)
}

fn numbers(group: &Group, name: &str, values: &[f64]) -> anyhow::Result<()> {
    let data = group
        .new_dataset::<f64>()
        .chunk([values.len()])
        .deflate(LEVEL)
        .shape([values.len()])
        .create(name)?;
    data.write(values)?;
    Ok(())
}

fn scalar<T: H5Type>(group: &Group, name: &str, value: T) -> anyhow::Result<()> {
    group
        .new_dataset::<T>()
        .create(name)?
        .write_scalar(&value)?;
    Ok(())
}

fn text(group: &Group, name: &str, value: &str) -> anyhow::Result<()> {
    let data = group.new_dataset::<VarLenUnicode>().create(name)?;
    data.write_scalar(&unicode(value))?;
    Ok(())
}

/// The chunk length that h5py guesses for a list of 64-bit integers: halved
/// until it is near a size that grows slowly with the whole.
#[must_use]
pub fn guessed_chunk(length: usize) -> usize {
    const BASE: f64 = 16.0 * 1024.0;
    const LEAST: f64 = 8.0 * 1024.0;
    const MOST: f64 = 1024.0 * 1024.0;
    let bytes = 8.0 * length.max(1) as f64;
    let target = (BASE * 2.0_f64.powf((bytes / MOST).log10())).clamp(LEAST, MOST);
    let mut chunk = length.max(1) as f64;
    while chunk > 1.0 {
        let size = 8.0 * chunk;
        if (size < target || (size - target).abs() / target < 0.5) && size < MOST {
            break;
        }
        chunk = (chunk / 2.0).ceil();
    }
    chunk as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_without_the_joints_of_the_layout_is_refused_with_their_names() {
        let mut robot = first_robot().unwrap();
        assert!(check_robot(&robot).is_ok());
        robot.joints[4].name = "elbow".to_owned();
        robot.frames[6].name = "tool".to_owned();
        let error = check_robot(&robot).unwrap_err().to_string();
        assert!(error.contains("(joint_1, end_effector)"), "{error}");
    }

    #[test]
    fn chunks_have_the_lengths_of_the_files_of_wheelarm_sim() {
        assert_eq!(super::guessed_chunk(2_764_800), 5_400);
        assert_eq!(super::guessed_chunk(3_686_400), 7_200);
    }
}
