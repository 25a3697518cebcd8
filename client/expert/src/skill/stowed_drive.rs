//! Drives with the arm stowed: to a stop where the arm has room to return home, or by way of
//! places where it has room to change its posture. The chair drives to such a place, changes,
//! and plans again.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::Now;
use super::base_search::{ARCS, Purpose, find, find_with};
use crate::base_placement;
use crate::drive::Drive;
use crate::grasp_candidate::GraspCandidate;
use crate::observation::Observation;
use crate::profile::OperatorProfile;
use crate::scene::SceneModel;
use wheelarm_planning::floor_map::{FloorMap, STOWED_CLEARANCE};
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2};
use wheelarm_planning::posture_routes::{change_goals, change_places};
use wheelarm_planning::postures::{Posture, PostureFloor};
use wheelarm_planning::reached::Reached;

/// Parts of the floor in which places to change are looked for.
const PARTS: usize = 4;

/// A drive that begins or ends with a change of the arm's posture.
pub(super) enum Leg {
    /// Stowed, to a stop for a candidate, where the arm returns home.
    Stop(Drive, Box<GraspCandidate>),
    /// With the arm at home, to a place where it has room to be stowed.
    ToStow(Drive),
    /// Stowed, to a place where the arm has room to return home; then the work is planned
    /// again.
    ToReturn(Drive),
}

/// The floor of a chair that stows its arm.
struct Floor {
    change: Arc<FloorMap>,
    check: FootprintCheck,
    floor: PostureFloor,
    stowed: SceneModel,
    profile: OperatorProfile,
}

impl Floor {
    fn new(now: &Now<'_>) -> Option<Self> {
        let (chair, margin) = (now.observation.chair(), now.profile.path.margin);
        let stowed = SceneModel {
            outlines: now.scene.travel.as_ref()?.outlines.clone(),
            ..now.scene.clone()
        };
        let change = now.scene.change_map(now.poses, chair)?;
        let mut at_home = now.scene.route_planner(now.poses, chair, margin);
        let mut travel = stowed.route_planner(now.poses, chair, STOWED_CLEARANCE);
        let maps = [travel.map(STOWED_CLEARANCE), change.clone()];
        Some(Self {
            floor: PostureFloor::new(at_home.map(margin), Some(maps)),
            change,
            check: now.scene.change_check(now.poses)?,
            stowed,
            profile: now.profile.in_narrow_places(),
        })
    }

    /// Whether the arm has room to change at the pose of the chair, which has a small error,
    /// for which places have their clearance.
    fn is_room_at(&self, chair: &Pose2) -> bool {
        self.check.is_free(chair, 0.0)
    }

    /// Places where the arm has room to change that `accepts`, the nearest to `near` first.
    fn places(&self, near: &Pose2, accepts: &dyn Fn(&Pose2) -> bool) -> Vec<Pose2> {
        change_places(&self.change, near, accepts)
    }

    /// The part of the map of a posture that contains a pose.
    fn part(&self, posture: Posture, pose: &Pose2) -> Option<u16> {
        self.floor.map(posture)?.part_at(pose)
    }

    /// The inputs of a skill for the chair with its arm stowed, with this clearance, metres.
    fn find(
        &self,
        now: &mut Now<'_>,
        purpose: Purpose,
        margin: f64,
    ) -> Option<(Drive, GraspCandidate)> {
        let mut profile = self.profile;
        profile.path.margin = margin;
        let mut stowed = Now {
            scene: &self.stowed,
            goal: now.goal,
            profile: &profile,
            observation: now.observation,
            poses: now.poses,
            reach: &mut *now.reach,
            shown: now.shown,
            memory: &mut *now.memory,
        };
        let chair = now.observation.chair();
        let mut routes = self.stowed.route_planner(now.poses, chair, margin);
        if margin == STOWED_CLEARANCE {
            routes = routes.through_narrow_places(margin);
        }
        let has_room = |pose: &Pose2| self.change.is_free(pose);
        find_with(&mut stowed, purpose, &mut routes, &has_room).ok()
    }

