//! Training rows, identical in every training format: rows of
//! observed state and of action, success, on an exact time grid. The rows
//! themselves are made in `wheelarm-policy`; this module locates their numbers
//! in a recording.

use std::collections::BTreeMap;

use wheelarm_policy::{ActionKind, Applied, Observed, state};
use wheelarm_proto::robot::ARM_JOINTS;
use wheelarm_proto::v1;

use super::{Recording, Sees, Size};
use crate::align::{Signal, usual_distance};
use crate::ending::PHYSICS;
use crate::pose::Pose;
use crate::read::Values;
use crate::urdf::Robot;

/// Streams that a row must have.
pub const STREAMS: [&str; 5] = ["joint_state", "pose", "odometry", "applied", "evaluation"];
/// Streams of sensor models that a row contains instead of exact values.
const SENSED: [&str; 2] = ["sensed_joint", "sensed_odometry"];
/// Least deviation of a value of state or action in the statistics, and least half range of the
/// scaling to [-1, 1]; in the value's own unit (m, rad, 1, m/s, rad/s). Otherwise a nearly
/// constant value would be amplified.
pub const LEAST_DEVIATION: f64 = 0.01;
/// Stamps may be this far from the grid, nanoseconds.
const OFF_GRID: u64 = 100_000;
/// Slower joints' set points are at rest, rad/s.
const JOINT_RESTS: f64 = 2e-3;
/// Slower wheels are at rest, rad/s.
const WHEEL_RESTS: f64 = 5e-3;
/// A knuckle that changes less within a row is at rest, rad.
const KNUCKLE_RESTS: f64 = 1e-4;

/// Laser scans: those of a sensor model before the exact ones.
const SCANS: [&str; 2] = ["sensed_scan", "scan"];

/// Whether rows are made of a stream.
#[must_use]
pub fn reads(stream: &str) -> bool {
    STREAMS.contains(&stream) || SENSED.contains(&stream) || SCANS.contains(&stream)
}

/// The laser scan that the robot observes, in every row of the alignment: that of the sensor
/// model where one was on. `None` without a scanner.
#[must_use]
pub fn scan(recording: &Recording) -> Option<&Signal> {
    let aligned = &recording.aligned;
    let on = SCANS
        .iter()
        .find(|stream| !aligned.whole_rows(&[stream], &[]).is_empty())?;
    aligned.signal(on, "ranges")
}

/// Distances of a scan as a network takes them, metres: the greatest distance of the scanner
/// where nothing is within its range, 0 where something is too close.
#[must_use]
pub fn finite_ranges(ranges: &[f64], scanner: &v1::ScannerDescription) -> Vec<f64> {
    let greatest = scanner.greatest_range;
    let finite = |range: f64| {
        if range.is_nan() {
            greatest
        } else {
            range.clamp(0.0, greatest)
        }
    };
    ranges.iter().copied().map(finite).collect()
}

/// Options of the rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowOptions {
    /// Kind of the actions.
    pub action: ActionKind,
    /// Seconds of idleness that stay at either end of an episode; all without it.
    pub trim_idle: Option<f64>,
}

/// The rows of an episode, and the columns behind them.
pub struct Learning<'a> {
    /// Places of the rows in the alignment.
    pub rows: Vec<usize>,
    /// A row of state each: `wheelarm_policy::state`.
    pub states: Vec<Vec<f64>>,
    /// A row of action each.
    pub actions: Vec<Vec<f64>>,
    /// The error on purpose that is under way in a row and not yet put right, a code of
    /// `v1::Incident` (1 to 3); 0 for none.
    pub incidents: Vec<usize>,
    /// Whether a policy commanded in a row: its actions are not demonstrations.
    pub by_policy: Vec<bool>,
    /// Notes about skipped rows.
    pub notes: Vec<String>,
    position: &'a Signal,
    velocity: &'a Signal,
    pose: &'a Signal,
    odometry: &'a Signal,
    /// Positions and velocities of the arm by its encoders, where a sensor model was on.
    sensed_arm: Option<[&'a Signal; 2]>,
    /// Pose by odometry with the errors of real wheels, where a sensor model was on.
    sensed_odometry: Option<&'a Signal>,
    twist: &'a Signal,
    knuckle: &'a Signal,
    success: &'a [u8],
    joints: Vec<usize>,
    effector: usize,
    chair: usize,
}

