//! Base search: chooses a base placement for one purpose, and finds a path to it. A goal
//! without a way costs look-ups on floor maps; one without a path costs few searches.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Translation3};

use super::{ARM_CHECKS, Now, bring, lift, place, push, tuck};
use crate::base_placement::{self, BasePlacement, GENTLE};
use crate::demonstration::adapt;
use crate::drive::Drive;
use crate::goal::Goal;
use crate::grasp_candidate::{GraspCandidate, MARGINS};
use crate::habits::Habits;
use wheelarm_planning::floor_map::STOP_CLEARANCE;
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2};
use wheelarm_planning::hybrid_a_star::{DriveGoal, Segment};
use wheelarm_planning::leaf_push::{NoPush, PushStop};
use wheelarm_planning::posture_routes::STOP_GOALS;
use wheelarm_planning::route_planner::RoutePlanner;
use wheelarm_proto::furniture::JointMotion;

/// Placements that are checked for reach and path per stop.
const PLACES: usize = 120;
/// The same after none of them did, for an object with few grasps or little floor before it.
const MORE_PLACES: usize = 500;
/// The same of those that suit the habits: each costs time, and there are others.
const WANTED: usize = 60;
/// Placements without a path after which a list of placements is abandoned: each takes a
/// search.
const PATHLESS: usize = 12;
/// A placement this near to one without a path has none either, metres and radians.
const NEIGHBOUR: [f64; 2] = [0.045, 0.15];
/// Goals of one search are at least this far apart, metres and radians.
const APART: [f64; 2] = [0.1, 0.2];
/// Levels of requirements on a placement: the whole work, or only its first step. A door that
/// turns is opened gently before that.
const LEVELS: usize = 2;
/// A placement that did not work is not taken again within this, metres and radians.
const LEFT: [f64; 2] = [0.12, 0.25];
/// Straight segments before a stop that are tried, metres.
const STRAIGHTS: [f64; 3] = [0.35, 0.2, 0.08];
/// Radii of arcs that are tried, as shares of the operator profile's.
pub(super) const ARCS: [f64; 2] = [1.0, 0.75];
/// Spacing of the collision checks along the straight segment, metres.
const SPACING: f64 = 0.04;
/// Nodes of all path searches after which a base search ends: two complete ones. Where the
/// floor map shows a way, but the chair has no path, more placements rarely have one.
const NODES: usize = 90_000;

/// Levels of requirements for the goal.
fn levels(now: &Now<'_>) -> usize {
    let slide = now.goal.slide().and_then(|i| now.scene.slides.get(i));
    let turns = slide.is_some_and(|slide| slide.motion == JointMotion::Turns);
    LEVELS + usize::from(turns)
}

/// Whether planning a drive has taken as long as it may.
fn is_exhausted(now: &Now<'_>, routes: &RoutePlanner) -> bool {
    routes.nodes() > NODES || now.memory.arm_checks > ARM_CHECKS
}

/// Purpose of a stop of the chair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To grasp the object.
    Take,
    /// To put down what is in the hand.
    Put,
}

/// Poses that an arm with its base at `house_from_base` must reach, in `house`.
struct Wanted {
    /// Pregrasp and grasp.
    approach: Vec<Isometry3<f64>>,
    /// Poses after it: for each level of requirements, the highest first, lists of
    /// poses, one of which must be reachable.
    then: Vec<Vec<Vec<Isometry3<f64>>>>,
    /// At the highest level no joint has to be quick after the approach: a hand that holds a
    /// door must not be late.
    gently: bool,
}

