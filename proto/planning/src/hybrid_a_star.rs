//! The chair's path: hybrid A* over straights, arcs and turns on the spot that keeps
//! the footprint free of all bodies on the floor.
//!
//! Dolgov, Thrun, Montemerlo and Diebel 2010, "Path Planning for Autonomous Vehicles in
//! Unknown Semi-structured Environments": poses are continuous, each cell of (x, y,
//! heading) keeps its cheapest node, and expanded nodes also try an analytic expansion to
//! the goals. Unlike there the chair turns on the spot, so the expansion is an arc between
//! straights or a straight between turns, not a Reeds-Shepp curve, and the path is not
//! smoothed. The heuristic is the distance field of the goals on a floor map, or the
//! straight distance.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};
use std::f64::consts::TAU;

use wheelarm_proto::exact;

use super::distance_field::DistanceField;
use super::floor_map::FloorMap;
use super::footprint_check::{FootprintCheck, Pose2, wrap};
use super::price::{self, Motion};

/// One segment of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Segment {
    /// Turns on the spot, radians, positive to the left.
    Turn(f64),
    /// Rolls `length` metres (negative: back) with `curvature` 1/m.
    Roll {
        /// Metres.
        length: f64,
        /// 1/m, positive to the left.
        curvature: f64,
    },
}

impl Segment {
    /// Pose after the share `share` (0 to 1) of the segment.
    #[must_use]
    pub fn after(&self, start: &Pose2, share: f64) -> Pose2 {
        match *self {
            Self::Turn(angle) => start.turned(angle * share),
            Self::Roll { length, curvature } => start.rolled(length * share, curvature),
        }
    }

    /// Whether the chair is collision-free along it, sampled every 5 cm or 5°.
    #[must_use]
    pub fn is_free(&self, start: &Pose2, map: &FloorMap) -> bool {
        let steps = match *self {
            Self::Turn(angle) => (angle.abs() / 0.09).ceil(),
            Self::Roll { length, curvature } => (length.abs() / 0.05)
                .max((length * curvature).abs() / 0.09)
                .ceil(),
        };
        (1..=steps as usize).all(|i| map.is_free(&self.after(start, i as f64 / steps)))
    }
}

/// Preferences for a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPreferences {
    /// Radius of arcs, metres.
    pub radius: f64,
    /// Clearance around the outline if start and goal allow it, metres.
    pub margin: f64,
}

/// Headings of the search.
const HEADINGS: i64 = 24;

/// How thorough a search is.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Effort {
    /// Cell of the search, metres.
    cell: f64,
    /// Weight of the heuristic.
    weight: f64,
    /// Largest number of nodes.
    limit: usize,
    /// Whether poses at which the chair arrives with different motions differ, and whether
    /// poses that cannot improve the best path so far are left out.
    is_fine: bool,
}

/// The search without a distance field.
const COMPLETE: Effort = Effort {
    cell: 0.1,
    weight: 1.0,
    limit: 60_000,
    is_fine: false,
};
/// Weight of the heuristic when any path is sufficient.
const GREED: f64 = 4.0;
/// Searches with a distance field, one after another until a path is found: a fast path,
/// then any through narrow places. Where the field shows a way that the chair's arcs
/// cannot follow, the search ends after all nodes.
const EFFORTS: [Effort; 2] = [
    Effort {
        cell: 0.05,
        weight: 1.0,
        limit: 20_000,
        is_fine: true,
    },
    Effort {
        cell: 0.1,
        weight: 1.5,
        limit: 25_000,
        is_fine: true,
    },
];

/// Cell of x, y and heading, and the motion with which the chair arrives.
type Cell = (i64, i64, i64, u8);

struct Node {
    pose: Pose2,
    cost: f64,
    parent: usize,
    segments: Vec<Segment>,
    /// The goal that it reaches.
    goal: Option<usize>,
}

struct OpenNode {
    rank: f64,
    node: usize,
}

impl PartialEq for OpenNode {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for OpenNode {}
impl PartialOrd for OpenNode {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for OpenNode {
    // The heap returns its greatest element: the smallest rank, then the oldest node.
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .rank
            .total_cmp(&self.rank)
            .then(other.node.cmp(&self.node))
    }
}

/// A path of the chair and its estimated duration.
#[derive(Clone, Debug, PartialEq)]
pub struct DrivePath {
    /// Segments in their order.
    pub segments: Vec<Segment>,
    /// Seconds, including costs of stops and bends.
    pub cost: f64,
}

/// One of several goals of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveGoal {
    /// Where the path ends.
    pub pose: Pose2,
    /// Cost of this goal, seconds: it is added to that of the path.
    pub cost: f64,
}

/// Result of a search with several goals.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundPath {
    /// The path; its cost includes that of the goal.
    pub path: DrivePath,
    /// Index of the goal.
    pub goal: usize,
}