impl<'a> Learning<'a> {
    /// Reads the rows of the alignment with these indices, in order.
    ///
    /// # Errors
    /// When the recording lacks a column, or the simulation broke in it.
    pub fn from_recording(
        recording: &'a Recording,
        rows: Vec<usize>,
        options: &RowOptions,
    ) -> anyhow::Result<Self> {
        if recording.summary.end_cause == PHYSICS {
            anyhow::bail!("the physics broke in this episode, it is not fit for training");
        }
        let position = recording.need("joint_state", "position")?;
        let pose = recording.need("pose", "pose")?;
        // Columns of streams without samples are empty.
        let is_on = |stream| !recording.aligned.whole_rows(&[stream], &[]).is_empty();
        let sensed = |stream, column| {
            let signal = recording.aligned.signal(stream, column);
            signal.filter(|_| is_on(stream))
        };
        let roles = &recording.roles;
        let joints = roles.arm.iter().copied().chain([roles.knuckle]).collect();
        let Values::Flag(success) = &recording.need("evaluation", "success")?.values else {
            anyhow::bail!("evaluation/success does not contain truth values");
        };
        let mut all = Self {
            rows,
            states: Vec::new(),
            actions: Vec::new(),
            incidents: Vec::new(),
            by_policy: Vec::new(),
            notes: Vec::new(),
            velocity: recording.need("joint_state", "velocity")?,
            odometry: recording.need("odometry", "pose")?,
            sensed_arm: sensed("sensed_joint", "position")
                .zip(sensed("sensed_joint", "velocity"))
                .map(<[_; 2]>::from),
            sensed_odometry: sensed("sensed_odometry", "pose"),
            twist: recording.need("odometry", "twist")?,
            knuckle: recording.need("applied", "knuckle")?,
            success,
            joints,
            effector: roles.end_effector,
            chair: roles.chair,
            position,
            pose,
        };
        let stamps = &recording.aligned.stamps;
        let applied = applied(recording)?;
        if let Some(seconds) = options.trim_idle {
            let kept = busy(&applied, &all.rows, stamps, seconds);
            if kept.len() < all.rows.len() {
                let trimmed = all.rows.len() - kept.len();
                all.notes
                    .push(format!("{trimmed} idle rows at the ends are left out"));
                all.rows = all.rows[kept].to_vec();
            }
        }
        let reported = incidents(recording);
        let stamped = all.rows.iter().map(|&row| stamps[row]);
        all.incidents = stamped.map(|stamp| under_way(&reported, stamp)).collect();
        let devices = devices(recording);
        let stamped = all.rows.iter().map(|&row| stamps[row]);
        let is_policy = |stamp| device(&devices, stamp) == Some(v1::Device::Policy);
        all.by_policy = stamped.map(is_policy).collect();
        let Some(&start) = all.rows.first() else {
            return Ok(all);
        };
        let start = all.sensed_pose(start);
        for (i, &row) in all.rows.iter().enumerate() {
            let observed = all.observed(row, start);
            all.states.push(state(&observed).to_vec());
            let next = all.rows.get(i + 1).map(|&next| seconds(stamps[next]));
            let action = applied.action(options.action, seconds(stamps[row]), next);
            all.actions
                .push(action.ok_or_else(|| anyhow::anyhow!("nothing was applied"))?);
        }
        Ok(all)
    }

    /// The longest run of whole rows on an exact grid, and its rate.
    ///
    /// # Errors
    /// As [`Learning::from_recording`]; when no two rows are on a grid.
    pub fn on_grid(
        recording: &'a Recording,
        options: &RowOptions,
        sees: Sees,
    ) -> anyhow::Result<(u32, Self)> {
        let (rate, rows, mut notes) = grid(recording, sees)?;
        let mut all = Self::from_recording(recording, rows, options)?;
        notes.append(&mut all.notes);
        all.notes = notes;
        Ok((rate, all))
    }

