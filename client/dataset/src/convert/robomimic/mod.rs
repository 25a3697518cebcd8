//! A robomimic data set with MimicGen's additions: one HDF5 file of all
//! episodes, actions normalised to [-1, 1] with the raw ones beside them.
//!
//! Images are compressed once and written as `obs` of their row and as
//! `next_obs` of the row before. The file has its final name only when whole.

mod arrays;
mod datagen;
mod split;

use std::path::Path;

use anyhow::Context;
use hdf5::Group;
use parking_lot::Mutex;
use serde_json::json;
use wheelarm_policy::{STATE, state_names, state_units};
use wheelarm_proto::robot::ARM_JOINTS;

use self::arrays::{NUMBER, What, describe, rows};
use self::split::{Origin, split};
use super::batch::parallel;
use super::intrinsics;
use super::learning::{self, Body, LEAST_DEVIATION, Learning, RowOptions};
use super::{Format, PendingFile, Recording, Sees, Size, Written, scaled};
use crate::calibration::{CONVENTION, PIXEL_CENTRE};
use crate::compress::Deflate;
use crate::hdf::{Attributes, Chunked, Filters};

/// Images that are compressed together.
const BLOCK: usize = 16;

/// Writes one file of all episodes.
pub struct Robomimic {
    size: Option<Size>,
    rows: RowOptions,
    threads: usize,
    set: Mutex<Set>,
}

struct Set {
    pending: PendingFile,
    file: hdf5::File,
    demos: usize,
    rows: usize,
    /// Source of each demo.
    origins: Vec<Origin>,
    /// Properties set by the first episode; `None` before it.
    common: Option<Common>,
}

/// Properties of all episodes.
struct Common {
    /// Least and greatest raw value of every action component so far.
    range: Range,
    environment: serde_json::Value,
    /// The robot; every episode has the same.
    body: Body,
    /// Names of the values of an action.
    names: Vec<String>,
    /// Cameras with their sizes; every episode has the same.
    cameras: Vec<(String, Size)>,
    /// Their intrinsics in the first episode, for images of these sizes.
    calibration: serde_json::Value,
}

impl Robomimic {
    /// A data set at `out`; images are scaled to `size` when it is given.
    ///
    /// # Errors
    /// When `out` exists already or cannot be made.
    pub fn new(
        out: &Path,
        size: Option<Size>,
        rows: RowOptions,
        threads: usize,
    ) -> anyhow::Result<Self> {
        let pending = PendingFile::new(out)?;
        let file = crate::hdf::unlocked().create_excl(pending.path())?;
        file.create_group("data")?;
        Ok(Self {
            size,
            rows,
            threads,
            set: Mutex::new(Set {
                pending,
                file,
                demos: 0,
                origins: Vec::new(),
                rows: 0,
                common: None,
            }),
        })
    }
}

impl Format for Robomimic {
    fn wants(&self, stream: &str) -> bool {
        learning::reads(stream) || stream == "object_pose"
    }

    fn collects(&self) -> bool {
        true
    }

    fn add(&self, recording: &Recording, tick: &(dyn Fn() + Sync)) -> anyhow::Result<Written> {
        let (rate, learning) = Learning::on_grid(recording, &self.rows, Sees::Exact)?;
        let rows = &learning.rows;
        anyhow::ensure!(
            rows.len() > 1,
            "one row is left, but an action needs the next row"
        );
        let set = &mut *self.set.lock();
        let cameras: Vec<(String, Size)> = learning::cameras(recording, self.size)
            .into_iter()
            .collect();
        if let Some(common) = &set.common {
            common
                .body
                .ensure_same(&Body::from_description(&recording.robot))?;
            anyhow::ensure!(
                common.cameras == cameras,
                "images differ from those of the first episode ({:?}, here {cameras:?}); --size makes sizes equal",
                common.cameras
            );
        }
        let data = set.file.group("data")?;
        let name = format!("demo_{}", set.demos);
        let group = data.create_group(&name)?;
        let (low, high) = match self.demo(&group, recording, &learning, &cameras, tick) {
            Ok(range) => range,
            Err(problem) => {
                drop(group);
                data.unlink(&name)?;
                return Err(problem);
            }
        };
        match &mut set.common {
            Some(common) => {
                let (least, greatest) = &mut common.range;
                let pairs = least.iter_mut().zip(low);
                pairs.for_each(|(all, one)| *all = all.min(one));
                let pairs = greatest.iter_mut().zip(high);
                pairs.for_each(|(all, one)| *all = all.max(one));
            }
            None => {
                set.common = Some(Common {
                    range: (low, high),
                    environment: environment(recording, rate, self.rows.action.name()),
                    body: Body::from_description(&recording.robot),
                    names: self.rows.action.names(&recording.robot),
                    cameras,
                    calibration: intrinsics::cameras(recording, self.size),
                });
            }
        }
        let [task, _, area] = &recording.summary.task;
        set.origins.push(Origin {
            seed: recording.summary.seed,
            area: area.clone(),
            task: task.clone(),
            label: recording.summary.label.clone(),
        });
        let calibration = intrinsics::cameras(recording, self.size).to_string();
        let demo = set.file.group("data")?.group(&name)?;
        Attributes::for_object(&demo).text("camera_calibration", &calibration)?;
        set.demos += 1;
        set.rows += rows.len() - 1;
        Ok(Written {
            path: Path::new("data").join(name),
            samples: rows.len() - 1,
            notes: learning.notes.clone(),
        })
    }

