//! The floor that a chair gets to, with its arm at home and in the travel posture. Sampling by
//! the maps queries it, see `wheelarm_proto`'s `Scenario.draws`.

use std::sync::{Arc, Mutex, PoisonError};

use rand_chacha::ChaCha8Rng;
use wheelarm_planning::distance_field::DistanceField;
use wheelarm_planning::floor_map::{
    CHANGE_CLEARANCE, DRIVE_CLEARANCE, FloorMap, STOP_CLEARANCE, STOWED_CLEARANCE,
};
use wheelarm_planning::footprint_check::Pose2;
use wheelarm_planning::hybrid_a_star::DriveGoal;
use wheelarm_planning::obb::Obb;
use wheelarm_planning::posture_routes::PostureRoutes;
use wheelarm_planning::postures::{Posture, PostureFloor, PostureReach};

use super::random::{fraction, index};

/// Poses sampled before the search for a start ends.
const TRIES: usize = 4_000;
/// Number of floors that are kept.
const KEPT: usize = 4;
/// With the arm stowed the chair takes this much longer for bends, and the arm moves twice,
/// seconds.
const STOWED: (f64, f64) = (1.6, 12.0);

/// Floors of the homes that were used last.
static FLOORS: Mutex<Vec<Ground>> = Mutex::new(Vec::new());

/// The floor of one home for one robot.
#[derive(Clone, Debug)]
pub(super) struct Ground {
    floor: Arc<PostureFloor>,
    /// Where the chair stops to use its arm, which is at home then.
    stops: Arc<FloorMap>,
    routes: Arc<PostureRoutes>,
}

impl Ground {
    /// The floor of a chair with these footprints that starts at `home`.
    pub(super) fn new(routes: PostureRoutes, home: &Pose2) -> Self {
        let map = |check, clearance| FloorMap::shared(check, clearance, &[*home]);
        let driven = map(&routes.home, DRIVE_CLEARANCE);
        let stowed = routes
            .stowed
            .as_ref()
            .map(|[travel, change]| [map(travel, STOWED_CLEARANCE), map(change, CHANGE_CLEARANCE)]);
        let mut floors = FLOORS.lock().unwrap_or_else(PoisonError::into_inner);
        let is_known = |known: &Self| {
            let is_map = |posture, map: Option<&Arc<FloorMap>>| {
                let of_known = known.floor.map(posture).map(Arc::as_ptr);
                of_known == map.map(Arc::as_ptr)
            };
            is_map(Posture::Home, Some(&driven))
                && is_map(Posture::Travel, stowed.as_ref().map(|[travel, _]| travel))
        };
        if let Some(known) = floors.iter().find(|known| is_known(known)) {
            return known.clone();
        }
        let ground = Self {
            stops: map(&routes.home, STOP_CLEARANCE),
            floor: Arc::new(PostureFloor::new(driven, stowed)),
            routes: Arc::new(routes),
        };
        floors.push(ground.clone());
        if floors.len() > KEPT {
            floors.remove(0);
        }
        ground
    }
}

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Drivable {
    reach: PostureReach,
    ground: Ground,
}

impl Drivable {
    /// The floor connected with `near`, and where that is not free, with `home`.
    #[must_use]
    pub(super) fn new(ground: &Ground, near: &Pose2, home: &Pose2) -> Self {
        let from = |start| ground.floor.from_start(start, Posture::Home);
        let reach = from(near);
        Self {
            reach: match reach.is_empty() {
                true => from(home),
                false => reach,
            },
            ground: ground.clone(),
        }
    }

    /// The same floor with further boxes on it: paths lead around them.
    pub(super) fn among(&self, boxes: &[Obb]) -> Self {
        let mut routes = PostureRoutes::clone(&self.ground.routes);
        let stowed = routes.stowed.iter_mut().flatten();
        for check in std::iter::once(&mut routes.home).chain(stowed) {
            for obb in boxes {
                check.put(obb.rectangle(), obb.heights());
            }
        }
        let ground = Ground {
            routes: Arc::new(routes),
            ..self.ground.clone()
        };
        Self {
            ground,
            ..self.clone()
        }
    }

    /// Whether the chair is free at a pose, and gets there.
    fn has(&self, posture: Posture, pose: &Pose2) -> bool {
        self.reach
            .part(posture)
            .is_some_and(|part| part.contains(pose) && part.map().is_free(pose))
    }

    /// Whether the chair gets to a stop at `pose`, where it uses its arm. It arrives on a
    /// straight segment.
    pub(super) fn is_stop(&self, pose: &Pose2) -> bool {
        self.ground.stops.is_free(pose) && self.reach.is_before(pose)
    }

    /// Whether a chair that starts at `start` with its arm in a posture has a path to one of
    /// these stops, as the scripted operator searches it.
    pub(super) fn has_path(&self, start: (&Pose2, Posture), stops: &[Pose2]) -> bool {
        self.ground.routes.reaches(&self.ground.floor, start, stops)
    }

    /// Whether a chair with its arm at home has a path from `start` to one of these stops: what
    /// carries an object does not stow its arm.
    pub(super) fn has_path_at_home(&self, start: &Pose2, stops: &[Pose2]) -> bool {
        self.ground.routes.reaches_at_home(start, stops)
    }

    /// Samples a pose uniformly over those that the chair gets to, where `accepts` holds, with
    /// the arm at home where it is free so. `None` when none was found.
    pub(super) fn sample(
        &self,
        random: &mut ChaCha8Rng,
        accepts: &dyn Fn(&Pose2, Posture) -> bool,
    ) -> Option<(Pose2, Posture)> {
        let postures = [Posture::Home, Posture::Travel];
        let parts = postures.map(|posture| self.reach.part(posture));
        let numbers = parts.map(|part| part.map_or_else(Vec::new, |part| part.numbers()));
        let count: usize = numbers.iter().map(Vec::len).sum();
        if count == 0 {
            return None;
        }
        (0..TRIES).find_map(|_| {
            let mut at = index(random, count);
            let shares = std::array::from_fn(|_| fraction(random) - 0.5);
            let of_posture = usize::from(at >= numbers[0].len());
            at -= of_posture * numbers[0].len();
            let posture = postures[of_posture];
            let pose = parts[of_posture]?.pose(numbers[of_posture][at], shares);
            // A pose of both postures counts once.
            let first = postures.into_iter().find(|p| self.has(*p, &pose));
            (first == Some(posture) && accepts(&pose, posture)).then_some((pose, posture))
        })
    }

    /// Expected time of the drive between two poses, seconds; `None` without a way.
    pub(super) fn seconds(&self, from: &Pose2, to: &Pose2) -> Option<f64> {
        let goal = DriveGoal {
            pose: *to,
            cost: 0.0,
        };
        let seconds = |posture| {
            let map = self.ground.floor.map(posture)?;
            DistanceField::new(Arc::clone(map), &[goal]).seconds(from, None)
        };
        let (factor, changes) = STOWED;
        let stowed = || seconds(Posture::Travel).map(|seconds| factor * seconds + changes);
        seconds(Posture::Home).or_else(stowed)
    }
}