/// A finished search.
#[derive(Clone, Debug, PartialEq)]
pub struct Searched {
    /// The path, if one was found.
    pub found: Option<FoundPath>,
    /// Number of nodes.
    pub nodes: usize,
}

/// Searches a fast path from `start` to `goal`, with at most 60,000 nodes and the straight
/// distance as heuristic; `None` when none is found. It is the reference for
/// [`search_field`].
#[must_use]
pub fn search(
    footprint: &FootprintCheck,
    start: Pose2,
    goal: Pose2,
    preferences: &PathPreferences,
) -> Option<DrivePath> {
    weighted(footprint, start, goal, preferences, COMPLETE)
}

/// Whether any path from `start` to `goal` is found within `limit` nodes, even a slow
/// one. The search is greedy (weighted A*) and expands far fewer nodes than [`search`].
#[must_use]
pub fn has_path(
    footprint: &FootprintCheck,
    start: Pose2,
    goal: Pose2,
    preferences: &PathPreferences,
    limit: usize,
) -> bool {
    rough_path(footprint, start, goal, preferences, limit).is_some()
}

/// A path from `start` to `goal`, possibly slow, found like in [`has_path`].
#[must_use]
pub fn rough_path(
    footprint: &FootprintCheck,
    start: Pose2,
    goal: Pose2,
    preferences: &PathPreferences,
    limit: usize,
) -> Option<DrivePath> {
    let effort = Effort {
        weight: GREED,
        limit,
        ..COMPLETE
    };
    weighted(footprint, start, goal, preferences, effort)
}

/// The search with the straight distance as heuristic.
fn weighted(
    footprint: &FootprintCheck,
    start: Pose2,
    goal: Pose2,
    preferences: &PathPreferences,
    effort: Effort,
) -> Option<DrivePath> {
    // A stop, or the present pose of the chair, may allow less clearance than
    // preferred.
    let margin = clearances(preferences.margin)
        .into_iter()
        .find(|margin| footprint.is_free(&start, *margin) && footprint.is_free(&goal, *margin))?;
    let map = FloorMap::shared(footprint, margin, &[start, goal]);
    // The map allows more than the search: without a way the search would fail.
    if !map.has_way(&start, &goal) {
        return None;
    }
    let goals = [DriveGoal {
        pose: goal,
        cost: 0.0,
    }];
    let search = Search {
        map: &map,
        bounds: footprint.bounds(),
        goals: &goals,
        radii: &[preferences.radius],
        effort,
    };
    let straight = |pose: &Pose2, _| Some(pose.distance(&goals[0].pose) / price::STRAIGHT);
    search.run(start, straight).found.map(|found| found.path)
}

/// The clearances that are tried: as preferred, half of it, none.
#[must_use]
pub fn clearances(preferred: f64) -> [f64; 3] {
    [preferred, preferred / 2.0, 0.0]
}

/// Searches a fast path from `start` to the goal that costs least, on the map and with the
/// distance field of these goals, with arcs of any of the `radii`, metres.
#[must_use]
pub fn search_field(
    map: &FloorMap,
    field: &mut DistanceField,
    start: Pose2,
    goals: &[DriveGoal],
    radii: &[f64],
) -> Searched {
    let mut nodes = 0;
    for effort in EFFORTS {
        let search = Search {
            map,
            bounds: map.bounds(),
            goals,
            radii,
            effort,
        };
        let searched = search.run(start, |pose, motion| field.seconds(pose, motion));
        nodes += searched.nodes;
        // Fewer nodes: all poses that the chair can reach were tried.
        if searched.found.is_some() || searched.nodes <= effort.limit {
            return Searched { nodes, ..searched };
        }
    }
    Searched { found: None, nodes }
}

/// A search on a map.
struct Search<'a> {
    map: &'a FloorMap,
    /// x min, x max, y min, y max, metres.
    bounds: [f64; 4],
    goals: &'a [DriveGoal],
    radii: &'a [f64],
    effort: Effort,
}

