//! WheelArm-Sim's final table, 117 columns in its order, and the folders of
//! numbered images beside it.
//!
//! Differences that help: velocities are the simulated ones instead of
//! differences of positions, orientations are interpolated by slerp, and metric
//! 16-bit depth (millimetres) is stored beside the grey images. What a policy learns
//! from is stored in a table of its own, `rows.csv`.

use std::path::{Path, PathBuf};

use wheelarm_policy::state_names;
use wheelarm_proto::v1;

use super::batch::parallel;
use super::intrinsics;
use super::learning::{self, Learning, RowOptions};
use super::{Format, PendingFolder, Recording, Sees, Size, Written, png_depth, png_grey, png_rgb};
use crate::align::Signal;
use crate::ending::PHYSICS;

/// Writes a folder `LABEL` per episode.
#[derive(Clone, Debug)]
pub struct CsvTable {
    /// Folder of the folders.
    pub out: PathBuf,
    /// Options of the rows of `rows.csv`.
    pub rows: RowOptions,
    /// Threads that compress images.
    pub threads: usize,
}

/// Streams whose values a row must have.
const STREAMS: [&str; 3] = ["joint_state", "pose", "imu"];
/// Rows whose images are compressed together.
const BLOCK: usize = 8;

/// A body of the table: prefix of its columns and its place in `PoseSet`.
fn bodies(robot: &v1::RobotDescription) -> Vec<(String, usize)> {
    let mut all: Vec<(bool, &v1::RobotFrame, usize)> = robot
        .frames
        .iter()
        .enumerate()
        .map(|(i, frame)| (frame.role() == v1::FrameRole::Chair, frame, i))
        .collect();
    // Alphabetical, as WheelArm-Sim's; the chair is last.
    all.sort_unstable_by_key(|(chair, frame, _)| (*chair, frame.name.clone()));
    all.into_iter()
        .map(|(chair, frame, i)| match chair {
            true => (format!("{}_", frame.name), i),
            false => (format!("robot_arm_{}_", frame.name), i),
        })
        .collect()
}

/// Names of the values of the state, in WheelArm-Sim's order: 112 for
/// its robot.
#[must_use]
pub fn state_columns(robot: &v1::RobotDescription) -> Vec<String> {
    let mut out = Vec::new();
    for parts in [
        &[
            "pos_x", "pos_y", "pos_z", "quat_x", "quat_y", "quat_z", "quat_w",
        ][..],
        &["vel_x", "vel_y", "vel_z"][..],
    ] {
        for (body, _) in bodies(robot) {
            out.extend(parts.iter().map(|p| format!("{body}{p}")));
        }
    }
    for (sensor, parts) in [
        ("imu_gyro_", &["x", "y", "z"][..]),
        ("imu_accel_", &["x", "y", "z"][..]),
        ("imu_quat_", &["x", "y", "z", "w"][..]),
    ] {
        out.extend(parts.iter().map(|p| format!("{sensor}{p}")));
    }
    for joint in robot.joint_names() {
        out.extend(["pos", "vel"].map(|p| format!("{joint}_{p}")));
    }
    out
}

/// Names of all columns: 117 of WheelArm-Sim's robot.
#[must_use]
pub fn columns(robot: &v1::RobotDescription) -> Vec<String> {
    let rest = [
        "sim_time",
        "instructions",
        "trial_id",
        "image_frame_id",
        "state_labels",
    ];
    let mut out = state_columns(robot);
    out.extend(rest.map(String::from));
    out
}

/// The columns that the state is made of.
pub struct State<'a> {
    bodies: Vec<usize>,
    pose: &'a Signal,
    twist: &'a Signal,
    gyro: &'a Signal,
    accel: &'a Signal,
    quat: &'a Signal,
    position: &'a Signal,
    velocity: &'a Signal,
}

impl<'a> State<'a> {
    /// Finds them.
    ///
    /// # Errors
    /// When the recording lacks one.
    pub fn read(recording: &'a Recording) -> anyhow::Result<Self> {
        let bodies = bodies(&recording.robot).into_iter();
        Ok(Self {
            bodies: bodies.map(|(_, i)| i).collect(),
            pose: recording.need("pose", "pose")?,
            twist: recording.need("pose", "twist")?,
            gyro: recording.need("imu", "angular_velocity")?,
            accel: recording.need("imu", "linear_acceleration")?,
            quat: recording.need("imu", "orientation")?,
            position: recording.need("joint_state", "position")?,
            velocity: recording.need("joint_state", "velocity")?,
        })
    }

    /// The values of a row, in the order of [`state_columns`].
    #[must_use]
    pub fn row(&self, row: usize) -> Vec<f64> {
        let mut out = Vec::new();
        for &i in &self.bodies {
            out.extend_from_slice(&self.pose.row(row)[7 * i..7 * i + 7]);
        }
        for &i in &self.bodies {
            out.extend_from_slice(&self.twist.row(row)[6 * i..6 * i + 3]);
        }
        for signal in [self.gyro, self.accel, self.quat] {
            out.extend_from_slice(signal.row(row));
        }
        for (p, v) in self.position.row(row).iter().zip(self.velocity.row(row)) {
            out.extend([*p, *v]);
        }
        out
    }
}

impl Format for CsvTable {
    fn wants(&self, stream: &str) -> bool {
        STREAMS.contains(&stream) || learning::reads(stream)
    }

