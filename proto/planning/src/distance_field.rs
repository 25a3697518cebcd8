//! Distance field: the least time from every open pose of a floor map to one of several
//! goals, for a chair that drives straight on, in arcs and back, and turns on the spot.
//!
//! The field is computed outwards from the goals (Dijkstra), and only as far as poses are
//! looked up. The time includes stops between driving and turning, so that a pose has
//! three values: for a chair that arrives forward, back or turning.

use std::f64::consts::TAU;
use std::sync::Arc;

use super::floor_map::FloorMap;
use super::footprint_check::Pose2;
use super::grid::{CellPose, Grid, HEADINGS};
use super::hybrid_a_star::DriveGoal;
use super::lattice::{LATTICE, Step};
use super::price::{self, Motion};

/// Times are multiples of this, seconds.
const UNIT: f64 = 0.01;
/// Queues of times that differ by less than the greatest price of a move.
const QUEUES: usize = 256;
const MOTIONS: usize = 3;
/// A cell beside the goal counts as its distance at this speed, m/s: a chair there may be
/// on the line to the goal, or may have to turn and come again.
const BESIDE: f64 = 0.1;
/// A time that is not known.
const UNKNOWN: u16 = u16::MAX;

/// See the module.
#[derive(Clone, Debug)]
pub struct DistanceField {
    map: Arc<FloorMap>,
    /// The coarse grid of the map.
    grid: Grid,
    /// Least known time of every pose and motion, units.
    times: Vec<u16>,
    /// Poses and motions by their time.
    queues: Vec<Vec<u32>>,
    /// Number of entries in the queues.
    waiting: usize,
    /// All times below are final.
    now: u16,
    /// Time at the goals that is left out of all others, seconds.
    offset: f64,
    settled: usize,
    prices: Prices,
}

/// Prices of the moves of every heading, units.
#[derive(Clone, Debug)]
struct Prices {
    straights: Vec<Vec<u16>>,
    arcs: Vec<[Vec<u16>; 2]>,
    backs: Vec<Vec<u16>>,
    turn: u16,
    stop: u16,
}

impl Prices {
    fn new() -> Self {
        let units = |seconds: f64| (seconds / UNIT).floor().min(QUEUES as f64 - 1.0) as u16;
        let along = |steps: &[Step], pace: f64| {
            let price = |step: &Step| units(step.length * pace);
            steps.iter().map(price).collect::<Vec<_>>()
        };
        let all = || LATTICE.headings.iter();
        let (straight, arc) = (1.0 / price::STRAIGHT, 1.0 / price::ARC);
        Self {
            straights: all().map(|m| along(&m.straights, straight)).collect(),
            arcs: all()
                .map(|m| m.arcs.each_ref().map(|arcs| along(arcs, arc)))
                .collect(),
            backs: all()
                .map(|m| along(&m.straights, straight * price::BACK))
                .collect(),
            turn: units(TAU / HEADINGS as f64 / price::TURN),
            stop: units(price::STOP),
        }
    }
}

impl DistanceField {
    /// The field of goals.
    #[must_use]
    pub fn new(map: Arc<FloorMap>, goals: &[DriveGoal]) -> Self {
        let costs = goals.iter().map(|goal| goal.cost);
        let offset = costs.fold(f64::INFINITY, f64::min);
        let mut field = Self {
            times: vec![UNKNOWN; map.grid().coarse().poses() * MOTIONS],
            grid: map.grid().coarse(),
            map,
            queues: vec![Vec::new(); QUEUES],
            waiting: 0,
            now: 0,
            offset,
            settled: 0,
            prices: Prices::new(),
        };
        for DriveGoal { pose, cost } in goals {
            for at in field.map.open_around(pose) {
                let middle = field.grid.middle(at);
                let (far, turned) = (pose.distance(&middle), pose.to(&middle)[2].abs());
                // In its own cell the chair may be at the goal.
                let off = (far - field.grid.side() * 0.71).max(0.0) / BESIDE
                    + (turned - TAU / HEADINGS as f64 / 2.0).max(0.0) / price::TURN;
                let rest = (cost - offset + off) / UNIT;
                let rest = rest.floor().min(QUEUES as f64 - 1.0) as u16;
                for motion in Motion::ALL {
                    field.reach(at, motion, rest);
                }
            }
        }
        field
    }

    /// Least time from a pose at which the chair arrives with `motion` (any when `None`)
    /// to the goals, seconds; `None` without a way.
    #[must_use]
    pub fn seconds(&mut self, pose: &Pose2, motion: Option<Motion>) -> Option<f64> {
        let mut least = UNKNOWN;
        for at in self.map.open_near(pose) {
            for own in Motion::ALL {
                if motion.is_none_or(|motion| motion == own) {
                    least = least.min(self.settle(at, own));
                }
            }
        }
        (least != UNKNOWN).then(|| f64::from(least) * UNIT + self.offset)
    }

    /// Number of poses and motions whose time is final.
    #[must_use]
    pub fn settled(&self) -> usize {
        self.settled
    }

    fn index(&self, at: CellPose, motion: Motion) -> usize {
        self.grid.index(at) * MOTIONS + motion as usize
    }

    fn reach(&mut self, at: CellPose, motion: Motion, time: u16) {
        let index = self.index(at, motion);
        if time < self.times[index] {
            self.times[index] = time;
            self.queues[usize::from(time) % QUEUES].push(index as u32);
            self.waiting += 1;
        }
    }

