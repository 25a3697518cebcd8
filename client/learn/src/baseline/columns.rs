//! The outputs of the paper, read from WheelArm-Sim's columns.

use anyhow::{Context, ensure};
use sha2::{Digest, Sha256};

use crate::episodes::Episode;

/// Outputs of the paper: hand pose, chair pose, both knuckles.
pub const OUTPUTS: usize = 16;
/// First index of the quaternions of hand and chair in the outputs.
pub const QUATERNIONS: [usize; 2] = [3, 10];
/// Column names of the outputs.
const NAMES: [&str; OUTPUTS] = [
    "robot_arm_end_effector_pos_x",
    "robot_arm_end_effector_pos_y",
    "robot_arm_end_effector_pos_z",
    "robot_arm_end_effector_quat_x",
    "robot_arm_end_effector_quat_y",
    "robot_arm_end_effector_quat_z",
    "robot_arm_end_effector_quat_w",
    "wheelchair_pos_x",
    "wheelchair_pos_y",
    "wheelchair_pos_z",
    "wheelchair_quat_x",
    "wheelchair_quat_y",
    "wheelchair_quat_z",
    "wheelchair_quat_w",
    "robotiq_85_left_knuckle_joint_pos",
    "robotiq_85_right_knuckle_joint_pos",
];

/// Short names of the outputs, with units.
pub const SHORT: [&str; OUTPUTS] = [
    "hand x, m",
    "hand y, m",
    "hand z, m",
    "hand qx",
    "hand qy",
    "hand qz",
    "hand qw",
    "chair x, m",
    "chair y, m",
    "chair z, m",
    "chair qx",
    "chair qy",
    "chair qz",
    "chair qw",
    "left knuckle, rad",
    "right knuckle, rad",
];

/// One episode with the columns of the baseline.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Label of the episode.
    pub label: String,
    /// Seed of its scenario.
    pub seed: u64,
    /// Index of the episode.
    pub episode: usize,
    /// First used row of the episode: before it a column has no sample.
    pub first: usize,
    /// All 112 columns, row by row.
    pub state: Vec<Vec<f32>>,
    /// The 16 outputs, with quaternions of consistent sign.
    pub outputs: Vec<[f32; OUTPUTS]>,
}

/// Reads the columns of an episode.
///
/// # Errors
/// When it lacks WheelArm-Sim's columns.
pub fn trial(number: usize, episode: &Episode) -> anyhow::Result<Trial> {
    let label = &episode.about.label;
    let (table, names) = episode
        .table
        .as_ref()
        .zip(episode.about.table_names.as_ref())
        .with_context(|| {
            format!("{label} lacks WheelArm-Sim's columns: record it with the streams imu, joint_states and poses")
        })?;
    let mut columns = [0; OUTPUTS];
    for (column, name) in columns.iter_mut().zip(NAMES) {
        let place = names.iter().position(|n| n == name);
        *column = place.with_context(|| format!("{label} has no column {name}"))?;
    }
    let complete = |row: &usize| table.row(*row).iter().all(|v| v.is_finite());
    let first = (0..table.rows()).find(complete);
    let first = first.with_context(|| format!("no row of {label} has a number in every column"))?;
    let state: Vec<Vec<f32>> = (first..table.rows())
        .map(|row| table.row(row).to_vec())
        .collect();
    ensure!(
        state.iter().flatten().all(|v| v.is_finite()),
        "{label} has rows without a sample in its middle"
    );
    let outputs = state.iter().map(|row| columns.map(|column| row[column]));
    let mut outputs: Vec<[f32; OUTPUTS]> = outputs.collect();
    unify_signs(&mut outputs);
    Ok(Trial {
        label: label.clone(),
        seed: episode.about.seed,
        episode: number,
        first,
        state,
        outputs,
    })
}

