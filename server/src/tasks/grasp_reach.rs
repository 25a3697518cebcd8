//! Whether the robot grasps an object where it is sampled: some free stops of the chair, to
//! which it gets, have one of the object's grasps in the reach map of the arm.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use wheelarm_planning::arm_access::{aside, furthest_at, leans, lifts, may_cover, way};
use wheelarm_planning::footprint_check::{Pose2, Rectangle, wrap};
use wheelarm_planning::reach_map::{HandPlace, ReachMap};
use wheelarm_proto::exact;

use super::drivable::Drivable;
use crate::robot::CorridorSettings;
use crate::scene::{Body, Surface};

/// Turns of a round object, and of an object that is put down.
const TURNS: u32 = 12;
/// Headings of the chair for a hand from above.
const HEADINGS: u32 = 12;
/// Step of the distance from the arm's base, metres.
const STEP: f64 = 0.05;
/// Stops that an object needs, which differ in heading or bearing. The reach map knows nothing
/// of the way of the hand from home: from a single stop it often fails.
const STOPS: usize = 4;
/// A hand with a smaller horizontal part of its direction is from above.
const LEVEL: f64 = 0.3;

/// Hand and wrist count as far back as this from the grasp point, metres: the forearm behind
/// them may come from aside.
const WRIST: f64 = 0.25;
/// Boxes around furniture are a little larger than it, metres.
const LOOSE: f64 = 0.01;

/// A box of the furniture on the floor plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solid {
    /// Index of its furniture.
    pub furniture: usize,
    pub outline: Rectangle,
    /// Lower and upper end, metres.
    pub heights: [f64; 2],
}

/// A hand at a grasp, in `house`.
struct Hand {
    point: Point3<f64>,
    /// Down is positive, radians.
    pitch: f64,
    /// Direction on the floor plan, radians.
    yaw: f64,
    is_level: bool,
}

impl Hand {
    /// The hand at a grasp that leans about its closing axis, radians.
    fn leaning(house_from_grasp: &Isometry3<f64>, lean: f64) -> Self {
        let (sin, cos) = exact::sin_cos(lean);
        // The approach direction, turned about x.
        let along = house_from_grasp.rotation * Vector3::new(0.0, -sin, cos);
        let level = exact::hypot(along.x, along.y);
        Self {
            point: Point3::from(house_from_grasp.translation.vector),
            pitch: exact::atan2(-along.z, level),
            yaw: exact::atan2(along.y, along.x),
            is_level: level > LEVEL,
        }
    }
}

/// See the module.
#[derive(Clone, Copy)]
pub(super) struct GraspReach<'a> {
    pub reach: &'a ReachMap,
    /// Least and greatest distance from the arm's base to a grasp, metres.
    pub range: [f64; 2],
    pub drivable: &'a Drivable,
    pub solids: &'a [Solid],
    /// Space that the hand needs.
    pub hand: CorridorSettings,
}

