//! Which doors and drawers of furniture the robot opens, from where, and why not the others.
//!
//! The hand takes the handle and moves along the arc to 45°, or straight to 0.20 m. Every pose
//! on the way must be in the reach map, from one stop of the chair that the leaf does not touch
//! on its way. A leaf that turns must not meet walls or furniture. As that of the scripted
//! operator, the hand may lean, and turn about the handle.

use std::f64::consts::FRAC_PI_4;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;
use wheelarm_planning::arm_access::leans;
use wheelarm_planning::footprint_check::{Pose2, Rectangle, wrap};
use wheelarm_planning::handle::LAGS;
use wheelarm_planning::hinged_leaf::{BEYOND, HingedLeaf};
use wheelarm_planning::obb::Obb;
use wheelarm_planning::reach_map::HandPlace;
use wheelarm_proto::exact;
use wheelarm_proto::furniture::JointMotion;

use super::floor::Floor;
use super::home::{Home, Leaf, Owner, Solid};
use super::robot::RobotFacts;

/// Angle that counts as open, radians; tasks ask for 45°, and the scripted operator turns a
/// leaf a little further.
const OPEN: f64 = 0.838;
/// Distance by which a drawer counts as open, metres; tasks ask for 0.20 m.
const OPEN_SLIDE: f64 = 0.21;
/// Stops of the hand on the arc.
const STOPS: u32 = 6;
/// Before it grasps, the hand is this far back, metres.
const STANDOFF: f64 = 0.12;
/// Greatest angle between the heading of the chair and the hand, and between the heading and
/// the handle, radians.
const ASIDE: f64 = 0.6;
/// Handles within these heights count as within the arm's reach by geometry, metres.
const HEIGHTS: [f64; 2] = [0.35, 1.3];
/// Steps to either side.
const TURNS: i32 = 3;
/// Step of the distance from the arm's base, metres.
const STEP: f64 = 0.04;
/// Distance between the leaf and the chair on its way, metres.
const APART: f64 = 0.02;
/// Solids count as in the way of the arm from this far below to this far above the handle,
/// metres.
const WAY: [f64; 2] = [-0.05, 0.15];

/// Why a leaf is not opened; later ones are nearer to success.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Its hinge ends before 45°, or its rail before 0.20 m.
    TooShort,
    /// It meets a wall or furniture before 45°.
    Blocked,
    /// Nothing to grasp was found.
    NoHandle,
    /// The arm reaches no hand at the handle, or not along the arc.
    OutOfReach,
    /// No free floor before it.
    NoFloor,
    /// Something is between the arm and the handle.
    Covered,
    /// The leaf would hit the chair.
    HitsChair,
    /// Free floor, but the chair does not get there.
    NotConnected,
}

/// A leaf in the report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeafReport {
    /// Name of its piece; its joint is `PIECE_joint`.
    pub piece: String,
    /// It slides; otherwise it turns.
    pub slides: bool,
    /// Name of the room.
    pub room: Option<String>,
    /// Height of its handle above the floor, metres.
    pub height: Option<f64>,
    /// Distance of the handle from the hinge, metres; `None` for a drawer.
    pub radius: Option<f64>,
    /// A stop of the chair from which it opens: x, y, metres, and heading, radians.
    pub stop: Option<[f64; 3]>,
    /// Geometry allows it: the chair has a stop anywhere in the home that is clear of the leaf
    /// and as far from the handle as the arm reaches, all the way.
    pub allowed: bool,
    /// Why it is not opened.
    pub reason: Option<Reason>,
}

/// Displacement in `house` of what rides on a leaf when it is open by a share of the way.
fn moved(leaf: &Leaf, share: f64) -> Isometry3<f64> {
    let position = share * open(leaf.motion);
    leaf.motion.displacement(&leaf.axis, &leaf.rest, position)
}

/// Position that counts as open, radians or metres.
fn open(motion: JointMotion) -> f64 {
    match motion {
        JointMotion::Slides => OPEN_SLIDE,
        JointMotion::Turns => OPEN,
    }
}