    fn observed(&self, row: usize, start: Pose) -> Observed {
        let (joints, speeds) = (self.joints(row), self.speeds(row));
        let arm = |all: &[f64]| std::array::from_fn(|k| all[k]);
        let [sensed, sensed_speeds] = match self.sensed_arm {
            Some(sensed) => sensed.map(|signal| arm(signal.row(row))),
            None => [arm(&joints), arm(&speeds)],
        };
        Observed {
            joints: sensed,
            velocities: sensed_speeds,
            knuckle: [joints[ARM_JOINTS], speeds[ARM_JOINTS]],
            hand: crate::pose::from_row(self.effector(row)),
            odometry: self.sensed_pose(row),
            start,
        }
    }

    /// Pose by odometry: that of the sensor model where one was on.
    fn sensed_pose(&self, row: usize) -> Pose {
        crate::pose::from_row(self.sensed_odometry.unwrap_or(self.odometry).row(row))
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

    /// True pose of the chair in `house`, which no robot knows.
    #[must_use]
    pub fn chair(&self, row: usize) -> &[f64] {
        &self.pose.row(row)[7 * self.chair..7 * self.chair + 7]
    }

    /// Forward speed, m/s, and turn rate, rad/s, of the chair by its odometry.
    #[must_use]
    pub fn chair_speed(&self, row: usize) -> [f64; 2] {
        let twist = self.twist.row(row);
        [twist[0], twist[5]]
    }

    /// Set point of the knuckle, rad.
    #[must_use]
    pub fn knuckle_target(&self, row: usize) -> f64 {
        self.knuckle.row(row).first().copied().unwrap_or(f64::NAN)
    }

    /// Whether the task's conditions are met.
    #[must_use]
    pub fn success(&self, row: usize) -> bool {
        self.success.get(row).is_some_and(|&s| s != 0)
    }
}

fn seconds(nanos: u64) -> f64 {
    nanos as f64 * 1e-9
}

/// The stream `applied` as it was recorded.
fn applied(recording: &Recording) -> anyhow::Result<Applied> {
    let episode = &recording.episode;
    let robot = &recording.robot;
    let column = |name: &str| -> anyhow::Result<Vec<f64>> {
        Ok(episode.f64s("applied", name)?.iter().copied().collect())
    };
    fn each<const N: usize>(all: Vec<f64>) -> Vec<[f64; N]> {
        let rows = all.chunks_exact(N);
        rows.map(|row| std::array::from_fn(|k| row[k])).collect()
    }
    let mut out = Applied::of(robot);
    let stamps = episode.stamps("applied")?;
    out.stamps = stamps.into_iter().map(seconds).collect();
    out.joints = each(column("joint_position")?);
    out.velocities = each(column("joint_velocity")?);
    out.desired = each(column("desired_pose")?);
    let wheels: Vec<[f64; 2]> = each(column("wheel_velocity")?);
    out.wheels = [0, 1].map(|side| wheels.iter().map(|w| w[side]).collect());
    out.knuckle = column("knuckle")?;
    let urdf = Robot::from_assets(&episode.snapshot()?.assets);
    let ends = [&robot.arm_base_link, &robot.end_effector_link];
    let chain = urdf.as_ref().and_then(|urdf| urdf.chain(ends[0], ends[1]));
    out.hand = match chain {
        Some(chain) => {
            let names = robot.arm_joint_names();
            let place = |joint: &[f64; ARM_JOINTS]| {
                chain.pose(|name| {
                    let index = names.iter().position(|n| *n == name);
                    index.map_or(0.0, |index| joint[index])
                })
            };
            out.joints.iter().map(place).collect()
        }
        // Without the robot's description every desired pose is used unchanged.
        None => out.desired.clone(),
    };
    let count = out.stamps.len();
    let lengths = [
        out.joints.len(),
        out.velocities.len(),
        out.desired.len(),
        wheels.len(),
        out.knuckle.len(),
    ];
    anyhow::ensure!(
        lengths.iter().all(|&l| l == count),
        "the stream applied has {count} stamps and columns of {lengths:?} samples: the file is damaged"
    );
    Ok(out)
}

/// The rows in which something is commanded to move, from the first to the last,
/// and `keep` seconds of those before and behind.
fn busy(applied: &Applied, rows: &[usize], stamps: &[u64], keep: f64) -> std::ops::Range<usize> {
    let moves = |i: usize| {
        let end = rows.get(i + 1).map_or(f64::MAX, |&r| seconds(stamps[r]));
        let first = applied
            .stamps
            .partition_point(|&s| s < seconds(stamps[rows[i]]) - 1e-6);
        let last = applied.stamps.partition_point(|&s| s < end - 1e-6);
        let joints = applied.velocities[first..last].iter().flatten();
        let wheels = applied.wheels.iter().flat_map(|w| &w[first..last]);
        let knuckle = &applied.knuckle[first..last];
        let least = knuckle.iter().copied().fold(f64::MAX, f64::min);
        let most = knuckle.iter().copied().fold(f64::MIN, f64::max);
        joints.map(|v| v.abs()).fold(0.0, f64::max) > JOINT_RESTS
            || wheels.map(|v| v.abs()).fold(0.0, f64::max) > WHEEL_RESTS
            || most - least > KNUCKLE_RESTS
    };
    let first = (0..rows.len()).find(|&i| moves(i));
    let last = (0..rows.len()).rev().find(|&i| moves(i));
    let (Some(first), Some(last)) = (first, last) else {
        return 0..rows.len();
    };
    let (from, to) = (seconds(stamps[rows[first]]), seconds(stamps[rows[last]]));
    let keeps = |i: &usize| {
        let at = seconds(stamps[rows[*i]]);
        at >= from - keep - 1e-6 && at <= to + keep + 1e-6
    };
    let start = (0..=first).find(keeps).unwrap_or(first);
    let end = (last..rows.len()).rev().find(keeps).unwrap_or(last);
    start..end + 1
}

/// Properties that are equal in all episodes of one set: the robot's joints in their
/// order, with their limits.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name of the robot.
    pub robot: String,
    /// Name, least and greatest position of each joint, rad or m.
    pub joints: Vec<(String, Option<f64>, Option<f64>)>,
}

