//! Where the chair drives: a search over rolling, arcs and turns on the spot
//! that keeps its outline free of everything that stands on the floor.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};
use std::f64::consts::TAU;

use wheelarm_proto::exact;

use super::ground::{Ground, Pose2, wrap};

/// One piece of a route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Piece {
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

impl Piece {
    /// Pose after the part `share` (0 to 1) of the piece.
    #[must_use]
    pub fn after(&self, start: &Pose2, share: f64) -> Pose2 {
        match *self {
            Self::Turn(angle) => start.turned(angle * share),
            Self::Roll { length, curvature } => start.rolled(length * share, curvature),
        }
    }

    /// Whether the chair stays free on it, looking every 5 cm or 5°.
    fn is_free(&self, start: &Pose2, ground: &Ground, margin: f64) -> bool {
        let steps = match *self {
            Self::Turn(angle) => (angle.abs() / 0.09).ceil(),
            Self::Roll { length, curvature } => (length.abs() / 0.05)
                .max((length * curvature).abs() / 0.09)
                .ceil(),
        };
        (1..=steps as usize).all(|i| ground.is_free(&self.after(start, i as f64 / steps), margin))
    }

    /// Rough seconds that it takes.
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

/// How a route may look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RouteStyle {
    /// Radius of arcs, metres.
    pub radius: f64,
    /// Room that is kept around the outline where start and goal leave it, metres.
    pub margin: f64,
}

/// Seconds lost by stopping between rolling and turning on the spot.
const STOP_COST: f64 = 1.5;
/// Seconds that a change of curvature counts: fewer bends look and track better.
const BEND_COST: f64 = 0.3;
/// Cell of the search, metres.
const CELL: f64 = 0.1;
/// Headings of the search.
const HEADINGS: i64 = 24;
/// Greatest number of poses looked at.
const LIMIT: usize = 60_000;

type Cell = (i64, i64, i64);

struct Node {
    pose: Pose2,
    cost: f64,
    parent: usize,
    pieces: Vec<Piece>,
    is_goal: bool,
}

struct Candidate {
    rank: f64,
    node: usize,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Candidate {}
impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Candidate {
    // The heap gives its greatest: the least rank, then the oldest node.
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .rank
            .total_cmp(&self.rank)
            .then(other.node.cmp(&self.node))
    }
}

/// A way of the chair and the rough seconds that it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// Pieces in their order.
    pub pieces: Vec<Piece>,
    /// Seconds, with a charge for stops and bends.
    pub cost: f64,
}

/// Finds a short route from `start` to `goal`; `None` when there is none.
#[must_use]
pub fn find(ground: &Ground, start: Pose2, goal: Pose2, style: &RouteStyle) -> Option<Route> {
    // A stop, or the place where the chair stands, may leave less room than is liked.
    let margin = [style.margin, style.margin / 2.0, 0.0]
        .into_iter()
        .find(|margin| ground.is_free(&start, *margin) && ground.is_free(&goal, *margin))?;
    let bounds = ground.bounds();
    let mut nodes = vec![Node {
        pose: start,
        cost: 0.0,
        parent: 0,
        pieces: Vec::new(),
        is_goal: false,
    }];
    let mut best: BTreeMap<Cell, f64> = BTreeMap::new();
    let mut open = BinaryHeap::from([Candidate { rank: 0.0, node: 0 }]);
    while let Some(Candidate { node: at, .. }) = open.pop() {
        if nodes[at].is_goal {
            return Some(Route {
                pieces: collect(&nodes, at),
                cost: nodes[at].cost,
            });
        }
        if nodes.len() > LIMIT {
            return None;
        }
        let (pose, cost) = (nodes[at].pose, nodes[at].cost);
        let last = nodes[at].pieces.last().copied();
        if best
            .get(&cell(&pose))
            .is_some_and(|known| *known < cost - 1e-9)
        {
            continue;
        }
        for pieces in connections(&pose, &goal, style) {
            if let Some(extra) = price(ground, &pose, last, &pieces, margin) {
                let rank = cost + extra;
                push(&mut nodes, &mut open, rank, goal, rank, at, pieces, true);
            }
        }
        for piece in steps(style) {
            let next = piece.after(&pose, 1.0);
            let inside = (bounds[0]..=bounds[1]).contains(&next.x)
                && (bounds[2]..=bounds[3]).contains(&next.y);
            if !inside {
                continue;
            }
            let Some(extra) = price(ground, &pose, last, &[piece], margin) else {
                continue;
            };
            let sum = cost + extra;
            let known = best.entry(cell(&next)).or_insert(f64::INFINITY);
            if sum < *known - 1e-9 {
                *known = sum;
                let rank = sum + next.distance(&goal) / 0.45;
                push(
                    &mut nodes,
                    &mut open,
                    rank,
                    next,
                    sum,
                    at,
                    vec![piece],
                    false,
                );
            }
        }
    }
    None
}