impl LeafReport {
    /// The result in words.
    #[must_use]
    pub fn words(&self) -> String {
        let why = match self.reason {
            None => return "opened".to_owned(),
            Some(Reason::TooShort) if self.slides => "it ends before 0.20 m",
            Some(Reason::TooShort) => "its hinge ends before 45°",
            Some(Reason::Blocked) => "it meets a wall or furniture before 45°",
            Some(Reason::NoHandle) => "no handle that the hand can take",
            Some(Reason::OutOfReach) => "out of reach at the handle or on its way",
            Some(Reason::Covered) => "something is between the arm and the handle",
            Some(Reason::NoFloor) => "no free floor before it",
            Some(Reason::HitsChair) => "it would hit the chair on its way",
            Some(Reason::NotConnected) => "the chair does not get there",
        };
        format!("not opened: {why}")
    }
}

/// Tests a leaf.
#[must_use]
pub fn test(home: &Home, floor: &Floor, robot: &RobotFacts, leaf: &Leaf) -> LeafReport {
    let mut search = Search {
        home,
        floor,
        robot,
        leaf,
        reason: Reason::TooShort,
        by_geometry: false,
    };
    let travels = leaf.travel >= open(leaf.motion);
    let moves = travels && swings_free(home, leaf);
    if travels && !moves {
        search.note(Reason::Blocked);
    }
    let stop = moves.then(|| search.stop()).flatten();
    let allowed = stop.is_some() || (moves && search.allows());
    let handle = leaf.grasps.first().map(|grasp| grasp.translation.vector);
    let room = handle.map_or_else(
        || home.room_at([leaf.rest.translation.x, leaf.rest.translation.y]),
        |at| home.room_at(before(&at, leaf)),
    );
    let slides = leaf.motion == JointMotion::Slides;
    let radius = handle.filter(|_| !slides).map(|at| {
        let arm = at - leaf.rest.translation.vector;
        (arm - leaf.axis.scale(arm.dot(&leaf.axis))).norm()
    });
    LeafReport {
        piece: home.owner_name(Owner::Piece(leaf.piece)).to_owned(),
        slides,
        room: room.map(|room| home.rooms[room].name.clone()),
        height: handle.map(|at| at.z),
        radius,
        reason: stop.is_none().then_some(search.reason),
        stop: stop.map(|stop| [stop.x, stop.y, stop.heading]),
        allowed,
    }
}

/// Whether a leaf that turns opens without meeting walls or furniture; true of a drawer.
fn swings_free(home: &Home, leaf: &Leaf) -> bool {
    let hinged = HingedLeaf {
        rest: leaf.rest,
        axis: leaf.axis,
        boxes: leaf
            .boxes
            .iter()
            .map(|obb| obb.at(&leaf.rest.inverse()))
            .collect(),
    };
    let own = [Some(leaf.piece), leaf.carrier].map(|piece| piece.map(Owner::Piece));
    let others = home.solids.iter();
    let others = others.filter(|solid| !own.contains(&Some(solid.owner)));
    leaf.motion == JointMotion::Slides
        || hinged.swings_free_of(
            FRAC_PI_4 + BEYOND,
            others.map(|solid| (solid.outline, solid.heights)),
        )
}

/// A point of the floor before a handle: the handle itself may be in no room.
pub(crate) fn before(at: &Vector3<f64>, leaf: &Leaf) -> [f64; 2] {
    let back = leaf
        .grasps
        .first()
        .map_or_else(Vector3::zeros, |grasp| grasp.rotation * Vector3::z());
    [at.x - 0.3 * back.x, at.y - 0.3 * back.y]
}

struct Search<'a> {
    home: &'a Home,
    floor: &'a Floor,
    robot: &'a RobotFacts,
    leaf: &'a Leaf,
    reason: Reason,
    /// Distances and heights count instead of the reach map and of the way to the stop.
    by_geometry: bool,
}