    /// The drive to the best of `places` with the arm in a posture.
    fn drive(&self, now: &Now<'_>, posture: Posture, places: &[Pose2]) -> Option<Drive> {
        let chair = now.observation.chair();
        let (scene, profile, margin) = match posture {
            Posture::Home => (now.scene, now.profile, now.profile.path.margin),
            Posture::Travel => (&self.stowed, &self.profile, STOWED_CLEARANCE),
        };
        let goals = change_goals(places);
        let radii = ARCS.map(|tightness| profile.path.radius * tightness);
        let routes = scene.route_planner(now.poses, chair, margin);
        let mut routes = routes.through_narrow_places(margin);
        let found = routes.route(&goals, &radii).ok()?;
        Some(Drive::new(chair, &found.path.segments, &profile.drive))
    }
}

/// The drive of a chair whose arm is in the travel posture to the nearest place where it has
/// room to return home; an empty one where it is there.
pub(super) fn to_return(now: &Now<'_>) -> Option<Drive> {
    let chair = now.observation.chair();
    let floor = Floor::new(now)?;
    if floor.is_room_at(&chair) {
        return Some(Drive::new(chair, &[], &floor.profile.drive));
    }
    let reached = Reached::from_start(floor.floor.map(Posture::Travel)?.clone(), &chair);
    let places = floor.places(&chair, &|pose| reached.contains(pose));
    floor.drive(now, Posture::Travel, &places)
}

/// The first drive of a chair with its arm at home that finds no stop in that posture.
pub(super) fn plan(now: &mut Now<'_>, purpose: Purpose) -> Option<Leg> {
    let floor = Floor::new(now)?;
    let chair = now.observation.chair();
    let margins = [now.profile.path.margin, STOWED_CLEARANCE];
    let found = (margins.into_iter()).find_map(|margin| floor.find(now, purpose, margin));
    let leg = match found {
        Some((drive, candidate)) => Leg::Stop(drive, Box::new(candidate)),
        None => Leg::ToReturn(beyond(now, &floor, purpose)?),
    };
    // The arm needs room to be stowed, too.
    if floor.is_room_at(&chair) {
        return Some(leg);
    }
    let to = match &leg {
        Leg::Stop(drive, _) | Leg::ToReturn(drive) | Leg::ToStow(drive) => drive.goal(),
    };
    let from = |posture, pose: &Pose2| {
        let map = floor.floor.map(posture)?;
        Some(Reached::from_start(map.clone(), pose))
    };
    let [own, travel] = [from(Posture::Home, &chair)?, from(Posture::Travel, &to)?];
    let is_between = |pose: &Pose2| own.contains(pose) && travel.contains(pose);
    let places = floor.places(&chair, &is_between);
    floor.drive(now, Posture::Home, &places).map(Leg::ToStow)
}

/// The stowed drive to a part of the floor from which the chair finds a stop with its arm at
/// home.
fn beyond(now: &mut Now<'_>, floor: &Floor, purpose: Purpose) -> Option<Drive> {
    let chair = now.observation.chair();
    let reach = floor.floor.from_start(&chair, Posture::Home);
    let own = floor.part(Posture::Home, &chair);
    let object = now.object().translation;
    let is_beyond = |pose: &Pose2| {
        let part = floor.part(Posture::Home, pose);
        part != own
            && reach.home.contains(pose)
            && reach
                .travel
                .as_ref()
                .is_some_and(|travel| travel.contains(pose))
    };
    let near = Pose2 {
        x: object.x,
        y: object.y,
        heading: chair.heading,
    };
    let places = floor.places(&near, &is_beyond);
    // Parts by their nearest place.
    let mut order = Vec::new();
    let mut of_part: BTreeMap<u16, Vec<Pose2>> = BTreeMap::new();
    for pose in places {
        if let Some(part) = floor.part(Posture::Home, &pose) {
            let known = of_part.entry(part).or_insert_with(|| {
                order.push(part);
                Vec::new()
            });
            known.push(pose);
        }
    }
    order.into_iter().take(PARTS).find_map(|part| {
        let places = &of_part[&part];
        let there = Observation {
            house_from_chair: base_placement::standing(places.first()?),
            ..now.observation.clone()
        };
        let mut from_there = Now {
            scene: now.scene,
            goal: now.goal,
            profile: now.profile,
            observation: &there,
            poses: now.poses,
            reach: &mut *now.reach,
            shown: now.shown,
            memory: &mut *now.memory,
        };
        find(&mut from_there, purpose).ok()?;
        floor.drive(now, Posture::Travel, places)
    })
}
