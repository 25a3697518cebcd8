//! Tuck: before a long way with an object, the hand brings it to where the hand is at home, and
//! the chair drives with the outline of hand and object.
//!
//! A hand that is left over the surface from which it took the object sweeps the room when the
//! chair turns.

use nalgebra::{Isometry3, Translation3, Vector3};

use super::motion::Motion;
use super::{Now, lift};
use crate::clearance::held_balls;
use crate::hand::Ball;
use crate::scene::SceneModel;
use wheelarm_planning::footprint_check::Outline;
use wheelarm_planning::obb::Obb;

/// A region further than this from the object is far, metres on the floor plan.
const FAR: f64 = 1.8;
/// Heights above the present one through which the hand may move back, metres, and distances
/// that it moves back before it rises.
const UP: [f64; 4] = [0.15, 0.10, 0.05, 0.0];
const BACK: [f64; 4] = [0.0, 0.1, 0.2, 0.3];
/// Room beside hand and object, metres.
const ROOM: f64 = 0.004;
/// The object leaves its support before obstacles count, metres.
const OFF: f64 = 0.012;

/// Whether an object is too far from a region for one stop, or for a small drive between both.
pub(super) fn is_far(object: &Isometry3<f64>, region: &Obb) -> bool {
    let way = region.pose.translation.vector - object.translation.vector;
    way.xy().norm() > FAR
}

/// The movement that brings what is held to where the hand is at home; `None` without a free
/// path.
pub(super) fn plan(now: &mut Now<'_>) -> Option<Motion> {
    let house_from_base = now.scene.house_from_base(now.observation);
    let home = house_from_base * now.memory.home?;
    let start = now.house_from_desired();
    let item = now.goal.item();
    let held = now.memory.held.unwrap_or_else(|| now.object_in_hand());
    let balls = held_balls(&now.scene.items[item].boxes, &held);
    let width = now.memory.candidate.map_or(0.0, |taken| taken.width);
    let base = house_from_base.translation.vector;
    let towards = base - start.translation.vector;
    let towards = Vector3::new(towards.x, towards.y, 0.0);
    let towards = towards.try_normalize(1e-6).unwrap_or_else(Vector3::x);
    for rotation in [start.rotation, home.rotation] {
        let end = Isometry3::from_parts(home.translation, rotation);
        for back in BACK {
            for up in UP {
                let drawn = Translation3::from(towards * back) * start;
                let mut raised = drawn;
                raised.translation.z += up;
                let mut over = end;
                over.translation.z = end.translation.z.max(raised.translation.z);
                let stops = [start, drawn, raised, over, end];
                let leaves = Translation3::new(0.0, 0.0, OFF) * start;
                let line = [&[leaves], &stops[1..]].concat();
                let around = now.scene.around(&line, now.poses, Some(item));
                let is_free = around.hand_is_free(&now.scene.hand, width, &line, -ROOM)
                    && (line.windows(2)).all(|leg| around.is_free(&balls, &leg[0], &leg[1], ROOM));
                if is_free && now.reaches(&stops[1..]) {
                    let mut timed: Vec<(Isometry3<f64>, f64)> = Vec::new();
                    for pose in &stops[1..] {
                        if timed.last().is_none_or(|(last, _)| last != pose) {
                            timed.push((*pose, now.profile.carry_speed));
                        }
                    }
                    return Some(lift::carried(now, &timed));
                }
            }
        }
    }
    None
}

/// The scene of a chair that drives with the hand where it is and what it holds.
pub(super) fn with_held(now: &Now<'_>) -> SceneModel {
    let held = now.memory.held.unwrap_or_else(|| now.object_in_hand());
    let width = now.memory.candidate.map_or(0.0, |taken| taken.width);
    let mut balls = held_balls(&now.scene.items[now.goal.item()].boxes, &held);
    balls.extend(now.scene.hand.balls(width));
    let tool = now.observation.base_from_desired;
    let tool = tool.unwrap_or(now.observation.base_from_tool);
    let chair_from_tool = now.scene.chair_from_base * tool;
    SceneModel {
        outlines: extended(&now.scene.outlines, &balls, &chair_from_tool),
        ..now.scene.clone()
    }
}

/// Outlines by height, bottom up, with balls at a pose in the chair.
fn extended(
    outlines: &[(f64, Outline)],
    balls: &[Ball],
    chair_from_balls: &Isometry3<f64>,
) -> Vec<(f64, Outline)> {
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = Vector3::repeat(f64::NEG_INFINITY);
    for ball in balls {
        let middle = chair_from_balls * nalgebra::Point3::from(ball.centre);
        low = low.inf(&middle.coords.add_scalar(-ball.radius));
        high = high.sup(&middle.coords.add_scalar(ball.radius));
    }
    let with_balls = |outline: &Outline| {
        let [back, front, right, left] = outline.sides;
        let sides = [
            back.min(low.x),
            front.max(high.x),
            right.min(low.y),
            left.max(high.y),
        ];
        Outline { sides }
    };
    let mut bottom = 0.0;
    let mut slices = Vec::new();
    for (top, outline) in outlines {
        for (end, is_held) in [(low.z, false), (high.z, true), (*top, false)] {
            let end = end.min(*top);
            if end > bottom {
                let outline = if is_held {
                    with_balls(outline)
                } else {
                    *outline
                };
                slices.push((end, outline));
                bottom = end;
            }
        }
    }
    if high.z > bottom {
        let sides = [low.x, high.x, low.y, high.y];
        slices.push((high.z, Outline { sides }));
    }
    slices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn held_object_extends_the_outline_at_its_height() {
        let outlines = [
            (
                0.5,
                Outline {
                    sides: [-0.2, 0.8, -0.3, 0.4],
                },
            ),
            (
                1.5,
                Outline {
                    sides: [-0.2, 0.5, -0.3, 0.4],
                },
            ),
        ];
        let ball = Ball {
            centre: Vector3::new(0.0, 0.0, 0.1),
            radius: 0.05,
        };
        let at = |z: f64| extended(&outlines, &[ball], &Isometry3::translation(0.9, 0.42, z));
        let front = |slices: &[(f64, Outline)], z: f64| {
            let slice = slices.iter().find(|(top, _)| z <= *top).expect("a slice");
            slice.1.sides
        };
        let slices = at(0.9);
        assert_eq!(slices.len(), 4);
        assert_eq!(front(&slices, 0.3)[1], 0.8);
        assert_eq!(front(&slices, 0.9)[1], 0.5);
        assert!((front(&slices, 1.0)[1] - 0.95).abs() < 1e-12);
        assert!((front(&slices, 1.0)[3] - 0.47).abs() < 1e-12);
        assert_eq!(front(&slices, 1.2)[1], 0.5);
        // Across two outlines, and above all of them.
        assert!((front(&at(0.4), 0.48)[1] - 0.95).abs() < 1e-12);
        assert!((front(&at(0.4), 0.52)[1] - 0.95).abs() < 1e-12);
        assert!((front(&at(1.6), 1.7)[0] - 0.85).abs() < 1e-12);
    }
}
