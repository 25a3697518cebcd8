//! The floor map: where one chair is collision-free among one set of obstacles.
//!
//! A map belongs to a home, the outlines of a robot in one posture, and a clearance. It is
//! made once, shared by all who plan with the same content ([`FloorMap::shared`]), and
//! changed where an obstacle moved ([`FloorMap::put`]). It answers:
//! - [`FloorMap::is_free`]: exactly whether a pose is free. A bit settles most poses: all
//!   poses of their cell are free.
//! - [`FloorMap::has_way`]: whether two poses are in the same connected part.
//!
//! The distance field of a goal (`distance_field`) and the search (`hybrid_a_star`) use it.

use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use wheelarm_proto::digest::{self, Digest};
use wheelarm_proto::exact;

use super::footprint_check::{FootprintCheck, Pose2, Rectangle};
use super::grid::{CELL, CellPose, Grid, HEADINGS, Overlap, PoseSet};
use super::lattice::LATTICE;
use super::nearby::Nearby;

/// Clearance that a chair keeps while it drives, where its start and goal allow it, metres.
/// Sampling, the scripted operator and the report on a home use the same.
pub const DRIVE_CLEARANCE: f64 = 0.05;
/// Clearance with the arm in the travel posture, where [`DRIVE_CLEARANCE`] leaves no way,
/// metres.
pub const STOWED_CLEARANCE: f64 = 0.025;
/// Clearance that a chair keeps where it stops to use its arm, metres.
pub const STOP_CLEARANCE: f64 = 0.045;

/// Clearance of the arm while it changes between home and the travel posture, metres: the
/// chair rests.
pub const CHANGE_CLEARANCE: f64 = 0.03;

/// A cell counts as open when its middle is free with this much less clearance, metres: a
/// way through a narrow door need not lead through middles of cells.
const LENIENT: f64 = 0.02;
/// Free floor around obstacles and poses that a map includes, metres.
const AROUND: f64 = 1.0;
/// Number of shared maps: those of a few robots and homes.
const SHARED: usize = 16;

/// Maps by the digest of their content.
static MAPS: Mutex<Vec<(Digest, Arc<FloorMap>)>> = Mutex::new(Vec::new());

/// See the module.
#[derive(Clone, Debug)]
pub struct FloorMap {
    footprint: FootprintCheck,
    margin: f64,
    grid: Grid,
    /// Poses that collide, by the middles of their cells and with less clearance.
    blocked: PoseSet,
    /// Cells of the coarse grid, made of four cells that are all blocked.
    coarse: OnceLock<PoseSet>,
    /// Poses whose cells contain some pose that may collide.
    unsure: PoseSet,
    nearby: Nearby,
    parts: OnceLock<Parts>,
}

/// Connected parts of the open poses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    /// Part of every pose of the grid, from 1; 0 for a blocked one.
    of_pose: Vec<u16>,
    /// Number of poses of each part, that of part 1 first.
    sizes: Vec<usize>,
}

impl FloorMap {
    /// The map of a footprint with `margin` metres of clearance, which contains the
    /// obstacles and `poses`.
    #[must_use]
    pub fn new(footprint: &FootprintCheck, margin: f64, poses: &[Pose2]) -> Self {
        Self::on(grid_around(footprint, poses), footprint, margin)
    }

    /// The same map as one with the same content that was made before, if it is still kept.
    #[must_use]
    pub fn shared(footprint: &FootprintCheck, margin: f64, poses: &[Pose2]) -> Arc<Self> {
        let grid = grid_around(footprint, poses);
        let key = content(footprint, margin, &grid);
        let lock = || MAPS.lock().unwrap_or_else(PoisonError::into_inner);
        let known = |maps: &mut Vec<(Digest, Arc<Self>)>| {
            let at = maps.iter().position(|(other, _)| *other == key)?;
            // The last is the one used last.
            let entry = maps.remove(at);
            maps.push(entry.clone());
            Some(entry.1)
        };
        if let Some(map) = known(&mut lock()) {
            return map;
        }
        // Not under the lock: others plan meanwhile.
        let map = Arc::new(Self::on(grid, footprint, margin));
        let mut maps = lock();
        if let Some(map) = known(&mut maps) {
            return map;
        }
        maps.push((key, map.clone()));
        if maps.len() > SHARED {
            maps.remove(0);
        }
        map
    }