    fn finish(self: Box<Self>) -> anyhow::Result<Option<Written>> {
        let set = self.set.into_inner();
        let Some(common) = set.common else {
            anyhow::bail!("no episode could be exported: no data set was written");
        };
        let (low, high) = &widened(&common.range);
        let data = set.file.group("data")?;
        let mut train = Vec::new();
        let mut valid = Vec::new();
        let split = split(&set.origins);
        for demo in 0..set.demos {
            let name = format!("demo_{demo}");
            normalise(&data.group(&name)?, low, high, &common.names)?;
            let validates = split.as_ref().is_some_and(|(valid, _)| valid[demo]);
            if validates { &mut valid } else { &mut train }.push(name);
        }
        let cameras: Vec<&str> = common.cameras.iter().map(|c| c.0.as_str()).collect();
        Attributes::for_object(&data)
            .text("camera_calibration", &common.calibration.to_string())?
            .set("total", i64::try_from(set.rows)?)?
            .text("env_args", &common.environment.to_string())?
            .text("action_kind", self.rows.action.name())?
            .texts("action_names", &common.names)?
            .texts("cameras", &cameras)?;
        for (name, values) in [("action_low", low), ("action_high", high)] {
            let attribute = data.new_attr::<f64>().shape([values.len()]).create(name)?;
            attribute.write(values)?;
        }
        let mask = set.file.create_group("mask")?;
        crate::hdf::texts(&mask, "train", &train)?;
        crate::hdf::texts(&mask, "valid", &valid)?;
        set.file.flush()?;
        drop((data, mask));
        set.file.close()?;
        let note = match split {
            Some((_, grouping)) => grouping.warning(),
            None => Some(
                "mask/valid is empty, because one episode cannot be split; export at least two",
            ),
        };
        Ok(Some(Written {
            path: set.pending.commit()?,
            samples: set.rows,
            notes: note.map(str::to_owned).into_iter().collect(),
        }))
    }
}

/// A range that scales no value that hardly changes up to the whole of [-1, 1].
fn widened((low, high): &Range) -> Range {
    let pairs = low.iter().zip(high).map(|(&low, &high)| {
        let middle = (low + high) / 2.0;
        (
            low.min(middle - LEAST_DEVIATION),
            high.max(middle + LEAST_DEVIATION),
        )
    });
    pairs.unzip()
}

fn environment(recording: &Recording, rate: u32, action: &str) -> serde_json::Value {
    let [task, activity, area] = &recording.summary.task;
    // Type 2 is "gym": robomimic knows no type for environments of one's own.
    json!({
        "env_name": format!("WheelArm-{task}"),
        "env_version": recording.summary.schema_version,
        "type": 2,
        "env_kwargs": {"task": task, "activity": activity, "area": area, "rate_hz": rate,
            "action": action, "cameras": recording.camera_names()},
    })
}

/// Scales the raw actions into [-1, 1] by the range over the whole set; a
/// component that never changes becomes 0.
fn normalise(demo: &Group, low: &[f64], high: &[f64], names: &[String]) -> anyhow::Result<()> {
    let raw: Vec<f64> = demo.dataset("actions_raw")?.read_raw()?;
    let width = low.len().max(1);
    let scaled: Vec<f64> = raw
        .iter()
        .enumerate()
        .map(|(i, v)| {
            let (l, h) = (low[i % width], high[i % width]);
            ((v - l) / (h - l) * 2.0 - 1.0).clamp(-1.0, 1.0)
        })
        .collect();
    let what = (
        "1 (in [-1, 1]; action_low and action_high undo the scaling)",
        "",
    );
    let data = rows(demo, "actions", what, &scaled, &[width])?;
    Attributes::for_object(&data).texts("names", names)?;
    Ok(())
}