impl Search<'_> {
    fn note(&mut self, reason: Reason) {
        self.reason = self.reason.max(reason);
    }

    /// The stop of the chair that turns least.
    fn stop(&mut self) -> Option<Pose2> {
        self.note(Reason::NoHandle);
        let leaf = self.leaf;
        let hands = match self.by_geometry {
            true => leaf.grasps.iter().map(|grasp| (*grasp, 0.0)).collect(),
            false => hands(leaf),
        };
        for (grasp, lag) in hands {
            let approach = grasp.rotation * Vector3::z();
            let poses = hand(leaf, &grasp, lag);
            let facing = exact::atan2(approach.y, approach.x);
            let is_level = exact::hypot(approach.x, approach.y) > 0.5;
            let facings = match is_level {
                true => vec![facing],
                false => (0..12)
                    .map(|i| f64::from(i) * std::f64::consts::FRAC_PI_6)
                    .collect(),
            };
            for facing in facings {
                if let Some(stop) = self.stop_at(&poses, facing) {
                    return Some(stop);
                }
            }
        }
        None
    }

    /// Whether geometry allows it.
    fn allows(&self) -> bool {
        let mut search = Search {
            by_geometry: true,
            ..*self
        };
        search.stop().is_some()
    }

    fn stop_at(&mut self, poses: &[Isometry3<f64>], facing: f64) -> Option<Pose2> {
        let mount = self.robot.reach.mount().translation;
        let [nearest, furthest] = self.robot.range;
        let steps = ((furthest - nearest) / STEP).round() as i32;
        let handle = poses[0].translation.vector;
        for turn in aside() {
            let heading = wrap(facing + turn);
            let (sin, cos) = exact::sin_cos(heading);
            for bearing in aside() {
                let (left, ahead) = exact::sin_cos(bearing);
                for step in 0..=steps {
                    let distance = furthest - STEP * f64::from(step);
                    let [u, v] = [mount.x + distance * ahead, mount.y + distance * left];
                    let pose = Pose2 {
                        x: handle.x - u * cos + v * sin,
                        y: handle.y - u * sin - v * cos,
                        heading,
                    };
                    if self.is_stop(&pose, poses) {
                        return Some(pose);
                    }
                }
            }
        }
        None
    }

    fn is_stop(&mut self, pose: &Pose2, poses: &[Isometry3<f64>]) -> bool {
        let mount = self.robot.reach.mount();
        let chair = Isometry3::from_parts(
            Translation3::new(pose.x, pose.y, 0.0),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.heading),
        );
        let base_from_house = (chair * mount).inverse();
        let [nearest, furthest] = self.robot.range;
        let reaches = |tool: &Isometry3<f64>| {
            if self.by_geometry {
                let at = (base_from_house * tool).translation.vector;
                let height = tool.translation.z;
                return (nearest..=furthest).contains(&exact::hypot(at.x, at.y))
                    && (HEIGHTS[0]..=HEIGHTS[1]).contains(&height);
            }
            let place = HandPlace::from_tool(&(base_from_house * tool), 0.0);
            self.robot.reach.reaches(&place)
        };
        // The pose before the handle may be nearer to the arm than a grasp.
        let before = usize::from(self.by_geometry);
        let (first, others) = poses.split_at(1);
        if !first.iter().chain(&others[before..]).all(reaches) {
            self.note(Reason::OutOfReach);
            return false;
        }
        if !self.floor.stops.is_free(pose) {
            self.note(Reason::NoFloor);
            return false;
        }
        let base = pose.point(mount.translation.x, mount.translation.y);
        if self.is_covered(base, &poses[0].translation.vector) {
            self.note(Reason::Covered);
            return false;
        }
        if self.hits(pose) {
            self.note(Reason::HitsChair);
            return false;
        }
        let is_driven = self.by_geometry || self.floor.reach.is_before(pose);
        if !is_driven {
            self.note(Reason::NotConnected);
        }
        is_driven
    }

    /// Whether something is between the arm's base and the handle, which is before its leaf.
    fn is_covered(&self, base: [f64; 2], handle: &Vector3<f64>) -> bool {
        let way = segment(base, [handle.x, handle.y]);
        let own = Owner::Piece(self.leaf.piece);
        self.home.solids.iter().any(|solid| {
            solid.owner != own
                && solid.heights[1] > handle.z + WAY[0]
                && solid.heights[0] < handle.z + WAY[1]
                && solid.outline.overlaps(&way)
        })
    }

    /// Whether the leaf touches a chair at `pose` on its way.
    fn hits(&self, pose: &Pose2) -> bool {
        (0..=STOPS).any(|stop| {
            let moved = moved(self.leaf, f64::from(stop) / f64::from(STOPS));
            self.leaf.boxes.iter().any(|obb| {
                let obb = Obb {
                    pose: moved * obb.pose,
                    ..*obb
                };
                let solid = Solid::from_box(Owner::Building, &obb);
                let mut below = 0.0;
                self.robot.outlines.iter().any(|(top, outline)| {
                    let meets = solid.heights[0] <= *top
                        && solid.heights[1] > below
                        && solid.outline.overlaps(&outline.rectangle_at(pose, APART));
                    below = *top;
                    meets
                })
            })
        })
    }
}