impl Body {
    /// That of a recording.
    #[must_use]
    pub fn from_description(robot: &v1::RobotDescription) -> Self {
        let joints = robot.joints.iter();
        Self {
            robot: robot.name.clone(),
            joints: joints.map(|j| (j.name.clone(), j.lower, j.upper)).collect(),
        }
    }

    /// Rejects another robot in the same set.
    ///
    /// # Errors
    /// With the first joint that differs.
    pub fn ensure_same(&self, here: &Self) -> anyhow::Result<()> {
        if self.joints == here.joints {
            return Ok(());
        }
        let differs = self
            .joints
            .iter()
            .zip(&here.joints)
            .find(|(a, b)| a != b)
            .map_or_else(
                || format!("{} joints, here {}", self.joints.len(), here.joints.len()),
                |(a, b)| format!("joint {}, here {}", limits(a), limits(b)),
            );
        anyhow::bail!(
            "its robot {:?} is not that of the first episode, {:?} ({differs}); export each robot into a set of its own",
            here.robot,
            self.robot
        )
    }
}

fn limits((name, lower, upper): &(String, Option<f64>, Option<f64>)) -> String {
    let word = |limit: &Option<f64>| limit.map_or("none".to_owned(), |l| format!("{l:.4}"));
    format!("{name} from {} to {}", word(lower), word(upper))
}

/// Incidents and their ends, with their times, nanoseconds.
fn incidents(recording: &Recording) -> Vec<(u64, v1::Incident)> {
    // Without commands, or in an older file, the list is empty.
    let commands = recording.episode.commands().unwrap_or_default();
    let reported = commands.into_iter().filter_map(|log| {
        let stamp = log.header?.stamp_nanos;
        Some((stamp, log.command?.incident()))
    });
    reported
        .filter(|(_, incident)| *incident != v1::Incident::Unspecified)
        .collect()
}

/// The error on purpose that is under way at a time: from its report until the
/// object is in the hand again.
fn under_way(reported: &[(u64, v1::Incident)], stamp: u64) -> usize {
    use v1::Incident::{ForcedDrop, ForcedWrongGrasp, ForcedWrongObject, Recovered};
    let before = reported.iter().take_while(|(at, _)| *at <= stamp);
    before.fold(0, |code, (_, incident)| match incident {
        ForcedWrongGrasp | ForcedWrongObject | ForcedDrop => *incident as usize,
        Recovered => 0,
        _ => code,
    })
}

