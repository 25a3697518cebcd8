//! Place: carries the held object over the region, lowers it, releases it and moves the
//! hand back.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::play::{Play, Played};
use super::{Act, Now, Skill, Step, lift};
use crate::clearance::held_balls;
use crate::demonstration::adapt;
use crate::grasp_candidate::GraspCandidate;
use crate::tool_path::distance;
use wheelarm_planning::obb::Obb;

/// The hand approaches from this far above, metres.
const ABOVE: f64 = 0.06;
/// The hand corrects a lean of the object from this on, sine of its angle: 1.5°.
const LEAN: f64 = 0.026;
/// The hand releases this far above the region, metres.
const DROP: f64 = 0.003;
/// Turns about the vertical that are tried besides the one of the grasp, radians.
const TURNS: [f64; 9] = [0.0, 0.35, -0.35, 0.7, -0.7, 1.1, -1.1, 1.57, -1.57];
/// The path there: metres back towards the arm, where there are fewer objects, and
/// metres up.
const PATHS: [[f64; 2]; 10] = [
    [0.0, 0.0],
    [0.10, 0.0],
    [0.18, 0.0],
    [0.10, 0.05],
    [0.18, 0.05],
    [0.25, 0.05],
    [0.0, 0.10],
    [0.18, 0.10],
    [0.0, 0.15],
    [0.25, 0.15],
];
/// Clearance of hand and object beside the path, metres; the second when the first is
/// not possible.
const CLEAR: [f64; 2] = [0.015, 0.0];
/// A held object is checked in slices no thicker than this, metres.
const SLICE: f64 = 0.03;
/// Time for the fingers to open, seconds.
const OPENING: f64 = 0.8;
/// Longest time until what springs back leaves the pads, seconds.
const LONGEST: f64 = 4.0;
/// A pad with less force has released, N.
const LOOSE: f64 = 0.05;
/// The fingers open wider than the object by this much, metres.
const ROOM: f64 = 0.03;

#[derive(Clone, Debug)]
enum State {
    Choose,
    Over(Motion, GraspCandidate),
    Lower(Motion, GraspCandidate),
    Open {
        since: f64,
    },
    Retreat(Motion),
    /// As it was shown.
    Shown(Play),
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Place {
    state: State,
}

impl Place {
    /// Begins.
    #[must_use]
    pub fn new() -> Self {
        Self {
            state: State::Choose,
        }
    }

    fn choose(&mut self, now: &mut Now<'_>) -> Step {
        let Some((candidate, stops)) = choose(now) else {
            return now.elsewhere("the arm cannot put it down from here");
        };
        let stops: Vec<_> = stops
            .into_iter()
            .map(|pose| (pose, now.profile.carry_speed))
            .collect();
        self.state = State::Over(lift::carried(now, &stops), candidate);
        Step::Going(Act::named(Phase::Retracting, "carrying"))
    }
}

impl Default for Place {
    fn default() -> Self {
        Self::new()
    }
}

impl Skill for Place {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let holds = matches!(self.state, State::Over(..) | State::Choose);
        if let (true, Some(why)) = (holds, now.slipped()) {
            return Step::Missed(why);
        }
        match self.state.clone() {
            State::Choose => self.choose(now),
            State::Over(motion, candidate) => match motion.step(now) {
                Progress::Moving(tool) => Step::Going(Act {
                    tool,
                    ..Act::named(Phase::Retracting, "carrying")
                }),
                Progress::Late(why) => Step::Missed(format!("carrying: {why}")),
                Progress::Arrived => {
                    if let Some(play) = playing(now, &candidate) {
                        now.memory.held = None;
                        self.state = State::Shown(play);
                        return Step::Going(Act::named(Phase::Retracting, "placing"));
                    }
                    let speed = now.profile.approach_speed * 0.7;
                    let turned = uprighted(now, &candidate);
                    let stops = turned.map_or(vec![(candidate.grasp, speed)], |at| {
                        vec![(above(&at), speed), (at, speed)]
                    });
                    self.state = State::Lower(Motion::new(now, &stops), candidate);
                    Step::Going(Act::named(Phase::Retracting, "placing"))
                }
            },
            State::Lower(motion, candidate) => match motion.step(now) {
                Progress::Moving(tool) => Step::Going(Act {
                    tool,
                    ..Act::named(Phase::Retracting, "placing")
                }),
                // It touches the support a little earlier than planned.
                Progress::Late(_) | Progress::Arrived => {
                    self.state = State::Open {
                        since: now.observation.time,
                    };
                    now.memory.held = None;
                    Step::Going(Act {
                        opening: Some(now.scene.hand.stroke.min(candidate.width + ROOM)),
                        ..Act::named(Phase::Retracting, "letting go")
                    })
                }
            },
            State::Open { since } => {
                let open = now.observation.time - since;
                let loose = now.observation.pad_force.iter().all(|force| *force < LOOSE);
                if open > OPENING && (loose || open > LONGEST) {
                    let at = now.house_from_desired();
                    // Out of the limbs of a deformable object along the approach.
                    let soft = now
                        .memory
                        .candidate
                        .filter(|candidate| candidate.force.is_some());
                    let out = soft.map_or(ABOVE, |candidate| {
                        distance(&candidate.pregrasp, &candidate.grasp)
                    });
                    let back = at * Translation3::new(0.0, 0.0, -out);
                    let stop = (back, now.profile.approach_speed);
                    self.state = State::Retreat(Motion::new(now, &[stop]));
                }
                Step::Going(Act::named(Phase::Retracting, "letting go"))
            }
            State::Shown(mut play) => {
                let played = play.step(now);
                self.state = State::Shown(play);
                match played {
                    Played::Moving(tool, opening) => Step::Going(Act {
                        tool,
                        opening,
                        ..Act::named(Phase::Retracting, "placing")
                    }),
                    Played::Late(_) | Played::Arrived => Step::Done,
                }
            }
            State::Retreat(motion) => match motion.step(now) {
                Progress::Moving(tool) => Step::Going(Act {
                    tool,
                    ..Act::named(Phase::Retracting, "retracting")
                }),
                Progress::Late(_) | Progress::Arrived => Step::Done,
            },
        }
    }
}

