//! The floor that a chair gets to, by the floor maps of its postures: the arm at home, and
//! the arm in the travel posture. Sampling by the maps queries it, see `wheelarm_proto`'s
//! `Scenario.draws`.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use wheelarm_planning::arm_access::ARRIVAL;
use wheelarm_planning::distance_field::DistanceField;
use wheelarm_planning::floor_map::{FloorMap, STOP_CLEARANCE};
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2};
use wheelarm_planning::hybrid_a_star::DriveGoal;
use wheelarm_planning::reached::Reached;

use super::random::{fraction, index};

/// Poses sampled before the search for a start ends.
const TRIES: usize = 4_000;

/// Posture of the arm while the chair drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Posture {
    Home,
    Travel,
}

/// The floor of one posture.
#[derive(Clone, Debug)]
struct Ground {
    posture: Posture,
    /// The chair among the furniture.
    footprint: FootprintCheck,
    reached: Reached,
}

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Drivable {
    grounds: Vec<Ground>,
}

impl Ground {
    /// Whether the chair is free at a pose, and gets there.
    fn has(&self, pose: &Pose2) -> bool {
        self.reached.contains(pose) && self.reached.map().is_free(pose)
    }
}

impl Drivable {
    /// The floor connected with `near`, and where that is not free, with `home`. `footprints`
    /// are those of the postures with their clearances, metres, the preferred one first.
    #[must_use]
    pub(super) fn new(
        footprints: impl IntoIterator<Item = (Posture, FootprintCheck, f64)>,
        near: &Pose2,
        home: &Pose2,
    ) -> Self {
        let ground = |(posture, footprint, clearance): (Posture, FootprintCheck, f64)| {
            let map = FloorMap::shared(&footprint, clearance, &[*near, *home]);
            let reached = Reached::from_start(Arc::clone(&map), near);
            Ground {
                posture,
                footprint,
                reached: match reached.is_empty() {
                    true => Reached::from_start(map, home),
                    false => reached,
                },
            }
        };
        Self {
            grounds: footprints.into_iter().map(ground).collect(),
        }
    }

    /// Whether the chair gets to a stop at `pose`, where it uses its arm. It arrives on a
    /// straight segment.
    pub(super) fn is_stop(&self, pose: &Pose2) -> bool {
        let before = pose.rolled(-ARRIVAL, 0.0);
        self.grounds.iter().any(|ground| {
            let reached = &ground.reached;
            (reached.contains(pose) || reached.contains(&before))
                && ground.footprint.is_free(pose, STOP_CLEARANCE)
        })
    }

    /// Samples a pose uniformly over those that the chair gets to, where `accepts` holds, with
    /// the first posture in which it is free there. `None` when none was found.
    pub(super) fn sample(
        &self,
        random: &mut ChaCha8Rng,
        accepts: &dyn Fn(&Pose2, Posture) -> bool,
    ) -> Option<(Pose2, Posture)> {
        let numbers: Vec<Vec<u32>> = (self.grounds.iter())
            .map(|ground| ground.reached.numbers())
            .collect();
        let count: usize = numbers.iter().map(Vec::len).sum();
        if count == 0 {
            return None;
        }
        (0..TRIES).find_map(|_| {
            let mut at = index(random, count);
            let shares = std::array::from_fn(|_| fraction(random) - 0.5);
            let mut of_ground = 0;
            while at >= numbers[of_ground].len() {
                at -= numbers[of_ground].len();
                of_ground += 1;
            }
            let ground = &self.grounds[of_ground];
            let pose = ground.reached.pose(numbers[of_ground][at], shares);
            // A pose of several postures counts once.
            let first = self.grounds.iter().position(|ground| ground.has(&pose));
            let is_sampled = first == Some(of_ground) && accepts(&pose, ground.posture);
            is_sampled.then_some((pose, ground.posture))
        })
    }

    /// Least time of the drive between two poses, seconds; `None` without a way.
    pub(super) fn seconds(&self, from: &Pose2, to: &Pose2) -> Option<f64> {
        let goal = DriveGoal {
            pose: *to,
            cost: 0.0,
        };
        self.grounds.iter().find_map(|ground| {
            let mut field = DistanceField::new(Arc::clone(ground.reached.map()), &[goal]);
            field.seconds(from, None)
        })
    }
}
