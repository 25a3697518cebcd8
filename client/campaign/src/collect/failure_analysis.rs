//! Cause and tick of the loss of a failed episode, from its recorded signals alone.
//!
//! | cause | tick of the loss |
//! |---|---|
//! | dropped, slipped | last tick with force on both pads |
//! | tipped, unreachable, lost | last tick at which the object was at rest before its last motion |
//! | hard collision, person force, wrong object, knocked over, tilted | tick of the event |
//! | all others | last change of the operator's phase |

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use wheelarm_dataset::read::Episode as Recording;

/// Pad force above which a pad presses, N.
const PRESS_FORCE: f64 = 1.0;
/// Speed below which an object is at rest, m/s.
const REST_SPEED: f64 = 0.02;

/// Cause of the loss of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The object fell.
    Dropped,
    /// The object tipped over in place.
    Tipped,
    /// The object rests out of reach of the arm.
    Unreachable,
    /// The object left the simulated area.
    Lost,
    /// The robot hit furniture above the force limit.
    HardCollision,
    /// The robot or an object pressed the person above the force limit.
    PersonForce,
    /// Another object than the requested one was lifted.
    WrongObject,
    /// Another object was knocked over.
    KnockedOver,
    /// The target tilted beyond its limit.
    Tilted,
    /// The time limit passed.
    Timeout,
    /// The chair found no path.
    NoWay,
    /// The hand did not reach its goal.
    NoReach,
    /// The fingers found no grip.
    NoGrip,
    /// The object slipped while it was lifted or carried.
    Slipped,
    /// The object could not be placed at its goal.
    NotPut,
    /// The sliding part was not moved.
    NotMoved,
    /// The operator finished, and the conditions did not hold.
    NotHeld,
    /// The operator gave up for another reason.
    GaveUp,
}

/// Tick and cause of the loss of an episode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Loss {
    /// Cause.
    pub cause: Cause,
    /// Physics tick of the loss.
    pub tick: u64,
    /// The kept recording, relative to the dataset's folder.
    pub file: String,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
}

impl Cause {
    /// The word in manifests.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Dropped => "dropped",
            Self::Tipped => "tipped",
            Self::Unreachable => "unreachable",
            Self::Lost => "lost",
            Self::HardCollision => "hard_collision",
            Self::PersonForce => "person_force",
            Self::WrongObject => "wrong_object",
            Self::KnockedOver => "knocked_over",
            Self::Tilted => "tilted",
            Self::Timeout => "timeout",
            Self::NoWay => "no_way",
            Self::NoReach => "no_reach",
            Self::NoGrip => "no_grip",
            Self::Slipped => "slipped",
            Self::NotPut => "not_put",
            Self::NotMoved => "not_moved",
            Self::NotHeld => "not_held",
            Self::GaveUp => "gave_up",
        }
    }
}

/// Count of kept recordings of failed attempts by cause, as one sentence; `None` without
/// recordings.
#[must_use]
pub fn sentence<'a>(losses: impl Iterator<Item = &'a Loss>) -> Option<String> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for loss in losses {
        *counts.entry(loss.cause.word()).or_default() += 1;
    }
    let all: usize = counts.values().sum();
    let each = counts
        .iter()
        .map(|(cause, count)| format!("{cause} {count}"));
    let each = each.collect::<Vec<_>>().join(", ");
    (all > 0).then(|| {
        format!("{all} recordings of failed attempts are kept in `failed_episodes/`: {each}")
    })
}

/// Cause and tick of the loss of a recorded episode. Without the needed streams, the tick is
/// that of the end.
#[must_use]
pub fn find_loss(recording: &Recording) -> (Cause, u64) {
    let ticks = |stream: &str| recording.u64s(stream, "tick").unwrap_or_default();
    let codes = recording.texts("evaluation", "failure_code");
    let failed = codes.unwrap_or_default();
    let failed = failed.iter().position(|c| !c.is_empty() && c != "none");
    let evaluated = ticks("evaluation");
    let event = failed.and_then(|i| {
        let codes = recording.texts("evaluation", "failure_code").ok()?;
        Some((cause_of_code(codes.get(i)?)?, *evaluated.get(i)?))
    });
    let last = evaluated.last().copied().unwrap_or_default();
    let names = recording.texts("phase", "name").unwrap_or_default();
    let phases: Vec<(u64, String)> = ticks("phase").into_iter().zip(names).collect();
    let (cause, end) = match event {
        Some(event) => event,
        None => (by_phase(&phases), last),
    };
    let tick = match cause {
        Cause::HardCollision
        | Cause::PersonForce
        | Cause::WrongObject
        | Cause::KnockedOver
        | Cause::Tilted => Some(end),
        Cause::Dropped | Cause::Slipped => last_grip(recording, end),
        Cause::Tipped | Cause::Unreachable | Cause::Lost => last_rest(recording, end),
        _ => last_change(&phases, end),
    };
    (cause, tick.unwrap_or(end))
}