    /// Continues until the time of a pose and motion is final.
    fn settle(&mut self, at: CellPose, motion: Motion) -> u16 {
        let wanted = self.index(at, motion);
        while self.times[wanted] >= self.now && self.waiting > 0 {
            let Some(index) = self.queues[usize::from(self.now) % QUEUES].pop() else {
                self.now += 1;
                continue;
            };
            self.waiting -= 1;
            let index = index as usize;
            if self.times[index] == self.now {
                self.settled += 1;
                let at = self.grid.cell_pose(index / MOTIONS);
                self.expand(at, Motion::ALL[index % MOTIONS]);
            }
        }
        self.times[wanted]
    }

    /// Reaches all poses from which `motion` leads to a pose, and the other motions that
    /// stop there.
    fn expand(&mut self, at: CellPose, motion: Motion) {
        let now = self.now;
        // Times are bounded, so that they fit: a home is not hours wide.
        let after = |price: u16| now.saturating_add(price).min(UNKNOWN - 1);
        let map = self.map.clone();
        let (grid, blocked) = (&self.grid.clone(), map.coarse());
        let stop = after(self.prices.stop);
        for other in Motion::ALL {
            if other != motion {
                self.reach(at, other, stop);
            }
        }
        match motion {
            Motion::Turn => {
                let time = after(self.prices.turn);
                for turn in [1, HEADINGS - 1] {
                    let heading = (at.heading + turn) % HEADINGS;
                    let from = CellPose { heading, ..at };
                    if !blocked.contains(grid, from) {
                        self.reach(from, motion, time);
                    }
                }
            }
            Motion::Forward => {
                let steps = &LATTICE.headings[at.heading].straights;
                for (i, step) in steps.iter().enumerate() {
                    if let Some(from) = step.end(grid, blocked, at, -1) {
                        self.reach(from, motion, after(self.prices.straights[at.heading][i]));
                    }
                }
                // An arc to the left came from the heading to the right.
                for (side, turn) in [HEADINGS - 1, 1].into_iter().enumerate() {
                    let heading = (at.heading + turn) % HEADINGS;
                    let before = CellPose { heading, ..at };
                    for (i, step) in LATTICE.headings[heading].arcs[side].iter().enumerate() {
                        if let Some(from) = step.end(grid, blocked, before, -1) {
                            self.reach(from, motion, after(self.prices.arcs[heading][side][i]));
                        }
                    }
                }
            }
            Motion::Back => {
                let steps = &LATTICE.headings[at.heading].straights;
                for (i, step) in steps.iter().enumerate() {
                    if let Some(from) = step.end(grid, blocked, at, 1) {
                        self.reach(from, motion, after(self.prices.backs[at.heading][i]));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::floor_map::tests::{LEFT, RIGHT, two_rooms};
    use super::super::hybrid_a_star::search;
    use super::*;
    use crate::hybrid_a_star::PathPreferences;

    fn field(door: f64, goals: &[(Pose2, f64)]) -> DistanceField {
        let map = Arc::new(FloorMap::new(&two_rooms(door), 0.05, &[]));
        let goals: Vec<DriveGoal> = goals
            .iter()
            .map(|&(pose, cost)| DriveGoal { pose, cost })
            .collect();
        DistanceField::new(map, &goals)
    }

    #[test]
    fn straight_ways_take_the_time_of_driving() {
        let goal = Pose2 {
            x: 3.0,
            y: 2.0,
            heading: 0.0,
        };
        let mut field = field(1.0, &[(goal, 2.0)]);
        let behind = goal.rolled(-1.5, 0.0);
        let seconds = field.seconds(&behind, None).expect("a way");
        assert!(
            (seconds - 2.0 - 1.5 / price::STRAIGHT).abs() < 0.3,
            "{seconds}"
        );
        // A chair that arrives turning stops first.
        let turning = field.seconds(&behind, Some(Motion::Turn)).expect("a way");
        assert!((turning - seconds - price::STOP).abs() < 0.02, "{turning}");
        // Half a turn on the spot.
        let turned = goal.turned(std::f64::consts::PI);
        let seconds = field.seconds(&turned, Some(Motion::Turn)).expect("a way");
        let expected = 2.0 + std::f64::consts::PI / price::TURN;
        assert!(
            (seconds - expected).abs() < 0.4,
            "{seconds}, not {expected}"
        );
    }

    #[test]
    fn field_is_at_most_the_cost_of_a_path() {
        let (footprint, mut field) = (two_rooms(1.0), field(1.0, &[(RIGHT, 0.0)]));
        let preferences = PathPreferences {
            radius: 0.8,
            margin: 0.05,
        };
        let path = search(&footprint, LEFT, RIGHT, &preferences).expect("a path");
        let seconds = field.seconds(&LEFT, None).expect("a way");
        let rounding = 0.4;
        assert!(
            seconds < path.cost + rounding && seconds > 0.6 * path.cost,
            "{seconds} s, path {} s",
            path.cost
        );
        // No segment brings the chair nearer than its own time.
        let mut pose = LEFT;
        for segment in &path.segments {
            let before = field.seconds(&pose, None).expect("a way");
            pose = segment.after(&pose, 1.0);
            let after = field
                .seconds(&pose, Some(Motion::along(segment)))
                .expect("a way");
            let own = price::seconds(None, &[*segment]);
            assert!(after > before - own - 2.0 * rounding, "{segment:?}");
        }
    }

    #[test]
    fn closed_rooms_have_no_time() {
        let mut field = field(0.0, &[(RIGHT, 0.0)]);
        assert_eq!(field.seconds(&LEFT, None), None);
        assert!(field.seconds(&RIGHT.turned(1.0), None).is_some());
        // Outside the grid.
        let far = Pose2 { x: 100.0, ..RIGHT };
        assert_eq!(field.seconds(&far, None), None);
    }
}
