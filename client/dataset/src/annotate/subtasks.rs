//! Phases as text: the action, its object, its place, and the held object.

use crate::label::{NAMES, Segment};

use super::grasps::ChosenGrasp;
use super::state::State;

/// A phase as text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Subtask {
    /// From when and until when it lasts, simulation time, nanoseconds.
    pub from: u64,
    /// The end, the next one's beginning.
    pub to: u64,
    /// 0 to 3, see [`crate::label::NAMES`].
    pub label: u8,
    /// Text.
    pub text: String,
    /// Object of the action.
    pub object: String,
    /// An area, or the goal; empty where neither is known.
    pub place: String,
    /// The object held through most of it; empty without one.
    pub held: String,
}

/// Texts of all phases.
pub(super) fn subtasks(state: &State, phases: &[Segment], grasps: &[ChosenGrasp]) -> Vec<Subtask> {
    let end = state.stamps.last().copied().unwrap_or(0);
    let area = area_of(state);
    let ends = phases.iter().skip(1).map(|next| next.from).chain([end]);
    let mut out: Vec<Subtask> = Vec::new();
    for (at, (phase, to)) in phases.iter().zip(ends).enumerate() {
        let object = taken(phases, at, grasps)
            .unwrap_or(&state.target)
            .to_owned();
        let held = held(state, phase.from, to);
        let holds_target = !held.is_empty() && held == state.target;
        let place = match (state.verb.as_str(), phase.label) {
            ("put", 3) => state.goal.clone(),
            _ => area.clone(),
        };
        let label = phase.label;
        let text = match object == state.target || label == 0 {
            true => words(state, label, holds_target, &area),
            false => amiss(state, label, &object),
        };
        out.push(Subtask {
            from: phase.from,
            to,
            label,
            text,
            object,
            place,
            held,
        });
    }
    out
}

/// The subtasks in order, each once in a row.
pub(super) fn plan(subtasks: &[Subtask]) -> Vec<String> {
    let mut plan: Vec<String> = subtasks.iter().map(|s| s.text.clone()).collect();
    plan.dedup();
    plan
}

/// Object of the hand in a phase: the one that its attempt grasps, which
/// may differ from the target; `None` without a grasp.
fn taken<'a>(phases: &[Segment], at: usize, grasps: &'a [ChosenGrasp]) -> Option<&'a str> {
    // An attempt begins with driving or reaching after anything else.
    let begins = |i: usize| i == 0 || phases[i].label < phases[i - 1].label;
    let first = (0..=at).rev().find(|&i| begins(i)).unwrap_or(0);
    let next = (at + 1..phases.len()).find(|&i| begins(i));
    let from = phases[first].from;
    let to = next.map_or(u64::MAX, |i| phases[i].from);
    let inside = |grasp: &&ChosenGrasp| (from..to).contains(&grasp.stamp);
    let grasp = grasps.iter().find(inside);
    grasp.map(|grasp| grasp.object.as_str())
}

/// Text of a phase with an object other than the target.
fn amiss(state: &State, label: u8, object: &str) -> String {
    let object = state.called(object);
    match label {
        1 => format!("reach for {object}"),
        2 => format!("close the hand around {object}"),
        _ => format!("let go of {object}"),
    }
}

fn words(state: &State, label: u8, holds_target: bool, area: &str) -> String {
    let spoken = |name: &str| name.replace('_', " ");
    if state.target.is_empty() {
        return NAMES[usize::from(label).min(3)].to_owned();
    }
    let target = state.called(&state.target);
    let at = match area {
        "" => String::new(),
        "workstation" => " under the kitchen counter".to_owned(),
        area => format!(" on the {}", spoken(area)),
    };
    match (label, state.verb.as_str()) {
        (0, _) if holds_target => format!("drive with {target} in the hand"),
        (0, _) if area.is_empty() => format!("drive to {target}"),
        (0, _) if area == "workstation" => "drive to the kitchen counter".to_owned(),
        (0, _) => format!("drive to the {}", spoken(area)),
        (1, "open" | "close") => format!("reach for the handle of {target}{at}"),
        (1, _) => format!("reach for {target}{at}"),
        (2, "open" | "close") => format!("close the hand on the handle of {target}"),
        (2, _) => format!("close the hand around {target}"),
        (_, "open") => format!("pull {target} open"),
        (_, "close") => format!("push {target} shut"),
        // Objects are put into a bin and onto other goals.
        (_, "put") if state.goal.ends_with("bin") => {
            format!("put {target} in the {}", spoken(&state.goal))
        }
        (_, "put") => format!("put {target} on the {}", spoken(&state.goal)),
        (_, "bring") => format!("bring {target} to the mouth"),
        (_, "give") => format!("lay {target} in the lap"),
        _ => format!("lift {target}{}", at.replacen(" on ", " from ", 1)),
    }
}

/// The area of the target at the first sample.
fn area_of(state: &State) -> String {
    let slide = state
        .home
        .slides
        .iter()
        .find(|slide| slide.name == state.target);
    if let Some(slide) = slide {
        return slide.area.clone();
    }
    if state.poses.is_empty() {
        return String::new();
    }
    let scene = state.scene(0);
    let area = scene
        .named(&state.target)
        .and_then(|i| scene.entities[i].area);
    area.map_or(String::new(), |i| scene.areas[i].name.clone())
}

/// The object held through most samples of a phase.
fn held(state: &State, from: u64, to: u64) -> String {
    let first = state.stamps.partition_point(|&t| t < from);
    let last = state.stamps.partition_point(|&t| t < to);
    let rows = state.held.get(first..last.max(first)).unwrap_or_default();
    let mut counts = vec![0; state.objects.len()];
    for object in rows.iter().flatten() {
        counts[*object] += 1;
    }
    let most = (0..counts.len()).max_by_key(|&i| counts[i]);
    let most = most.filter(|&i| 2 * counts[i] > rows.len());
    most.map_or(String::new(), |i| state.objects[i].clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attempt_at_the_wrong_object_is_named() {
        let phase = |(from, label)| Segment { from, label };
        // Drives, grasps the can, releases it, reaches again and grasps the bottle.
        let phases = [(0, 0), (10, 1), (20, 2), (30, 3), (50, 1), (60, 2), (70, 3)].map(phase);
        let grasp = |(stamp, object): (u64, &str)| ChosenGrasp {
            stamp,
            object: object.to_owned(),
            name: String::new(),
            index: 0,
            distance: 0.0,
            angle: 0.0,
            alternatives: Vec::new(),
        };
        let grasps = [(24, "can"), (66, "bottle")].map(grasp);
        let all = (0..phases.len()).map(|at| taken(&phases, at, &grasps));
        let all: Vec<_> = all.collect();
        let [can, bottle] = ["can", "bottle"].map(Some);
        assert_eq!(all, [can, can, can, can, bottle, bottle, bottle]);
        assert_eq!(taken(&phases, 1, &[]), None);
    }
}
