//! Which surfaces of a home the arm reaches, from where, and why not the others.
//!
//! A point of a surface counts where a pose that the chair gets to has it in the range of the
//! arm's base and within 35° of the heading, the reach map has a hand at it, and nothing
//! rises higher than 0.12 m above the surface on the way. Without the last test shelves are
//! reached through walls. The best edge and its strip are kept with the stops of the chair.

use std::f64::consts::FRAC_PI_2;

use serde::Serialize;
use wheelarm_planning::arm_access::{PITCHES, aside, lifts, may_cover, way};
use wheelarm_planning::footprint_check::{Pose2, wrap};
use wheelarm_planning::reach_map::HandPlace;
use wheelarm_proto::exact;

use super::floor::Floor;
use super::home::{Home, Owner, Solid, Surface};
use super::robot::RobotFacts;

/// Distance of the tested points from the edge, metres.
pub(crate) const INWARDS: f64 = 0.16;
/// Their spacing along the edge, metres.
pub(crate) const SPACING: f64 = 0.1;
/// Their least distance from the ends of the edge, metres.
const END: f64 = 0.08;
/// Shortest and longest depth of a surface that an edge offers, metres.
const DEPTHS: [f64; 2] = [0.16, 0.4];
/// Step of the distance from the arm's base, metres.
const STEP: f64 = 0.04;
/// The grasp point is this high above the surface, metres.
const GRASP: f64 = 0.08;

/// Stage at which points of a surface fail; later ones are nearer to success.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Too small for the tested points.
    TooSmall,
    /// The arm reaches no hand at this height.
    OutOfReach,
    /// Something is between the arm and the surface.
    Covered,
    /// No free floor before the surface.
    NoFloor,
    /// Free floor, but the chair does not get there.
    NotConnected,
}

/// Part of an edge from which the arm reaches the surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Strip {
    /// Middle of the strip at the edge, in `house`, metres.
    pub edge: [f64; 3],
    /// Direction from the edge inwards, radians.
    pub inwards: f64,
    /// Metres.
    pub width: f64,
    /// Of the surface behind the edge, metres.
    pub depth: f64,
    /// Quarter turns, counter-clockwise, from the surface's approach edge to this edge: 0 to 3.
    pub side: usize,
    /// Reached points of the edge: distances from the middle of the whole edge, to the left of
    /// a chair that faces it, metres; rising.
    pub points: Vec<f64>,
    /// A stop of the chair for each of these points: x, y, metres, and heading, radians.
    pub stops: Vec<[f64; 3]>,
}

/// A surface in the report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceReport {
    /// Name of its piece.
    pub piece: String,
    /// Its name on the piece.
    pub surface: String,
    /// Name of the room.
    pub room: Option<String>,
    /// Height above the floor, metres.
    pub height: f64,
    /// Sides, metres.
    pub size: [f64; 2],
    /// Share of the points of its best edge that are reached.
    pub share: f64,
    /// Where it is reached; `None` where it is not.
    pub strip: Option<Strip>,
    /// Why it is not reached.
    pub reason: Option<Reason>,
    /// Names of what is in the way, most often first.
    pub blocked_by: Vec<String>,
}

/// An edge of a surface.
#[derive(Clone, Copy, Debug)]
struct Edge {
    /// Middle, on the floor plan, metres.
    middle: [f64; 2],
    /// Unit vectors along the edge and inwards.
    along: [f64; 2],
    inwards: [f64; 2],
    /// Of `inwards`, radians.
    facing: f64,
    width: f64,
    depth: f64,
}

impl Edge {
    fn all(surface: &Surface) -> [Self; 4] {
        let [first, second] = surface.size;
        let edge = |quarter: i32| {
            let facing = wrap(surface.yaw + f64::from(quarter) * FRAC_PI_2);
            let (sin, cos) = exact::sin_cos(facing);
            let (width, depth) = match quarter % 2 {
                0 => (second, first),
                _ => (first, second),
            };
            Self {
                middle: [
                    surface.centre[0] - cos * depth / 2.0,
                    surface.centre[1] - sin * depth / 2.0,
                ],
                along: [-sin, cos],
                inwards: [cos, sin],
                facing,
                width,
                depth,
            }
        };
        [edge(0), edge(1), edge(2), edge(3)]
    }

