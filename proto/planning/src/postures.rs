//! The floor of a chair whose arm has two postures: home, from which it works, and the travel
//! posture, in which the chair passes narrow doors.
//!
//! The chair gets from a part of one posture's floor map to a part of the other's where the
//! arm has room to change: it turns about its base, beside the chair. [`changing`] is the
//! footprint of that movement. Parts that are joined in this way are one zone. The report on a
//! home, sampling and the scripted operator ask the same, so that an arm is never stowed for
//! good: a stop counts where the chair gets to it with the arm at home.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use wheelarm_proto::exact;

use super::arm_access::ARRIVAL;
use super::floor_map::FloorMap;
use super::footprint_check::{FootprintCheck, Level, Outline, Pose2};
use super::reached::Reached;

/// Number of strips that cover the half disc of a turning arm, of equal angles. They are wider
/// than the disc by at most a tenth of its radius.
const STRIPS: u32 = 8;

/// Posture of the arm while the chair drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Posture {
    /// The hand forward and level.
    Home,
    /// Stowed beside the seat.
    Travel,
}

/// The chair while its arm changes between the postures with the outlines `home` and `travel`,
/// each by height, bottom up. The folded arm turns about its base at `mount`, x and y in the
/// chair, metres: above the heights at which both outlines are equal it takes up the half disc
/// beside the chair whose radius is the length of the arm in the travel posture.
#[must_use]
pub fn changing(
    home: &[(f64, Outline)],
    travel: &[(f64, Outline)],
    mount: [f64; 2],
) -> FootprintCheck {
    let mut check = FootprintCheck::from_outlines(home.iter().copied());
    let stowed = |level: &Level| {
        let middle = f64::midpoint(level.bottom, level.top);
        let known = travel.iter().find(|(top, _)| middle <= *top);
        known.or(travel.last()).map(|(_, outline)| *outline)
    };
    let of_arm = check.levels.iter().filter_map(|level| {
        let stowed = stowed(level)?;
        (!level.outline.is_within(&stowed)).then_some((level, stowed))
    });
    let of_arm: Vec<(Level, Outline)> = of_arm.map(|(l, o)| (l.clone(), o)).collect();
    for (level, stowed) in of_arm {
        let [back, front, right, left] = stowed.sides;
        let side = match mount[1] >= f64::midpoint(right, left) {
            true => 1.0,
            false => -1.0,
        };
        let edge = if side > 0.0 { left } else { right };
        let length = |x: f64| exact::hypot(x - mount[0], edge - mount[1]);
        let radius = length(back).max(length(front));
        let mut begin = 0.0_f64;
        for strip in 1..=STRIPS {
            let end = exact::sin(FRAC_PI_2 * f64::from(strip) / f64::from(STRIPS));
            let half = radius * (1.0 - begin * begin).max(0.0).sqrt();
            let far = mount[1] + side * radius * end;
            check.levels.push(Level {
                outline: Outline {
                    sides: [
                        mount[0] - half,
                        // The hand at home is the furthest ahead.
                        (mount[0] + half).min(level.outline.sides[1]),
                        mount[1].min(far),
                        mount[1].max(far),
                    ],
                },
                ..level.clone()
            });
            begin = end;
        }
    }
    check
}

/// See the module.
#[derive(Clone, Debug)]
pub struct PostureFloor {
    home: Arc<FloorMap>,
    /// The map of the travel posture, and that of the footprint between both.
    stowed: Option<[Arc<FloorMap>; 2]>,
    /// Zone of each part of the home map, and of the travel map, that of part 1 first.
    zones: [Vec<u32>; 2],
}

/// What a chair gets to, by the posture of its arm.
#[derive(Clone, Debug)]
pub struct PostureReach {
    /// With the arm at home.
    pub home: Reached,
    /// With the arm in the travel posture, if the robot has one.
    pub travel: Option<Reached>,
}