/// Least and greatest value of every component.
type Range = (Vec<f64>, Vec<f64>);

impl Robomimic {
    /// Writes one episode and returns the range of its raw actions.
    fn demo(
        &self,
        group: &Group,
        recording: &Recording,
        learning: &Learning<'_>,
        cameras: &[(String, Size)],
        tick: &(dyn Fn() + Sync),
    ) -> anyhow::Result<Range> {
        let all = learning.rows.as_slice();
        let here = &all[..all.len() - 1];
        let range = self.numbers(group, recording, learning)?;
        let (obs, next_obs) = (group.create_group("obs")?, group.create_group("next_obs")?);
        observations(&obs, recording, learning, 0..here.len())?;
        observations(&next_obs, recording, learning, 1..all.len())?;
        privileged(&group.create_group("privileged")?, learning, here)?;
        for (number, camera) in cameras.iter().enumerate() {
            let tick = || {
                if number == 0 {
                    tick();
                }
            };
            self.images([&obs, &next_obs], recording, camera, all, &tick)?;
        }
        datagen::write(group, recording, learning, here)?;
        Ok(range)
    }

    /// Writes a camera's images of the rows `all`: as `obs` of their row and as
    /// `next_obs` of the row before.
    fn images(
        &self,
        groups: [&Group; 2],
        recording: &Recording,
        (camera, size): &(String, Size),
        all: &[usize],
        tick: &dyn Fn(),
    ) -> anyhow::Result<()> {
        let n = all.len() - 1;
        let name = format!("{camera}_image");
        let shape = [size.height, size.width, 3];
        let create = |g: &Group| Chunked::create::<u8>(g, &name, n, &shape, 1, Filters::Deflate);
        let (to, to_next) = (create(groups[0])?, create(groups[1])?);
        for images in [&to, &to_next] {
            let what = ("1 (0 to 255, sRGB)", "row-major from the top left");
            describe(images.dataset(), what)?;
            Attributes::for_object(images.dataset())
                .set("pixel_centre", PIXEL_CENTRE)?
                .text("convention", CONVENTION)?;
        }
        for (block, part) in all.chunks(BLOCK).enumerate() {
            let compressed = parallel(part.len(), self.threads, |i| {
                let (source, index) = recording.image(camera, part[i])?;
                let (width, height) = source.size().context("a size")?;
                let rgb = source.rgb(&recording.episode, index)?;
                let rgb = scaled(rgb, Size { width, height }, *size);
                let mut out = Vec::new();
                Deflate::default().append(&rgb, 1, &mut out);
                Ok(out)
            })?;
            for (i, bytes) in compressed.iter().enumerate() {
                let row = block * BLOCK + i;
                if row < n {
                    to.write(row, bytes)?;
                }
                if row > 0 {
                    to_next.write(row - 1, bytes)?;
                }
                tick();
            }
        }
        Ok(())
    }
}

impl Robomimic {
    /// Writes actions, states, rewards and labels of the rows, of which the last
    /// one is only the next one of another row, and returns the range of the raw actions.
    fn numbers(
        &self,
        group: &Group,
        recording: &Recording,
        learning: &Learning<'_>,
    ) -> anyhow::Result<Range> {
        let all = learning.rows.as_slice();
        let (here, next) = (&all[..all.len() - 1], &all[1..]);
        let n = here.len();
        let kind = self.rows.action;
        let flat = |rows: &[Vec<f64>]| rows[..n].concat();
        let list = |units: Vec<&str>| units.join(", ");
        let action = flat(&learning.actions);
        let width = kind.size();
        let units = list(kind.units().collect());
        let data = rows(group, "actions_raw", (&units, ""), &action, &[width])?;
        Attributes::for_object(&data).texts("names", &kind.names(&recording.robot))?;
        let names = state_names(&recording.robot);
        let units = list(state_units().collect());
        let frame = format!(
            "hand in {}, odometry from the first row",
            recording.robot.arm_base_link
        );
        let what = (units.as_str(), frame.as_str());
        let state = flat(&learning.states);
        let data = rows(group, "states", what, &state, &[names.len()])?;
        Attributes::for_object(&data).texts("names", &names)?;
        let reward = next
            .iter()
            .map(|&r| f64::from(u8::from(learning.success(r))));
        let reward: Vec<f64> = reward.collect();
        rows(group, "rewards", NUMBER, &reward, &[])?;
        let dones: Vec<i64> = (1..=n).map(|i| i64::from(i == n)).collect();
        rows(group, "dones", NUMBER, &dones, &[])?;
        let stamps = &recording.aligned.stamps;
        let time: Vec<f64> = here.iter().map(|&r| stamps[r] as f64 * 1e-9).collect();
        rows(group, "simulation_time", ("s", ""), &time, &[])?;
        let phase = here.iter().map(|&r| i64::from(recording.labels[r]));
        let phase: Vec<i64> = phase.collect();
        let what = ("1 (0 navigating, 1 reaching, 2 grasping, 3 retracting)", "");
        rows(group, "phase", what, &phase, &[])?;
        let incident = learning.incidents.iter().take(n);
        let incident: Vec<i64> = incident.map(|&code| code as i64).collect();
        let what = (
            "1 (0 none; on purpose: 1 wrong grasp, 2 wrong object, 3 drop)",
            "",
        );
        rows(group, "incident", what, &incident, &[])?;
        Attributes::for_object(group)
            .set("num_samples", i64::try_from(n)?)?
            .text("label", &recording.summary.label)?
            .text("instruction", &recording.summary.instruction)?
            .set("success", recording.summary.success)?;
        let column = |c: usize| action.iter().skip(c).step_by(width).copied();
        let extreme = |start: f64, of: fn(f64, f64) -> f64| {
            (0..width).map(|c| column(c).fold(start, of)).collect()
        };
        Ok((extreme(f64::MAX, f64::min), extreme(f64::MIN, f64::max)))
    }
}

