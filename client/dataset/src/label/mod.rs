//! The original's four labels by a rule that reads only recorded motion: speed
//! of the chair, speed of the arm, angle of the knuckle. What an operator
//! published is never looked at; [`agreement`] compares with it.
//!
//! The rule walks through time:
//! - the chair drives: navigating;
//! - at rest with an empty hand, the arm starts to move: reaching;
//! - the knuckle starts to close: grasping;
//! - it has closed and the arm starts to move: retracting, which lasts (lifting,
//!   carrying, placing) until the chair drives or the hand closes again. After
//!   a drive with a closed hand the arm's motion is retracting, not reaching.
//!
//! The paper ends navigating when the chair's speed falls to zero; the scripted
//! operator publishes reaching about a second later, when the arm moves, and
//! the rule follows that. It and its thresholds were chosen on episodes of
//! `pick_mustard` alone; `client/guide/process.md` has the figures, with those
//! of seeds and tasks that were recorded afterwards. Known to fail: a hand that
//! closes a little in the air to take its shape counts as grasping.

mod agreement;
mod corrections;

pub use agreement::{Agreement, agreement, share_within};
pub use corrections::{Corrections, write};

use crate::align::interpolate::nearest;
use crate::read::{Episode, ReadError};

/// Names of the labels 0 to 3.
pub const NAMES: [&str; 4] = ["navigating", "reaching", "grasping", "retracting"];

/// The chair drives above this speed, m/s.
const DRIVES: f64 = 0.02;
/// The chair turns above this rate, rad/s.
const TURNS: f64 = 0.03;
/// Shorter rests belong to the drive, nanoseconds.
const REST: u64 = 300_000_000;
/// The arm moves when a joint is faster than this, rad/s: well above what a
/// stiff grip shakes it by.
const ARM_MOVES: f64 = 0.05;
/// The knuckle closes or opens faster than this, rad/s.
const KNUCKLE_MOVES: f64 = 0.1;
/// Window of the knuckle's speed, nanoseconds: its angle counts, a contact
/// shakes its speed. A closing is found up to this much too early.
const WINDOW: u64 = 100_000_000;
/// A closing or opening by less than this is none, rad.
const STROKE: f64 = 0.05;

/// A label from a time on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Simulation time from which it holds, nanoseconds.
    pub from: u64,
    /// 0 to 3.
    pub label: u8,
}

/// What the rule reads, sampled together.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// Stamps, nanoseconds.
    pub stamps: Vec<u64>,
    /// Whether the chair drives or turns.
    pub chair: Vec<bool>,
    /// Whether the arm moves.
    pub arm: Vec<bool>,
    /// Knuckle, radians, greater is more closed.
    pub knuckle: Vec<f64>,
}

/// Reads the signals of the rule.
///
/// # Errors
/// When the file has no joint states or poses.
pub fn motion(episode: &Episode) -> Result<Motion, ReadError> {
    let stamps = episode.stamps("joint_state")?;
    let names = episode.names("joint_state", "position")?;
    let index = |name: &str| names.iter().position(|n| n == name);
    let position = numbers(episode, "joint_state", "position")?;
    let velocity = numbers(episode, "joint_state", "velocity")?;
    let arm: Vec<usize> = (1..=6)
        .filter_map(|k| index(&format!("joint_{k}")))
        .collect();
    let width = names.len().max(1);
    let knuckle = index("robotiq_85_left_knuckle_joint").unwrap_or(0);

    let frames = episode.names("pose", "twist")?;
    let chair = frames.iter().position(|n| n == "wheelchair").unwrap_or(0);
    let twist = numbers(episode, "pose", "twist")?;
    let pose_stamps = episode.stamps("pose")?;
    let drives = stamps.iter().map(|&t| {
        let row = nearest(&pose_stamps, t, REST)?;
        let at = 6 * (row * frames.len() + chair);
        let v = twist.get(at..at + 6)?;
        Some(v[0].hypot(v[1]) > DRIVES || v[5].abs() > TURNS)
    });
    let mut out = Motion {
        chair: drives.map(|d| d.unwrap_or(false)).collect(),
        arm: velocity
            .chunks_exact(width)
            .map(|row| arm.iter().any(|&i| row[i].abs() > ARM_MOVES))
            .collect(),
        knuckle: position
            .chunks_exact(width)
            .map(|row| row[knuckle])
            .collect(),
        stamps,
    };
    bridge(&mut out.chair, &out.stamps, REST);
    Ok(out)
}

fn numbers(episode: &Episode, stream: &str, column: &str) -> Result<Vec<f64>, ReadError> {
    Ok(episode.f64s(stream, column)?.into_raw_vec_and_offset().0)
}

/// Sets gaps shorter than `gap` nanoseconds between true entries to true.
fn bridge(flags: &mut [bool], stamps: &[u64], gap: u64) {
    let mut last: Option<usize> = None;
    for i in 0..flags.len() {
        if flags[i] {
            if let Some(last) = last
                && stamps[i] - stamps[last] < gap
            {
                flags[last..i].fill(true);
            }
            last = Some(i);
        }
    }
}