impl PostureFloor {
    /// The floor of a robot with its arm at home, in the travel posture, and while it changes.
    #[must_use]
    pub fn new(home: Arc<FloorMap>, stowed: Option<[Arc<FloorMap>; 2]>) -> Self {
        let first = home.parts().sizes().len();
        let travel = stowed.as_ref().map(|[travel, _]| travel);
        let others = travel.map_or(0, |travel| travel.parts().sizes().len());
        let mut joined: Vec<u32> = (0..(first + others) as u32).collect();
        if let Some([travel, change]) = &stowed {
            let grid = change.grid().coarse();
            for index in 0..grid.poses() {
                let at = grid.cell_pose(index);
                if change.coarse().contains(&grid, at) {
                    continue;
                }
                let pose = grid.middle(at);
                let parts = home.part_at(&pose).zip(travel.part_at(&pose));
                let Some((a, b)) = parts else { continue };
                let a = root(&mut joined, usize::from(a) - 1);
                let b = root(&mut joined, first + usize::from(b) - 1);
                if a != b && change.is_free(&pose) {
                    joined[a.max(b)] = a.min(b) as u32;
                }
            }
        }
        let mut zone = |index: usize| root(&mut joined, index) as u32;
        let zones = [
            (0..first).map(&mut zone).collect(),
            (first..first + others).map(&mut zone).collect(),
        ];
        Self {
            home,
            stowed,
            zones,
        }
    }

    /// The map of a posture, if the robot has it.
    #[must_use]
    pub fn map(&self, posture: Posture) -> Option<&Arc<FloorMap>> {
        match (posture, &self.stowed) {
            (Posture::Home, _) => Some(&self.home),
            (Posture::Travel, stowed) => stowed.as_ref().map(|[travel, _]| travel),
        }
    }

    /// The map of the footprint between the postures.
    #[must_use]
    pub fn change(&self) -> Option<&Arc<FloorMap>> {
        self.stowed.as_ref().map(|[_, change]| change)
    }

    /// Zones of a chair at `pose`.
    fn zones(&self, pose: &Pose2, posture: Posture) -> BTreeSet<u32> {
        let Some(map) = self.map(posture) else {
            return BTreeSet::new();
        };
        let zones = &self.zones[posture as usize];
        let grid = map.grid().coarse();
        let open = map.open_near(pose).into_iter();
        let parts = open.map(|at| usize::from(map.parts().part(&grid, at)));
        parts
            .filter_map(|part| zones.get(part.wrapping_sub(1)).copied())
            .collect()
    }

    fn reach(&self, is_in: &dyn Fn(u32) -> bool) -> PostureReach {
        let reached = |map: &Arc<FloorMap>, zones: &[u32]| {
            let parts = zones.iter().enumerate().filter(|(_, zone)| is_in(**zone));
            Reached::of_parts(map.clone(), parts.map(|(index, _)| (index + 1) as u16))
        };
        let [home, travel] = &self.zones;
        let stowed = self.stowed.as_ref();
        PostureReach {
            home: reached(&self.home, home),
            travel: stowed.map(|[map, _]| reached(map, travel)),
        }
    }

    /// What a chair gets to from `start` with its arm in a posture.
    #[must_use]
    pub fn from_start(&self, start: &Pose2, posture: Posture) -> PostureReach {
        let zones = self.zones(start, posture);
        self.reach(&|zone| zones.contains(&zone))
    }

    /// The zone with the most poses.
    #[must_use]
    pub fn largest(&self) -> PostureReach {
        let mut sizes = vec![0; self.zones.iter().map(Vec::len).sum()];
        let maps = [Some(&self.home), self.map(Posture::Travel)];
        for (map, zones) in maps.into_iter().zip(&self.zones) {
            let parts = map.map_or(&[][..], |map| map.parts().sizes());
            for (size, zone) in parts.iter().zip(zones) {
                sizes[*zone as usize] += size;
            }
        }
        // The first of equal ones.
        let largest = sizes
            .iter()
            .enumerate()
            .rev()
            .max_by_key(|(_, size)| **size);
        let largest = largest.map(|(zone, _)| zone as u32);
        self.reach(&|zone| Some(zone) == largest)
    }