    fn on(grid: Grid, footprint: &FootprintCheck, margin: f64) -> Self {
        let mut map = Self {
            footprint: footprint.clone(),
            margin,
            grid,
            blocked: PoseSet::empty(&grid),
            coarse: OnceLock::new(),
            unsure: PoseSet::empty(&grid),
            nearby: Nearby::new(footprint, &grid, margin),
            parts: OnceLock::new(),
        };
        for (index, level) in footprint.levels.iter().enumerate() {
            for obstacle in &level.obstacles {
                map.mark(index, obstacle);
            }
        }
        map
    }

    /// Adds an obstacle between two heights, metres, as [`FootprintCheck::put`] does.
    pub fn put(&mut self, obstacle: Rectangle, heights: [f64; 2]) {
        for level in self.footprint.levels_at(heights) {
            self.footprint.levels[level].obstacles.push(obstacle);
            self.nearby.put(level, obstacle);
            self.mark(level, &obstacle);
        }
        self.coarse = OnceLock::new();
        self.parts = OnceLock::new();
    }

    /// Closes the cells whose middle, x and y in metres, is not `inside`: a chair does not
    /// drive there, although it would collide with nothing. [`FloorMap::is_free`] is not
    /// changed.
    pub fn confine(&mut self, inside: &dyn Fn([f64; 2]) -> bool) {
        let [along, across] = self.grid.count();
        for y in 0..across {
            for x in 0..along {
                let cell = CellPose { x, y, heading: 0 };
                let middle = self.grid.middle(cell);
                if !inside([middle.x, middle.y]) {
                    for heading in 0..HEADINGS {
                        self.blocked
                            .insert(&self.grid, CellPose { heading, ..cell });
                    }
                }
            }
        }
        self.coarse = OnceLock::new();
        self.parts = OnceLock::new();
    }

    /// Marks the poses that collide with an obstacle at a level.
    fn mark(&mut self, level: usize, obstacle: &Rectangle) {
        let outline = self.footprint.levels[level].outline;
        // Rounding must not make a pose at an edge sure.
        const ROUNDING: f64 = 1e-6;
        let swept = outline.swept(TAU / HEADINGS as f64 / 2.0 + ROUNDING);
        let lenient = (self.margin - LENIENT).max(0.0);
        let mut origin = Pose2 {
            x: 0.0,
            y: 0.0,
            heading: 0.0,
        };
        for heading in 0..HEADINGS {
            origin.heading = heading as f64 / HEADINGS as f64 * TAU;
            let facing = exact::sin_cos(origin.heading);
            let middle = outline.rectangle_facing(&origin, facing, lenient);
            let shape = Overlap::new(obstacle, &middle, 0.0);
            self.blocked.add(&self.grid, heading, &shape);
            let whole = swept.rectangle_facing(&origin, facing, self.margin);
            let shape = Overlap::new(obstacle, &whole, CELL / 2.0 + ROUNDING);
            self.unsure.add(&self.grid, heading, &shape);
        }
    }