impl GraspReach<'_> {
    /// Whether the robot grasps `body` at `pose` on `surface`. An object without grasps is
    /// not grasped, and needs no reach.
    pub(super) fn can_grasp(&self, body: &Body, pose: &Isometry3<f64>, surface: &Surface) -> bool {
        body.grasps.is_empty() || self.stops((body, pose, surface), false, STOPS).len() == STOPS
    }

    /// Whether the robot puts `body` down at `pose` on `surface`, turned about the vertical by
    /// any angle.
    pub(super) fn can_put(&self, body: &Body, pose: &Isometry3<f64>, surface: &Surface) -> bool {
        body.grasps.is_empty() || self.stops((body, pose, surface), true, STOPS).len() == STOPS
    }

    /// Stops of the chair, at most `most`, from which the robot grasps `body` at `pose` on
    /// `surface`, or, where it `turns` about the vertical by any angle, puts it down.
    pub(super) fn stops(
        &self,
        (body, pose, surface): (&Body, &Isometry3<f64>, &Surface),
        turns: bool,
        most: usize,
    ) -> Vec<Pose2> {
        let height = surface.edge.translation.z;
        let point = pose.translation.vector;
        let near = |solid: &&Solid| {
            let [dx, dy] = [
                solid.outline.centre[0] - point.x,
                solid.outline.centre[1] - point.y,
            ];
            solid.furniture != surface.furniture
                && may_cover(solid.heights, height)
                && exact::hypot(dx, dy) < self.range[1] + 0.5 + solid.outline.radius()
        };
        let covers: Vec<&Solid> = self.solids.iter().filter(near).collect();
        let around = |solid: &&Solid| {
            let [dx, dy] = [
                solid.outline.centre[0] - point.x,
                solid.outline.centre[1] - point.y,
            ];
            solid.heights[1] > height + LOOSE
                && exact::hypot(dx, dy) < WRIST + self.hand.fingers + solid.outline.radius()
        };
        let around: Vec<&Solid> = self.solids.iter().filter(around).collect();
        let mut found = Vec::new();
        let about = |angle: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
        for grasp in &body.grasps {
            let count = if grasp.symmetric || turns { TURNS } else { 1 };
            for turn in 0..count {
                let turned = about(TAU * f64::from(turn) / f64::from(count));
                let turned = match grasp.symmetric {
                    true => pose * turned,
                    // Put down with another heading.
                    false => Isometry3::from_parts(pose.translation, turned * pose.rotation),
                };
                // The hand looks the same after half a turn about its own axis.
                for half in [0.0, PI] {
                    let at = turned * grasp.pose * about(half);
                    let hands = leans(&at, grasp.from_above).iter();
                    let hands = hands.map(|lean| Hand::leaning(&at, *lean));
                    for hand in hands.filter(|hand| self.has_room(hand, &around)) {
                        let left = most - found.len();
                        found.extend(self.stops_for(&hand, &covers).take(left));
                        if found.len() == most {
                            return found;
                        }
                    }
                }
            }
        }
        found
    }

    /// Whether fingers, palm and wrist of a hand overlap none of `around`.
    fn has_room(&self, hand: &Hand, around: &[&Solid]) -> bool {
        let (sin, cos) = exact::sin_cos(hand.yaw);
        let size = &self.hand;
        let (rise, level) = exact::sin_cos(hand.pitch);
        // From a distance behind the grasp point to another one: half width, and half height.
        let parts = [
            (-size.tip, size.palm, size.fingers, size.fingers_height),
            (size.palm, WRIST, size.wrist, size.palm_height),
        ];
        parts.iter().all(|&(from, to, wide, tall)| {
            let middle = f64::midpoint(from, to) * level;
            let long = (to - from) / 2.0 * level.abs() + tall * rise.abs();
            let outline = Rectangle {
                centre: [hand.point.x - middle * cos, hand.point.y - middle * sin],
                half: [(long - LOOSE).max(0.0), (wide - LOOSE).max(0.0)],
                along: [cos, sin],
            };
            let ends = [from, to].map(|far| hand.point.z + far * rise);
            let low = ends[0].min(ends[1]) - tall * level.abs() + LOOSE;
            let high = ends[0].max(ends[1]) + tall * level.abs() - LOOSE;
            around.iter().all(|solid| {
                let meets = solid.heights[1] > low && solid.heights[0] < high;
                !(meets && solid.outline.overlaps(&outline))
            })
        })
    }

    /// Stops of the chair for a hand, with nothing of `covers` on the way of the arm.
    fn stops_for(&self, hand: &Hand, covers: &[&Solid]) -> impl Iterator<Item = Pose2> {
        let mount = self.reach.mount().translation;
        let point = [hand.point.x, hand.point.y];
        let [nearest, furthest] = self.range;
        let furthest = furthest_at(hand.point.z, furthest);
        let steps = ((furthest - nearest) / STEP).round().max(0.0) as u32;
        let is_level = hand.is_level;
        let level = aside().filter(move |_| is_level);
        let above = (0..HEADINGS).filter(move |_| !is_level);
        let above = above.map(|i| TAU * f64::from(i) / f64::from(HEADINGS));
        level.chain(above).flat_map(move |turn| {
            let heading = wrap(hand.yaw + turn);
            let (sin, cos) = exact::sin_cos(heading);
            aside().filter_map(move |bearing| {
                let (left, ahead) = exact::sin_cos(bearing);
                (0..=steps).find_map(|step| {
                    let place = HandPlace {
                        distance: furthest - STEP * f64::from(step),
                        height: hand.point.z - mount.z,
                        pitch: hand.pitch,
                        direction: wrap(-turn - bearing),
                    };
                    if !lifts(self.reach, &place) {
                        return None;
                    }
                    let u = mount.x + place.distance * ahead;
                    let v = mount.y + place.distance * left;
                    let pose = Pose2 {
                        x: point[0] - u * cos + v * sin,
                        y: point[1] - u * sin - v * cos,
                        heading,
                    };
                    let is_stop = self.drivable.is_stop(&pose) && {
                        let way = way(pose.point(mount.x, mount.y), point);
                        !covers.iter().any(|solid| solid.outline.overlaps(&way))
                    };
                    is_stop.then_some(pose)
                })
            })
        })
    }
}
