//! Routes of a chair that stows its arm: whether the chair has a path to one of several stops,
//! with its arm at home, or in the travel posture by way of places where the arm changes.
//!
//! The floor of both postures ([`PostureFloor`]) tells where a path may be: its cells are a
//! little larger than the chair allows. Here the paths are searched, with the clearances and the
//! legs of the scripted operator, so that sampling offers what the operator gets to.

use super::arm_access::ARRIVAL;
use super::floor_map::{DRIVE_CLEARANCE, FloorMap, STOWED_CLEARANCE};
use super::footprint_check::{FootprintCheck, Pose2, wrap};
use super::hybrid_a_star::DriveGoal;
use super::postures::{Posture, PostureFloor};
use super::reached::Reached;
use super::route_planner::RoutePlanner;

/// Radii of arcs of the scripted operator, metres.
const RADII: [f64; 2] = [0.8, 0.6];
/// Places to change the posture that one drive may have as goals.
const CHANGE_GOALS: usize = 40;
/// Places that are this near to one another are one, metres and radians.
const CHANGE_SPACING: [f64; 2] = [0.15, 0.9];
/// A place is further by this for each radian that the chair turns, metres.
const TURN: f64 = 0.3;
/// Places that are looked at for one drive.
const CHANGE_PLACES: usize = 1_000;
/// Stops that one search may have as goals: each node of the search tries a path to each of
/// them.
pub const STOP_GOALS: usize = 12;

/// Footprints of one robot among the obstacles of a home.
#[derive(Clone, Debug)]
pub struct PostureRoutes {
    /// With the arm at home.
    pub home: FootprintCheck,
    /// In the travel posture and while the arm changes, if the robot has that posture.
    pub stowed: Option<[FootprintCheck; 2]>,
}

/// Places of a map where the arm has room to change that `accepts`, the nearest to `near` first.
#[must_use]
pub fn change_places(
    change: &FloorMap,
    near: &Pose2,
    accepts: &dyn Fn(&Pose2) -> bool,
) -> Vec<Pose2> {
    let grid = change.grid().coarse();
    let open = (0..grid.poses()).filter_map(|index| {
        let cell = grid.cell_pose(index);
        let is_open = !change.coarse().contains(&grid, cell);
        is_open.then(|| grid.middle(cell))
    });
    let far = |pose: &Pose2| near.distance(pose) + TURN * wrap(pose.heading - near.heading).abs();
    let accepted = open.filter(|pose| accepts(pose));
    let mut places: Vec<(f64, Pose2)> = accepted.map(|pose| (far(&pose), pose)).collect();
    places.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let places = places.into_iter().map(|(_, pose)| pose);
    places.filter(|pose| change.is_free(pose)).collect()
}

/// Goals of a drive to the first of `places`, apart from one another.
#[must_use]
pub fn change_goals(places: &[Pose2]) -> Vec<DriveGoal> {
    let mut goals: Vec<DriveGoal> = Vec::new();
    for place in places.iter().take(CHANGE_PLACES) {
        let is_new = |goal: &DriveGoal| {
            goal.pose.distance(place) > CHANGE_SPACING[0]
                || wrap(goal.pose.heading - place.heading).abs() > CHANGE_SPACING[1]
        };
        if goals.len() < CHANGE_GOALS && goals.iter().all(is_new) {
            goals.push(DriveGoal {
                pose: *place,
                cost: 0.0,
            });
        }
    }
    goals
}

impl PostureRoutes {
    /// Whether a chair that starts at `start` with its arm in `posture` gets to one of `stops`,
    /// where the arm works from home. `floor` is that of the same robot in the same home.
    #[must_use]
    pub fn reaches(
        &self,
        floor: &PostureFloor,
        (start, posture): (&Pose2, Posture),
        stops: &[Pose2],
    ) -> bool {
        match (posture, &self.stowed) {
            (Posture::Home, _) => self.reaches_from_home(floor, start, stops),
            (Posture::Travel, None) => false,
            (Posture::Travel, Some([_, change])) => {
                if change.is_free(start, 0.0) {
                    return self.reaches_from_home(floor, start, stops);
                }
                let reached =
                    (floor.map(Posture::Travel)).map(|map| Reached::from_start(map.clone(), start));
                let places = floor.change().zip(reached).map(|(change, reached)| {
                    change_places(change, start, &|pose| reached.contains(pose))
                });
                self.drive(Posture::Travel, start, &places.unwrap_or_default())
                    .is_some_and(|place| self.reaches_from_home(floor, &place, stops))
            }
        }
    }

    /// Whether a chair whose arm stays at home gets from `start` to one of `stops`.
    #[must_use]
    pub fn reaches_at_home(&self, start: &Pose2, stops: &[Pose2]) -> bool {
        self.route(Posture::Home, start, &arrivals(stops)).is_some()
    }