    /// The clearance, metres.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.margin
    }

    /// Its cells.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Poses that collide, by the middles of their cells.
    #[must_use]
    pub fn blocked(&self) -> &PoseSet {
        &self.blocked
    }

    /// Bounds of the map: x min, x max, y min, y max, metres.
    #[must_use]
    pub fn bounds(&self) -> [f64; 4] {
        let [x, y] = self.grid.corner().map(f64::from);
        let [along, across] = self.grid.count().map(|cells| cells as f64 * CELL);
        [x, x + along, y, y + across]
    }

    /// Whether the chair with the map's clearance is collision-free at `pose`: the result
    /// of [`FootprintCheck::is_free`].
    #[must_use]
    pub fn is_free(&self, pose: &Pose2) -> bool {
        let cell = self.grid.pose_at(pose);
        cell.is_some_and(|cell| !self.unsure.contains(&self.grid, cell))
            || self.nearby.is_free(pose)
    }

    /// The connected parts, computed once.
    #[must_use]
    pub fn parts(&self) -> &Parts {
        self.parts
            .get_or_init(|| Parts::of(&self.grid.coarse(), self.coarse()))
    }

    /// Poses of the coarse grid all of whose cells are blocked.
    #[must_use]
    pub fn coarse(&self) -> &PoseSet {
        self.coarse
            .get_or_init(|| self.blocked.coarsened(&self.grid))
    }

    /// The connected part of the cell of the coarse grid that contains `pose`, from 1; `None`
    /// where it is blocked.
    #[must_use]
    pub fn part_at(&self, pose: &Pose2) -> Option<u16> {
        let grid = self.grid.coarse();
        let part = self.parts().part(&grid, grid.pose_at(pose)?);
        (part != 0).then_some(part)
    }

    /// The pose of the coarse grid that contains `pose`, where it is open, and otherwise
    /// the open ones beside it.
    #[must_use]
    pub fn open_near(&self, pose: &Pose2) -> Vec<CellPose> {
        let grid = self.grid.coarse();
        match grid.pose_at(pose) {
            Some(at) if !self.coarse().contains(&grid, at) => vec![at],
            _ => self.open_around(pose),
        }
    }

    /// The open poses of the coarse grid at most one cell and one heading from `pose`.
    #[must_use]
    pub fn open_around(&self, pose: &Pose2) -> Vec<CellPose> {
        let grid = self.grid.coarse();
        let at = grid.pose_at(pose);
        at.map_or_else(Vec::new, |at| grid.open_around(at, self.coarse()))
    }

    /// Whether two poses are in the same connected part. A chair that cannot turn within
    /// 10° may have no path nevertheless; without a way there is none.
    #[must_use]
    pub fn has_way(&self, from: &Pose2, to: &Pose2) -> bool {
        let parts = |pose: &Pose2| {
            let open = self.open_near(pose).into_iter();
            open.map(|at| self.parts().part(&self.grid.coarse(), at))
        };
        let to: Vec<u16> = parts(to).collect();
        parts(from).any(|part| to.contains(&part))
    }
}

impl Parts {
    fn of(grid: &Grid, blocked: &PoseSet) -> Self {
        let mut parts = Self {
            of_pose: vec![0; grid.poses()],
            sizes: Vec::new(),
        };
        let mut open = Vec::new();
        for index in 0..grid.poses() {
            let at = grid.cell_pose(index);
            if parts.of_pose[index] != 0 || blocked.contains(grid, at) {
                continue;
            }
            // Further parts are slivers; one number does for them.
            let part = (parts.sizes.len() + 1).min(usize::from(u16::MAX));
            parts.sizes.resize(part, 0);
            let mut reach = |at: CellPose, open: &mut Vec<CellPose>| {
                let of_pose = &mut parts.of_pose[grid.index(at)];
                if *of_pose == 0 && !blocked.contains(grid, at) {
                    *of_pose = part as u16;
                    parts.sizes[part - 1] += 1;
                    open.push(at);
                }
            };
            reach(at, &mut open);
            while let Some(at) = open.pop() {
                for turn in [1, HEADINGS - 1] {
                    let heading = (at.heading + turn) % HEADINGS;
                    reach(CellPose { heading, ..at }, &mut open);
                }
                for step in &LATTICE.headings[at.heading].straights {
                    for way in [1, -1] {
                        if let Some(to) = step.end(grid, blocked, at, way) {
                            reach(to, &mut open);
                        }
                    }
                }
            }
        }
        parts
    }

    /// The part of a pose, from 1; 0 where it is blocked.
    #[must_use]
    pub fn part(&self, grid: &Grid, at: CellPose) -> u16 {
        self.of_pose[grid.index(at)]
    }