/// Poses that a base placement must reach.
fn wanted(
    now: &Now<'_>,
    candidate: &GraspCandidate,
    purpose: Purpose,
    house_from_base: &Isometry3<f64>,
) -> Wanted {
    let mut approach = vec![candidate.pregrasp, candidate.grasp];
    if purpose == Purpose::Put {
        let then = vec![vec![Vec::new()]];
        return Wanted {
            approach,
            then,
            gently: false,
        };
    }
    let mut gently = false;
    let height = lift::height(now.goal, now.profile.grasp.lift);
    let mut raised = lift::lift_paths(house_from_base, &candidate.grasp, height);
    if let Some(shown) = &candidate.shown {
        approach = adapt::approach_stops(now.shown, shown, &now.object());
        let lift = adapt::lift_stops(now.shown, shown, &now.object());
        if !lift.is_empty() {
            raised = vec![lift];
        }
    }
    let then = match now.goal {
        Goal::Lift { .. } => {
            let up = raised[0].last().copied().unwrap_or(candidate.grasp);
            let back = up * Translation3::new(0.0, 0.0, -now.profile.retract);
            let best = [&raised[0][..], &[back]].concat();
            vec![vec![best], raised]
        }
        // No stop is for both.
        Goal::Put { region, .. } if tuck::is_far(&now.object(), region) => vec![raised],
        Goal::Put { .. } => {
            let held = candidate.grasp.inv_mul(&now.object());
            let puts = place::candidates(now, &held, candidate);
            let both = |put: &GraspCandidate| {
                let then = |up: &Vec<_>| [&up[..], &[put.pregrasp, put.grasp]].concat();
                raised.iter().take(2).map(then).collect::<Vec<_>>()
            };
            vec![puts.iter().flat_map(both).collect(), raised.clone()]
        }
        Goal::Give { .. } | Goal::Bring { .. } => {
            let chair = house_from_base * now.scene.chair_from_base.inverse();
            vec![bring::after(now, &chair, candidate), raised]
        }
        Goal::Close { slide, .. } if candidate.push.is_some() => {
            vec![push::ways(now, *slide, candidate)]
        }
        Goal::Open { slide, .. } | Goal::Close { slide, .. } => {
            let slide_now = now.observation.slides.get(*slide).copied().unwrap_or(0.0);
            let joint = &now.scene.slides[*slide];
            let aim = now.goal.aim(now.scene).map_or(slide_now, |(_, aim)| aim);
            gently = joint.motion == JointMotion::Turns;
            let pulled = |share: f64| {
                let by = (aim - slide_now) * share;
                let tool = now.scene.tool_length;
                let lags = joint.lags().iter();
                lags.map(|lag| joint.carried_about_bar(&candidate.grasp, by, (*lag, tool)))
                    .collect::<Vec<_>>()
            };
            match gently {
                true => vec![pulled(1.0), pulled(1.0), pulled(0.3)],
                false => vec![pulled(1.0), pulled(0.3)],
            }
        }
    };
    Wanted {
        approach,
        then,
        gently,
    }
}

impl Wanted {
    /// Whether all of a level can be reached by a chair at `house_from_chair`.
    fn is_reached(
        &self,
        level: usize,
        now: &mut Now<'_>,
        house_from_chair: &Isometry3<f64>,
        never: impl FnOnce(),
    ) -> bool {
        let Some(lists) = self.then.get(level) else {
            return false;
        };
        now.memory.arm_checks += 1;
        let tool = now.observation.base_from_tool;
        let scene = now.scene;
        let mut reaches = |poses: &[Isometry3<f64>]| {
            base_placement::reaches_from(scene, house_from_chair, &tool, poses, now.reach)
        };
        // Most placements are out for the approach already.
        if !reaches(&self.approach) {
            never();
            return false;
        }
        let reached = |list: &&Vec<_>| reaches(&[&self.approach[..], &list[..]].concat());
        let mut reached = lists.iter().filter(reached);
        if !self.gently || level > 0 {
            return reached.next().is_some();
        }
        let reached: Vec<_> = reached.collect();
        let base_from_house = (house_from_chair * scene.chair_from_base).inverse();
        let at = |pose: &Isometry3<f64>| base_from_house * pose;
        reached.into_iter().any(|list| {
            let list: Vec<_> = list.iter().map(at).collect();
            self.approach.last().is_some_and(|grasp| {
                base_placement::reaches_within(&at(grasp), &list, GENTLE, now.reach)
            })
        })
    }
}

/// Approaches, of an arm at a place, that it does not reach: they come again with the
/// next level and the next margin.
type Unreached = BTreeSet<[u64; 10]>;