    /// Distances of the tested points from the middle of the edge, metres.
    fn points(&self) -> Vec<f64> {
        let room = self.width / 2.0 - END;
        if room < 0.0 || self.depth < DEPTHS[0] {
            return Vec::new();
        }
        let steps = (2.0 * room / SPACING).floor();
        let first = -steps * SPACING / 2.0;
        (0..=steps as i32)
            .map(|step| first + f64::from(step) * SPACING)
            .collect()
    }

    fn at(&self, along: f64, inwards: f64) -> [f64; 2] {
        [0, 1].map(|i| self.middle[i] + along * self.along[i] + inwards * self.inwards[i])
    }
}

/// What the search found for one surface.
struct Search<'a> {
    home: &'a Home,
    floor: &'a Floor,
    robot: &'a RobotFacts,
    surface: &'a Surface,
    /// Solids in the way at this height, with the index of the solid.
    above: Vec<&'a Solid>,
    /// Distances from the arm's base with bearings that the hand reaches, by heading.
    reason: Reason,
    /// Counts of owners in the way, at the stage of `reason`.
    blockers: Vec<(Owner, usize)>,
}

/// Tests a surface.
#[must_use]
pub fn test(home: &Home, floor: &Floor, robot: &RobotFacts, surface: &Surface) -> SurfaceReport {
    let above = home.solids.iter().filter(|solid| {
        may_cover(solid.heights, surface.height) && solid.owner != Owner::Piece(surface.piece)
    });
    let mut search = Search {
        home,
        floor,
        robot,
        surface,
        above: above.collect(),
        reason: Reason::TooSmall,
        blockers: Vec::new(),
    };
    let mut best: Option<(f64, f64, Strip)> = None;
    for (side, edge) in Edge::all(surface).iter().enumerate() {
        if let Some((share, strip)) = search.strip(side, edge) {
            let gain = strip.stops.len() as f64 * edge.depth.min(DEPTHS[1]);
            if best.as_ref().is_none_or(|(other, ..)| gain > *other) {
                best = Some((gain, share, strip));
            }
        }
    }
    let (share, strip) = best.map_or((0.0, None), |(_, share, strip)| (share, Some(strip)));
    let is_reached = strip.is_some();
    search
        .blockers
        .sort_by_key(|(owner, count)| (std::cmp::Reverse(*count), *owner));
    let names = search
        .blockers
        .iter()
        .map(|(owner, _)| home.owner_name(*owner));
    let room = home.room_at(surface.centre);
    SurfaceReport {
        piece: home.owner_name(Owner::Piece(surface.piece)).to_owned(),
        surface: surface.name.clone(),
        room: room.map(|room| home.rooms[room].name.clone()),
        height: surface.height,
        size: surface.size,
        share,
        strip,
        reason: (!is_reached).then_some(search.reason),
        blocked_by: match is_reached {
            true => Vec::new(),
            false => names.take(3).map(str::to_owned).collect(),
        },
    }
}