const QUATERNION: &str = "1 (unit quaternion x y z w)";

/// An observation: its name, unit and frame, width, and how it is read from a row.
type Observation<'a> = (&'a str, What<'a>, usize, &'a dyn Fn(usize) -> Vec<f64>);

/// Writes the numbers that a policy sees in each of some rows.
fn observations(
    group: &Group,
    recording: &Recording,
    learning: &Learning<'_>,
    part: std::ops::Range<usize>,
) -> anyhow::Result<()> {
    let base = recording.robot.arm_base_link.as_str();
    let chair = recording.robot.root_link.as_str();
    // Joints of the arm, which precede the knuckle.
    let arm = ARM_JOINTS;
    let place = |i: usize| learning.rows[i];
    let observed: [Observation<'_>; 7] = [
        ("joint_pos", ("rad", ""), arm, &|i| {
            learning.joints(place(i))[..arm].to_vec()
        }),
        ("joint_vel", ("rad/s", ""), arm, &|i| {
            learning.speeds(place(i))[..arm].to_vec()
        }),
        ("gripper_qpos", ("rad (knuckle)", ""), 1, &|i| {
            learning.joints(place(i))[arm..].to_vec()
        }),
        ("eef_pos", ("m", base), 3, &|i| {
            learning.effector(place(i))[..3].to_vec()
        }),
        ("eef_quat", (QUATERNION, base), 4, &|i| {
            learning.effector(place(i))[3..].to_vec()
        }),
        (
            "odometry",
            (
                "m (x, y), 1 (cosine and sine of the yaw)",
                "chair in the first row",
            ),
            4,
            &|i| learning.states[i][STATE - 4..].to_vec(),
        ),
        (
            "base_vel",
            ("m/s (forward), rad/s (turn)", chair),
            2,
            &|i| learning.chair_speed(place(i)).to_vec(),
        ),
    ];
    for (name, what, width, of) in observed {
        let all: Vec<f64> = part.clone().flat_map(of).collect();
        rows(group, name, what, &all, &[width])?;
    }
    Ok(())
}

/// Writes the privileged state, which no robot measures.
fn privileged(group: &Group, learning: &Learning<'_>, here: &[usize]) -> anyhow::Result<()> {
    let all = |from: usize, to: usize| -> Vec<f64> {
        let poses = here.iter().map(|&r| learning.chair(r));
        poses.flat_map(|pose| pose[from..to].to_vec()).collect()
    };
    rows(group, "base_pos", ("m", "house"), &all(0, 3), &[3])?;
    rows(group, "base_quat", (QUATERNION, "house"), &all(3, 7), &[4])?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearly_constant_values_are_not_scaled_up() {
        let (low, high) = widened(&(vec![0.4, -1.0, 0.0], vec![0.4001, 1.0, 0.0]));
        assert!((high[0] - low[0] - 0.02).abs() < 1e-12 && low[0] < 0.4 && high[0] > 0.4001);
        assert_eq!((low[1], high[1]), (-1.0, 1.0));
        assert_eq!((low[2], high[2]), (-LEAST_DEVIATION, LEAST_DEVIATION));
    }
}
