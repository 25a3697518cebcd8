//! The part of a floor that a chair gets to: the connected parts of a floor map that contain
//! one start. The report on a home, sampling and the scripted operator ask the same.

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::sync::Arc;

use super::floor_map::FloorMap;
use super::footprint_check::{Pose2, wrap};
use super::grid::{CellPose, HEADINGS};

/// See the module.
#[derive(Clone, Debug)]
pub struct Reached {
    map: Arc<FloorMap>,
    parts: BTreeSet<u16>,
}

/// A place of the coarse grid that the chair gets to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReachedPlace {
    /// Middle in `house`, metres.
    pub at: [f64; 2],
    /// The chair is free there with every heading, so that it turns on the spot.
    pub turns: bool,
    /// A heading with which it gets there, radians.
    pub heading: f64,
}

impl Reached {
    /// What a chair gets to from `start`.
    #[must_use]
    pub fn from_start(map: Arc<FloorMap>, start: &Pose2) -> Self {
        let grid = map.grid().coarse();
        let open = map.open_near(start).into_iter();
        let parts = open.map(|at| map.parts().part(&grid, at)).collect();
        Self { map, parts }
    }

    /// The connected parts with these numbers.
    pub(super) fn of_parts(map: Arc<FloorMap>, parts: impl Iterator<Item = u16>) -> Self {
        let parts = parts.collect();
        Self { map, parts }
    }

    /// The connected part with the most poses; nothing where no pose is open.
    #[must_use]
    pub fn largest(map: Arc<FloorMap>) -> Self {
        let sizes = map.parts().sizes().iter().enumerate();
        // The first of equal ones.
        let largest = sizes.rev().max_by_key(|(_, size)| **size);
        let parts = largest.map(|(index, _)| (index + 1) as u16);
        let parts = parts.into_iter().collect();
        Self { map, parts }
    }

    /// What a chair gets to in a home: from `start`, or the largest connected part where
    /// that has less than half of its poses. A start in a niche says little of the home.
    #[must_use]
    pub fn of_home(map: &Arc<FloorMap>, start: Option<&Pose2>) -> Self {
        let largest = Self::largest(map.clone());
        let from_start = start.map(|start| Self::from_start(map.clone(), start));
        let is_driven = |reached: &Self| !reached.is_empty() && 2 * reached.len() >= largest.len();
        from_start.filter(is_driven).unwrap_or(largest)
    }

    /// All connected parts: what some chair gets to that starts in them.
    #[must_use]
    pub fn all(map: Arc<FloorMap>) -> Self {
        let parts = (1..=map.parts().sizes().len()).map(|part| part as u16);
        let parts = parts.collect();
        Self { map, parts }
    }

    /// The map.
    #[must_use]
    pub fn map(&self) -> &Arc<FloorMap> {
        &self.map
    }

    /// Whether a chair at `pose` is in the part. Whether it is exactly free there says
    /// [`FloorMap::is_free`].
    #[must_use]
    pub fn contains(&self, pose: &Pose2) -> bool {
        // Most poses are in an open cell.
        if let Some(part) = self.map.part_at(pose) {
            return self.parts.contains(&part);
        }
        let grid = self.map.grid().coarse();
        let open = self.map.open_around(pose);
        open.into_iter()
            .any(|at| self.parts.contains(&self.map.parts().part(&grid, at)))
    }

