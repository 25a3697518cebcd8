//! Grasp candidates: every grasp of an object, turned, leaned and moved out
//! until the hand is free of collisions at the grasp and on its way in.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use wheelarm_planning::arm_access::{LEVEL_LEANS, LOW, leans};
use wheelarm_planning::footprint_check::Pose2;
use wheelarm_planning::leaf_push::{LeafPush, PushShape};
use wheelarm_proto::exact;

use super::clearance::Surroundings;
use super::goal::Goal;
use super::habits::Habits;
use super::hand::Hand;
use super::scene::{Grasp, SceneModel};

/// A pose of the hand to grasp an object or to put it down, in `house`. The retreat is
/// the way back, from `grasp` towards `pregrasp`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraspCandidate {
    /// End effector before the object, from where the hand approaches straight.
    pub pregrasp: Isometry3<f64>,
    /// End effector at the grasp.
    pub grasp: Isometry3<f64>,
    /// Opening of the hand during the approach, metres.
    pub opening: f64,
    /// Distance between the pads at the grasp, metres.
    pub width: f64,
    /// Cap of the pads' force, N; `None` leaves it to the operator profile.
    pub force: Option<f64>,
    /// Lean about the closing axis, radians.
    pub lean: f64,
    /// How much shallower than specified the object is grasped, metres.
    pub backoff: f64,
    /// Cost without habits: 0 for a hand at the specified grasp, infinite for a
    /// candidate of habits alone.
    pub cost: f64,
    /// The same where the habits count; lower for a grasp that suits them.
    pub wish: f64,
    /// The demonstration that it is of; `None` for one of the operator's own.
    pub shown: Option<Shown>,
    /// Closed fingers push a door shut here, instead of a grasp.
    pub push: Option<PushShape>,
}

/// Of which demonstration a grasp candidate is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// Its index.
    pub index: usize,
    /// Turn of the object about its own vertical against the demonstration, radians.
    pub turn: f64,
    /// Demonstrated pose of the chair.
    pub chair: Pose2,
}

impl GraspCandidate {
    /// Closed fingers that push a door.
    #[must_use]
    pub fn from_push(push: &LeafPush) -> Self {
        Self {
            pregrasp: push.before,
            grasp: push.contact,
            opening: 0.0,
            width: 0.0,
            force: None,
            lean: push.shape.down,
            backoff: 0.0,
            cost: push.cost,
            wish: push.cost,
            shown: None,
            push: Some(push.shape),
        }
    }

    /// The grasp point of `hand` in `house`.
    #[must_use]
    pub fn point(&self, hand: &Hand) -> Point3<f64> {
        self.grasp * Point3::new(0.0, 0.0, hand.pads(self.width))
    }

    /// Direction of the hand on the floor plan, radians; `None` for a hand from above.
    #[must_use]
    pub fn heading(&self) -> Option<f64> {
        let forward = self.grasp.rotation * Vector3::z();
        (forward.xy().norm() > 0.3).then(|| exact::atan2(forward.y, forward.x))
    }
}

/// Clearances of the hand, metres: the first that leaves a candidate is used. The last
/// one allows for boxes around round objects.
pub const MARGINS: [f64; 4] = [0.008, 0.004, 0.0, -0.006];
/// The hand opens wider than the object by this much where possible, metres.
const ROOM: f64 = 0.034;
/// Number of sampled turns of a round object.
const TURNS: u8 = 24;
/// A grasp may be shallower than specified by this much, metres.
const BACKOFF: [f64; 4] = [0.0, 0.006, 0.012, 0.018];
/// Greatest difference in height from the specified grasp, metres.
const HIGHER: f64 = 0.025;
/// The pads of a higher or lower grasp keep this far from the object's ends, metres.
const FROM_END: f64 = 0.02;
/// Cost of a grasp at the specified height when another one is wanted.
const NOT_AS_WANTED: f64 = 0.6;
/// Factor of the standoff of a hand from above: there is little room below the
/// shoulder.
const TOP_STANDOFF: f64 = 0.55;
/// The fingers reach this far beyond the grasp point, metres.
const FINGER_TIP: f64 = 0.012;
/// Clearance between the fingers and the limbs of a deformable object before they
/// enter, metres.
const OUTSIDE: f64 = 0.015;
/// What is within this distance of a door's hinge may be in the way of a hand at it, metres.
const BESIDE_DOOR: f64 = 1.6;
/// The handle is the part of a slide this close to the grasp point, metres.
const HANDLE: f64 = 0.02;