    /// Number of poses of every part, that of part 1 first.
    #[must_use]
    pub fn sizes(&self) -> &[usize] {
        &self.sizes
    }
}

fn grid_around(footprint: &FootprintCheck, poses: &[Pose2]) -> Grid {
    let [x0, x1, y0, y1] = poses.iter().fold(footprint.extent(), |b, pose| {
        [
            b[0].min(pose.x),
            b[1].max(pose.x),
            b[2].min(pose.y),
            b[3].max(pose.y),
        ]
    });
    Grid::around([x0 - AROUND, x1 + AROUND, y0 - AROUND, y1 + AROUND])
}

/// Digest of all that a map depends on.
fn content(footprint: &FootprintCheck, margin: f64, grid: &Grid) -> Digest {
    let mut numbers = vec![margin];
    numbers.extend(grid.corner().map(f64::from));
    numbers.extend(grid.count().map(|cells| cells as f64));
    for level in &footprint.levels {
        numbers.extend([level.bottom, level.top]);
        numbers.extend(level.outline.sides);
        numbers.push(level.obstacles.len() as f64);
        for o in &level.obstacles {
            numbers.extend([o.centre, o.half, o.along].as_flattened());
        }
    }
    let bytes: Vec<[u8; 8]> = numbers.into_iter().map(f64::to_le_bytes).collect();
    digest::of_message([bytes.as_flattened()])
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::footprint_check::Outline;
    use super::super::grid::PoseSet;
    use super::*;

    /// A chair with two levels among forty turned boxes.
    pub(crate) fn cluttered() -> FootprintCheck {
        let outline = |sides| Outline { sides };
        let mut footprint = FootprintCheck::from_outlines([
            (0.32, outline([-0.2, 0.8, -0.3, 0.4])),
            (1.5, outline([-0.2, 1.0, -0.3, 0.5])),
        ]);
        for (obstacle, heights) in boxes(0..40) {
            footprint.put(obstacle, heights);
        }
        footprint
    }

    fn boxes(numbers: std::ops::Range<i32>) -> Vec<(Rectangle, [f64; 2])> {
        let one = |i: i32| {
            let i = f64::from(i);
            let turn = i * 0.7;
            let obstacle = Rectangle {
                centre: [(i * 1.7) % 9.0, (i * 2.3) % 6.0],
                half: [0.1 + (i * 0.13) % 0.9, 0.05 + (i * 0.07) % 0.3],
                along: [exact::cos(turn), exact::sin(turn)],
            };
            (obstacle, [(i * 0.11) % 0.6, 0.7])
        };
        numbers.map(one).collect()
    }

    /// A wall of 10 cm along x or y between two corners.
    pub(crate) fn wall(x: [f64; 2], y: [f64; 2]) -> Rectangle {
        Rectangle {
            centre: [f64::midpoint(x[0], x[1]), f64::midpoint(y[0], y[1])],
            half: [(x[1] - x[0]) / 2.0, (y[1] - y[0]) / 2.0],
            along: [1.0, 0.0],
        }
    }

    /// Two rooms of 4 m x 4 m side by side; in the wall between them a door of this width,
    /// metres, whose middle is at y = 2.
    pub(crate) fn two_rooms(door: f64) -> FootprintCheck {
        let sides = [-0.19, 0.79, -0.30, 0.41];
        let mut footprint = FootprintCheck::from_outlines([(1.5, Outline { sides })]);
        let walls = [
            wall([-0.1, 8.2], [-0.1, 0.0]),
            wall([-0.1, 8.2], [4.0, 4.1]),
            wall([-0.1, 0.0], [-0.1, 4.1]),
            wall([8.1, 8.2], [-0.1, 4.1]),
            wall([4.0, 4.1], [0.0, 2.0 - door / 2.0]),
            wall([4.0, 4.1], [2.0 + door / 2.0, 4.0]),
        ];
        for obstacle in walls {
            footprint.put(obstacle, [0.0, 2.0]);
        }
        footprint
    }

    pub(crate) const LEFT: Pose2 = Pose2 {
        x: 1.0,
        y: 2.5,
        heading: 1.0,
    };
    pub(crate) const RIGHT: Pose2 = Pose2 {
        x: 6.0,
        y: 1.0,
        heading: 0.3,
    };

    #[test]
    fn map_gives_the_result_of_the_complete_check() {
        let footprint = cluttered();
        let mut sure = 0;
        for margin in [0.0, 0.05] {
            let map = FloorMap::new(&footprint, margin, &[]);
            for i in 0..20_000 {
                let i = f64::from(i);
                let pose = Pose2 {
                    x: (i * 0.3717) % 13.0 - 2.0,
                    y: (i * 0.5331) % 10.0 - 2.0,
                    heading: (i * 0.7123) % 12.0 - 6.0,
                };
                let is_free = footprint.is_free(&pose, margin);
                assert_eq!(map.is_free(&pose), is_free, "{pose:?}, margin {margin}");
                let cell = map.grid.pose_at(&pose).expect("inside");
                sure += usize::from(!map.unsure.contains(&map.grid, cell));
                let middle = map.grid.middle(cell);
                let lenient = (margin - LENIENT).max(0.0);
                let is_blocked = map.blocked.contains(&map.grid, cell);
                assert_eq!(
                    !is_blocked,
                    footprint.is_free(&middle, lenient),
                    "{middle:?}"
                );
            }
        }
        assert!(sure > 4000, "only {sure} poses were settled by a bit");
    }

    #[test]
    fn added_obstacles_mark_the_cells_of_a_new_map() {
        let mut changed = FloorMap::new(&cluttered(), 0.05, &[]);
        let mut whole = cluttered();
        let before = changed.blocked.len();
        for (obstacle, heights) in boxes(40..45) {
            changed.put(obstacle, heights);
            whole.put(obstacle, heights);
        }
        let new = FloorMap::on(changed.grid, &whole, 0.05);
        assert!(changed.blocked.len() > before);
        assert_eq!(changed.blocked, new.blocked);
        assert_eq!(changed.unsure, new.unsure);
        assert_eq!(changed.footprint, new.footprint);
        assert_eq!(changed.parts(), new.parts());
    }

    #[test]
    fn equal_content_shares_one_map() {
        let footprint = two_rooms(1.1);
        let first = FloorMap::shared(&footprint, 0.031, &[LEFT]);
        assert!(Arc::ptr_eq(
            &first,
            &FloorMap::shared(&footprint, 0.031, &[RIGHT])
        ));
        let other = FloorMap::shared(&footprint, 0.032, &[LEFT]);
        assert!(!Arc::ptr_eq(&first, &other));
        let narrow = FloorMap::shared(&two_rooms(1.09), 0.031, &[LEFT]);
        assert!(!Arc::ptr_eq(&first, &narrow));
    }

    #[test]
    fn only_a_door_that_is_wide_enough_connects_two_rooms() {
        // The chair is 0.71 m wide.
        for (door, is_way) in [(1.0, true), (0.85, true), (0.6, false), (0.0, false)] {
            let map = FloorMap::new(&two_rooms(door), 0.05, &[]);
            assert_eq!(map.has_way(&LEFT, &RIGHT), is_way, "door of {door} m");
            assert_eq!(map.has_way(&RIGHT, &LEFT), is_way, "door of {door} m");
        }
        let map = FloorMap::new(&two_rooms(0.0), 0.05, &[]);
        let sizes: usize = map.parts().sizes().iter().sum();
        let coarse = map.grid.coarse();
        assert_eq!(sizes, coarse.poses() - map.coarse().len());
        let none: &PoseSet = map.coarse();
        assert!(!none.is_empty());
        // An open door, then a box in it.
        let mut map = FloorMap::new(&two_rooms(1.0), 0.05, &[]);
        assert!(map.has_way(&LEFT, &RIGHT));
        map.put(wall([3.9, 4.2], [1.8, 2.0]), [0.0, 0.3]);
        assert!(!map.has_way(&LEFT, &RIGHT));
    }
}