/// Tells one approach of an arm with its base at `house_from_base` from another.
fn key(house_from_base: &Isometry3<f64>, candidate: &GraspCandidate) -> [u64; 10] {
    let grasp = house_from_base.inv_mul(&candidate.grasp);
    let pregrasp = house_from_base.inv_mul(&candidate.pregrasp);
    let [x, y, z] = grasp.translation.vector.into();
    let [i, j, k, w] = grasp.rotation.coords.into();
    let [a, b, c] = pregrasp.translation.vector.into();
    [x, y, z, i, j, k, w, a, b, c].map(f64::to_bits)
}

/// Counts of rejected placements, by reason.
#[derive(Default)]
struct Tally {
    /// Most grasp candidates that a margin left.
    candidates: usize,
    /// Placements that were looked at.
    tried: usize,
    /// Of them, out of the arm's reach.
    unreached: usize,
    /// Of them, without a path of the chair.
    pathless: usize,
}

/// The drive to the best base placement, and the candidate that it is for.
///
/// # Errors
/// Why there is none, for people.
pub(super) fn find(now: &mut Now<'_>, purpose: Purpose) -> Result<(Drive, GraspCandidate), String> {
    let chair = now.observation.chair();
    let margin = now.profile.path.margin;
    let mut routes = now.scene.route_planner(now.poses, chair, margin);
    find_with(now, purpose, &mut routes, &|_| true)
}

/// The same through places that are narrower than the clearance of the profile, slowly. One
/// search has several placements as its goals: a placement by itself may be in a corner.
pub(super) fn find_narrow(now: &mut Now<'_>, purpose: Purpose) -> Option<(Drive, GraspCandidate)> {
    let chair = now.observation.chair();
    let (slow, margin) = (now.profile.in_narrow_places(), now.profile.path.margin);
    let routes = now.scene.route_planner(now.poses, chair, margin);
    let mut routes = routes.through_narrow_places(margin);
    let mut now = Now {
        scene: now.scene,
        goal: now.goal,
        profile: &slow,
        observation: now.observation,
        poses: now.poses,
        reach: &mut *now.reach,
        shown: now.shown,
        memory: &mut *now.memory,
    };
    if !routes.is_start_free() {
        return None;
    }
    let room = routes.map(STOP_CLEARANCE);
    let opened = opened(&now);
    let distance = now.profile.grasp.distance;
    match pushes(&mut now, purpose, &|pose| room.is_free(pose)) {
        Err(NoPush::NoFace) => {}
        Err(_) => return None,
        Ok((choice, placements)) => {
            return choice.drive_to_any(&placements, 0, &mut now, &mut routes);
        }
    }
    // The least clearance of the hand leaves the most candidates.
    for margin in [MARGINS[0], MARGINS[MARGINS.len() - 1]] {
        let candidates = candidates(&now, purpose, margin);
        let mut placements =
            base_placement::placements(now.scene, &chair, &candidates, None, distance);
        placements.retain(|placement| {
            let opened = opened.as_ref();
            room.is_free(&placement.chair)
                && opened.is_none_or(|opened| opened.is_free(&placement.chair, 0.0))
        });
        let choice = Choice {
            purpose,
            candidates,
        };
        for level in 0..levels(&now) {
            if let Some(found) = choice.drive_to_any(&placements, level, &mut now, &mut routes) {
                return Some(found);
            }
            if is_exhausted(&now, &routes) {
                return None;
            }
        }
    }
    None
}

