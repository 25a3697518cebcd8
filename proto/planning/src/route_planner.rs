//! Route planner: paths of one chair from one start to many candidate goals.
//!
//! The maps of the fixed obstacles are shared between planners; obstacles that moved are
//! marked on a copy. Without a way on the map a goal costs a look-up and no search.

use std::fmt;
use std::sync::Arc;

use super::distance_field::DistanceField;
use super::floor_map::FloorMap;
use super::footprint_check::{FootprintCheck, Pose2, Rectangle};
use super::hybrid_a_star::{DriveGoal, FoundPath, clearances, search_field};

/// An obstacle and its heights above the floor, metres.
pub type Obstacle = (Rectangle, [f64; 2]);

/// See the module.
#[derive(Clone, Debug)]
pub struct RoutePlanner {
    fixed: FootprintCheck,
    moved: Vec<Obstacle>,
    /// Both.
    footprint: FootprintCheck,
    start: Pose2,
    /// Poses that the maps contain.
    poses: Vec<Pose2>,
    /// Clearances that the start allows, the greatest first, metres.
    clearances: Vec<f64>,
    /// Goals without a path at their own clearance are searched for with less, down to this,
    /// metres.
    least: f64,
    /// Maps by their clearance.
    maps: Vec<(f64, Arc<FloorMap>)>,
    nodes: usize,
}

/// Why no route was found.
#[derive(Clone, Debug, PartialEq)]
pub enum RouteError {
    /// The chair collides at the start, or at every goal.
    Collides,
    /// No goal is connected with the start.
    NoWay,
    /// The search found no path.
    NotFound {
        /// Number of nodes.
        nodes: usize,
    },
}

impl fmt::Display for RouteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Collides => write!(
                f,
                "no route: the chair collides at its start or at every goal; choose other goals"
            ),
            Self::NoWay => write!(
                f,
                "no route: no free floor connects the start with a goal; clear the floor"
            ),
            Self::NotFound { nodes } => write!(
                f,
                "no route: none found with {nodes} nodes; clear the narrow places"
            ),
        }
    }
}

impl std::error::Error for RouteError {}

impl RoutePlanner {
    /// A planner from `start` with `margin` metres of clearance around the outline, where
    /// start and goal allow it. `fixed` is the footprint with the obstacles that never
    /// move, `moved` are the others. Goals are among `goals` or within a metre of the
    /// obstacles.
    #[must_use]
    pub fn new(
        fixed: FootprintCheck,
        moved: Vec<Obstacle>,
        start: Pose2,
        goals: &[Pose2],
        margin: f64,
    ) -> Self {
        let mut footprint = fixed.clone();
        for (obstacle, heights) in &moved {
            footprint.put(*obstacle, *heights);
        }
        let mut clearances = clearances(margin).to_vec();
        clearances.retain(|margin| footprint.is_free(&start, *margin));
        Self {
            fixed,
            moved,
            footprint,
            start,
            poses: [&[start], goals].concat(),
            clearances,
            least: f64::INFINITY,
            maps: Vec::new(),
            nodes: 0,
        }
    }

    /// The same planner for narrow places: where no path keeps the clearance that start and goal
    /// allow, one may have half of the preferred one.
    #[must_use]
    pub fn through_narrow_places(mut self, margin: f64) -> Self {
        self.least = margin / 2.0;
        self
    }

    /// Number of nodes of all searches.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Whether the chair is collision-free at the start with any of the clearances.
    #[must_use]
    pub fn is_start_free(&self) -> bool {
        !self.clearances.is_empty()
    }

    /// The footprint with all obstacles.
    #[must_use]
    pub fn footprint(&self) -> &FootprintCheck {
        &self.footprint
    }

    /// The map with this clearance, metres.
    pub fn map(&mut self, margin: f64) -> Arc<FloorMap> {
        if let Some((_, map)) = self.maps.iter().find(|(other, _)| *other == margin) {
            return map.clone();
        }
        let mut map = FloorMap::shared(&self.fixed, margin, &self.poses);
        if !self.moved.is_empty() {
            let mut changed = (*map).clone();
            for (obstacle, heights) in &self.moved {
                changed.put(*obstacle, *heights);
            }
            map = Arc::new(changed);
        }
        self.maps.push((margin, map.clone()));
        map
    }

    /// The greatest clearance that start and goal allow, metres; `None` where the chair
    /// collides.
    fn clearance(&self, goal: &Pose2) -> Option<f64> {
        let all = self.clearances.iter().copied();
        let mut free = all.filter(|margin| self.footprint.is_free(goal, *margin));
        free.next()
    }

    /// Whether a goal that allows `own` metres is searched for with a clearance.
    fn is_tried(&self, own: Option<f64>, margin: f64) -> bool {
        own.is_some_and(|own| own == margin || (own > margin && margin >= self.least))
    }