/// A pose above another one.
fn above(at: &Isometry3<f64>) -> Isometry3<f64> {
    Translation3::new(0.0, 0.0, ABOVE) * at
}

/// The pose of the end effector that puts the object down as the candidate means to, when it has
/// turned in the hand since it was grasped: it would touch the region with an edge, and tip.
fn uprighted(now: &mut Now<'_>, candidate: &GraspCandidate) -> Option<Isometry3<f64>> {
    let is_soft = now
        .memory
        .candidate
        .is_some_and(|taken| taken.force.is_some());
    let held = now.memory.held.filter(|_| !is_soft)?;
    let present = now.object_in_hand();
    let planned = candidate.grasp * held;
    // What is up when it is put down.
    let up = planned.rotation.inverse() * Vector3::z();
    let found = candidate.grasp.rotation * (present.rotation * up);
    let at = planned * present.inverse();
    let leans = found.cross(&Vector3::z()).norm() > LEAN;
    (leans && now.reaches(&[above(&at), at])).then_some(at)
}

/// The stretch that was shown for a candidate to put down what is in the hand.
fn playing(now: &Now<'_>, candidate: &GraspCandidate) -> Option<Play> {
    let shown = candidate.shown?;
    let putting = now.shown.list.get(shown.index)?.putting.as_ref()?;
    let held = now.memory.held?;
    let after = adapt::correction(putting, &held, shown.turn);
    let region = now.goal.region()?.pose;
    Some(Play::new(now, &putting.track, &region).after(after))
}

/// The grasp of the held object; its present pose in the hand when the grasp is
/// unknown.
#[must_use]
pub fn taken(now: &Now<'_>, tool_from_item: &Isometry3<f64>) -> GraspCandidate {
    let at = now.object() * tool_from_item.inverse();
    now.memory.candidate.unwrap_or(GraspCandidate {
        pregrasp: at,
        grasp: at,
        opening: 0.03,
        width: 0.03,
        force: None,
        lean: 0.0,
        backoff: 0.0,
        cost: 0.0,
        wish: 0.0,
        shown: None,
        push: None,
    })
}

/// Candidates to put down an object with the pose `tool_from_item` in the hand that was
/// grasped as `taken`: the demonstrated ones, then the operator's own.
#[must_use]
pub fn candidates(
    now: &Now<'_>,
    tool_from_item: &Isometry3<f64>,
    taken: &GraspCandidate,
) -> Vec<GraspCandidate> {
    let Some(region) = now.goal.region() else {
        return Vec::new();
    };
    let shown = taken.shown.iter();
    let shown =
        shown.flat_map(|as_shown| adapt::puttings(now.shown, now.goal, tool_from_item, as_shown));
    shown
        .chain(own(now, &region, tool_from_item, taken.width))
        .collect()
}

