//! Reach: chooses a grasp candidate for the present pose of the chair, moves the hand
//! to the pregrasp and then straight to the grasp. A hand that another driver left in
//! front of the object is corrected on the spot, with the least retreat.

use nalgebra::{Isometry3, Translation3};
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::play::{Play, Played};
use super::{Act, Now, Skill, Step, bring, lift, push};
use crate::demonstration::adapt;
use crate::goal::Goal;
use crate::grasp_candidate::{self, GraspCandidate, MARGINS};
use crate::habits::ApproachHabit;
use crate::tool_path::{Shape, distance};
use wheelarm_planning::footprint_check::wrap;

/// Heights of a path over the objects that are tried, metres.
const OVER: [f64; 5] = [0.08, 0.14, 0.20, 0.26, 0.32];
/// A candidate counts as refused within this, metres and radians.
const SAME: [f64; 2] = [0.01, 0.1];
/// The object counts as moved when it is this far from where the hand aimed, metres.
const MOVED: f64 = 0.015;
/// Forced miss of the hand: clearance between finger and object, and the distance short
/// of it for lack of room beside it, metres.
const BESIDE: [f64; 2] = [0.015, 0.09];
/// Most candidates that are checked from one pose of the chair.
const LOOKS: usize = 60;
/// Distance before the grasp at which a hand is corrected on the spot, metres.
const SHORT_STANDOFF: f64 = 0.03;
/// A hand that is further from the pregrasp than this has misjudged it, metres.
const CORRECTED: f64 = 0.008;
/// Such a hand is this close to the pregrasp at most, metres and radians.
const ON_THE_SPOT: [f64; 2] = [0.25, 0.9];
/// Room that a curved path keeps, metres.
const CURVE_MARGIN: f64 = 0.004;
/// Retreats of the hand that are tried first, metres: the smallest that works is used.
const BACK: [f64; 6] = [0.0, 0.02, 0.04, 0.06, 0.09, 0.12];
/// Share of the way from the pregrasp to the grasp on which the fingers are around the
/// object.
const AROUND: f64 = 0.7;
/// A candidate for which the chair was not placed is worse by this for each of these
/// metres and radians in which it differs.
const UNPLANNED: [f64; 2] = [0.03, 0.3];
/// Longest time until chair and fingers are ready for it, seconds.
const LONGEST_READY: f64 = 3.0;

#[derive(Clone, Debug)]
enum State {
    /// Brakes and opens, since then.
    Ready(Option<f64>),
    Aim,
    ToPregrasp(Motion),
    /// To the pregrasp, after it was misjudged.
    Correct(Motion),
    /// Past the pregrasp without a stop, to the grasp.
    Blend(Motion),
    Approach(Motion),
    /// As it was shown.
    Shown(Play),
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Reach {
    state: State,
    /// The object in `house` when the hand was aimed at it.
    aimed: Option<Isometry3<f64>>,
    /// Ends in front of the object.
    before: bool,
    /// From wherever the hand was left.
    on_the_spot: bool,
}

impl Reach {
    /// Begins.
    #[must_use]
    pub fn new() -> Self {
        Self {
            state: State::Aim,
            aimed: None,
            before: false,
            on_the_spot: false,
        }
    }

    /// Begins at the pose in which another driver left the hand: brakes, opens, and
    /// goes straight on from in front of the object.
    #[must_use]
    pub fn on_the_spot() -> Self {
        Self {
            state: State::Ready(None),
            on_the_spot: true,
            ..Self::new()
        }
    }

    /// Ends in front of the object.
    #[must_use]
    pub fn before() -> Self {
        Self {
            before: true,
            ..Self::new()
        }
    }

    /// Waits until the chair rests and the fingers are open.
    fn ready(&mut self, since: Option<f64>, now: &Now<'_>) -> Step {
        let begun = since.unwrap_or(now.observation.time);
        let waited = now.observation.time - begun;
        let [speed, rate] = now.observation.chair_speed;
        let rests = speed.abs() < 0.005 && rate.abs() < 0.01;
        let ready = rests && now.scene.hand.is_open(now.observation.knuckle);
        self.state = match ready || waited > LONGEST_READY {
            true => State::Aim,
            false => State::Ready(Some(begun)),
        };
        Step::Going(Act {
            base: Some([0.0, 0.0]),
            opening: since.is_none().then_some(now.scene.hand.stroke),
            ..Act::named(Phase::Reaching, "getting ready")
        })
    }

