//! What a policy learns from, the same for every format that trains one: the
//! observed state, the action, success, on an exact time grid.

use std::collections::BTreeMap;

use super::{Recording, Size};
use crate::align::{Signal, usual_distance};
use crate::ending::PHYSICS;
use crate::read::Values;

/// Streams that a row must have.
pub const STREAMS: [&str; 5] = ["joint_state", "pose", "odometry", "applied", "evaluation"];
/// Stamps may be this far from the grid, nanoseconds.
const OFF_GRID: u64 = 100_000;
const POSE: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];

/// Names of the state's values: rad, rad/s, m, unit quaternion, m/s.
#[must_use]
pub fn state_names() -> Vec<String> {
    let mut out: Vec<String> = (1..=6).map(|j| format!("joint_{j}.position")).collect();
    out.push("knuckle.position".into());
    out.extend((1..=6).map(|j| format!("joint_{j}.velocity")));
    out.push("knuckle.velocity".into());
    out.extend(POSE.map(|p| format!("end_effector.{p}")));
    out.extend(POSE.map(|p| format!("wheelchair.{p}")));
    out.extend(["linear", "angular"].map(|p| format!("wheelchair.{p}_velocity")));
    out
}

/// Names of the action's values: joint targets rad, wheel speeds rad/s, knuckle
/// target rad, as the controllers got them.
#[must_use]
pub fn action_names() -> Vec<String> {
    let mut out: Vec<String> = (1..=6).map(|j| format!("joint_{j}.target")).collect();
    out.extend(["left", "right"].map(|w| format!("wheel_{w}.target_velocity")));
    out.push("knuckle.target".into());
    out
}

/// The columns behind state, action and success.
pub struct Learning<'a> {
    position: &'a Signal,
    velocity: &'a Signal,
    pose: &'a Signal,
    odometry: &'a Signal,
    target: &'a Signal,
    wheels: &'a Signal,
    knuckle: &'a Signal,
    success: &'a [u8],
    joints: Vec<usize>,
    effector: usize,
    chair: usize,
}

impl<'a> Learning<'a> {
    /// Finds them.
    ///
    /// # Errors
    /// When the recording lacks one.
    pub fn of(recording: &'a Recording) -> anyhow::Result<Self> {
        if recording.summary.end_cause == PHYSICS {
            anyhow::bail!("the physics broke in this episode, it is not fit for training");
        }
        let position = recording.need("joint_state", "position")?;
        let pose = recording.need("pose", "pose")?;
        let roles = &recording.roles;
        let joints = roles.arm.iter().copied().chain([roles.knuckle]).collect();
        let Values::Flag(success) = &recording.need("evaluation", "success")?.values else {
            anyhow::bail!("evaluation/success holds no truth values");
        };
        Ok(Self {
            velocity: recording.need("joint_state", "velocity")?,
            odometry: recording.need("odometry", "twist")?,
            target: recording.need("applied", "joint_position")?,
            wheels: recording.need("applied", "wheel_velocity")?,
            knuckle: recording.need("applied", "knuckle")?,
            success,
            joints,
            effector: roles.end_effector,
            chair: roles.chair,
            position,
            pose,
        })
    }

    /// Positions of the six arm joints and the knuckle, rad.
    #[must_use]
    pub fn joints(&self, row: usize) -> Vec<f64> {
        self.joints
            .iter()
            .map(|&j| self.position.row(row)[j])
            .collect()
    }

    /// Velocities of the six arm joints and the knuckle, rad/s.
    #[must_use]
    pub fn speeds(&self, row: usize) -> Vec<f64> {
        self.joints
            .iter()
            .map(|&j| self.velocity.row(row)[j])
            .collect()
    }

    /// Pose of the end effector in `base_link`.
    #[must_use]
    pub fn effector(&self, row: usize) -> &[f64] {
        &self.pose.row(row)[7 * self.effector..7 * self.effector + 7]
    }

    /// Pose of the chair in `house`.
    #[must_use]
    pub fn chair(&self, row: usize) -> &[f64] {
        &self.pose.row(row)[7 * self.chair..7 * self.chair + 7]
    }

    /// Forward speed, m/s, and turn rate, rad/s, of the chair.
    #[must_use]
    pub fn chair_speed(&self, row: usize) -> [f64; 2] {
        let twist = self.odometry.row(row);
        [twist[0], twist[5]]
    }

    /// The values that [`state_names`] names.
    #[must_use]
    pub fn state(&self, row: usize) -> Vec<f64> {
        let mut out = self.joints(row);
        out.extend(self.speeds(row));
        out.extend_from_slice(self.effector(row));
        out.extend_from_slice(self.chair(row));
        out.extend(self.chair_speed(row));
        out
    }

    /// The values that [`action_names`] names.
    #[must_use]
    pub fn action(&self, row: usize) -> Vec<f64> {
        let mut out = self.target.row(row).to_vec();
        out.extend_from_slice(self.wheels.row(row));
        out.extend_from_slice(self.knuckle.row(row));
        out
    }

    /// Whether the task's conditions hold.
    #[must_use]
    pub fn success(&self, row: usize) -> bool {
        self.success.get(row).is_some_and(|&s| s != 0)
    }
}

/// The cameras that have pictures, with the size that these get: `size` where it
/// is given, else their own.
pub fn cameras(recording: &Recording, size: Option<Size>) -> BTreeMap<String, Size> {
    let cameras = recording.cameras.iter();
    cameras
        .filter_map(|(name, camera)| {
            let (width, height) = camera.size()?;
            Some((name.clone(), size.unwrap_or(Size { width, height })))
        })
        .collect()
}

/// Pictures per second and the longest run of whole rows that lie on the exact
/// grid of that rate, with words about the rest.
///
/// # Errors
/// When no two rows lie on a grid.
pub fn grid(recording: &Recording) -> anyhow::Result<(u32, Vec<usize>, Vec<String>)> {
    let (rows, mut notes) = recording.rows(&STREAMS)?;
    let stamps = &recording.aligned.stamps;
    let usual = usual_distance(stamps).unwrap_or(0).max(1);
    let rate = (1e9 / usual as f64).round().max(1.0);
    let on_grid = |first: usize, count: usize, row: usize| {
        let due = stamps[first] as f64 + count as f64 * 1e9 / rate;
        stamps[row].abs_diff(due.round() as u64) <= OFF_GRID
    };
    let mut best: &[usize] = &[];
    let mut start = 0;
    for end in 0..rows.len() {
        if !on_grid(rows[start], end - start, rows[end]) {
            start = end;
        }
        if end + 1 - start > best.len() {
            best = &rows[start..=end];
        }
    }
    if best.len() < 2 {
        anyhow::bail!(
            "{}: no rows lie on a grid of {rate} Hz",
            recording.summary.label
        );
    }
    if best.len() < rows.len() {
        notes.push(format!(
            "{} rows beside a gap are left out: the format needs an exact grid of {rate} Hz",
            rows.len() - best.len()
        ));
    }
    Ok((rate as u32, best.to_vec(), notes))
}
