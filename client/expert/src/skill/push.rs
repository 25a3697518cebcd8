//! Push: closed fingers push a door of furniture shut along its arc.

use nalgebra::Isometry3;
use wheelarm_planning::arm_access::FURTHEST;
use wheelarm_planning::footprint_check::Pose2;
use wheelarm_planning::leaf_push::{NoPush, PushShape, PushStop, PushingChair};
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::{ARM_CHECKS, Act, Now, Skill, Step};
use crate::base_placement;
use crate::goal::Goal;
use crate::grasp_candidate::{self, GraspCandidate};
use crate::tool_path::Shape;

/// The door may stay short of the aim by this angle, radians.
const SHORT: f64 = 0.03;
/// Movements along the arc before the push has failed.
const TRIES: usize = 3;
/// Overlap of the legs along the arc: the hand does not stop between them.
const OVERLAP: f64 = 0.5;

/// Most base placements that are searched; the chair has no path to some of them.
const STOPS: usize = 24;

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Push {
    motion: Option<Motion>,
    tries: usize,
}

/// Poses of a hand that pushes the goal's door from where it is: one list, or none where the
/// candidate does not push.
pub(super) fn ways(
    now: &Now<'_>,
    slide: usize,
    candidate: &GraspCandidate,
) -> Vec<Vec<Isometry3<f64>>> {
    let way = candidate.push.and_then(|shape| way(now, slide, &shape));
    way.into_iter().collect()
}

fn way(now: &Now<'_>, slide: usize, shape: &PushShape) -> Option<Vec<Isometry3<f64>>> {
    let leaf = now.scene.leaf(slide)?;
    let (_, aim) = now.goal.aim(now.scene)?;
    let angle = now.observation.slides.get(slide).copied()?;
    Some(leaf.way(&now.scene.hand.closed(), shape, [angle, aim]))
}

/// Base placements from which the arm pushes the goal's door shut, by the search that sampling
/// of the scene uses.
///
/// # Errors
/// Why there is none. [`NoPush::NoFace`] also of goals that close no door on a hinge.
pub(super) fn stops(
    now: &mut Now<'_>,
    is_stop: &dyn Fn(&Pose2) -> bool,
) -> Result<Vec<PushStop>, NoPush> {
    let &Goal::Close { item, slide, .. } = now.goal else {
        return Err(NoPush::NoFace);
    };
    let (leaf, (_, aim)) = (now.scene.leaf(slide))
        .zip(now.goal.aim(now.scene))
        .ok_or(NoPush::NoFace)?;
    let angle = now.observation.slides.get(slide).copied();
    let around = grasp_candidate::around_door(now.scene, item, now.poses);
    let from = now.observation.base_from_tool;
    let hand = now.scene.hand.closed();
    let (reach, checks) = (&mut *now.reach, &mut now.memory.arm_checks);
    let mut reaches = |poses: &[Isometry3<f64>]| {
        *checks += 1;
        *checks <= ARM_CHECKS && base_placement::reaches(&from, poses, &mut *reach)
    };
    let [nearest, furthest] = now.scene.arm_range;
    let mut chair = PushingChair {
        mount: now.scene.chair_from_base,
        range: [nearest, furthest.min(FURTHEST)],
        hand: &hand,
        is_stop,
        reaches: &mut reaches,
    };
    let angles = [angle.ok_or(NoPush::NoFace)?, aim];
    leaf.placements(angles, &around.boxes, &mut chair, STOPS)
}

impl Push {
    /// The movement from where the hand is, which keeps its direction or turns as the door
    /// does.
    fn plan(now: &mut Now<'_>, slide: usize) -> Option<Motion> {
        let shape = now.memory.candidate?.push?;
        let leaf = now.scene.leaf(slide)?;
        let angle = now.observation.slides.get(slide).copied()?;
        let shape = leaf.continued(&shape, &now.house_from_desired(), angle);
        let way = way(now, slide, &shape)?;
        if !now.reaches(&way) {
            return None;
        }
        let speed = 0.7 * now.profile.carry_speed;
        let stops: Vec<_> = way.into_iter().map(|pose| (pose, speed)).collect();
        let shape = Shape {
            overlap: OVERLAP,
            ..Shape::default()
        };
        Some(Motion::shaped(now, &stops, &shape))
    }
}

impl Skill for Push {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let Some((slide, aim)) = now.goal.aim(now.scene) else {
            return Step::Impossible("there is nothing to push".to_owned());
        };
        let angle = now.observation.slides.get(slide).copied().unwrap_or(0.0);
        if angle - aim <= SHORT {
            return Step::Done;
        }
        let act = Act::named(Phase::Retracting, "pushing");
        let degrees = angle.to_degrees();
        let Some(motion) = &self.motion else {
            self.motion = match self.tries < TRIES {
                true => Self::plan(now, slide),
                false => return Step::Missed(format!("the door stays at {degrees:.0}°")),
            };
            self.tries += 1;
            return match self.motion {
                Some(_) => Step::Going(act),
                None => Step::Missed(format!("the arm does not reach on from {degrees:.0}°")),
            };
        };
        match motion.step(now) {
            Progress::Moving(tool) => Step::Going(Act { tool, ..act }),
            Progress::Late(_) | Progress::Arrived => {
                self.motion = None;
                Step::Going(act)
            }
        }
    }
}