    fn aim(&mut self, now: &mut Now<'_>) -> Step {
        if self.on_the_spot
            && let Some((candidate, stops)) = choose_on_the_spot(now)
        {
            self.aimed = Some(now.object());
            let stops: Vec<_> = stops
                .into_iter()
                .map(|pose| (pose, now.profile.approach_speed))
                .collect();
            self.state = State::ToPregrasp(Motion::new(now, &stops));
            now.memory.candidate = Some(candidate);
            now.note("goes on from where the hand is".to_owned());
            return Step::Going(Act {
                opening: Some(candidate.opening),
                ..Act::named(Phase::Reaching, "reaching")
            });
        }
        let mut chosen = choose(now);
        // The cause of the last failure may be gone.
        if chosen.is_none() && now.memory.hindered && !now.memory.refused.is_empty() {
            now.memory.refused.clear();
            chosen = choose(now);
        }
        let Some((mut candidate, mut stops)) = chosen else {
            return now.elsewhere("the arm cannot take it from here");
        };
        self.aimed = Some(now.object());
        if std::mem::take(&mut now.memory.aside) {
            let by = beside(now, &candidate, &stops);
            candidate.pregrasp *= by;
            candidate.grasp *= by;
            if let Some(last) = stops.last_mut() {
                *last *= by;
            }
        }
        self.state = match self.before {
            true => approach_stopping(now, &candidate, &stops),
            false => approach(now, &candidate, &stops),
        };
        now.memory.candidate = Some(candidate);
        if let Some((one, _)) = now.taken_as() {
            let note = format!("comes as in {}", one.source);
            now.note(note);
        }
        now.note(format!(
            "comes {}leaning {:.0}°, {:.0} mm shallower, open {:.0} mm",
            if candidate.heading().is_some() {
                ""
            } else {
                "from above, "
            },
            candidate.lean.to_degrees(),
            candidate.backoff * 1e3,
            candidate.opening * 1e3
        ));
        Step::Going(Act {
            opening: Some(candidate.opening),
            ..Act::named(Phase::Reaching, "reaching")
        })
    }
}

impl Reach {
    /// Begins the demonstrated stretch, relative to the pose of the object at which the
    /// hand was aimed.
    fn begin_to_play(&mut self, now: &mut Now<'_>) {
        let object = self.aimed.unwrap_or_else(|| now.object());
        let Some((one, shown)) = now.taken_as() else {
            return;
        };
        let frame = object * adapt::turned(shown.turn);
        let wander = now
            .shown
            .wander(one.approach.duration(), one.opening - one.width);
        let play = Play::new(now, &one.approach, &frame).off(wander);
        now.memory.playing = Some((frame, play.off_at_end()));
        self.state = State::Shown(play);
    }

    fn play(&mut self, now: &mut Now<'_>) -> Step {
        let State::Shown(play) = &mut self.state else {
            return Step::Done;
        };
        let moved = self.aimed.map_or(0.0, |at| distance(&at, &now.object()));
        if now.memory.hindered && moved > MOVED {
            return Step::Missed(format!("it was moved by {:.0} mm", moved * 1e3));
        }
        match play.step(now) {
            Played::Moving(tool, opening) => Step::Going(Act {
                tool,
                opening,
                ..Act::named(Phase::Reaching, "approaching")
            }),
            // The approach into an object may end at the object.
            Played::Late(off) if off > 2.0 * MOVED => {
                now.refuse_candidate();
                let problem = &now.observation.arm_problem;
                Step::Missed(format!(
                    "approaching: the hand stays {:.0} mm off {problem}",
                    off * 1e3
                ))
            }
            Played::Late(_) | Played::Arrived => {
                now.memory.rest = Some(now.object());
                Step::Done
            }
        }
    }
}

impl Default for Reach {
    fn default() -> Self {
        Self::new()
    }
}

impl Skill for Reach {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let (motion, name) = match &self.state {
            State::Ready(since) => return self.ready(*since, now),
            State::Aim => return self.aim(now),
            State::ToPregrasp(motion) => (motion, "reaching"),
            State::Correct(motion) => (motion, "correcting"),
            State::Blend(motion) if motion.is_on_last_leg(now) => (motion, "reaching in"),
            State::Blend(motion) => (motion, "reaching"),
            State::Approach(motion) => (motion, "approaching"),
            State::Shown(_) => return self.play(now),
        };
        let moved = self.aimed.map_or(0.0, |at| distance(&at, &now.object()));
        if now.memory.hindered && moved > MOVED {
            return Step::Missed(format!("it was moved by {:.0} mm", moved * 1e3));
        }
        match motion.step(now) {
            Progress::Moving(tool) => Step::Going(Act {
                tool,
                ..Act::named(Phase::Reaching, name)
            }),
            Progress::Late(why) => {
                now.refuse_candidate();
                Step::Missed(format!("{name}: {why}"))
            }
            Progress::Arrived => match (&self.state, now.memory.candidate) {
                (State::ToPregrasp(_), Some(candidate))
                    if distance(&candidate.pregrasp, &now.house_from_desired()) > CORRECTED =>
                {
                    let stop = (candidate.pregrasp, now.profile.approach_speed);
                    self.state = State::Correct(Motion::new(now, &[stop]));
                    Step::Going(Act::named(Phase::Reaching, "correcting"))
                }
                (State::ToPregrasp(_), Some(_)) if !self.before && now.taken_as().is_some() => {
                    self.begin_to_play(now);
                    Step::Going(Act::named(Phase::Reaching, "approaching"))
                }
                (State::ToPregrasp(_) | State::Correct(_), Some(candidate)) if !self.before => {
                    let stop = (candidate.grasp, now.profile.approach_speed);
                    self.state = State::Approach(Motion::new(now, &[stop]));
                    Step::Going(Act::named(Phase::Reaching, "approaching"))
                }
                _ => {
                    now.memory.rest = Some(now.object());
                    Step::Done
                }
            },
        }
    }
}