/// Hands at the handle in `house`, each with the share of the leaf's angle by which it lags
/// about the handle: upright and not turning first.
fn hands(leaf: &Leaf) -> Vec<(Isometry3<f64>, f64)> {
    let lags: &[f64] = match leaf.motion {
        JointMotion::Slides => &[0.0],
        JointMotion::Turns => &LAGS,
    };
    let mut hands = Vec::new();
    for lag in lags {
        // The hand looks the same after half a turn about its own axis.
        for half in [0.0, std::f64::consts::PI] {
            for grasp in &leaf.grasps {
                let grasp = grasp * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), half);
                let lean = |by: &f64| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), *by);
                let leaned = leans(&grasp, false).iter().map(|by| grasp * lean(by));
                hands.extend(leaned.map(|hand| (hand, *lag)));
            }
        }
    }
    hands
}

/// Poses of the hand in `house`: at the handle, before it, and along the way.
fn hand(leaf: &Leaf, grasp: &Isometry3<f64>, lag: f64) -> Vec<Isometry3<f64>> {
    let back = Translation3::from(grasp.rotation * Vector3::z() * -STANDOFF);
    let way = (1..=STOPS).map(|stop| f64::from(stop) / f64::from(STOPS));
    let way = way.map(|share| {
        let mut pose = moved(leaf, share) * grasp;
        let behind = -lag * share * open(leaf.motion);
        if leaf.motion == JointMotion::Turns {
            pose.rotation = UnitQuaternion::from_axis_angle(&leaf.axis, behind) * pose.rotation;
        }
        pose
    });
    [*grasp, back * grasp].into_iter().chain(way).collect()
}

/// Angles from 0 to either side, radians.
fn aside() -> impl Iterator<Item = f64> {
    let step = ASIDE / f64::from(TURNS);
    (0..=2 * TURNS).map(move |i| {
        let sign = if i % 2 == 0 { -1.0 } else { 1.0 };
        sign * f64::from((i + 1) / 2) * step
    })
}

/// A line on the floor plan as a rectangle without width.
fn segment(a: [f64; 2], b: [f64; 2]) -> Rectangle {
    let way = [b[0] - a[0], b[1] - a[1]];
    let length = exact::hypot(way[0], way[1]).max(1e-9);
    Rectangle {
        centre: [f64::midpoint(a[0], b[0]), f64::midpoint(a[1], b[1])],
        half: [length / 2.0, 0.0],
        along: way.map(|part| part / length),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaf_beside_a_wall_is_blocked_and_its_carrier_does_not_block_it() {
        // A door of 0.5 m before a cupboard, whose hinge is 5 cm before its boards.
        let leaf = Leaf {
            piece: 1,
            carrier: Some(0),
            rest: Isometry3::translation(0.0, -0.05, 0.0),
            motion: JointMotion::Turns,
            axis: -Vector3::z_axis(),
            travel: 1.5,
            grasps: Vec::new(),
            boxes: vec![Obb::between([-0.04, -0.02, 0.4], [0.5, 0.0, 1.1])],
        };
        let solids = |others: &[(Owner, Obb)]| Home {
            solids: others
                .iter()
                .map(|(owner, obb)| Solid::from_box(*owner, obb))
                .collect(),
            ..Home::default()
        };
        let cupboard = Obb::between([-0.1, 0.01, 0.0], [0.6, 0.5, 1.2]);
        let door = leaf.boxes[0];
        let own = [(Owner::Piece(0), cupboard), (Owner::Piece(1), door)];
        assert!(swings_free(&solids(&own), &leaf));
        // The door's far corner is 0.35 m before the cupboard when it is open by 45°.
        let wall = (
            Owner::Building,
            Obb::between([0.3, -1.0, 0.0], [0.6, -0.25, 2.5]),
        );
        assert!(!swings_free(&solids(&[own[0], own[1], wall]), &leaf));
        let far = (
            Owner::Building,
            Obb::between([0.3, -1.5, 0.0], [0.6, -0.6, 2.5]),
        );
        assert!(swings_free(&solids(&[own[0], own[1], far]), &leaf));
        // It does not meet what is above it.
        let above = (
            Owner::Piece(2),
            Obb::between([0.0, -0.4, 1.2], [0.5, 0.5, 1.8]),
        );
        assert!(swings_free(&solids(&[own[0], own[1], above]), &leaf));
    }
}