impl Search<'_> {
    /// Searches from `start`. `heuristic` estimates the cost from a pose at which the
    /// chair arrives with a motion; `None` without a way.
    fn run(
        &self,
        start: Pose2,
        mut heuristic: impl FnMut(&Pose2, Option<Motion>) -> Option<f64>,
    ) -> Searched {
        let mut nodes = vec![Node {
            pose: start,
            cost: 0.0,
            parent: 0,
            segments: Vec::new(),
            goal: None,
        }];
        let mut best: BTreeMap<Cell, f64> = BTreeMap::new();
        let mut open = BinaryHeap::new();
        if heuristic(&start, None).is_some() {
            open.push(OpenNode { rank: 0.0, node: 0 });
        }
        let primitives = motion_primitives(self.radii);
        // Cost of the best path so far.
        let mut least = f64::INFINITY;
        let is_fine = self.effort.is_fine;
        while let Some(OpenNode { node: at, .. }) = open.pop() {
            if let Some(goal) = nodes[at].goal {
                let path = DrivePath {
                    segments: collect(&nodes, at),
                    cost: nodes[at].cost,
                };
                return Searched {
                    found: Some(FoundPath { path, goal }),
                    nodes: nodes.len(),
                };
            }
            if nodes.len() > self.effort.limit {
                break;
            }
            let (pose, cost) = (nodes[at].pose, nodes[at].cost);
            let last = nodes[at].segments.last().copied();
            if best
                .get(&self.cell(&pose, last.as_ref()))
                .is_some_and(|known| *known < cost - 1e-9)
            {
                continue;
            }
            for (index, goal) in self.goals.iter().enumerate() {
                for segments in analytic_expansions(&pose, &goal.pose, self.radii) {
                    let sum = cost + price::seconds(last, &segments) + goal.cost;
                    if (sum < least || !is_fine) && self.is_free(&pose, &segments) {
                        least = least.min(sum);
                        let node = Node {
                            pose: goal.pose,
                            cost: sum,
                            parent: at,
                            segments,
                            goal: Some(index),
                        };
                        push(&mut nodes, &mut open, sum, node);
                    }
                }
            }
            for segment in &primitives {
                let next = segment.after(&pose, 1.0);
                let bounds = self.bounds;
                let inside = (bounds[0]..=bounds[1]).contains(&next.x)
                    && (bounds[2]..=bounds[3]).contains(&next.y);
                if !inside {
                    continue;
                }
                let sum = cost + price::seconds(last, &[*segment]);
                let cell = self.cell(&next, Some(segment));
                let known = best.get(&cell).copied().unwrap_or(f64::INFINITY);
                if sum >= known - 1e-9 || !segment.is_free(&pose, self.map) {
                    continue;
                }
                let Some(rest) = heuristic(&next, Some(Motion::along(segment))) else {
                    continue;
                };
                if sum + rest < least || !is_fine {
                    best.insert(cell, sum);
                    let node = Node {
                        pose: next,
                        cost: sum,
                        parent: at,
                        segments: vec![*segment],
                        goal: None,
                    };
                    push(&mut nodes, &mut open, sum + self.effort.weight * rest, node);
                }
            }
        }
        Searched {
            found: None,
            nodes: nodes.len(),
        }
    }

    fn cell(&self, pose: &Pose2, last: Option<&Segment>) -> Cell {
        (
            (pose.x / self.effort.cell).round() as i64,
            (pose.y / self.effort.cell).round() as i64,
            ((pose.heading / TAU * HEADINGS as f64).round() as i64).rem_euclid(HEADINGS),
            last.filter(|_| self.effort.is_fine)
                .map_or(0, |last| Motion::along(last) as u8),
        )
    }

    fn is_free(&self, start: &Pose2, segments: &[Segment]) -> bool {
        let mut pose = *start;
        segments.iter().all(|segment| {
            let is_free = segment.is_free(&pose, self.map);
            pose = segment.after(&pose, 1.0);
            is_free
        })
    }
}

/// Adds a node to the open list.
fn push(nodes: &mut Vec<Node>, open: &mut BinaryHeap<OpenNode>, rank: f64, node: Node) {
    open.push(OpenNode {
        rank,
        node: nodes.len(),
    });
    nodes.push(node);
}

/// The motion primitives of the search.
fn motion_primitives(radii: &[f64]) -> Vec<Segment> {
    let turn = TAU / 24.0;
    let straight = |length| Segment::Roll {
        length,
        curvature: 0.0,
    };
    let arcs = radii.iter().flat_map(|radius| {
        [1.0, -1.0].map(|side| Segment::Roll {
            length: radius * turn,
            curvature: side / radius,
        })
    });
    [straight(0.15)]
        .into_iter()
        .chain(arcs)
        .chain([Segment::Turn(turn), Segment::Turn(-turn), straight(-0.15)])
        .collect()
}