    /// The same with the arm at home.
    fn reaches_from_home(&self, floor: &PostureFloor, start: &Pose2, stops: &[Pose2]) -> bool {
        if self.reaches_at_home(start, stops) {
            return true;
        }
        let (Some([_, check]), Some(change)) = (&self.stowed, floor.change()) else {
            return false;
        };
        let Some((home, travel)) = (floor.map(Posture::Home)).zip(floor.map(Posture::Travel))
        else {
            return false;
        };
        // Where the arm is stowed: here, or at the nearest place.
        let own = Reached::from_start(home.clone(), start);
        let stowed_at = match check.is_free(start, 0.0) {
            true => Some(*start),
            false => {
                let places = change_places(change, start, &|p| own.contains(p));
                self.drive(Posture::Home, start, &places)
            }
        };
        let Some(stowed_at) = stowed_at else {
            return false;
        };
        let with_room = stops.iter().filter(|stop| change.is_free(stop));
        let with_room: Vec<Pose2> = with_room.copied().collect();
        if (self.route(Posture::Travel, &stowed_at, &arrivals(&with_room))).is_some() {
            return true;
        }
        // By way of a place from which the stops are reached with the arm at home.
        let stowed = Reached::from_start(travel.clone(), &stowed_at);
        stops.iter().take(2).any(|stop| {
            let before = Reached::from_start(home.clone(), &stop.rolled(-ARRIVAL, 0.0));
            let is_before = |pose: &Pose2| before.contains(pose) && stowed.contains(pose);
            let places = change_places(change, stop, &is_before);
            self.drive(Posture::Travel, &stowed_at, &places)
                .is_some_and(|place| {
                    self.route(Posture::Home, &place, &arrivals(stops))
                        .is_some()
                })
        })
    }

    /// The place of `places` to which the chair drives.
    fn drive(&self, posture: Posture, start: &Pose2, places: &[Pose2]) -> Option<Pose2> {
        self.route(posture, start, &change_goals(places))
    }

    /// The goal of a path.
    fn route(&self, posture: Posture, start: &Pose2, goals: &[DriveGoal]) -> Option<Pose2> {
        if goals.is_empty() {
            return None;
        }
        let (check, margin) = match (posture, &self.stowed) {
            (Posture::Home, _) => (&self.home, DRIVE_CLEARANCE),
            (Posture::Travel, Some([travel, _])) => (travel, STOWED_CLEARANCE),
            (Posture::Travel, None) => return None,
        };
        let planner = RoutePlanner::new(check.clone(), Vec::new(), *start, &[], margin);
        let mut planner = planner.through_narrow_places(margin);
        let found = planner.route(goals, &RADII).ok()?;
        Some(goals[found.goal].pose)
    }
}

/// Goals before stops, at which the chair arrives on a straight segment.
fn arrivals(stops: &[Pose2]) -> Vec<DriveGoal> {
    let before = stops.iter().take(STOP_GOALS).map(|stop| DriveGoal {
        pose: stop.rolled(-ARRIVAL, 0.0),
        cost: 0.0,
    });
    before.collect()
}

#[cfg(test)]
mod tests {
    use super::super::postures::tests::{LEFT, RIGHT, floor, footprints};
    use super::*;

    fn routes(door: f64, wide: f64) -> PostureRoutes {
        let [home, travel, change] = footprints(door, wide);
        PostureRoutes {
            home,
            stowed: Some([travel, change]),
        }
    }

    #[test]
    fn stops_behind_a_narrow_door_are_reached_with_the_arm_stowed() {
        let (floor, routes) = (floor(0.8, 4.0), routes(0.8, 4.0));
        assert!(!routes.reaches_at_home(&LEFT, &[RIGHT]));
        assert!(routes.reaches(&floor, (&LEFT, Posture::Home), &[RIGHT]));
        assert!(routes.reaches(&floor, (&LEFT, Posture::Travel), &[RIGHT]));
        let without = PostureRoutes {
            stowed: None,
            ..routes
        };
        assert!(!without.reaches(&floor, (&LEFT, Posture::Home), &[RIGHT]));
        assert!(without.reaches_at_home(&LEFT, &[LEFT.rolled(0.5, 0.0)]));
    }

    #[test]
    fn stop_without_room_for_the_arm_is_not_reached() {
        // In the right room the arm cannot return home.
        let (floor, routes) = (floor(0.8, 1.0), routes(0.8, 1.0));
        assert!(!routes.reaches(&floor, (&LEFT, Posture::Home), &[RIGHT]));
        // A chair that is stowed there leaves it first.
        let to = LEFT.rolled(0.5, 0.0);
        assert!(routes.reaches(&floor, (&RIGHT, Posture::Travel), &[to]));
        assert!(!routes.reaches(&floor, (&RIGHT, Posture::Travel), &[]));
    }
}