#[allow(
    clippy::too_many_arguments,
    reason = "the fields of one node and its rank"
)]
fn push(
    nodes: &mut Vec<Node>,
    open: &mut BinaryHeap<Candidate>,
    rank: f64,
    pose: Pose2,
    cost: f64,
    parent: usize,
    pieces: Vec<Piece>,
    is_goal: bool,
) {
    open.push(Candidate {
        rank,
        node: nodes.len(),
    });
    nodes.push(Node {
        pose,
        cost,
        parent,
        pieces,
        is_goal,
    });
}

fn cell(pose: &Pose2) -> Cell {
    (
        (pose.x / CELL).round() as i64,
        (pose.y / CELL).round() as i64,
        ((pose.heading / TAU * HEADINGS as f64).round() as i64).rem_euclid(HEADINGS),
    )
}

/// The steps of the search.
fn steps(style: &RouteStyle) -> [Piece; 6] {
    let turn = TAU / HEADINGS as f64;
    let arc = |side: f64| Piece::Roll {
        length: style.radius * turn,
        curvature: side / style.radius,
    };
    let straight = |length| Piece::Roll {
        length,
        curvature: 0.0,
    };
    [
        straight(0.15),
        arc(1.0),
        arc(-1.0),
        Piece::Turn(turn),
        Piece::Turn(-turn),
        straight(-0.15),
    ]
}

/// Direct ways to the goal: one arc between two straights, or turns on the
/// spot before and after one straight.
fn connections(pose: &Pose2, goal: &Pose2, style: &RouteStyle) -> Vec<Vec<Piece>> {
    let mut ways = Vec::new();
    let straight = |length| Piece::Roll {
        length,
        curvature: 0.0,
    };
    let bearing = exact::atan2(goal.y - pose.y, goal.x - pose.x);
    let (before, after) = (wrap(bearing - pose.heading), wrap(goal.heading - bearing));
    let length = pose.distance(goal);
    ways.push(if length < 0.02 {
        vec![Piece::Turn(wrap(goal.heading - pose.heading))]
    } else {
        vec![Piece::Turn(before), straight(length), Piece::Turn(after)]
    });
    let [forward, left, turn] = pose.to(goal);
    if turn.abs() > 0.05 && turn.abs() < 2.6 {
        // The lines of both headings meet `ahead` of the pose and `back` before the goal.
        let back = left / exact::sin(turn);
        let ahead = forward - back * exact::cos(turn);
        let tangent = style.radius * exact::tan(turn.abs() / 2.0);
        if ahead >= tangent && back >= tangent {
            ways.push(vec![
                straight(ahead - tangent),
                Piece::Roll {
                    length: style.radius * turn.abs(),
                    curvature: turn.signum() / style.radius,
                },
                straight(back - tangent),
            ]);
        }
    }
    for way in &mut ways {
        way.retain(|piece| match *piece {
            Piece::Turn(angle) => angle.abs() > 1e-3,
            Piece::Roll { length, .. } => length.abs() > 1e-3,
        });
    }
    ways
}