/// The movement to a candidate through `stops` as the habits have it: the last stop is its
/// pregrasp.
fn approach(now: &mut Now<'_>, candidate: &GraspCandidate, stops: &[Isometry3<f64>]) -> State {
    let habits = now.profile.habits;
    match habits.map(|habits| habits.approach) {
        Some(ApproachHabit::Blend) if candidate.shown.is_none() => {
            let mut timed = timed(now, stops);
            timed.push((candidate.grasp, now.profile.approach_speed));
            let shape = Shape {
                straight_end: true,
                ..now.profile.shape
            };
            let mut blends = false;
            let motion = Motion::curved(now, &timed, &shape, |now, poses| {
                blends = is_clear(now, candidate, poses);
                blends
            });
            match blends {
                true => State::Blend(motion),
                false => approach_stopping(now, candidate, stops),
            }
        }
        Some(ApproachHabit::Correct([x, y, z])) => {
            let start = now.scene.house_from_tool(now.observation);
            // The lateral error shrinks where it would collide; the error along the approach stays.
            for share in [1.0, 0.5, 0.0] {
                let misjudged = candidate.pregrasp * Translation3::new(share * x, share * y, z);
                let mut short = stops.to_vec();
                if let Some(last) = short.last_mut() {
                    *last = misjudged;
                }
                let line = [&[start], &short[..], &[candidate.pregrasp]].concat();
                if is_clear(now, candidate, &line) {
                    return approach_stopping(now, candidate, &short);
                }
            }
            approach_stopping(now, candidate, stops)
        }
        _ => approach_stopping(now, candidate, stops),
    }
}

/// The movement through `stops`, in the profile's shape, to a stop.
fn approach_stopping(
    now: &mut Now<'_>,
    candidate: &GraspCandidate,
    stops: &[Isometry3<f64>],
) -> State {
    let timed = timed(now, stops);
    let shape = now.profile.shape;
    State::ToPregrasp(Motion::curved(now, &timed, &shape, |now, poses| {
        is_clear(now, candidate, poses)
    }))
}

fn timed(now: &Now<'_>, stops: &[Isometry3<f64>]) -> Vec<(Isometry3<f64>, f64)> {
    let speed = now.profile.free_speed;
    stops.iter().map(|pose| (*pose, speed)).collect()
}

/// Whether the hand can pass `poses` on the way to a candidate, and the poses after it:
/// without a collision, and within reach of the arm. Near the grasp the fingers may
/// enclose the object.
fn is_clear(now: &mut Now<'_>, candidate: &GraspCandidate, poses: &[Isometry3<f64>]) -> bool {
    // A soft object gives way.
    let margin = match candidate.force {
        Some(_) => MARGINS[MARGINS.len() - 1],
        None => CURVE_MARGIN,
    };
    let near = AROUND * distance(&candidate.pregrasp, &candidate.grasp);
    let far = poses
        .iter()
        .take_while(|pose| distance(pose, &candidate.grasp) > near);
    let (outer, inner) = poses.split_at(far.count());
    let free = |poses: &[Isometry3<f64>], except: Option<usize>| {
        let around = now.scene.around(poses, now.poses, except);
        poses.is_empty() || around.hand_is_free(&now.scene.hand, candidate.opening, poses, margin)
    };
    let item = now.goal.item();
    if !free(outer, None) || !free(inner, Some(item)) {
        return false;
    }
    let then = then_from_pregrasp(now, candidate);
    then.iter()
        .any(|then| now.reaches(&[poses, &then[..]].concat()))
}