/// Every candidate for the goal's object at its present pose that keeps `margin` metres
/// from obstacles. The pregrasp is `standoff` metres before the grasp. Candidates that
/// suit the habits cost less.
#[must_use]
pub fn candidates(
    scene: &SceneModel,
    goal: &Goal,
    poses: &[Isometry3<f64>],
    habits: Option<&Habits>,
    standoff: f64,
    margin: f64,
) -> Vec<GraspCandidate> {
    let Some(house_from_item) = poses.get(goal.item()) else {
        return Vec::new();
    };
    // A leaning hand presses into the lap: what is laid there is taken the plain way.
    let habits = habits.filter(|_| !matches!(goal, Goal::Give { .. }));
    let mut candidates = pushes(scene, goal, house_from_item, poses, margin);
    // Of an open door, hardly any placement reaches the handle.
    if !candidates.is_empty() {
        return candidates;
    }
    for grasp in scene.grasps.iter().filter(|g| g.item == goal.item()) {
        let point = house_from_item * grasp.item_from_grasp * Point3::origin();
        let around = surroundings(scene, goal, poses, &point);
        let turns = if grasp.symmetric { TURNS } else { 1 };
        for turn in 0..turns {
            let turned = UnitQuaternion::from_axis_angle(
                &Vector3::z_axis(),
                TAU * f64::from(turn) / f64::from(turns),
            );
            // The hand looks the same after half a turn about its own axis.
            for half in [0.0, PI] {
                let flipped = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), half);
                let house_from_grasp = house_from_item * turned * grasp.item_from_grasp * flipped;
                let leans = leans(&house_from_grasp, grasp.from_above);
                // A deformable object slips out of a leaning hand.
                let leaning = habits.filter(|_| grasp.force.is_none());
                let is_low = house_from_grasp.translation.z < LOW;
                let wanted = leaning.map_or(0.0, |habits| wanted_lean(leans, is_low, habits.lean));
                let heights = match goal.slide() {
                    Some(_) => vec![(0.0, 0.0)],
                    None => heights(scene, grasp, house_from_item, &house_from_grasp, habits),
                };
                for (height, cost) in heights {
                    let at = Translation3::new(0.0, 0.0, height) * house_from_grasp;
                    for lean in leans {
                        let found = deepest(scene, grasp, &at, *lean, &around, standoff, margin);
                        candidates.extend(found.map(|mut candidate| {
                            let backoff = candidate.cost;
                            // Habits alone choose a height other than the specified
                            // one.
                            candidate.cost = match height == 0.0 {
                                true => backoff + (lean / 0.4).powi(2),
                                false => f64::INFINITY,
                            };
                            candidate.wish = backoff + cost + ((lean - wanted) / 0.4).powi(2);
                            candidate
                        }));
                    }
                }
            }
        }
    }
    candidates
}

/// The lean that a habit wants among those that are possible, radians.
fn wanted_lean(leans: &[f64], is_low: bool, share: f64) -> f64 {
    // The steepest ones are for places that are hard to reach, and the arm reaches a low
    // object with no others.
    let usual = match is_low && leans == LEVEL_LEANS {
        true => &leans[2..],
        false => &leans[..leans.len().min(3)],
    };
    let least = usual.iter().copied().fold(0.0, f64::min);
    let most = usual.iter().copied().fold(0.0, f64::max);
    least + share * (most - least)
}

/// Offsets of height at which a level hand grasps an upright object, metres, with their
/// costs: the wanted one, then 0.
fn heights(
    scene: &SceneModel,
    grasp: &Grasp,
    house_from_item: &Isometry3<f64>,
    house_from_grasp: &Isometry3<f64>,
    habits: Option<&Habits>,
) -> Vec<(f64, f64)> {
    let specified = vec![(0.0, 0.0)];
    let forward = house_from_grasp.rotation * Vector3::z();
    let closing = house_from_grasp.rotation * Vector3::x();
    let level = forward.z.abs() < 0.3 && closing.z.abs() < 0.3;
    let Some(habits) = habits.filter(|_| level && grasp.force.is_none()) else {
        return specified;
    };
    let corners = scene.items[grasp.item].boxes.iter();
    let corners = corners.flat_map(|obb| obb.corners());
    let offs = corners.map(|corner| (house_from_item * corner).z - house_from_grasp.translation.z);
    let [low, high] = offs.fold([0.0_f64; 2], |[low, high], z| [low.min(z), high.max(z)]);
    let least = (low + FROM_END).clamp(-HIGHER, 0.0);
    let most = (high - FROM_END).clamp(0.0, HIGHER);
    let wanted = match habits.height < 0.0 {
        true => -habits.height * least,
        false => habits.height * most,
    };
    vec![(wanted, 0.0), (0.0, NOT_AS_WANTED)]
}