/// Makes the signs of quaternions consistent, because q and -q are one rotation: w of the first
/// row is positive, and each row has the sign of the previous one.
fn unify_signs(rows: &mut [[f32; OUTPUTS]]) {
    for at in QUATERNIONS {
        let mut before = [0.0, 0.0, 0.0, 1.0];
        for row in rows.iter_mut() {
            let q = &mut row[at..at + 4];
            let dot: f32 = q.iter().zip(before).map(|(a, b)| a * b).sum();
            if dot < 0.0 {
                for part in &mut *q {
                    *part = -*part;
                }
            }
            before.copy_from_slice(q);
        }
    }
}

/// Angle between two rotations, degrees; the quaternions may have any length except zero.
#[must_use]
pub fn degrees(a: &[f32], b: &[f32]) -> f64 {
    let dot = |x: &[f32], y: &[f32]| -> f64 {
        let products = x.iter().zip(y).map(|(a, b)| f64::from(*a) * f64::from(*b));
        products.sum()
    };
    let scale = (dot(a, a) * dot(b, b)).sqrt().max(1e-12);
    2.0 * (dot(a, b).abs() / scale).min(1.0).acos().to_degrees()
}

/// Splits trials by seed into training, validation and test, 16 : 4 : 4.
#[must_use]
pub fn split(trials: Vec<Trial>) -> [Vec<Trial>; 3] {
    let mut seeds: Vec<u64> = trials.iter().map(|t| t.seed).collect();
    seeds.sort_unstable();
    seeds.dedup();
    seeds.sort_by_key(|seed| Sha256::digest(seed.to_string()));
    let part = (seeds.len() / 6).max(1);
    let mut parts = [Vec::new(), Vec::new(), Vec::new()];
    for trial in trials {
        let rank = seeds.iter().position(|s| *s == trial.seed).unwrap_or(0);
        let which = match rank {
            r if r < part => 2,
            r if r < 2 * part => 1,
            _ => 0,
        };
        parts[which].push(trial);
    }
    parts
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A moving trial: the chair moves along x by `speed` m a row, the hand turns about z.
    pub fn moving_trial(seed: u64, rows: usize, speed: f32) -> Trial {
        let outputs: Vec<[f32; OUTPUTS]> = (0..rows)
            .map(|row| {
                let mut out = [0.0; OUTPUTS];
                let half = 0.01 * row as f32;
                (out[5], out[6], out[13]) = (half.sin(), half.cos(), 1.0);
                out[7] = speed * row as f32;
                out
            })
            .collect();
        let state = outputs.iter().map(|out| {
            let mut state = out.to_vec();
            state.push(speed);
            state
        });
        Trial {
            label: format!("t{seed}"),
            seed,
            episode: 0,
            first: 0,
            state: state.collect(),
            outputs: outputs.clone(),
        }
    }

    #[test]
    fn quaternions_get_consistent_signs() {
        let mut rows = moving_trial(0, 4, 0.0).outputs;
        for value in &mut rows[2][3..7] {
            *value = -*value;
        }
        rows[0][13] = -1.0;
        unify_signs(&mut rows);
        assert!(
            rows.iter().all(|row| row[6] > 0.0 && row[13] > 0.0),
            "{rows:?}"
        );
    }

    #[test]
    fn angle_ignores_sign_and_length_of_quaternions() {
        let half = 15.0_f32.to_radians();
        let turned = [0.0, 0.0, half.sin(), half.cos()];
        let minus = turned.map(|v| -v);
        let none = [0.0, 0.0, 0.0, 1.0];
        assert!((degrees(&turned, &none) - 30.0).abs() < 1e-4);
        assert!((degrees(&minus, &none) - 30.0).abs() < 1e-4);
        assert!(degrees(&none, &[0.0, 0.0, 0.0, 2.0]) < 1e-6);
    }

    #[test]
    fn episodes_of_one_seed_are_in_one_part() {
        let trials: Vec<Trial> = (0..24)
            .flat_map(|s| [moving_trial(s, 2, 0.1), moving_trial(s, 2, 0.2)])
            .collect();
        let [learned, held, tests] = split(trials);
        assert_eq!([learned.len(), held.len(), tests.len()], [32, 8, 8]);
        assert!(
            learned
                .iter()
                .all(|t| tests.iter().chain(&held).all(|o| o.seed != t.seed))
        );
    }
}