/// Analytic expansions to a goal: one arc between two straights, or turns on the spot
/// before and after one straight.
fn analytic_expansions(pose: &Pose2, goal: &Pose2, radii: &[f64]) -> Vec<Vec<Segment>> {
    let mut expansions = Vec::new();
    let straight = |length| Segment::Roll {
        length,
        curvature: 0.0,
    };
    let bearing = exact::atan2(goal.y - pose.y, goal.x - pose.x);
    let (before, after) = (wrap(bearing - pose.heading), wrap(goal.heading - bearing));
    let length = pose.distance(goal);
    expansions.push(if length < 0.02 {
        vec![Segment::Turn(wrap(goal.heading - pose.heading))]
    } else {
        vec![
            Segment::Turn(before),
            straight(length),
            Segment::Turn(after),
        ]
    });
    let [forward, left, turn] = pose.to(goal);
    if turn.abs() > 0.05 && turn.abs() < 2.6 {
        // The lines of both headings intersect `ahead` of the pose and `back` before
        // the goal.
        let back = left / exact::sin(turn);
        let ahead = forward - back * exact::cos(turn);
        for radius in radii {
            let tangent = radius * exact::tan(turn.abs() / 2.0);
            if ahead >= tangent && back >= tangent {
                expansions.push(vec![
                    straight(ahead - tangent),
                    Segment::Roll {
                        length: radius * turn.abs(),
                        curvature: turn.signum() / radius,
                    },
                    straight(back - tangent),
                ]);
            }
        }
    }
    for expansion in &mut expansions {
        expansion.retain(|segment| match *segment {
            Segment::Turn(angle) => angle.abs() > 1e-3,
            Segment::Roll { length, .. } => length.abs() > 1e-3,
        });
    }
    expansions
}

fn collect(nodes: &[Node], goal: usize) -> Vec<Segment> {
    let mut chain = Vec::new();
    let mut at = goal;
    while at != 0 {
        chain.push(at);
        at = nodes[at].parent;
    }
    chain
        .into_iter()
        .rev()
        .flat_map(|node| nodes[node].segments.iter().copied())
        .collect()
}
#[cfg(test)]
mod tests {
    use super::super::footprint_check::{Level, Outline, Rectangle};
    use super::*;

    fn wall(x: [f64; 2], y: [f64; 2]) -> Rectangle {
        Rectangle {
            centre: [f64::midpoint(x[0], x[1]), f64::midpoint(y[0], y[1])],
            half: [(x[1] - x[0]) / 2.0, (y[1] - y[0]) / 2.0],
            along: [1.0, 0.0],
        }
    }

    fn room(obstacles: Vec<Rectangle>) -> FootprintCheck {
        let level = |bottom, top, sides, obstacles| Level {
            bottom,
            top,
            outline: Outline { sides },
            obstacles,
        };
        let walls = vec![
            wall([-11.6, -11.5], [-0.4, 6.6]),
            wall([-2.5, -2.4], [-0.4, 6.6]),
            wall([-11.6, -2.4], [-0.5, -0.4]),
            wall([-11.6, -2.4], [6.5, 6.6]),
        ];
        FootprintCheck {
            levels: vec![
                level(0.03, 0.95, [-0.19, 0.79, -0.30, 0.41], obstacles),
                level(0.95, 1.50, [-0.19, 0.98, -0.30, 0.46], walls),
            ],
        }
    }

    const PREFERENCES: PathPreferences = PathPreferences {
        radius: 0.8,
        margin: 0.05,
    };
    const START: Pose2 = Pose2 {
        x: -6.635,
        y: 3.389,
        heading: -std::f64::consts::FRAC_PI_2,
    };

    /// Follows a path and asserts that it is collision-free and ends at the goal.
    fn check(footprint: &FootprintCheck, goal: Pose2) -> Vec<Segment> {
        let path = search(footprint, START, goal, &PREFERENCES)
            .unwrap()
            .segments;
        let mut pose = START;
        for segment in &path {
            for i in 0..=20 {
                let at = segment.after(&pose, f64::from(i) / 20.0);
                assert!(footprint.is_free(&at, 0.0), "{at:?} touches, path {path:?}");
            }
            pose = segment.after(&pose, 1.0);
        }
        // Segments below a millimetre are dropped.
        assert!(pose.distance(&goal) < 2e-3, "{pose:?} instead of {goal:?}");
        assert!(wrap(pose.heading - goal.heading).abs() < 2e-3);
        path
    }

    #[test]
    fn an_open_room_needs_one_arc_and_a_narrow_one_has_a_path() {
        let table = wall([-9.35, -8.55], [0.8, 3.0]);
        let goal = Pose2 {
            x: -7.71,
            y: 2.2,
            heading: std::f64::consts::PI,
        };
        let path = check(&room(vec![table]), goal);
        assert!(
            path.iter()
                .all(|segment| matches!(segment, Segment::Roll { .. })),
            "{path:?}"
        );
        // A sofa across the direct path leaves only the detour.
        let sofa = wall([-8.2, -6.2], [2.2, 2.35]);
        let goal = Pose2 { y: 1.3, ..goal };
        check(&room(vec![table, sofa]), goal);
    }

    #[test]
    fn a_goal_inside_furniture_has_no_path() {
        let table = wall([-9.35, -8.55], [0.8, 3.0]);
        let goal = Pose2 {
            x: -8.5,
            y: 2.2,
            heading: 0.0,
        };
        assert!(search(&room(vec![table]), START, goal, &PREFERENCES).is_none());
    }
}