/// The same with a planner of routes from the chair, and only stops that `accepts`.
pub(crate) fn find_with(
    now: &mut Now<'_>,
    purpose: Purpose,
    routes: &mut RoutePlanner,
    accepts: &dyn Fn(&Pose2) -> bool,
) -> Result<(Drive, GraspCandidate), String> {
    let chair = now.observation.chair();
    if !routes.is_start_free() {
        let name = &now.scene.items[now.goal.item()].name;
        return Err(format!(
            "no place to stop for {name:?}: the chair has no room to drive where it is"
        ));
    }
    let room = routes.map(STOP_CLEARANCE);
    let opened = opened(now);
    let mut tally = Tally::default();
    let mut unreached = Unreached::default();
    let mut pathless = Vec::new();
    let is_stop = |pose: &Pose2| room.is_free(pose) && accepts(pose);
    match pushes(now, purpose, &is_stop) {
        Err(NoPush::NoFace) => {}
        Err(why) => {
            let name = &now.scene.items[now.goal.item()].name;
            return Err(format!("no place to push {name:?} from: {why}"));
        }
        Ok((choice, placements)) => {
            let mut search = Search {
                routes,
                tally: &mut tally,
                unreached: &mut unreached,
                pathless: &mut pathless,
            };
            let drive = choice.drive((&placements, placements.len()), 0, now, &mut search);
            return drive.ok_or_else(|| {
                let name = &now.scene.items[now.goal.item()].name;
                format!(
                    "no place to push {name:?} from: of {} base placements {} out of the arm's reach and {} without a path",
                    tally.tried, tally.unreached, tally.pathless
                )
            });
        }
    }
    let rounds = [PLACES, MORE_PLACES].into_iter();
    let rounds = rounds.flat_map(|most| MARGINS.map(|margin| (most, margin)));
    for (most, margin) in rounds {
        // Others would have no way either.
        if most == MORE_PLACES && tally.unreached == 0 || is_exhausted(now, routes) {
            break;
        }
        let candidates = candidates(now, purpose, margin);
        tally.candidates = tally.candidates.max(candidates.len());
        let distance = now.profile.grasp.distance;
        let habits = now.profile.habits.filter(|_| purpose == Purpose::Take);
        let place = |habits: Option<&Habits>| {
            let mut placements =
                base_placement::placements(now.scene, &chair, &candidates, habits, distance);
            placements
                .retain(|placement| room.is_free(&placement.chair) && accepts(&placement.chair));
            if let Some(opened) = &opened {
                placements.retain(|placement| opened.is_free(&placement.chair, 0.0));
            }
            placements.truncate(20 * most);
            placements
        };
        // As the habits want, on the other side, the same half as far, then anywhere.
        // A second round looks at more placements of no habit.
        let habits = habits.filter(|_| most == PLACES);
        let wanted = habits.into_iter();
        let wanted = wanted.flat_map(|habits| [habits, habits.milder()]);
        let wanted = wanted.flat_map(|habits| [habits, habits.mirrored()]);
        let wanted = wanted.map(|habits| (place(Some(&habits)), WANTED));
        let placements: Vec<_> = wanted.chain([(place(None), most)]).collect();
        let choice = Choice {
            purpose,
            candidates,
        };
        // Placements from which everything can be done come first.
        for level in 0..levels(now) {
            for (placements, most) in &placements {
                let mut search = Search {
                    routes: &mut *routes,
                    tally: &mut tally,
                    unreached: &mut unreached,
                    pathless: &mut pathless,
                };
                let drive = choice.drive((&placements[..], *most), level, now, &mut search);
                if let Some(found) = drive {
                    return Ok(found);
                }
            }
        }
    }
    let name = &now.scene.items[now.goal.item()].name;
    Err(format!(
        "no place to stop for {name:?}: {} grasp candidates, of {} base placements {} out of the arm's reach and {} without a path",
        tally.candidates, tally.tried, tally.unreached, tally.pathless
    ))
}

/// Obstacles of the chair after the goal's slide is open; `None` for other goals.
pub(super) fn opened(now: &Now<'_>) -> Option<FootprintCheck> {
    let Goal::Open { slide, .. } = now.goal else {
        return None;
    };
    let (_, aim) = now.goal.aim(now.scene)?;
    let slide = now.scene.slides.get(*slide)?;
    let mut poses = now.poses.to_vec();
    poses[slide.item] = slide.pose(aim);
    Some(now.scene.footprint_check(&poses))
}

/// Candidates to grasp the object, or to put down the object in the hand.
fn candidates(now: &Now<'_>, purpose: Purpose, margin: f64) -> Vec<GraspCandidate> {
    match purpose {
        Purpose::Take => now.candidates(margin),
        Purpose::Put => {
            let held = now.memory.held.unwrap_or_else(|| now.object_in_hand());
            place::candidates(now, &held, &place::taken(now, &held))
        }
    }
}