/// Cost of `pieces` after `last`, or `None` when something is in the way.
fn price(
    ground: &Ground,
    start: &Pose2,
    last: Option<Piece>,
    pieces: &[Piece],
    margin: f64,
) -> Option<f64> {
    let mut pose = *start;
    let mut previous = last;
    let mut cost = 0.0;
    for piece in pieces {
        if !piece.is_free(&pose, ground, margin) {
            return None;
        }
        let stops = match (previous, piece) {
            (Some(Piece::Turn(_)), Piece::Roll { .. })
            | (Some(Piece::Roll { .. }), Piece::Turn(_)) => true,
            (Some(Piece::Turn(a)), Piece::Turn(b)) => a * b < 0.0,
            (Some(Piece::Roll { length: a, .. }), Piece::Roll { length: b, .. }) => a * b < 0.0,
            (None, _) => false,
        };
        let bends = match (previous, piece) {
            (Some(Piece::Roll { curvature: a, .. }), Piece::Roll { curvature: b, .. }) => a != *b,
            _ => false,
        };
        cost += piece.cost()
            + if stops { STOP_COST } else { 0.0 }
            + if bends { BEND_COST } else { 0.0 };
        pose = piece.after(&pose, 1.0);
        previous = Some(*piece);
    }
    Some(cost)
}

fn collect(nodes: &[Node], goal: usize) -> Vec<Piece> {
    let mut chain = Vec::new();
    let mut at = goal;
    while at != 0 {
        chain.push(at);
        at = nodes[at].parent;
    }
    chain
        .into_iter()
        .rev()
        .flat_map(|node| nodes[node].pieces.iter().copied())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::ground::{Level, Outline, Rectangle};
    use super::*;

    fn wall(x: [f64; 2], y: [f64; 2]) -> Rectangle {
        Rectangle {
            centre: [f64::midpoint(x[0], x[1]), f64::midpoint(y[0], y[1])],
            half: [(x[1] - x[0]) / 2.0, (y[1] - y[0]) / 2.0],
            along: [1.0, 0.0],
        }
    }

    fn room(obstacles: Vec<Rectangle>) -> Ground {
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
        Ground {
            levels: vec![
                level(0.03, 0.95, [-0.19, 0.79, -0.30, 0.41], obstacles),
                level(0.95, 1.50, [-0.19, 0.98, -0.30, 0.46], walls),
            ],
        }
    }

    const STYLE: RouteStyle = RouteStyle {
        radius: 0.8,
        margin: 0.05,
    };
    const START: Pose2 = Pose2 {
        x: -6.635,
        y: 3.389,
        heading: -std::f64::consts::FRAC_PI_2,
    };

    /// Follows a route and asserts that it is free and ends at the goal.
    fn check(ground: &Ground, goal: Pose2) -> Vec<Piece> {
        let route = find(ground, START, goal, &STYLE).unwrap().pieces;
        let mut pose = START;
        for piece in &route {
            for i in 0..=20 {
                let at = piece.after(&pose, f64::from(i) / 20.0);
                assert!(ground.is_free(&at, 0.0), "{at:?} touches, route {route:?}");
            }
            pose = piece.after(&pose, 1.0);
        }
        // Pieces below a millimetre are left out.
        assert!(pose.distance(&goal) < 2e-3, "{pose:?} instead of {goal:?}");
        assert!(wrap(pose.heading - goal.heading).abs() < 2e-3);
        route
    }

    #[test]
    fn an_open_room_needs_one_smooth_arc_and_a_narrow_one_still_has_a_route() {
        let table = wall([-9.35, -8.55], [0.8, 3.0]);
        let goal = Pose2 {
            x: -7.71,
            y: 2.2,
            heading: std::f64::consts::PI,
        };
        let route = check(&room(vec![table]), goal);
        assert!(
            route
                .iter()
                .all(|piece| matches!(piece, Piece::Roll { .. })),
            "{route:?}"
        );
        // A sofa across the direct way leaves only the way around it.
        let sofa = wall([-8.2, -6.2], [2.2, 2.35]);
        let goal = Pose2 { y: 1.3, ..goal };
        check(&room(vec![table, sofa]), goal);
    }

    #[test]
    fn a_goal_inside_furniture_has_no_route() {
        let table = wall([-9.35, -8.55], [0.8, 3.0]);
        let goal = Pose2 {
            x: -8.5,
            y: 2.2,
            heading: 0.0,
        };
        assert!(find(&room(vec![table]), START, goal, &STYLE).is_none());
    }
}