    /// What a chair gets to in a home: from `start` with its arm at home, or the largest zone
    /// where that has less than half of its poses. A start in a niche says little of the home.
    #[must_use]
    pub fn of_home(&self, start: Option<&Pose2>) -> PostureReach {
        let largest = self.largest();
        let from_start = start.map(|start| self.from_start(start, Posture::Home));
        let is_driven =
            |reach: &PostureReach| 2 * reach.len() >= largest.len() && !reach.is_empty();
        from_start.filter(is_driven).unwrap_or(largest)
    }

    /// All zones: what some chair gets to that starts in them.
    #[must_use]
    pub fn all(&self) -> PostureReach {
        self.reach(&|_| true)
    }

    /// Whether a chair with its arm at home gets from `from` to a stop at `to`.
    #[must_use]
    pub fn has_way(&self, from: &Pose2, to: &Pose2) -> bool {
        self.from_start(from, Posture::Home).is_before(to)
    }
}

impl PostureReach {
    /// Whether the chair gets to `stop`, with its arm at home, on a straight segment.
    #[must_use]
    pub fn is_before(&self, stop: &Pose2) -> bool {
        self.home.contains(stop) || self.home.contains(&stop.rolled(-ARRIVAL, 0.0))
    }

    /// The part of a posture.
    #[must_use]
    pub fn part(&self, posture: Posture) -> Option<&Reached> {
        match posture {
            Posture::Home => Some(&self.home),
            Posture::Travel => self.travel.as_ref(),
        }
    }

