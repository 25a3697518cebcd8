//! Lift: raises what is in the hand; out from under a board first, if there is one.

use nalgebra::{Isometry3, Translation3, Vector3};
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::play::{Play, Played};
use super::{Act, Now, Skill, Step};
use crate::clearance::held_balls;
use crate::goal::Goal;
use crate::tool_path::Shape;

/// Heights to raise by under a board, metres, after that of the operator profile.
const LOW: [f64; 5] = [0.13, 0.10, 0.07, 0.04, 0.02];
/// The object is raised above its support by this much before the grip is checked,
/// metres.
const OFF: f64 = 0.012;
/// Room above while lifting, metres.
const ROOM: f64 = 0.004;
/// Distances to move out from under a board, metres.
const OUT: [f64; 5] = [0.26, 0.22, 0.18, 0.14, 0.10];

/// A soft object bows out by this share of what a rigid one does.
const SOFT_BOW: f64 = 0.65;
/// The object is raised straight by this before it moves back as well, metres.
const FIRST: f64 = 0.05;
/// Greatest distance back towards the arm during the lift, metres.
const TOWARDS: [f64; 3] = [0.08, 0.15, 0.22];

/// How far an object is raised for a goal, metres; less when it is only moved
/// elsewhere.
#[must_use]
pub fn height(goal: &Goal, lift: f64) -> f64 {
    match goal {
        Goal::Put { .. } => 0.4 * lift,
        Goal::Lift { .. }
        | Goal::Give { .. }
        | Goal::Bring { .. }
        | Goal::Open { .. }
        | Goal::Close { .. } => lift,
    }
}

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Lift {
    motion: Option<Motion>,
    /// As it was shown.
    play: Option<Play>,
}

impl Skill for Lift {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        if let Some(why) = now.slipped() {
            return Step::Missed(why);
        }
        if self.motion.is_none()
            && self.play.is_none()
            && let Some((one, _)) = now.taken_as()
            && let Some((frame, wander)) = now.memory.playing.clone()
            && !one.lift.is_empty()
        {
            self.play = Some(Play::new(now, &one.lift, &frame).off(wander));
        }
        if let Some(play) = &mut self.play {
            return match play.step(now) {
                Played::Moving(tool, opening) => Step::Going(Act {
                    tool,
                    opening,
                    ..Act::named(Phase::Retracting, "lifting")
                }),
                Played::Late(_) | Played::Arrived => Step::Done,
            };
        }
        if self.motion.is_none() {
            let stops: Vec<_> = stops(now)
                .into_iter()
                .map(|pose| (pose, now.profile.carry_speed))
                .collect();
            self.motion = Some(carried(now, &stops));
        }
        let act = Act::named(Phase::Retracting, "lifting");
        match self.motion.as_ref().map(|motion| motion.step(now)) {
            Some(Progress::Moving(tool)) => Step::Going(Act { tool, ..act }),
            Some(Progress::Late(why)) => {
                // Keeping the object has priority over the exact pose.
                now.note(format!("lifting: {why}"));
                Step::Done
            }
            Some(Progress::Arrived) | None => Step::Done,
        }
    }
}

/// The movement of what is held through `stops` in `house`, in the profile's shape where hand
/// and object then touch nothing and the arm reaches it.
#[must_use]
pub fn carried(now: &mut Now<'_>, stops: &[(Isometry3<f64>, f64)]) -> Motion {
    let item = now.goal.item();
    let held = now.memory.held.unwrap_or_else(|| now.object_in_hand());
    let balls = held_balls(&now.scene.items[item].boxes, &held);
    let taken = now.memory.candidate;
    let width = taken.map_or(0.0, |candidate| candidate.width);
    // A deformable object hangs from the fingers and swings: bow less, without overlap.
    let soft = taken.is_some_and(|candidate| candidate.force.is_some());
    let shape = match now.profile.habits {
        Some(_) if soft => Shape {
            bow: [
                SOFT_BOW * now.profile.shape.bow[0],
                now.profile.shape.bow[1],
            ],
            ..Shape::default()
        },
        Some(_) => now.profile.shape,
        None => Shape::default(),
    };
    Motion::curved(now, stops, &shape, |now, poses| {
        // The first part leaves the support straight enough.
        let start = poses[0].translation.vector;
        let left = |pose: &&Isometry3<f64>| (pose.translation.vector - start).norm() < OFF;
        let poses = &poses[poses.iter().take_while(left).count()..];
        let around = now.scene.around(poses, now.poses, Some(item));
        poses.len() > 1
            && around.hand_is_free(&now.scene.hand, width, poses, ROOM)
            && poses
                .windows(2)
                .all(|leg| around.is_free(&balls, &leg[0], &leg[1], ROOM))
            && now.reaches(poses)
    })
}

/// Paths that raise what is held at `at` by `height` that an arm with its base at
/// `house_from_base` may take, the best first: straight up, or a little up and
/// then up and back towards the arm, which reaches higher there.
#[must_use]
pub fn lift_paths(
    house_from_base: &Isometry3<f64>,
    at: &Isometry3<f64>,
    height: f64,
) -> Vec<Vec<Isometry3<f64>>> {
    let up = Translation3::new(0.0, 0.0, height) * at;
    let low = Translation3::new(0.0, 0.0, height.min(FIRST)) * at;
    let to_base = house_from_base.translation.vector - at.translation.vector;
    let back = Vector3::new(to_base.x, to_base.y, 0.0);
    let back = back / back.norm().max(1e-9);
    let mut paths = vec![vec![up]];
    paths.extend(TOWARDS.map(|by| vec![low, Translation3::from(back * by) * up]));
    paths
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
    let held = now.memory.held.unwrap_or_else(|| now.object_in_hand());
    let balls = held_balls(&now.scene.items[item].boxes, &held);
    let width = now
        .memory
        .candidate
        .map_or(0.0, |candidate| candidate.width);
    let scene = now.scene;
    let free = |height: f64| {
        let (from, to) = (up(OFF.min(height)) * start, up(height) * start);
        around.is_free(&balls, &from, &to, ROOM)
            && around.hand_is_free(&scene.hand, width, &[from, to], -ROOM)
    };
    let whole = height(now.goal, now.profile.grasp.lift);
    let highest = [whole].into_iter().chain(LOW).find(|height| free(*height));
    let first = highest.unwrap_or(whole);
    if first >= whole {
        let base = now.scene.house_from_base(now.observation);
        let paths = lift_paths(&base, &start, whole);
        let path = paths.iter().find(|path| now.reaches(path));
        return path.or(paths.first()).cloned().unwrap_or_default();
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