/// Places from which a door is pushed shut, each with a candidate of its own.
fn pushes(
    now: &mut Now<'_>,
    purpose: Purpose,
    is_stop: &dyn Fn(&Pose2) -> bool,
) -> Result<(Choice, Vec<BasePlacement>), NoPush> {
    let stops = push::stops(now, is_stop)?;
    let of_push = |stop: &PushStop| GraspCandidate::from_push(&stop.push);
    let choice = Choice {
        purpose,
        candidates: stops.iter().map(of_push).collect(),
    };
    let placements = stops.iter().enumerate();
    let placements = placements.map(|(i, stop)| BasePlacement::from_push_stop(stop, i));
    Ok((choice, placements.collect()))
}

/// State of one search for a base placement.
struct Search<'a> {
    routes: &'a mut RoutePlanner,
    tally: &'a mut Tally,
    unreached: &'a mut Unreached,
    /// Placements without a path of the chair.
    pathless: &'a mut Vec<Pose2>,
}

/// Whether two placements are so near that one does as well as the other.
fn are_neighbours(a: &Pose2, b: &Pose2) -> bool {
    a.distance(b) < NEIGHBOUR[0] && a.to(b)[2].abs() < NEIGHBOUR[1]
}

/// Grasp candidates of one purpose.
struct Choice {
    purpose: Purpose,
    candidates: Vec<GraspCandidate>,
}

impl Choice {
    /// The drive to the best of `placements` from which all of a level of content can
    /// be reached.
    fn drive(
        &self,
        (placements, most): (&[BasePlacement], usize),
        level: usize,
        now: &mut Now<'_>,
        search: &mut Search<'_>,
    ) -> Option<(Drive, GraspCandidate)> {
        let chair = now.observation.chair();
        let (mut looked, mut without_path) = (0, 0);
        let mut refused: Vec<(Pose2, usize)> = Vec::new();
        for placement in placements {
            let is_over = is_exhausted(now, search.routes);
            if looked == most || without_path > PATHLESS || is_over {
                break;
            }
            // Neighbours of a placement that did not do rarely do better.
            let is_near = |(pose, candidate): &(Pose2, usize)| {
                *candidate == placement.candidate && are_neighbours(pose, &placement.chair)
            };
            let was_left = now.memory.left.iter().any(|pose| {
                pose.distance(&placement.chair) < LEFT[0]
                    && pose.to(&placement.chair)[2].abs() < LEFT[1]
            });
            if was_left
                || refused.iter().any(is_near)
                || (search.pathless.iter()).any(|pose| are_neighbours(pose, &placement.chair))
            {
                continue;
            }
            let at = base_placement::standing(&placement.chair);
            let base = at * now.scene.chair_from_base;
            search.tally.tried += 1;
            looked += 1;
            // A look-up; whether the arm reaches takes longer.
            if !has_way(search.routes, &placement.chair) {
                search.tally.pathless += 1;
                search.pathless.push(placement.chair);
                continue;
            }
            let candidate = &self.candidates[placement.candidate];
            let wanted = wanted(now, candidate, self.purpose, &base);
            let key = key(&base, candidate);
            if search.unreached.contains(&key)
                || !wanted.is_reached(level, now, &at, || {
                    search.unreached.insert(key);
                })
            {
                search.tally.unreached += 1;
                refused.push((placement.chair, placement.candidate));
                continue;
            }
            let goals = drive_goals(search.routes, &placement.chair, now);
            let Some(path) = drive_path(search.routes, &goals, now) else {
                search.tally.pathless += 1;
                search.pathless.push(placement.chair);
                without_path += 1;
                continue;
            };
            return Some((Drive::new(chair, &path, &now.profile.drive), *candidate));
        }
        None
    }
}