    /// Number of poses of both postures.
    #[must_use]
    pub fn len(&self) -> usize {
        self.home.len() + self.travel.as_ref().map_or(0, Reached::len)
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The root of a part in a forest of joined parts.
fn root(joined: &mut [u32], index: usize) -> usize {
    let mut at = index;
    while joined[at] as usize != at {
        // Half of the way is left out the next time.
        joined[at] = joined[joined[at] as usize];
        at = joined[at] as usize;
    }
    at
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::floor_map::tests::wall;
    use super::*;

    const HOME: [(f64, Outline); 2] = [
        (0.95, outline([-0.2, 0.8, -0.3, 0.4])),
        (1.5, outline([-0.2, 1.0, -0.3, 0.5])),
    ];
    const TRAVEL: [(f64, Outline); 1] = [(1.5, outline([-0.2, 0.8, -0.3, 0.4]))];
    const MOUNT: [f64; 2] = [0.4, 0.35];
    pub(crate) const LEFT: Pose2 = pose(1.5, 2.0);
    pub(crate) const RIGHT: Pose2 = pose(6.0, 2.0);

    const fn outline(sides: [f64; 4]) -> Outline {
        Outline { sides }
    }

    const fn pose(x: f64, y: f64) -> Pose2 {
        let heading = 0.0;
        Pose2 { x, y, heading }
    }

    /// Footprints at home, in the travel posture and between both in two rooms with a door of
    /// this width, in which only the travel posture fits; the right one is `wide` metres along
    /// y.
    pub(crate) fn footprints(door: f64, wide: f64) -> [FootprintCheck; 3] {
        let walls = [
            wall([-0.1, 8.2], [-0.1, 0.0]),
            wall([-0.1, 8.2], [4.0, 4.1]),
            wall([-0.1, 0.0], [-0.1, 4.1]),
            wall([8.1, 8.2], [-0.1, 4.1]),
            wall([4.0, 4.1], [0.0, 2.05 - door / 2.0]),
            wall([4.0, 4.1], [2.05 + door / 2.0, 4.0]),
            wall([4.0, 8.2], [2.05 + wide / 2.0, 4.1]),
            wall([4.0, 8.2], [-0.1, 2.05 - wide / 2.0]),
        ];
        let home = FootprintCheck::from_outlines(HOME);
        let travel = FootprintCheck::from_outlines(TRAVEL);
        [home, travel, changing(&HOME, &TRAVEL, MOUNT)].map(|mut check| {
            for obstacle in walls {
                check.put(obstacle, [0.0, 2.5]);
            }
            check
        })
    }

    /// The floor of these footprints.
    pub(crate) fn floor(door: f64, wide: f64) -> PostureFloor {
        let [home, travel, change] = footprints(door, wide).map(|check| {
            let mut map = FloorMap::new(&check, 0.025, &[]);
            map.confine(&|[x, y]| (0.0..8.1).contains(&x) && (0.0..4.0).contains(&y));
            Arc::new(map)
        });
        PostureFloor::new(home, Some([travel, change]))
    }

    #[test]
    fn turning_arm_needs_a_half_disc_on_its_side_above_the_seat() {
        let mut check = changing(&HOME, &TRAVEL, MOUNT);
        let is_free = |check: &FootprintCheck| check.is_free(&pose(0.0, 0.0), 0.0);
        let post = |x: f64, y: f64| wall([x, x + 0.01], [y, y + 0.01]);
        // Low obstacles, the other side, and what is further away than the arm is long.
        for (at, heights) in [
            (post(0.4, 0.8), [0.0, 0.9]),
            (post(0.4, -0.4), [0.0, 2.0]),
            (post(0.4, 0.98), [0.0, 2.0]),
            (post(-0.2, 0.9), [0.0, 2.0]),
        ] {
            check.put(at, heights);
            assert!(is_free(&check), "{at:?}");
        }
        for at in [post(0.4, 0.9), post(-0.15, 0.45), post(0.9, 0.55)] {
            let mut check = check.clone();
            check.put(at, [1.0, 1.1]);
            assert!(!is_free(&check), "{at:?}");
        }
        // An arm on the right.
        let mut other = changing(&HOME, &TRAVEL, [0.4, -0.25]);
        other.put(post(0.4, 0.8), [0.0, 2.0]);
        assert!(is_free(&other));
        other.put(post(0.4, -0.6), [0.0, 2.0]);
        assert!(!is_free(&other));
    }

    #[test]
    fn stop_behind_a_narrow_door_needs_room_for_the_arm() {
        // The travel posture is 0.75 m wide with its clearance, home 0.85 m.
        for (door, wide, is_way) in [
            (1.0, 4.0, true),
            (0.8, 4.0, true),
            (0.8, 1.0, false),
            (0.6, 4.0, false),
        ] {
            let floor = floor(door, wide);
            assert_eq!(floor.has_way(&LEFT, &RIGHT), is_way, "{door} m, {wide} m");
            let reach = floor.from_start(&LEFT, Posture::Home);
            let travel = reach.travel.expect("a travel posture");
            assert_eq!(travel.contains(&RIGHT), door > 0.7, "{door} m, {wide} m");
            assert!(travel.contains(&LEFT));
        }
    }

    #[test]
    fn arm_that_has_no_room_stays_in_its_posture() {
        let floor = floor(0.8, 1.0);
        // In the narrow room the arm is never stowed.
        let at_home = floor.from_start(&RIGHT, Posture::Home);
        assert!(at_home.home.contains(&RIGHT) && !at_home.home.contains(&LEFT));
        assert!(at_home.travel.as_ref().is_some_and(Reached::is_empty));
        // A chair that is stowed there leaves it.
        let stowed = floor.from_start(&RIGHT, Posture::Travel);
        assert!(stowed.is_before(&LEFT) && !stowed.is_before(&RIGHT));
    }

    #[test]
    fn largest_zone_replaces_that_of_a_start_in_a_niche() {
        let floor = floor(0.8, 1.0);
        for start in [None, Some(&RIGHT), Some(&LEFT)] {
            let reach = floor.of_home(start);
            assert!(
                reach.is_before(&LEFT) && !reach.is_before(&RIGHT),
                "{start:?}"
            );
            assert!(reach.len() > reach.home.len());
        }
        assert!(floor.all().is_before(&RIGHT));
    }

    #[test]
    fn robot_without_a_travel_posture_has_one_map() {
        let map = floor(0.8, 4.0).home;
        let floor = PostureFloor::new(map, None);
        let reach = floor.from_start(&LEFT, Posture::Home);
        assert!(reach.is_before(&LEFT) && !reach.is_before(&RIGHT));
        assert!(reach.travel.is_none() && floor.change().is_none());
        assert!(floor.from_start(&LEFT, Posture::Travel).is_empty());
    }
}
