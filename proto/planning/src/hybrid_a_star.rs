//! The chair's path: hybrid A* over straights, arcs and turns on the spot that keeps
//! the footprint free of all bodies on the floor.
//!
//! Dolgov, Thrun, Montemerlo and Diebel 2010, "Path Planning for Autonomous Vehicles in
//! Unknown Semi-structured Environments": poses are continuous, each cell of (x, y,
//! heading) keeps its cheapest node, and every expanded node also tries an analytic
//! expansion to the goal. Unlike there the chair turns on the spot, so the expansion is
//! an arc between straights or a straight between turns, not a Reeds-Shepp curve; the
//! heuristic is the straight distance, and the path is not smoothed.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};
use std::f64::consts::TAU;

use wheelarm_proto::exact;

use super::footprint_check::{FootprintCheck, Pose2, wrap};
use super::nearby::Nearby;

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
    fn is_free(&self, start: &Pose2, nearby: &Nearby<'_>) -> bool {
        let steps = match *self {
            Self::Turn(angle) => (angle.abs() / 0.09).ceil(),
            Self::Roll { length, curvature } => (length.abs() / 0.05)
                .max((length * curvature).abs() / 0.09)
                .ceil(),
        };
        (1..=steps as usize).all(|i| nearby.is_free(&self.after(start, i as f64 / steps)))
    }

    /// Estimated duration, s.
    fn cost(&self) -> f64 {
        match *self {
            Self::Turn(angle) => angle.abs() / 0.5,
            Self::Roll { length, curvature } => {
                let speed = if curvature == 0.0 { 0.45 } else { 0.35 };
                length.abs() / speed * if length < 0.0 { 2.5 } else { 1.0 }
            }
        }
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

/// Time lost by stopping between rolling and turning on the spot, s.
const STOP_COST: f64 = 1.5;
/// Cost of a change of curvature, s: fewer bends track better.
const BEND_COST: f64 = 0.3;
/// Cell of the search, metres.
const CELL: f64 = 0.1;
/// Headings of the search.
const HEADINGS: i64 = 24;
/// Weight of the heuristic when any path is sufficient.
const GREED: f64 = 4.0;
/// Largest number of expanded poses.
const LIMIT: usize = 60_000;

type Cell = (i64, i64, i64);

struct Node {
    pose: Pose2,
    cost: f64,
    parent: usize,
    segments: Vec<Segment>,
    is_goal: bool,
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

/// Searches a fast path from `start` to `goal`, with at most 60,000 nodes; `None` when
/// none is found.
#[must_use]
pub fn search(
    footprint: &FootprintCheck,
    start: Pose2,
    goal: Pose2,
    preferences: &PathPreferences,
) -> Option<DrivePath> {
    weighted(footprint, start, goal, preferences, 1.0, LIMIT)
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
    weighted(footprint, start, goal, preferences, GREED, limit)
}

/// The search with the heuristic multiplied by `weight`.
fn weighted(
    footprint: &FootprintCheck,
    start: Pose2,
    goal: Pose2,
    preferences: &PathPreferences,
    weight: f64,
    limit: usize,
) -> Option<DrivePath> {
    // A stop, or the present pose of the chair, may allow less clearance than
    // preferred.
    let margin = [preferences.margin, preferences.margin / 2.0, 0.0]
        .into_iter()
        .find(|margin| footprint.is_free(&start, *margin) && footprint.is_free(&goal, *margin))?;
    let bounds = footprint.bounds();
    let nearby = Nearby::new(footprint, margin);
    let mut nodes = vec![Node {
        pose: start,
        cost: 0.0,
        parent: 0,
        segments: Vec::new(),
        is_goal: false,
    }];
    let mut best: BTreeMap<Cell, f64> = BTreeMap::new();
    let mut open = BinaryHeap::from([OpenNode { rank: 0.0, node: 0 }]);
    while let Some(OpenNode { node: at, .. }) = open.pop() {
        if nodes[at].is_goal {
            return Some(DrivePath {
                segments: collect(&nodes, at),
                cost: nodes[at].cost,
            });
        }
        if nodes.len() > limit {
            return None;
        }
        let (pose, cost) = (nodes[at].pose, nodes[at].cost);
        let last = nodes[at].segments.last().copied();
        if best
            .get(&cell(&pose))
            .is_some_and(|known| *known < cost - 1e-9)
        {
            continue;
        }
        for segments in analytic_expansions(&pose, &goal, preferences) {
            if let Some(extra) = price(&nearby, &pose, last, &segments) {
                let rank = cost + extra;
                let node = Node {
                    pose: goal,
                    cost: rank,
                    parent: at,
                    segments,
                    is_goal: true,
                };
                push(&mut nodes, &mut open, rank, node);
            }
        }
        for segment in motion_primitives(preferences) {
            let next = segment.after(&pose, 1.0);
            let inside = (bounds[0]..=bounds[1]).contains(&next.x)
                && (bounds[2]..=bounds[3]).contains(&next.y);
            if !inside {
                continue;
            }
            let Some(extra) = price(&nearby, &pose, last, &[segment]) else {
                continue;
            };
            let sum = cost + extra;
            let known = best.entry(cell(&next)).or_insert(f64::INFINITY);
            if sum < *known - 1e-9 {
                *known = sum;
                let rank = sum + next.distance(&goal) / 0.45 * weight;
                let node = Node {
                    pose: next,
                    cost: sum,
                    parent: at,
                    segments: vec![segment],
                    is_goal: false,
                };
                push(&mut nodes, &mut open, rank, node);
            }
        }
    }
    None
}

/// Adds a node to the open list.
fn push(nodes: &mut Vec<Node>, open: &mut BinaryHeap<OpenNode>, rank: f64, node: Node) {
    open.push(OpenNode {
        rank,
        node: nodes.len(),
    });
    nodes.push(node);
}

fn cell(pose: &Pose2) -> Cell {
    (
        (pose.x / CELL).round() as i64,
        (pose.y / CELL).round() as i64,
        ((pose.heading / TAU * HEADINGS as f64).round() as i64).rem_euclid(HEADINGS),
    )
}

/// The motion primitives of the search.
fn motion_primitives(preferences: &PathPreferences) -> [Segment; 6] {
    let turn = TAU / HEADINGS as f64;
    let arc = |side: f64| Segment::Roll {
        length: preferences.radius * turn,
        curvature: side / preferences.radius,
    };
    let straight = |length| Segment::Roll {
        length,
        curvature: 0.0,
    };
    [
        straight(0.15),
        arc(1.0),
        arc(-1.0),
        Segment::Turn(turn),
        Segment::Turn(-turn),
        straight(-0.15),
    ]
}

/// Analytic expansions to the goal: one arc between two straights, or turns on the
/// spot before and after one straight.
fn analytic_expansions(
    pose: &Pose2,
    goal: &Pose2,
    preferences: &PathPreferences,
) -> Vec<Vec<Segment>> {
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
        let tangent = preferences.radius * exact::tan(turn.abs() / 2.0);
        if ahead >= tangent && back >= tangent {
            expansions.push(vec![
                straight(ahead - tangent),
                Segment::Roll {
                    length: preferences.radius * turn.abs(),
                    curvature: turn.signum() / preferences.radius,
                },
                straight(back - tangent),
            ]);
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

/// Cost of `segments` after `last`, or `None` for a collision.
fn price(
    nearby: &Nearby<'_>,
    start: &Pose2,
    last: Option<Segment>,
    segments: &[Segment],
) -> Option<f64> {
    let mut pose = *start;
    let mut previous = last;
    let mut cost = 0.0;
    for segment in segments {
        if !segment.is_free(&pose, nearby) {
            return None;
        }
        let stops = match (previous, segment) {
            (Some(Segment::Turn(_)), Segment::Roll { .. })
            | (Some(Segment::Roll { .. }), Segment::Turn(_)) => true,
            (Some(Segment::Turn(a)), Segment::Turn(b)) => a * b < 0.0,
            (Some(Segment::Roll { length: a, .. }), Segment::Roll { length: b, .. }) => a * b < 0.0,
            (None, _) => false,
        };
        let bends = match (previous, segment) {
            (Some(Segment::Roll { curvature: a, .. }), Segment::Roll { curvature: b, .. }) => {
                a != *b
            }
            _ => false,
        };
        cost += segment.cost()
            + if stops { STOP_COST } else { 0.0 }
            + if bends { BEND_COST } else { 0.0 };
        pose = segment.after(&pose, 1.0);
        previous = Some(*segment);
    }
    Some(cost)
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