/// A shift in the hand's frame with which the fingers miss the object: to one side, or
/// short of it.
fn beside(
    now: &mut Now<'_>,
    candidate: &GraspCandidate,
    stops: &[Isometry3<f64>],
) -> Translation3<f64> {
    let off = (candidate.opening + candidate.width) / 2.0 + BESIDE[0];
    let start = now.scene.house_from_tool(now.observation);
    let sides = [off, -off].map(|x| Translation3::new(x, 0.0, 0.0));
    let free = sides.into_iter().find(|by| {
        let (pregrasp, grasp) = (candidate.pregrasp * by, candidate.grasp * by);
        let around = now.scene.around(&[start, pregrasp], now.poses, None);
        let line = [pregrasp, grasp];
        around.hand_is_free(&now.scene.hand, candidate.opening, &line, MARGINS[0])
            && now.reaches(&[stops, &line].concat())
    });
    free.unwrap_or_else(|| Translation3::new(0.0, 0.0, -BESIDE[1]))
}

/// The candidate that fits the chair best and the stops up to its pregrasp; one after
/// which all of the work can be reached, if there is any.
fn choose(now: &mut Now<'_>) -> Option<(GraspCandidate, Vec<Isometry3<f64>>)> {
    let whole = match now.goal {
        Goal::Give { .. } | Goal::Bring { .. } => choose_for(now, can_bring),
        _ => None,
    };
    whole.or_else(|| choose_for(now, |_, _| true))
}

/// Whether the object can be brought to the person with this grasp.
fn can_bring(now: &mut Now<'_>, candidate: &GraspCandidate) -> bool {
    let approach = [candidate.pregrasp, candidate.grasp];
    let lists = bring::after(now, &now.observation.house_from_chair, candidate);
    lists
        .iter()
        .any(|then| now.reaches(&[&approach, &then[..]].concat()))
}