/// The operator's own.
fn own(
    now: &Now<'_>,
    region: &Obb,
    tool_from_item: &Isometry3<f64>,
    width: f64,
) -> Vec<GraspCandidate> {
    let boxes = &now.scene.items[now.goal.item()].boxes;
    // Rotation before the grasp, or the present one.
    let lying = now.memory.rest.unwrap_or_else(|| now.object()).rotation;
    let top = region.pose.translation.z - region.half.z;
    TURNS
        .iter()
        .map(|turn| {
            let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *turn) * lying;
            // Put the middle of the object over the middle of the region.
            let mut low = Vector3::repeat(f64::INFINITY);
            let mut high = Vector3::repeat(f64::NEG_INFINITY);
            for corner in boxes.iter().flat_map(|obb| obb.corners()) {
                let corner: Point3<f64> = turned * corner;
                low = low.inf(&corner.coords);
                high = high.sup(&corner.coords);
            }
            let middle = (low + high) / 2.0;
            let put = Isometry3::from_parts(
                Translation3::new(
                    region.pose.translation.x - middle.x,
                    region.pose.translation.y - middle.y,
                    top + DROP - low.z,
                ),
                turned,
            );
            let at = put * tool_from_item.inverse();
            GraspCandidate {
                pregrasp: above(&at),
                grasp: at,
                opening: width,
                width,
                force: None,
                lean: 0.0,
                backoff: 0.0,
                cost: (turn / 0.7).powi(2),
                wish: 0.0,
                shown: None,
                push: None,
            }
        })
        .collect()
}

/// The candidate to put it down and the stops up to its pregrasp.
fn choose(now: &mut Now<'_>) -> Option<(GraspCandidate, Vec<Isometry3<f64>>)> {
    let start = now.house_from_desired();
    let item = now.goal.item();
    // A deformable object hangs in another shape than it lay.
    let soft = now
        .memory
        .candidate
        .is_some_and(|candidate| candidate.force.is_some());
    let held = now.memory.held.filter(|_| !soft);
    let held = held.unwrap_or_else(|| now.object_in_hand());
    let taken = taken(now, &held);
    let width = taken.width;
    let balls = held_balls(&slices(&now.scene.items[item].boxes), &held);
    let candidates = candidates(now, &held, &taken);
    let base = now
        .scene
        .house_from_base(now.observation)
        .translation
        .vector;
    let towards = Vector3::new(
        base.x - start.translation.x,
        base.y - start.translation.y,
        0.0,
    );
    let towards = towards.try_normalize(1e-6).unwrap_or_else(Vector3::x);
    for margin in CLEAR {
        for candidate in &candidates {
            let around = now
                .scene
                .around(&[start, candidate.pregrasp], now.poses, Some(item));
            for [back, height] in PATHS {
                let aside = Translation3::from(towards * back + Vector3::z() * height);
                let stops = [
                    start,
                    aside * start,
                    aside * candidate.pregrasp,
                    candidate.pregrasp,
                ];
                let is_free = around.hand_is_free(&now.scene.hand, width, &stops, margin)
                    && stops
                        .windows(2)
                        .all(|leg| around.is_free(&balls, &leg[0], &leg[1], margin));
                let stops = if [back, height] == PATHS[0] {
                    &stops[3..]
                } else {
                    &stops[1..]
                };
                if is_free && now.reaches(&[stops, &[candidate.grasp]].concat()) {
                    return Some((*candidate, stops.to_vec()));
                }
            }
        }
    }
    let candidate = candidates
        .into_iter()
        .find(|candidate| now.reaches(&[candidate.pregrasp, candidate.grasp]))?;
    now.note("something stands in the way of what it carries".to_owned());
    Some((candidate, vec![candidate.pregrasp]))
}

/// The boxes cut across their longest side, so that nothing fits between two
/// points at which they are looked at.
fn slices(boxes: &[Obb]) -> Vec<Obb> {
    let cut = |obb: &Obb| {
        let axis = obb.half.imax();
        let count = (2.0 * obb.half[axis] / SLICE).ceil().max(1.0);
        let half = obb.half[axis] / count;
        let obb = *obb;
        (0..count as usize).map(move |i| {
            let mut slice = obb;
            let mut offset = Vector3::zeros();
            offset[axis] = (2.0 * i as f64 + 1.0) * half - obb.half[axis];
            slice.pose = obb.pose * Translation3::from(offset);
            slice.half[axis] = half;
            slice
        })
    };
    boxes.iter().flat_map(cut).collect()
}
