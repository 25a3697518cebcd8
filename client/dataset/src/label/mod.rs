//! WheelArm-Sim's four labels by a rule that reads only recorded signals: speed
//! of the chair, speed of the arm, angle of the knuckle, force at the finger
//! tips, position of drawers. Published phases are never used;
//! [`agreement`] compares with it.
//!
//! The rule walks through time:
//! - the chair drives: navigating, unless a full hand draws a drawer with it;
//! - at rest with an empty hand, the arm starts to move: reaching;
//! - the knuckle starts to close on something (a finger tip touches, or the hand
//!   shuts completely around nothing): grasping; a hand that closes a little in
//!   the air to take its shape does not grasp;
//! - it has closed and the arm, or the chair with a drawer, starts to move:
//!   retracting, which lasts (lifting, carrying, placing, pulling) until the
//!   chair drives or the hand closes again. After a drive with a full hand the
//!   arm's motion is retracting, not reaching.
//!
//! The paper ends navigating when the chair's speed falls to zero; the scripted
//! operator publishes reaching about a second later, when the arm moves, and
//! the rule follows that. `docs/train-and-evaluate/process.md` lists the episodes on which the
//! rule was chosen, and its results on episodes recorded afterwards.

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
/// Shorter rests belong to the drive; shorter drives are a shaking of the chair
/// by its arm, nanoseconds.
const REST: u64 = 300_000_000;
/// The arm moves when a joint is faster than this, rad/s: well above what a
/// stiff grip shakes it by.
const ARM_MOVES: f64 = 0.05;
/// The knuckle closes or opens faster than this, rad/s.
const KNUCKLE_MOVES: f64 = 0.1;
/// Window of the knuckle's speed, nanoseconds: its angle counts, a contact
/// shakes its speed. A closing is found up to this much too early.
const WINDOW: u64 = 100_000_000;
/// A closing or opening by less than this is ignored, rad.
const STROKE: f64 = 0.05;
/// A finger tip touches from this force, N; the weight of the pads is far below.
const TOUCH: f64 = 2.0;
/// A touch belongs to a closing until so long after it, nanoseconds.
const TOUCH_LATE: u64 = 500_000_000;
/// A hand whose pads are closer than this holds nothing but has tried to, m: thinner than
/// any object.
const SHUT: f64 = 0.0116;
/// A drive that draws furniture further than this is a pull, m.
const PULL: f64 = 0.02;

/// A label from a time on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Simulation time from which it applies, nanoseconds.
    pub from: u64,
    /// 0 to 3.
    pub label: u8,
}

/// Inputs of the rule, sampled together.
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
    /// Whether the pads are closer than any object is thick.
    pub shut: Vec<bool>,
    /// Whether a finger tip touches; true throughout where it was not recorded.
    pub touch: Vec<bool>,
    /// Sum of the openings of all drawers, metres.
    pub drawn: Vec<f64>,
}