/// The best of those that `will_do`.
fn choose_for(
    now: &mut Now<'_>,
    will_do: impl Fn(&mut Now<'_>, &GraspCandidate) -> bool,
) -> Option<(GraspCandidate, Vec<Isometry3<f64>>)> {
    let chair = now.observation.chair();
    let object = now.object();
    let start = now.scene.house_from_tool(now.observation);
    for margin in MARGINS {
        let mut candidates = now.candidates(margin);
        candidates.retain(|candidate| {
            let at = object.inv_mul(&candidate.grasp);
            !now.memory.refused.iter().any(|refused| {
                distance(refused, &at) < SAME[0]
                    && refused.rotation.angle_to(&at.rotation) < SAME[1]
            })
        });
        let rank = |candidate: &GraspCandidate| {
            let off = candidate
                .heading()
                .map_or(0.3, |h| wrap(h - chair.heading).abs());
            candidate.cost + (off / 0.3).powi(2)
        };
        // The arm pushes from few places: what is planned from this one is tried first.
        let has_plan = now.profile.habits.is_some() || candidates.iter().any(|c| c.push.is_some());
        let planned = now.memory.planned.filter(|_| has_plan);
        let rank = |candidate: &GraspCandidate| match planned {
            Some(planned) => {
                let at = object.inv_mul(&candidate.grasp);
                let turn = planned.rotation.angle_to(&at.rotation);
                distance(&planned, &at) / UNPLANNED[0] + turn / UNPLANNED[1]
            }
            None => rank(candidate),
        };
        candidates.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        for candidate in candidates.into_iter().take(LOOKS) {
            if will_do(now, &candidate)
                && let Some(stops) = path_to(now, &start, &candidate, margin)
            {
                return Some((candidate, stops));
            }
        }
    }
    None
}

/// The candidate nearest to a hand in front of the object, with a short approach, and
/// the stops up to its pregrasp.
fn choose_on_the_spot(now: &mut Now<'_>) -> Option<(GraspCandidate, Vec<Isometry3<f64>>)> {
    let start = now.scene.house_from_tool(now.observation);
    let off = |candidate: &GraspCandidate| {
        let turn = start.rotation.angle_to(&candidate.pregrasp.rotation);
        let way = distance(&start, &candidate.pregrasp);
        (way < ON_THE_SPOT[0] && turn < ON_THE_SPOT[1]).then_some(way + 0.1 * turn)
    };
    for margin in MARGINS {
        let standoff = SHORT_STANDOFF;
        let found =
            grasp_candidate::candidates(now.scene, now.goal, now.poses, None, standoff, margin);
        let mut near: Vec<_> = found
            .into_iter()
            .filter_map(|candidate| Some((off(&candidate)? + 0.05 * candidate.cost, candidate)))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        for back in BACK {
            for (_, candidate) in near.iter().take(LOOKS) {
                let back_first = start * Translation3::new(0.0, 0.0, -back);
                let line = [back_first, candidate.pregrasp];
                let around = now.scene.around(&line, now.poses, None);
                if !around.hand_is_free(&now.scene.hand, candidate.opening, &line, margin) {
                    continue;
                }
                let stops = &line[usize::from(back == 0.0)..];
                let then = then_from_pregrasp(now, candidate);
                let reached = then
                    .iter()
                    .any(|then| now.reaches(&[stops, &then[..]].concat()));
                if reached {
                    return Some((*candidate, stops.to_vec()));
                }
            }
        }
    }
    None
}

/// Poses after the pregrasp: the grasp and the next steps; several lists, one of which
/// must be reachable.
fn then_from_pregrasp(now: &Now<'_>, candidate: &GraspCandidate) -> Vec<Vec<Isometry3<f64>>> {
    let mut approach = vec![candidate.grasp];
    if let Some(shown) = &candidate.shown {
        approach = adapt::approach_stops(now.shown, shown, &now.object());
        let lift = adapt::lift_stops(now.shown, shown, &now.object());
        if !lift.is_empty() {
            return vec![[&approach[..], &lift[..]].concat()];
        }
    }
    let then = match now.goal {
        Goal::Lift { .. } | Goal::Put { .. } | Goal::Give { .. } | Goal::Bring { .. } => {
            let height = lift::height(now.goal, now.profile.grasp.lift);
            lift::lift_paths(
                &now.scene.house_from_base(now.observation),
                &candidate.grasp,
                height,
            )
        }
        Goal::Close { slide, .. } if candidate.push.is_some() => push::ways(now, *slide, candidate),
        Goal::Open { slide, .. } | Goal::Close { slide, .. } => {
            let joint = &now.scene.slides[*slide];
            let first = match now.goal {
                Goal::Close { .. } => -0.03,
                _ => 0.06,
            };
            let radius = joint.radius(&candidate.grasp.translation.vector.into());
            let first = joint.change(first, radius);
            vec![joint.carried(&candidate.grasp, first)]
        }
    };
    then.into_iter()
        .map(|then| [&approach[..], &then[..]].concat())
        .collect()
}

/// Stops of a collision-free path of the hand in `house`: straight, or over the
/// objects.
fn path_to(
    now: &mut Now<'_>,
    start: &Isometry3<f64>,
    candidate: &GraspCandidate,
    margin: f64,
) -> Option<Vec<Isometry3<f64>>> {
    let above = |height: f64| Translation3::new(0.0, 0.0, height) * candidate.pregrasp;
    let around = now
        .scene
        .around(&[*start, candidate.pregrasp, above(0.2)], now.poses, None);
    // Straight, over the objects, from nearer to the arm, or first back to where the
    // hand began.
    let home = now
        .memory
        .home
        .map(|home| now.scene.house_from_base(now.observation) * home);
    let mut paths = vec![vec![candidate.pregrasp]];
    paths.extend(OVER.map(|height| vec![above(height), candidate.pregrasp]));
    // Down from the side of the arm, which reaches higher there.
    let base = now.scene.house_from_base(now.observation);
    for height in OVER {
        let lifts = lift::lift_paths(&base, &candidate.pregrasp, height);
        let vias = lifts.iter().skip(1).filter_map(|lift| lift.last());
        paths.extend(vias.map(|via| vec![*via, candidate.pregrasp]));
    }
    if let Some(home) = home {
        paths.extend(OVER.map(|height| vec![home, above(height), candidate.pregrasp]));
    }
    let then = then_from_pregrasp(now, candidate);
    paths.into_iter().find(|stops| {
        let line = [&[*start], &stops[..]].concat();
        around.hand_is_free(&now.scene.hand, candidate.opening, &line, margin)
            && then
                .iter()
                .any(|then| now.reaches(&[&stops[..], &then[..]].concat()))
    })
}
