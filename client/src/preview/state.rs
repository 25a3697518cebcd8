//! The state that the page shows, as JSON.

use serde::Serialize;

use crate::watch::Recorder;
use wheelarm_drive::watch::{Connection, Happening, Situation};

/// Newest happenings that the page gets.
const HAPPENINGS: usize = 6;

#[derive(Serialize)]
struct Episode<'a> {
    number: u64,
    label: &'a str,
    instruction: &'a str,
    /// Simulated seconds.
    seconds: f64,
}

#[derive(Serialize)]
struct Condition<'a> {
    name: &'a str,
    holds: bool,
    required: bool,
    value: f64,
}

#[derive(Serialize)]
struct Event<'a> {
    /// Seconds ago.
    ago: f64,
    bad: bool,
    text: &'a str,
}

#[derive(Serialize)]
struct State<'a> {
    /// `opening`, `open`, `silent` or `lost`.
    connection: &'static str,
    /// Seconds since it is so; for `silent` and `lost`.
    since: Option<f64>,
    holder: &'a str,
    paused: bool,
    waiting_for: &'a str,
    /// Simulated seconds per wall second.
    factor: f64,
    round_trip_ms: Option<f64>,
    refused: u64,
    task: &'a str,
    seed: u64,
    instruction: &'a str,
    success: bool,
    failure: &'a str,
    elapsed: f64,
    conditions: Vec<Condition<'a>>,
    episode: Option<Episode<'a>>,
    phase: &'a str,
    recorders: Vec<Recorder>,
    cameras: Vec<&'a str>,
    /// m/s and rad/s.
    speed: [f64; 2],
    /// x, y in m and heading in degrees, in `house`.
    chair: Option<[f64; 3]>,
    /// Forward, left, up of the arm's base, m.
    hand: Option<[f64; 3]>,
    opening_mm: Option<f64>,
    pad_force: [f64; 2],
    arm_problem: &'a str,
    events: Vec<Event<'a>>,
}

/// The newest state at `now`, s, as JSON.
#[must_use]
pub fn state_text(situation: &Situation, now: f64) -> String {
    let (connection, since) = match &situation.connection {
        Connection::Opening => ("opening", None),
        Connection::Open => ("open", None),
        Connection::Silent(at) => ("silent", Some(now - at)),
        Connection::Lost(at, _) => ("lost", Some(now - at)),
    };
    let status = situation.status.as_ref();
    let scenario = situation.scenario();
    let evaluation = situation.evaluation.as_ref();
    let newest = situation.happenings.len().saturating_sub(HAPPENINGS);
    let event = |h: &'_ Happening| (now - h.at, h.bad);
    let state = State {
        connection,
        since,
        holder: status.map_or("", |s| &s.holder),
        paused: status.is_some_and(|s| s.paused),
        waiting_for: status.map_or("", |s| &s.waiting_for),
        factor: situation.factor,
        round_trip_ms: situation.round_trip.map(|s| s * 1e3),
        refused: status.map_or(0, |s| s.refused),
        task: scenario.map_or("", |s| s.task()),
        seed: scenario.map_or(0, |s| s.seed()),
        instruction: scenario.map_or("", |s| s.instruction()),
        success: evaluation.is_some_and(|e| e.success),
        failure: evaluation.map_or("", |e| &e.failure),
        elapsed: evaluation.map_or(0.0, |e| e.elapsed_seconds),
        conditions: evaluation
            .map(|e| e.conditions.as_slice())
            .unwrap_or_default()
            .iter()
            .map(|c| Condition {
                name: &c.name,
                holds: c.holds,
                required: c.required,
                value: c.value,
            })
            .collect(),
        episode: situation.episode().map(|e| Episode {
            number: e.header.as_ref().map_or(0, |h| h.episode),
            label: &e.label,
            instruction: &e.instruction,
            seconds: situation.episode_clock().unwrap_or_default(),
        }),
        phase: &situation.phase,
        recorders: status
            .map(|s| s.recorders.iter().map(Recorder::new).collect())
            .unwrap_or_default(),
        cameras: scenario
            .map(|s| s.cameras.iter().map(|c| c.name.as_str()).collect())
            .unwrap_or_default(),
        speed: situation.chair_speed,
        chair: situation
            .chair()
            .map(|[x, y, heading]| [x, y, heading.to_degrees()]),
        hand: situation.hand(),
        opening_mm: situation.opening().map(|m| m * 1e3),
        pad_force: situation.pad_force,
        arm_problem: situation
            .applied
            .as_ref()
            .map_or("", |a| a.arm_problem.as_str()),
        events: situation
            .happenings
            .iter()
            .skip(newest)
            .rev()
            .map(|h| {
                let (ago, bad) = event(h);
                Event {
                    ago,
                    bad,
                    text: &h.text,
                }
            })
            .collect(),
    };
    // Numbers and words always make JSON.
    serde_json::to_string(&state).unwrap_or_else(|_| "{}".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_known_is_still_a_state() {
        let mut situation = Situation::default();
        situation.lose(1.0, "no server");
        let text = state_text(&situation, 3.0);
        let state: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(state["connection"], "lost");
        assert_eq!(state["since"], 2.0);
        assert_eq!(state["events"][0]["bad"], true);
    }
}