/// Reads the signals of the rule.
///
/// # Errors
/// When the file has no joint states or poses, or one of them has another size than
/// it must have.
pub fn motion(episode: &Episode) -> Result<Motion, ReadError> {
    let stamps = episode.stamps("joint_state")?;
    let (robot, roles) = episode.roles()?;
    let position = numbers(episode, "joint_state", "position")?;
    let velocity = numbers(episode, "joint_state", "velocity")?;
    let width = robot.joints.len().max(1);
    let frames = robot.frames.len();
    let twist = numbers(episode, "pose", "twist")?;
    let pose_stamps = episode.stamps("pose")?;
    let drives = stamps.iter().map(|&t| {
        let row = nearest(&pose_stamps, t, REST)?;
        let at = 6 * (row * frames + roles.chair);
        let v = twist.get(at..at + 6)?;
        Some(v[0].hypot(v[1]) > DRIVES || v[5].abs() > TURNS)
    });
    let touch = match numbers(episode, "contact", "pad_force") {
        Ok(force) => {
            let times = episode.stamps("contact")?;
            let touches = |row: usize| {
                let pads = force.get(2 * row..2 * row + 2);
                pads.is_some_and(|p| p.iter().any(|f| *f > TOUCH))
            };
            let at = |t: &u64| nearest(&times, *t, REST).is_some_and(touches);
            stamps.iter().map(at).collect()
        }
        Err(problem @ ReadError::Shape { .. }) => return Err(problem),
        Err(_) => vec![true; stamps.len()],
    };
    let drawn = if episode.has("furniture_joint") {
        let times = episode.stamps("furniture_joint")?;
        let all = numbers(episode, "furniture_joint", "position")?;
        let slides = all.len() / times.len().max(1);
        let sum = |row: usize| all[row * slides..(row + 1) * slides].iter().sum::<f64>();
        let at = |t: &u64| nearest(&times, *t, REST).map_or(0.0, sum);
        stamps.iter().map(at).collect()
    } else {
        vec![0.0; stamps.len()]
    };
    let knuckle: Vec<f64> = position
        .chunks_exact(width)
        .map(|row| row[roles.knuckle])
        .collect();
    let is_shut = |&angle: &f64| robot.opening(angle).is_some_and(|gap| gap < SHUT);
    let mut out = Motion {
        shut: knuckle.iter().map(is_shut).collect(),
        touch,
        drawn,
        chair: drives.map(|d| d.unwrap_or(false)).collect(),
        arm: velocity
            .chunks_exact(width)
            .map(|row| roles.arm.iter().any(|&i| row[i].abs() > ARM_MOVES))
            .collect(),
        knuckle,
        stamps,
    };
    bridge(&mut out.chair, &out.stamps, REST);
    drop_short(&mut out.chair, &out.stamps, REST);
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

/// Sets runs of true entries shorter than `least` nanoseconds to false.
fn drop_short(flags: &mut [bool], stamps: &[u64], least: u64) {
    let mut from = 0;
    for run in flags.chunk_by_mut(|a, b| a == b) {
        let to = from + run.len();
        if stamps[to - 1] - stamps[from] < least {
            run.fill(false);
        }
        from = to;
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

/// Intervals in which the chair's drives pull furniture.
fn pulls(motion: &Motion) -> Vec<bool> {
    let mut out = vec![false; motion.chair.len()];
    let mut from = 0;
    for drive in motion.chair.chunk_by(|a, b| a == b) {
        let to = from + drive.len();
        let way = (motion.drawn[to - 1] - motion.drawn[from]).abs();
        out[from..to].fill(drive[0] && way > PULL);
        from = to;
    }
    out
}

/// The label at every sample of the motion.
#[must_use]
pub fn label(motion: &Motion) -> Vec<u8> {
    let mut closings = strokes(motion, 1.0);
    closings.retain(|&(a, b)| {
        let late = motion.stamps[b] + TOUCH_LATE;
        let end = motion.stamps.partition_point(|&t| t <= late);
        motion.shut[b] || motion.touch[a..end].contains(&true)
    });
    let openings = strokes(motion, -1.0);
    let pulls = pulls(motion);
    let inside = |runs: &[(usize, usize)], i: usize| runs.iter().any(|&(a, b)| a <= i && i <= b);
    let mut out = Vec::with_capacity(motion.stamps.len());
    let (mut now, mut holding) = (0, false);
    for (i, &pulled) in pulls.iter().enumerate() {
        let closing = inside(&closings, i);
        if inside(&openings, i) {
            holding = false;
        }
        let pulling = holding && pulled;
        if motion.chair[i] && !pulling {
            now = 0;
        } else if closing {
            now = 2;
            holding = true;
        } else if motion.arm[i] || pulling {
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

/// The labels of rows at `stamps`; the first segment also applies before its start.
#[must_use]
pub fn labels_at(segments: &[Segment], stamps: &[u64]) -> Vec<u8> {
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
            shut: t.iter().map(|&t| knuckle(t) > 0.7).collect(),
            touch: t.iter().map(|&t| knuckle(t) >= 0.5).collect(),
            drawn: vec![0.0; t.len()],
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
    fn short_rests_and_short_drives_are_none() {
        let stamps: Vec<u64> = (0..10).map(|i| i * 100).collect();
        let mut flags = [0, 1, 1, 0, 1, 1, 0, 0, 0, 1].map(|f| f == 1);
        bridge(&mut flags, &stamps, 300);
        assert_eq!(flags, [0, 1, 1, 1, 1, 1, 0, 0, 0, 1].map(|f| f == 1));
        drop_short(&mut flags, &stamps, 300);
        assert_eq!(flags, [0, 1, 1, 1, 1, 1, 0, 0, 0, 0].map(|f| f == 1));
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
    fn hand_that_closes_in_the_air_does_not_grasp() {
        let shaped = made(
            |t| t < 1.0,
            |t| (2.0..4.0).contains(&t) || t > 6.0,
            |t| ((t - 1.2) * 0.6).clamp(0.0, 0.2) + ((t - 4.5) * 0.6).clamp(0.0, 0.3),
        );
        // Closing begins at 4.5 s, found up to 0.1 s early.
        assert_eq!(order(&shaped), [(0, 0), (1, 20), (2, 44), (3, 60)]);
    }

    #[test]
    fn chair_that_pulls_a_drawer_with_a_closed_hand_retracts() {
        let mut pull = made(
            |t| t < 2.0 || (7.0..9.0).contains(&t),
            |t| (2.5..4.0).contains(&t),
            |t| ((t - 4.5) * 0.6).clamp(0.0, 0.5),
        );
        let labels = |m: &Motion| order(m).iter().map(|o| o.0).collect::<Vec<_>>();
        assert_eq!(labels(&pull), [0, 1, 2, 0], "a drive with no drawer");
        for (i, drawn) in pull.drawn.iter_mut().enumerate() {
            *drawn = ((i as f64 / 60.0 - 7.1) * 0.08).clamp(0.0, 0.14);
        }
        assert_eq!(labels(&pull), [0, 1, 2, 3]);
    }

    #[test]
    fn a_hand_that_only_opens_grasps_nothing() {
        let open = made(|_| false, |t| t > 1.0, |t| (0.5 - t).max(0.0));
        assert_eq!(order(&open), [(0, 0), (1, 10)]);
    }
}
