//! Lift: raises what is in the hand; out from under a board first, if there is one.

use nalgebra::{Isometry3, Translation3, Vector3};
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::{Act, Now, Skill, Step};
use crate::operate::clearance::held_balls;

/// Heights to raise by under a board, metres; the style's comes first.
const LOW: [f64; 5] = [0.13, 0.10, 0.07, 0.04, 0.02];
/// The thing leaves what it stands on by this much before it is looked at, metres.
const OFF: f64 = 0.012;
/// Room above while lifting, metres.
const ROOM: f64 = 0.004;
/// Distances to draw out from under a board, metres.
const OUT: [f64; 5] = [0.26, 0.22, 0.18, 0.14, 0.10];

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Lift {
    motion: Option<Motion>,
}

impl Skill for Lift {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        if let Some(why) = now.slipped() {
            return Step::Missed(why);
        }
        if self.motion.is_none() {
            let stops: Vec<_> = stops(now)
                .into_iter()
                .map(|pose| (pose, now.style.carry_speed))
                .collect();
            self.motion = Some(Motion::new(now, &stops));
        }
        let act = Act::named(Phase::Retracting, "lifting");
        match self.motion.as_ref().map(|motion| motion.step(now)) {
            Some(Progress::Moving(tool)) => Step::Going(Act { tool, ..act }),
            Some(Progress::Late(why)) => {
                // What it holds is worth more than the exact place.
                now.note(format!("lifting: {why}"));
                Step::Done
            }
            Some(Progress::Arrived) | None => Step::Done,
        }
    }
}

/// Straight up as far as there is room; what is missing after the hand was
/// drawn back.
fn stops(now: &mut Now<'_>) -> Vec<Isometry3<f64>> {
    let start = now.house_from_desired();
    let up = |height: f64| Translation3::new(0.0, 0.0, height);
    let item = now.goal.item();
    let around = now
        .scene
        .around(&[start, up(0.2) * start], now.poses, Some(item));
    let held = now.memory.held.unwrap_or_else(|| now.thing_in_hand());
    let balls = held_balls(&now.scene.items[item].blocks, &held);
    let width = now.memory.way.map_or(0.0, |way| way.width);
    let free = |height: f64| {
        let (from, to) = (up(OFF.min(height)) * start, up(height) * start);
        around.is_free(&balls, &from, &to, ROOM) && around.hand_is_free(width, &[from, to], -ROOM)
    };
    let whole = now.style.grasp.lift;
    let Some(first) = [whole].into_iter().chain(LOW).find(|height| free(*height)) else {
        return vec![up(whole) * start];
    };
    if first >= whole {
        return vec![up(whole) * start];
    }
    let back = start.rotation * -Vector3::z();
    let level = Vector3::new(back.x, back.y, 0.0);
    let level = level / level.norm().max(1e-9);
    let low = up(first) * start;
    for out in OUT {
        let drawn = Translation3::from(level * out) * low;
        let raised = up(whole - first) * drawn;
        if now.reaches(&[low, drawn, raised]) {
            return vec![low, drawn, raised];
        }
    }
    vec![low]
}