/// The cause of a failure code of the evaluation.
fn cause_of_code(code: &str) -> Option<Cause> {
    Some(match code {
        "dropped" => Cause::Dropped,
        "tipped" => Cause::Tipped,
        "unreachable" => Cause::Unreachable,
        "hard_collision" => Cause::HardCollision,
        "lost" => Cause::Lost,
        "person_force" => Cause::PersonForce,
        "wrong_object" => Cause::WrongObject,
        "knocked_over" => Cause::KnockedOver,
        "tilted" => Cause::Tilted,
        "timeout" => Cause::Timeout,
        _ => return None,
    })
}

/// The cause from the last phase in which the operator worked on the task.
fn by_phase(phases: &[(u64, String)]) -> Cause {
    let mut names = phases.iter().rev().map(|(_, name)| name.as_str());
    let idle = [
        "",
        "over",
        "thinking",
        "opening",
        "retreating",
        "retracting",
    ];
    match names.find(|name| !idle.contains(name)).unwrap_or("") {
        "stowing" | "planning" | "driving" | "driving and preparing" | "stopping" => Cause::NoWay,
        "reaching" | "correcting" | "reaching in" | "approaching" => Cause::NoReach,
        "closing" => Cause::NoGrip,
        "lifting" | "carrying" | "carrying and backing off" => Cause::Slipped,
        "placing" | "letting go" => Cause::NotPut,
        "pulling" | "pushing" => Cause::NotMoved,
        "holding" => Cause::NotHeld,
        _ => Cause::GaveUp,
    }
}

fn last_change(phases: &[(u64, String)], end: u64) -> Option<u64> {
    let mut pairs = phases.windows(2).rev();
    let change = pairs.find(|p| p[1].0 <= end && p[0].1 != p[1].1 && p[1].1 != "over");
    change.map(|p| p[1].0)
}

fn last_grip(recording: &Recording, end: u64) -> Option<u64> {
    let ticks = recording.u64s("contact", "tick").ok()?;
    let forces = recording.f64s("contact", "pad_force").ok()?;
    let mut rows = ticks.iter().zip(forces.outer_iter()).rev();
    let pressed = rows.find(|(tick, pads)| **tick <= end && pads.iter().all(|f| *f > PRESS_FORCE));
    pressed.map(|(tick, _)| *tick)
}

fn last_rest(recording: &Recording, end: u64) -> Option<u64> {
    let target = recording.scenario().ok()?.target?;
    let names = recording.names("object_pose", "twist").ok()?;
    let target = names.iter().position(|name| *name == target)?;
    let ticks = recording.u64s("object_pose", "tick").ok()?;
    let twists = recording.f64s("object_pose", "twist").ok()?;
    let speed = |i: usize| {
        let linear = (0..3).map(|axis| twists[[i, target, axis]]);
        linear.map(|v| v * v).sum::<f64>().sqrt()
    };
    let before = (0..ticks.len()).rev().filter(|&i| ticks[i] <= end);
    let mut moving = before.skip_while(|&i| speed(i) < REST_SPEED);
    moving.find(|&i| speed(i) < REST_SPEED).map(|i| ticks[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn last_working_phase_gives_cause_and_tick() {
        let phases = |names: &[&str]| -> Vec<(u64, String)> {
            let each = names.iter().enumerate();
            each.map(|(i, name)| (4 * i as u64, (*name).to_owned()))
                .collect()
        };
        let stuck = phases(&["driving", "reaching", "reaching", "opening", "over"]);
        assert_eq!(by_phase(&stuck), Cause::NoReach);
        assert_eq!(last_change(&stuck, 16), Some(12));
        assert_eq!(last_change(&stuck, 8), Some(4));
        let carried = phases(&["closing", "carrying", "over"]);
        assert_eq!(by_phase(&carried), Cause::Slipped);
        assert_eq!(by_phase(&[]), Cause::GaveUp);
        assert_eq!(cause_of_code("tipped"), Some(Cause::Tipped));
        assert_eq!(cause_of_code("none"), None);
    }

    #[test]
    fn kept_failures_are_counted_by_cause() {
        let loss = |cause| Loss {
            cause,
            tick: 8,
            file: String::new(),
            sha256: String::new(),
        };
        let losses = [Cause::Tipped, Cause::NoGrip, Cause::Tipped].map(loss);
        let text = sentence(losses.iter()).unwrap();
        assert!(text.starts_with("3 recordings"), "{text}");
        assert!(text.ends_with("no_grip 1, tipped 2"), "{text}");
        assert_eq!(sentence([].into_iter()), None);
        let json = serde_json::to_value(&losses[1]).unwrap();
        assert_eq!(json["cause"], Cause::NoGrip.word());
    }
}