    /// Whether free floor connects the start with a goal: a look-up. A chair that needs
    /// more room to turn may have no path nevertheless; without a way there is none.
    pub fn has_way(&mut self, goal: &Pose2) -> bool {
        let own = self.clearance(goal);
        let tried = self.clearances.iter().copied();
        let tried: Vec<f64> = tried.filter(|margin| self.is_tried(own, *margin)).collect();
        let start = self.start;
        let mut tried = tried.into_iter();
        tried.any(|margin| self.map(margin).has_way(&start, goal))
    }

    /// The path to the goal that costs least, with arcs of any of the `radii`, metres.
    /// Goals with more clearance come first.
    ///
    /// # Errors
    /// When no goal is free, none is connected with the start, or none was found.
    pub fn route(&mut self, goals: &[DriveGoal], radii: &[f64]) -> Result<FoundPath, RouteError> {
        let mut error = RouteError::Collides;
        let allowed: Vec<Option<f64>> = goals.iter().map(|g| self.clearance(&g.pose)).collect();
        let mut nodes = 0;
        for margin in self.clearances.clone() {
            let here = (0..goals.len()).filter(|&i| self.is_tried(allowed[i], margin));
            let here: Vec<usize> = here.collect();
            if here.is_empty() {
                continue;
            }
            let map = self.map(margin);
            let connected = |i: &usize| map.has_way(&self.start, &goals[*i].pose);
            let here: Vec<usize> = here.into_iter().filter(connected).collect();
            if here.is_empty() {
                if nodes == 0 {
                    error = RouteError::NoWay;
                }
                continue;
            }
            let some: Vec<DriveGoal> = here.iter().map(|&i| goals[i]).collect();
            let mut field = DistanceField::new(map.clone(), &some);
            let searched = search_field(&map, &mut field, self.start, &some, radii);
            self.nodes += searched.nodes;
            if let Some(mut found) = searched.found {
                found.goal = here[found.goal];
                return Ok(found);
            }
            nodes += searched.nodes;
            error = RouteError::NotFound { nodes };
        }
        Err(error)
    }
}

#[cfg(test)]
mod tests {
    use super::super::floor_map::tests::{LEFT, RIGHT, cluttered, two_rooms, wall};
    use super::super::hybrid_a_star::{PathPreferences, search};
    use super::*;

    const RADII: [f64; 2] = [0.8, 0.6];

    fn goal(pose: Pose2) -> DriveGoal {
        DriveGoal { pose, cost: 0.0 }
    }

    fn planner(footprint: FootprintCheck, start: Pose2, moved: Vec<Obstacle>) -> RoutePlanner {
        RoutePlanner::new(footprint, moved, start, &[], 0.05)
    }

    /// Follows a route in steps of at most 2 cm and asserts that it is free and arrives.
    fn follow(footprint: &FootprintCheck, start: Pose2, found: &FoundPath, goal: &Pose2) {
        let mut pose = start;
        for segment in &found.path.segments {
            for i in 0..=60 {
                let at = segment.after(&pose, f64::from(i) / 60.0);
                assert!(footprint.is_free(&at, 0.0), "{at:?} of {found:?}");
            }
            pose = segment.after(&pose, 1.0);
        }
        // The search leaves out a straight of up to 2 cm.
        let off = pose.distance(goal);
        assert!(off < 0.021 && pose.to(goal)[2].abs() < 2e-3, "{pose:?}");
    }

    #[test]
    fn routes_cost_about_the_reference_or_less() {
        let footprint = two_rooms(1.1);
        let preferences = PathPreferences {
            radius: RADII[0],
            margin: 0.05,
        };
        let (mut sum, mut reference) = (0.0, 0.0);
        for (i, start) in (0..6).map(|i| (f64::from(i), LEFT.turned(f64::from(i)))) {
            let to = RIGHT.turned(1.3 * i);
            let mut planner = planner(footprint.clone(), start, Vec::new());
            let found = planner.route(&[goal(to)], &RADII).expect("a route");
            follow(&footprint, start, &found, &to);
            let known = search(&footprint, start, to, &preferences).expect("a path");
            sum += found.path.cost;
            reference += known.cost;
        }
        assert!(sum <= 1.03 * reference, "{sum} s, reference {reference} s");
    }

    #[test]
    fn goal_behind_a_closed_door_needs_no_search() {
        let mut planner = planner(two_rooms(0.0), LEFT, Vec::new());
        assert!(!planner.has_way(&RIGHT));
        assert_eq!(
            planner.route(&[goal(RIGHT)], &RADII),
            Err(RouteError::NoWay)
        );
        let map = planner.map(0.05);
        let goals = [goal(RIGHT)];
        let mut field = DistanceField::new(map.clone(), &goals);
        let searched = search_field(&map, &mut field, LEFT, &goals, &RADII);
        assert_eq!(searched.found, None);
        assert_eq!(searched.nodes, 1);
    }