impl Search<'_> {
    /// The share of the points of an edge that are reached, and the strip around them.
    fn strip(&mut self, side: usize, edge: &Edge) -> Option<(f64, Strip)> {
        let points = edge.points();
        let mut reached: Vec<(f64, [f64; 3])> = Vec::new();
        for &along in &points {
            let inwards = INWARDS.min(edge.depth / 2.0);
            if let Some(stop) = self.stop(edge.at(along, inwards), edge.facing) {
                reached.push((along, [stop.x, stop.y, stop.heading]));
            }
        }
        let (first, last) = (reached.first()?.0, reached.last()?.0);
        let low = (first - END).max(-edge.width / 2.0);
        let high = (last + END).min(edge.width / 2.0);
        let [x, y] = edge.at(f64::midpoint(low, high), 0.0);
        let strip = Strip {
            edge: [x, y, self.surface.height],
            inwards: edge.facing,
            width: high - low,
            depth: edge.depth,
            side,
            points: reached.iter().map(|(along, _)| *along).collect(),
            stops: reached.iter().map(|(_, stop)| *stop).collect(),
        };
        Some((reached.len() as f64 / points.len() as f64, strip))
    }

    /// A stop of the chair from which the arm reaches a point, towards `facing`, radians: the
    /// one that turns least.
    fn stop(&mut self, point: [f64; 2], facing: f64) -> Option<Pose2> {
        let mount = self.robot.reach.mount().translation;
        let [nearest, furthest] = self.robot.range;
        let steps = ((furthest - nearest) / STEP).round() as i32;
        for turn in aside() {
            let heading = wrap(facing + turn);
            let (sin, cos) = exact::sin_cos(heading);
            for bearing in aside() {
                // The hand points into the surface, or along the arm.
                let direction = wrap(-turn - bearing);
                let (aside, ahead) = exact::sin_cos(bearing);
                for step in 0..=steps {
                    let distance = furthest - STEP * f64::from(step);
                    if !self.reaches(distance, direction) {
                        self.note(Reason::OutOfReach, None);
                        continue;
                    }
                    let [u, v] = [mount.x + distance * ahead, mount.y + distance * aside];
                    let pose = Pose2 {
                        x: point[0] - u * cos + v * sin,
                        y: point[1] - u * sin - v * cos,
                        heading,
                    };
                    if self.is_stop(&pose, point) {
                        return Some(pose);
                    }
                }
            }
        }
        None
    }

    /// Whether the chair may stop at `pose` to reach `point`.
    fn is_stop(&mut self, pose: &Pose2, point: [f64; 2]) -> bool {
        let mount = self.robot.reach.mount().translation;
        let base = pose.point(mount.x, mount.y);
        let way = way(base, point);
        let covered = self.above.iter().find(|solid| solid.outline.overlaps(&way));
        if let Some(owner) = covered.map(|solid| solid.owner) {
            self.note(Reason::Covered, Some(owner));
            return false;
        }
        if !self.floor.stops.is_free(pose) {
            let blocker = match self.reason <= Reason::NoFloor {
                true => self.collision(pose),
                false => None,
            };
            self.note(Reason::NoFloor, blocker);
            return false;
        }
        // The chair arrives on a straight segment.
        let is_driven = self.floor.reach.is_before(pose);
        if !is_driven {
            self.note(Reason::NotConnected, None);
        }
        is_driven
    }

    /// Owner of a solid that a chair at `pose` collides with.
    fn collision(&self, pose: &Pose2) -> Option<Owner> {
        let margin = self.floor.stops.margin();
        let mut below = 0.0;
        for (top, outline) in &self.robot.outlines_at_home {
            let at = outline.rectangle_at(pose, margin);
            let met = self.home.solids.iter().find(|solid| {
                solid.heights[0] <= *top
                    && solid.heights[1] > f64::max(below, 0.03)
                    && solid.outline.overlaps(&at)
            });
            if let Some(solid) = met {
                return Some(solid.owner);
            }
            below = *top;
        }
        None
    }

    /// Whether the hand gets to a point of the surface: level or inclined along the arm or
    /// into the surface, or from above; with room to lift.
    fn reaches(&self, distance: f64, direction: f64) -> bool {
        let base = self.robot.reach.mount().translation.z;
        let height = self.surface.height + GRASP - base;
        [direction, 0.0].iter().any(|&direction| {
            PITCHES.iter().any(|&pitch| {
                let place = HandPlace {
                    distance,
                    height,
                    pitch,
                    direction,
                };
                lifts(&self.robot.reach, &place)
            })
        })
    }

    /// Remembers the furthest stage and what was in the way there.
    fn note(&mut self, reason: Reason, owner: Option<Owner>) {
        if reason > self.reason {
            self.reason = reason;
            self.blockers.clear();
        }
        let Some(owner) = owner
            .filter(|owner| reason == self.reason && *owner != Owner::Piece(self.surface.piece))
        else {
            return;
        };
        match self.blockers.iter_mut().find(|(other, _)| *other == owner) {
            Some((_, count)) => *count += 1,
            None => self.blockers.push((owner, 1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_faces_the_middle_of_the_surface() {
        let surface = Surface {
            piece: 0,
            name: "top".to_owned(),
            centre: [2.0, 1.0],
            height: 0.75,
            yaw: 0.3,
            size: [1.2, 0.6],
        };
        for edge in Edge::all(&surface) {
            let middle = edge.at(0.0, edge.depth / 2.0);
            assert!((0..2).all(|i| (middle[i] - surface.centre[i]).abs() < 1e-9));
            assert!((edge.width * edge.depth - 0.72).abs() < 1e-9);
            let points = edge.points();
            assert!(points.len() >= 4, "{points:?}");
            let sum: f64 = points.iter().sum();
            assert!(sum.abs() < 1e-9, "points lie evenly about the middle");
            assert!(
                points
                    .iter()
                    .all(|at| at.abs() <= edge.width / 2.0 - END + 1e-9)
            );
        }
        let small = Surface {
            size: [0.12, 0.12],
            ..surface
        };
        assert!(
            Edge::all(&small)
                .iter()
                .all(|edge| edge.points().is_empty())
        );
    }
}