/// Devices of the commands, with their times, nanoseconds.
fn devices(recording: &Recording) -> Vec<(u64, v1::Device)> {
    let commands = recording.episode.commands().unwrap_or_default();
    let reported = commands.into_iter().filter_map(|log| {
        let stamp = log.header?.stamp_nanos;
        Some((stamp, log.command?.device()))
    });
    reported
        .filter(|(_, device)| *device != v1::Device::Unspecified)
        .collect()
}

/// Device that commanded the row of an image: the answer to the image arrives
/// within a control tick.
fn device(devices: &[(u64, v1::Device)], stamp: u64) -> Option<v1::Device> {
    let until = stamp + 1_000_000_000 / wheelarm_proto::CONTROL_HZ;
    let behind = devices.partition_point(|(at, _)| *at <= until);
    Some(devices.get(behind.checked_sub(1)?)?.1)
}

/// The cameras that have images, with the size that these get: `size` where it
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

/// Images per second and the longest run of whole rows on the exact
/// grid of that rate, with notes about the rest.
///
/// # Errors
/// When no two rows are on a grid.
fn grid(recording: &Recording, sees: Sees) -> anyhow::Result<(u32, Vec<usize>, Vec<String>)> {
    let (rows, mut notes) = recording.rows(&STREAMS, sees)?;
    if rows.len() < 2 {
        anyhow::bail!(
            "{}: a policy learns from two images or more, and this episode has {}: it ended at once; leave it out",
            recording.summary.label,
            rows.len()
        );
    }
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
            "{}: no rows are on a grid of {rate} Hz",
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deliberate_error_lasts_until_it_is_corrected() {
        use v1::Incident::{ForcedWrongObject, Missed, Recovered};
        let reported = [
            (10, ForcedWrongObject),
            (20, Missed),
            (30, Recovered),
            (40, Missed),
        ];
        let codes = [5, 10, 25, 29, 30, 50].map(|stamp| under_way(&reported, stamp));
        assert_eq!(codes, [0, 2, 2, 2, 0, 0]);
    }

    #[test]
    fn idle_ends_are_cut_to_the_requested_rest() {
        let count = 61;
        let mut applied = Applied {
            stamps: (0..count).map(|k| f64::from(k) / 60.0).collect(),
            velocities: vec![[0.0; 6]; 61],
            wheels: [vec![0.0; 61], vec![0.0; 61]],
            knuckle: vec![0.1; 61],
            ..Applied::default()
        };
        let stamps: Vec<u64> = (0..=10).map(|k| k * 100_000_000).collect();
        let rows: Vec<usize> = (0..11).collect();
        assert_eq!(busy(&applied, &rows, &stamps, 0.1), 0..11);
        applied.wheels[1][20] = 0.3;
        applied.velocities[35][2] = -0.1;
        assert_eq!(busy(&applied, &rows, &stamps, 0.0), 3..6);
        assert_eq!(busy(&applied, &rows, &stamps, 0.2), 1..8);
        assert_eq!(busy(&applied, &rows, &stamps, 9.0), 0..11);
    }

    #[test]
    fn a_robot_with_other_joints_is_refused_by_the_joint() {
        let joint = |name: &str, upper| v1::RobotJoint {
            name: name.to_owned(),
            upper,
            ..Default::default()
        };
        let robot = |name: &str, joints: &[v1::RobotJoint]| {
            Body::from_description(&v1::RobotDescription {
                name: name.to_owned(),
                joints: joints.to_vec(),
                ..Default::default()
            })
        };
        let first = robot("one", &[joint("a", None), joint("b", Some(1.0))]);
        assert!(first.ensure_same(&first.clone()).is_ok());
        let swapped = robot("two", &[joint("b", Some(1.0)), joint("a", None)]);
        let problem = first.ensure_same(&swapped).unwrap_err().to_string();
        assert!(
            problem.contains("joint a") && problem.contains("two"),
            "{problem}"
        );
        let longer = robot("one", &[joint("a", None), joint("b", Some(1.1))]);
        let problem = first.ensure_same(&longer).unwrap_err().to_string();
        assert!(problem.contains("1.1000"), "{problem}");
        let fewer = robot("one", &[joint("a", None)]);
        assert!(first.ensure_same(&fewer).is_err());
    }
}