    #[test]
    fn narrow_door_is_passed_with_half_of_the_clearance() {
        // The chair is 0.71 m wide.
        for (door, is_passed) in [(0.79, true), (0.73, false)] {
            let footprint = two_rooms(door);
            let plain = planner(footprint.clone(), LEFT, Vec::new());
            assert!(
                plain.clone().route(&[goal(RIGHT)], &RADII).is_err(),
                "{door}"
            );
            let mut narrow = plain.through_narrow_places(0.05);
            assert_eq!(narrow.has_way(&RIGHT), is_passed, "{door}");
            let found = narrow.route(&[goal(RIGHT)], &RADII);
            assert_eq!(found.is_ok(), is_passed, "{door}: {found:?}");
            if let Ok(found) = found {
                follow(&footprint, LEFT, &found, &RIGHT);
            }
        }
    }

    #[test]
    fn search_without_a_path_is_bounded() {
        // The chair enters the niche straight ahead only; turned around it is stuck.
        let mut footprint = two_rooms(1.0);
        for y in [1.52, 2.43] {
            footprint.put(wall([4.1, 8.1], [y, y + 0.05]), [0.0, 1.0]);
        }
        let to = Pose2 {
            x: 6.5,
            y: 1.95,
            heading: std::f64::consts::FRAC_PI_2,
        };
        let mut planner = planner(footprint, LEFT, Vec::new());
        match planner.route(&[goal(to)], &RADII) {
            Err(RouteError::NotFound { nodes }) => assert!(nodes <= 50_000, "{nodes}"),
            Err(RouteError::NoWay | RouteError::Collides) => {}
            Ok(found) => panic!("{found:?}"),
        }
    }

    #[test]
    fn cheapest_of_several_goals_is_found() {
        let footprint = two_rooms(1.1);
        let goals = [
            DriveGoal {
                pose: RIGHT,
                cost: -1.0,
            },
            DriveGoal {
                pose: RIGHT.rolled(-0.3, 0.0),
                cost: 0.5,
            },
            goal(RIGHT.turned(2.0)),
        ];
        let mut planner = planner(footprint.clone(), LEFT, Vec::new());
        let single = |goal: &DriveGoal, planner: &mut RoutePlanner| {
            planner.route(&[*goal], &RADII).expect("a route").path.cost
        };
        let costs: Vec<f64> = goals.iter().map(|g| single(g, &mut planner)).collect();
        let found = planner.route(&goals, &RADII).expect("a route");
        let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(found.path.cost < least + 0.1, "{found:?}, single {costs:?}");
        follow(&footprint, LEFT, &found, &goals[found.goal].pose);
    }

    #[test]
    fn moved_obstacles_change_the_route() {
        let fixed = two_rooms(1.1);
        let free = planner(fixed.clone(), LEFT, Vec::new()).route(&[goal(RIGHT)], &RADII);
        let free = free.expect("a route");
        // A box beside the straight way, then one in the door.
        let aside = (wall([2.6, 3.0], [0.9, 1.3]), [0.0, 0.3]);
        let mut changed = planner(fixed.clone(), LEFT, vec![aside]);
        let found = changed.route(&[goal(RIGHT)], &RADII).expect("a route");
        follow(changed.footprint(), LEFT, &found, &RIGHT);
        assert!(found.path.cost >= free.path.cost - 0.1);
        let door = (wall([3.9, 4.2], [1.8, 2.0]), [0.0, 0.3]);
        let mut closed = planner(fixed, LEFT, vec![door]);
        assert_eq!(closed.route(&[goal(RIGHT)], &RADII), Err(RouteError::NoWay));
        let inside = Pose2 {
            x: 4.05,
            y: 2.0,
            heading: 0.0,
        };
        assert_eq!(
            closed.route(&[goal(inside)], &RADII),
            Err(RouteError::Collides)
        );
    }

    #[test]
    fn routes_among_clutter_are_free() {
        let footprint = cluttered();
        let place = |i: f64| Pose2 {
            x: (i * 0.937) % 11.0 - 1.0,
            y: (i * 0.731) % 8.0 - 1.0,
            heading: (i * 0.71) % 6.0 - 3.0,
        };
        let free: Vec<Pose2> = (0..400)
            .map(|i| place(f64::from(i)))
            .filter(|pose| footprint.is_free(pose, 0.05))
            .collect();
        let mut found = 0;
        for pair in free.chunks_exact(2).take(25) {
            let mut planner = planner(footprint.clone(), pair[0], Vec::new());
            if let Ok(route) = planner.route(&[goal(pair[1])], &RADII) {
                follow(&footprint, pair[0], &route, &pair[1]);
                found += 1;
            }
        }
        assert!(found > 10, "only {found} routes");
    }
}