/// Runs in which the knuckle closes (or, mirrored, opens): first and last index.
fn strokes(motion: &Motion, sign: f64) -> Vec<(usize, usize)> {
    let (stamps, knuckle) = (&motion.stamps, &motion.knuckle);
    let mut out: Vec<(usize, usize)> = Vec::new();
    let mut before = 0;
    for i in 0..stamps.len() {
        while stamps[i] - stamps[before] > WINDOW {
            before += 1;
        }
        let seconds = (stamps[i] - stamps[before]) as f64 * 1e-9;
        let speed = sign * (knuckle[i] - knuckle[before]) / seconds.max(1e-9);
        if before == i || speed <= KNUCKLE_MOVES {
            continue;
        }
        match out.last_mut() {
            // Runs that touch are one.
            Some(run) if before <= run.1 => run.1 = i,
            _ => out.push((before, i)),
        }
    }
    out.retain(|&(a, b)| sign * (knuckle[b] - knuckle[a]) >= STROKE);
    out
}

/// The label at every sample of the motion.
#[must_use]
pub fn label(motion: &Motion) -> Vec<u8> {
    let closings = strokes(motion, 1.0);
    let openings = strokes(motion, -1.0);
    let inside = |runs: &[(usize, usize)], i: usize| runs.iter().any(|&(a, b)| a <= i && i <= b);
    let mut out = Vec::with_capacity(motion.stamps.len());
    let (mut now, mut holding) = (0, false);
    for i in 0..motion.stamps.len() {
        let closing = inside(&closings, i);
        if inside(&openings, i) {
            holding = false;
        }
        if motion.chair[i] {
            now = 0;
        } else if closing {
            now = 2;
            holding = true;
        } else if motion.arm[i] {
            now = match now {
                0 if holding => 3,
                0 => 1,
                2 => 3,
                same => same,
            };
        }
        out.push(now);
    }
    out
}

/// Labels of an episode as segments by the rule.
///
/// # Errors
/// Those of [`motion`].
pub fn segments(episode: &Episode) -> Result<Vec<Segment>, ReadError> {
    let motion = motion(episode)?;
    Ok(runs(&motion.stamps, &label(&motion)))
}

/// Turns labels by sample into segments.
#[must_use]
pub fn runs(stamps: &[u64], labels: &[u8]) -> Vec<Segment> {
    let mut out: Vec<Segment> = Vec::new();
    for (&from, &label) in stamps.iter().zip(labels) {
        if out.last().is_none_or(|last| last.label != label) {
            out.push(Segment { from, label });
        }
    }
    out
}

/// The labels of rows at `stamps`; the first segment also holds before itself.
#[must_use]
pub fn at(segments: &[Segment], stamps: &[u64]) -> Vec<u8> {
    let find = |&t: &u64| {
        let after = segments.partition_point(|s| s.from <= t);
        segments.get(after.max(1) - 1).map_or(0, |s| s.label)
    };
    stamps.iter().map(find).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten seconds at 60 Hz out of predicates of the time in seconds.
    fn made(chair: fn(f64) -> bool, arm: fn(f64) -> bool, knuckle: fn(f64) -> f64) -> Motion {
        let t: Vec<f64> = (0..600).map(|i| f64::from(i) / 60.0).collect();
        Motion {
            stamps: t.iter().map(|t| (t * 1e9) as u64).collect(),
            chair: t.iter().map(|&t| chair(t)).collect(),
            arm: t.iter().map(|&t| arm(t)).collect(),
            knuckle: t.iter().map(|&t| knuckle(t)).collect(),
        }
    }

    fn order(motion: &Motion) -> Vec<(u8, u64)> {
        runs(&motion.stamps, &label(motion))
            .iter()
            .map(|s| (s.label, s.from / 100_000_000))
            .collect()
    }

    #[test]
    fn a_pick_is_navigating_reaching_grasping_retracting() {
        let pick = made(
            |t| t < 3.0,
            |t| (3.5..6.0).contains(&t) || (7.5..9.0).contains(&t),
            |t| ((t - 6.2) * 0.6).clamp(0.0, 0.5),
        );
        // Closing begins at 6.2 s; the window of its speed puts it up to 0.1 s early.
        assert_eq!(order(&pick), [(0, 0), (1, 35), (2, 61), (3, 75)]);
    }

    #[test]
    fn after_a_drive_with_a_full_hand_the_arm_does_not_reach() {
        let carry = made(
            |t| (3.0..5.0).contains(&t),
            |t| t < 1.0 || (2.2..2.9).contains(&t) || t > 6.0,
            |t| ((t - 1.0) * 0.8).clamp(0.0, 0.5),
        );
        let labels: Vec<u8> = order(&carry).iter().map(|o| o.0).collect();
        assert_eq!(labels, [1, 2, 3, 0, 3]);
    }

    #[test]
    fn a_hand_that_only_opens_grasps_nothing() {
        let open = made(|_| false, |t| t > 1.0, |t| (0.5 - t).max(0.0));
        assert_eq!(order(&open), [(0, 0), (1, 10)]);
    }
}