impl Choice {
    /// The drive to the one of the first `placements`, apart from one another, to which the
    /// path costs least, with all of a level of content in reach.
    fn drive_to_any(
        &self,
        placements: &[BasePlacement],
        level: usize,
        now: &mut Now<'_>,
        routes: &mut RoutePlanner,
    ) -> Option<(Drive, GraspCandidate)> {
        let chair = now.observation.chair();
        let mut stops: Vec<&BasePlacement> = Vec::new();
        let mut goals: Vec<(usize, (DriveGoal, f64))> = Vec::new();
        let mut looked = 0;
        for placement in placements {
            let is_over = is_exhausted(now, routes);
            if looked == MORE_PLACES || stops.len() == STOP_GOALS || is_over {
                break;
            }
            let is_near = |stop: &&BasePlacement| {
                stop.chair.distance(&placement.chair) < APART[0]
                    && stop.chair.to(&placement.chair)[2].abs() < APART[1]
            };
            let was_left = |pose: &Pose2| {
                pose.distance(&placement.chair) < LEFT[0]
                    && pose.to(&placement.chair)[2].abs() < LEFT[1]
            };
            if stops.iter().any(is_near)
                || now.memory.left.iter().any(was_left)
                || !has_way(routes, &placement.chair)
            {
                continue;
            }
            looked += 1;
            let at = base_placement::standing(&placement.chair);
            let base = at * now.scene.chair_from_base;
            let candidate = &self.candidates[placement.candidate];
            let wanted = wanted(now, candidate, self.purpose, &base);
            if !wanted.is_reached(level, now, &at, || {}) {
                continue;
            }
            // The shortest segment: there is little room.
            let before = drive_goals(routes, &placement.chair, now);
            goals.extend(before.last().map(|goal| (stops.len(), *goal)));
            stops.push(placement);
        }
        let all: Vec<DriveGoal> = goals.iter().map(|(_, (goal, _))| *goal).collect();
        let radii = ARCS.map(|tightness| now.profile.path.radius * tightness);
        let found = routes.route(&all, &radii).ok()?;
        let (stop, (_, length)) = goals[found.goal];
        let mut segments = found.path.segments;
        segments.push(Segment::Roll {
            length,
            curvature: 0.0,
        });
        let drive = Drive::new(chair, &segments, &now.profile.drive);
        Some((drive, self.candidates[stops[stop].candidate]))
    }
}

/// Whether free floor connects the chair with a pose before a stop.
fn has_way(routes: &mut RoutePlanner, stop: &Pose2) -> bool {
    let before = STRAIGHTS.map(|length| stop.rolled(-length, 0.0));
    before.iter().any(|pose| routes.has_way(pose))
}

/// Poses before a stop from which a free straight segment leads to it, so that the chair
/// arrives aligned, each with the length of the segment, metres.
fn drive_goals(routes: &RoutePlanner, stop: &Pose2, now: &Now<'_>) -> Vec<(DriveGoal, f64)> {
    let is_free = |length: &f64| {
        let steps = (length / SPACING).ceil() as u32;
        let before = |step: u32| stop.rolled(-length * f64::from(step) / f64::from(steps), 0.0);
        (1..=steps).all(|step| routes.footprint().is_free(&before(step), 0.0))
    };
    let goal = |length: f64| DriveGoal {
        pose: stop.rolled(-length, 0.0),
        // A long straight part aligns better than a short one.
        cost: length / now.profile.drive.speed - 4.0 * length,
    };
    let lengths = STRAIGHTS.into_iter().filter(is_free);
    lengths.map(|length| (goal(length), length)).collect()
}

/// The quickest path to one of the goals and on to the stop, with wide or with tight arcs.
fn drive_path(
    routes: &mut RoutePlanner,
    goals: &[(DriveGoal, f64)],
    now: &Now<'_>,
) -> Option<Vec<Segment>> {
    let radii = ARCS.map(|tightness| now.profile.path.radius * tightness);
    let all: Vec<DriveGoal> = goals.iter().map(|(goal, _)| *goal).collect();
    let found = routes.route(&all, &radii).ok()?;
    let mut segments = found.path.segments;
    segments.push(Segment::Roll {
        length: goals[found.goal].1,
        curvature: 0.0,
    });
    Some(segments)
}