    fn add(&self, recording: &Recording, tick: &(dyn Fn() + Sync)) -> anyhow::Result<Written> {
        let (rows, notes) = recording.rows(&STREAMS, Sees::Exact)?;
        let folder = PendingFolder::new(&self.out.join(&recording.summary.label))?;
        table(&folder.path().join("final_data.csv"), recording, &rows)?;
        let mut notes = notes;
        let written = policy_rows(
            &folder.path().join("rows.csv"),
            recording,
            &rows,
            &self.rows,
        )?;
        notes.extend(written);
        let cameras = intrinsics::cameras(recording, None);
        std::fs::write(folder.path().join("cameras.json"), format!("{cameras:#}\n"))?;
        for (camera, source) in &recording.cameras {
            let Some((width, height)) = source.size() else {
                continue;
            };
            let size = Size { width, height };
            let kinds = ["rgb", "depth", "depth_mm"];
            for kind in &kinds[..if source.has_depth() { 3 } else { 1 }] {
                std::fs::create_dir(folder.path().join(format!("{camera}_{kind}")))?;
            }
            for (block, part) in rows.chunks(BLOCK).enumerate() {
                parallel(part.len(), self.threads, |i| {
                    let name = format!("frame_{}.png", block * BLOCK + i + 1);
                    let save = |kind: &str, bytes: Vec<u8>| {
                        let to = folder.path().join(format!("{camera}_{kind}")).join(&name);
                        std::fs::write(to, bytes)
                    };
                    save("rgb", png_rgb(&recording.rgb(camera, part[i])?, size)?)?;
                    if source.has_depth() {
                        let depth = recording.depth(camera, part[i])?;
                        save("depth", png_grey(&depth, size)?)?;
                        save("depth_mm", png_depth(&depth, size)?)?;
                    }
                    Ok(())
                })?;
                if Some(camera) == recording.cameras.keys().next() {
                    part.iter().for_each(|_| tick());
                }
            }
        }
        Ok(Written {
            path: folder.commit()?,
            samples: rows.len(),
            notes,
        })
    }
}

fn table(path: &Path, recording: &Recording, rows: &[usize]) -> anyhow::Result<()> {
    let state = State::read(recording)?;
    let mut table = csv::Writer::from_path(path)?;
    table.write_record(columns(&recording.robot))?;
    let stamps = &recording.aligned.stamps;
    let start = rows.first().map_or(0, |&r| stamps[r]);
    for (number, &row) in rows.iter().enumerate() {
        let mut line: Vec<String> = state.row(row).iter().map(f64::to_string).collect();
        line.push(((stamps[row] - start) as f64 * 1e-9).to_string());
        line.push(recording.summary.instruction.clone());
        line.push(recording.number.to_string());
        line.push((number + 1).to_string());
        line.push(recording.labels[row].to_string());
        table.write_record(&line)?;
    }
    table.flush()?;
    Ok(())
}

/// Writes state and action of the same images, and returns a note about those
/// that are left out.
fn policy_rows(
    path: &Path,
    recording: &Recording,
    rows: &[usize],
    options: &RowOptions,
) -> anyhow::Result<Vec<String>> {
    if recording.summary.end_cause == PHYSICS {
        return Ok(vec![
            "rows.csv is left out: the physics broke in this episode".to_owned(),
        ]);
    }
    let whole = recording.aligned.whole_rows(&learning::STREAMS, &[]);
    let wanted: Vec<usize> = rows.iter().copied().filter(|r| whole.contains(r)).collect();
    let all = Learning::from_recording(recording, wanted, options)?;
    let mut table = csv::Writer::from_path(path)?;
    let mut header = vec!["image_frame_id".to_owned(), "sim_time".to_owned()];
    header.extend(
        state_names(&recording.robot)
            .iter()
            .map(|name| format!("state.{name}")),
    );
    let action = options.action.names(&recording.robot);
    header.extend(action.iter().map(|name| format!("action.{name}")));
    header.push("incident".to_owned());
    table.write_record(header)?;
    let stamps = &recording.aligned.stamps;
    let start = rows.first().map_or(0, |&r| stamps[r]);
    let incidents = all.incidents.iter();
    let records = all.rows.iter().zip(&all.states).zip(&all.actions);
    for (((&row, state), action), incident) in records.zip(incidents) {
        let frame = rows.iter().position(|&r| r == row).map_or(0, |at| at + 1);
        let time = (stamps[row] - start) as f64 * 1e-9;
        let mut line = vec![frame.to_string(), time.to_string()];
        line.extend(state.iter().chain(action).map(f64::to_string));
        line.push(incident.to_string());
        table.write_record(&line)?;
    }
    table.flush()?;
    let lost = rows.len() - all.rows.len();
    let note = format!(
        "rows.csv has no row for {lost} of the {} images",
        rows.len()
    );
    Ok((lost > 0).then_some(note).into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_columns_have_the_order_of_wheelarm_sim() {
        let robot = crate::read::first_robot().unwrap();
        let all = columns(&robot);
        assert_eq!(all.len(), 117);
        for (index, name) in [
            (0, "robot_arm_bicep_pos_x"),
            (7, "robot_arm_end_effector_pos_x"),
            (20, "robot_arm_forearm_quat_w"),
            (27, "robot_arm_shoulder_quat_w"),
            (42, "wheelchair_pos_x"),
            (49, "robot_arm_bicep_vel_x"),
            (69, "wheelchair_vel_z"),
            (70, "imu_gyro_x"),
            (79, "imu_quat_w"),
            (80, "back_left_wheel_joint_pos"),
            (99, "joint_6_vel"),
            (106, "robotiq_85_left_knuckle_joint_pos"),
            (111, "robotiq_85_right_knuckle_joint_vel"),
            (112, "sim_time"),
            (116, "state_labels"),
        ] {
            assert_eq!(all[index], name);
        }
    }
}