/// The candidate that leans by `lean` and is as deep as possible.
fn deepest(
    scene: &SceneModel,
    grasp: &Grasp,
    house_from_grasp: &Isometry3<f64>,
    lean: f64,
    around: &Surroundings,
    standoff: f64,
    margin: f64,
) -> Option<GraspCandidate> {
    let leaned = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), lean);
    let hand = &scene.hand;
    let opening = hand.stroke.min(grasp.width + ROOM);
    // The pads must still meet the object when the grasp is shallower.
    let most = hand.pads(grasp.width) + 0.005 - scene.tool_length;
    BACKOFF
        .iter()
        .filter(|by| **by <= most)
        .find_map(|backoff| {
            let tool_from_grasp = Translation3::new(0.0, 0.0, -scene.tool_length - backoff);
            let at = house_from_grasp * leaned * tool_from_grasp;
            let from_above = (house_from_grasp.rotation * Vector3::z()).z < -0.8;
            let standoff = standoff * if from_above { TOP_STANDOFF } else { 1.0 };
            let standoff = standoff.max(outside(scene, grasp));
            let pregrasp = at * Translation3::new(0.0, 0.0, -standoff);
            let is_free = around.hand_is_free(hand, grasp.width, &[at], margin)
                && around.hand_is_free(hand, opening, &[pregrasp, at], margin);
            is_free.then_some(GraspCandidate {
                pregrasp,
                grasp: at,
                opening,
                width: grasp.width,
                force: grasp.force,
                lean,
                backoff: *backoff,
                cost: backoff / 0.02 * 0.3,
                wish: 0.0,
                shown: None,
                push: None,
            })
        })
}

/// Pushes of closed fingers against the door of a goal that closes one, each at its present
/// angle.
fn pushes(
    scene: &SceneModel,
    goal: &Goal,
    house_from_item: &Isometry3<f64>,
    poses: &[Isometry3<f64>],
    margin: f64,
) -> Vec<GraspCandidate> {
    let Goal::Close { item, slide, .. } = *goal else {
        return Vec::new();
    };
    let Some((leaf, (_, aim))) = scene.leaf(slide).zip(goal.aim(scene)) else {
        return Vec::new();
    };
    let angle = scene.slides[slide].position_at(house_from_item);
    let around = around_door(scene, item, poses);
    let found = leaf.pushes(&scene.hand.closed(), [angle, aim], &around.boxes, margin);
    let found = found.unwrap_or_default();
    found.iter().map(GraspCandidate::from_push).collect()
}

/// What may be in the way of a hand at a door.
pub(crate) fn around_door(
    scene: &SceneModel,
    item: usize,
    poses: &[Isometry3<f64>],
) -> Surroundings {
    let hinge = Point3::from(poses[item].translation.vector);
    scene.near(&hinge, BESIDE_DOOR, poses, Some(item))
}

/// Distance before a grasp at which the fingers are outside the limbs of a deformable
/// object, metres; 0 for a rigid object, whose grasps are at its rim.
fn outside(scene: &SceneModel, grasp: &Grasp) -> f64 {
    if grasp.force.is_none() {
        return 0.0;
    }
    let corners = scene.items[grasp.item].boxes.iter();
    let corners = corners.flat_map(|obb| obb.corners());
    let before = |corner: Point3<f64>| {
        let corner = grasp.item_from_grasp.inverse_transform_point(&corner);
        FINGER_TIP + OUTSIDE - corner.z
    };
    corners.map(before).fold(0.0, f64::max)
}

/// Obstacles of the hand at a grasp of the goal's object at `point`. The fingers
/// enclose an object; of a slide they enclose the handle alone.
pub(crate) fn surroundings(
    scene: &SceneModel,
    goal: &Goal,
    poses: &[Isometry3<f64>],
    point: &Point3<f64>,
) -> Surroundings {
    const WIDE: f64 = 0.75;
    let item = goal.item();
    let mut around = scene.near(point, WIDE, poses, Some(item));
    if goal.slide().is_some() {
        let front = scene.items[item]
            .boxes
            .iter()
            .map(|obb| obb.at(&poses[item]))
            .filter(|obb| obb.distance(point) > HANDLE);
        around.boxes.extend(front);
    }
    around
}
