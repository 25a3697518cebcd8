//! Which doors of furniture the robot opens, from where, and why not the others.
//!
//! The hand takes the handle and moves along the arc to 45°. Every pose on the way must be in
//! the reach map, from one stop of the chair that the leaf does not touch on its arc.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;
use wheelarm_planning::footprint_check::{Pose2, Rectangle, wrap};
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
/// Stops of the hand on the arc.
const STOPS: u32 = 6;
/// Before it grasps, the hand is this far back, metres.
const STANDOFF: f64 = 0.12;
/// Greatest angle between the heading of the chair and the hand, and between the heading and
/// the handle, radians.
const ASIDE: f64 = 0.6;
/// Steps to either side.
const TURNS: i32 = 3;
/// Step of the distance from the arm's base, metres.
const STEP: f64 = 0.04;
/// Distance between the leaf and the chair on its arc, metres.
const APART: f64 = 0.02;
/// Solids count as in the way of the arm from this far below to this far above the handle,
/// metres.
const WAY: [f64; 2] = [-0.05, 0.15];

/// Why a leaf is not opened; later ones are nearer to success.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Its hinge ends before 45°.
    TooShort,
    /// Nothing to grasp was found.
    NoHandle,
    /// The arm reaches no hand at the handle, or not along the arc.
    OutOfReach,
    /// Something is between the arm and the handle.
    Covered,
    /// No free floor before it.
    NoFloor,
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
    /// Name of the room.
    pub room: Option<String>,
    /// Height of its handle above the floor, metres.
    pub height: Option<f64>,
    /// Distance of the handle from the hinge, metres.
    pub radius: Option<f64>,
    /// A stop of the chair from which it opens: x, y, metres, and heading, radians.
    pub stop: Option<[f64; 3]>,
    /// Why it is not opened.
    pub reason: Option<Reason>,
}

/// Displacement in `house` of what rides on a leaf when it turns by an angle.
fn turned(leaf: &Leaf, angle: f64) -> Isometry3<f64> {
    JointMotion::Turns.displacement(&leaf.axis, &leaf.rest, angle)
}

impl LeafReport {
    /// The result in words.
    #[must_use]
    pub fn words(&self) -> String {
        let why = match self.reason {
            None => return "opened".to_owned(),
            Some(Reason::TooShort) => "its hinge ends before 45°",
            Some(Reason::NoHandle) => "no handle that the hand can take",
            Some(Reason::OutOfReach) => "out of reach at the handle or on its arc",
            Some(Reason::Covered) => "something is between the arm and the handle",
            Some(Reason::NoFloor) => "no free floor before it",
            Some(Reason::HitsChair) => "it would hit the chair on its arc",
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
    };
    let stop = match leaf.travel < OPEN {
        true => None,
        false => search.stop(),
    };
    let handle = leaf.grasps.first().map(|grasp| grasp.translation.vector);
    let room = handle.map_or_else(
        || home.room_at([leaf.rest.translation.x, leaf.rest.translation.y]),
        |at| home.room_at(before(&at, leaf)),
    );
    let radius = handle.map(|at| {
        let arm = at - leaf.rest.translation.vector;
        (arm - leaf.axis.scale(arm.dot(&leaf.axis))).norm()
    });
    LeafReport {
        piece: home.owner_name(Owner::Piece(leaf.piece)).to_owned(),
        room: room.map(|room| home.rooms[room].name.clone()),
        height: handle.map(|at| at.z),
        radius,
        reason: stop.is_none().then_some(search.reason),
        stop: stop.map(|stop| [stop.x, stop.y, stop.heading]),
    }
}

/// A point of the floor before a handle: the handle itself may be in no room.
fn before(at: &Vector3<f64>, leaf: &Leaf) -> [f64; 2] {
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
}

impl Search<'_> {
    fn note(&mut self, reason: Reason) {
        self.reason = self.reason.max(reason);
    }

    /// The stop of the chair that turns least.
    fn stop(&mut self) -> Option<Pose2> {
        self.note(Reason::NoHandle);
        let leaf = self.leaf;
        for grasp in &leaf.grasps {
            let approach = grasp.rotation * Vector3::z();
            let poses = hand(leaf, grasp);
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
        let reaches = |tool: &Isometry3<f64>| {
            let place = HandPlace::from_tool(&(base_from_house * tool), 0.0);
            self.robot.reach.reaches(&place)
        };
        if !poses.iter().all(reaches) {
            self.note(Reason::OutOfReach);
            return false;
        }
        let base = pose.point(mount.translation.x, mount.translation.y);
        if self.is_covered(base, &poses[0].translation.vector) {
            self.note(Reason::Covered);
            return false;
        }
        if !self.floor.stops.is_free(pose) {
            self.note(Reason::NoFloor);
            return false;
        }
        if self.hits(pose) {
            self.note(Reason::HitsChair);
            return false;
        }
        let is_driven = self.floor.reach.is_before(pose);
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

    /// Whether the leaf touches a chair at `pose` on its arc.
    fn hits(&self, pose: &Pose2) -> bool {
        (0..=STOPS).any(|stop| {
            let turned = turned(self.leaf, OPEN * f64::from(stop) / f64::from(STOPS));
            self.leaf.boxes.iter().any(|obb| {
                let moved = Obb {
                    pose: turned * obb.pose,
                    ..*obb
                };
                let solid = Solid::from_box(Owner::Building, &moved);
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

/// Poses of the hand in `house`: at the handle, before it, and along the arc.
fn hand(leaf: &Leaf, grasp: &Isometry3<f64>) -> Vec<Isometry3<f64>> {
    let back = Translation3::from(grasp.rotation * Vector3::z() * -STANDOFF);
    let arc = (1..=STOPS).map(|stop| OPEN * f64::from(stop) / f64::from(STOPS));
    let arc = arc.map(|angle| turned(leaf, angle) * grasp);
    [*grasp, back * grasp].into_iter().chain(arc).collect()
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