    /// Number of poses.
    #[must_use]
    pub fn len(&self) -> usize {
        let sizes = self.map.parts().sizes();
        let size = |part: &u16| sizes.get(usize::from(*part).wrapping_sub(1));
        self.parts.iter().filter_map(size).sum()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Numbers of the poses, rising; [`Reached::pose`] turns one into a pose.
    #[must_use]
    pub fn numbers(&self) -> Vec<u32> {
        let grid = self.map.grid().coarse();
        let parts = self.map.parts();
        let is_reached = |number: &u32| {
            let at = grid.cell_pose(*number as usize);
            self.parts.contains(&parts.part(&grid, at))
        };
        (0..grid.poses() as u32).filter(is_reached).collect()
    }

    /// The pose with a number, `shares` of a cell along x and y and of a heading from the
    /// middle, -0.5 to 0.5.
    #[must_use]
    pub fn pose(&self, number: u32, shares: [f64; 3]) -> Pose2 {
        let grid = self.map.grid().coarse();
        let middle = grid.middle(grid.cell_pose(number as usize));
        Pose2 {
            x: middle.x + shares[0] * grid.side(),
            y: middle.y + shares[1] * grid.side(),
            heading: wrap(middle.heading + shares[2] * TAU / HEADINGS as f64),
        }
    }

    /// Side of the cells of [`Reached::places`], metres.
    #[must_use]
    pub fn side(&self) -> f64 {
        self.map.grid().coarse().side()
    }

    /// The cells with at least one reached heading, row by row.
    #[must_use]
    pub fn places(&self) -> Vec<ReachedPlace> {
        let grid = self.map.grid().coarse();
        let parts = self.map.parts();
        let is_reached = |at: CellPose| self.parts.contains(&parts.part(&grid, at));
        let [along, across] = grid.count();
        let cells = (0..across).flat_map(|y| (0..along).map(move |x| (x, y)));
        let place = |(x, y): (usize, usize)| {
            let at = |heading: usize| CellPose { x, y, heading };
            let first = (0..HEADINGS).find(|heading| is_reached(at(*heading)))?;
            let middle = grid.middle(at(first));
            Some(ReachedPlace {
                at: [middle.x, middle.y],
                turns: (0..HEADINGS).all(|heading| is_reached(at(heading))),
                heading: middle.heading,
            })
        };
        cells.filter_map(place).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::floor_map::tests::{LEFT, RIGHT, two_rooms, wall};
    use super::*;

    fn map(door: f64) -> Arc<FloorMap> {
        Arc::new(FloorMap::new(&two_rooms(door), 0.05, &[]))
    }

    #[test]
    fn a_chair_gets_through_a_wide_door_only() {
        for (door, is_way) in [(1.0, true), (0.6, false)] {
            let reached = Reached::from_start(map(door), &LEFT);
            assert!(reached.contains(&LEFT));
            assert_eq!(reached.contains(&RIGHT), is_way, "door of {door} m");
            let beyond = reached
                .places()
                .iter()
                .any(|p| p.at[0] > 4.3 && p.at[0] < 8.0 && p.at[1] > 0.0 && p.at[1] < 4.0);
            assert_eq!(beyond, is_way, "door of {door} m");
        }
    }

    #[test]
    fn a_confined_map_has_nothing_outside() {
        let inside = |[x, y]: [f64; 2]| (0.0..8.1).contains(&x) && (0.0..4.0).contains(&y);
        let mut open = FloorMap::new(&two_rooms(1.0), 0.05, &[]);
        open.confine(&inside);
        let reached = Reached::largest(Arc::new(open));
        assert!(reached.contains(&LEFT) && reached.contains(&RIGHT));
        let places = reached.places();
        assert!(places.iter().all(|place| inside(place.at)));
        assert!(places.iter().any(|place| place.turns));
        // Beside a wall some headings collide.
        assert!(places.iter().any(|place| !place.turns));
        assert!(reached.len() > places.len());
    }

    #[test]
    fn numbered_poses_are_those_of_the_part() {
        let reached = Reached::from_start(map(0.6), &LEFT);
        let numbers = reached.numbers();
        assert_eq!(numbers.len(), reached.len());
        for number in numbers.iter().step_by(101) {
            let pose = reached.pose(*number, [0.0; 3]);
            assert!(reached.contains(&pose) && pose.x < 4.0, "{pose:?}");
            let aside = reached.pose(*number, [0.49, -0.49, 0.49]);
            let grid = reached.map().grid().coarse();
            assert_eq!(grid.pose_at(&aside), grid.pose_at(&pose));
        }
    }

    #[test]
    fn start_in_a_niche_gives_the_largest_part() {
        // The right room is half as wide as the left one.
        let mut footprint = two_rooms(0.0);
        footprint.put(wall([6.0, 8.2], [0.0, 4.0]), [0.0, 2.0]);
        let mut map = FloorMap::new(&footprint, 0.05, &[]);
        map.confine(&|[x, y]| (0.0..8.1).contains(&x) && (0.0..4.0).contains(&y));
        let map = Arc::new(map);
        let niche = Pose2 { x: 5.0, ..RIGHT };
        assert!(!Reached::from_start(map.clone(), &niche).is_empty());
        for start in [None, Some(&niche), Some(&LEFT)] {
            let reached = Reached::of_home(&map, start);
            assert!(reached.contains(&LEFT) && !reached.contains(&niche));
        }
    }

    #[test]
    fn nothing_is_reached_from_a_start_in_a_wall() {
        let wall = Pose2 {
            x: 4.05,
            y: 0.5,
            heading: 0.0,
        };
        let reached = Reached::from_start(map(0.6), &wall);
        assert!(reached.is_empty() && reached.places().is_empty());
        assert!(!reached.contains(&LEFT));
    }
}
