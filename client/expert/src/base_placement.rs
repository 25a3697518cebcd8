//! Base placement: chooses a pose of the chair from which the arm reaches every pose of
//! the work.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::exact;

use super::grasp_candidate::GraspCandidate;
use super::habits::Habits;
use super::scene::SceneModel;
use wheelarm_planning::arm_access::furthest_at;
use wheelarm_planning::footprint_check::{Pose2, wrap};
use wheelarm_planning::leaf_push::{ARM_STEPS, PushStop, sampled_lines};

/// Answers whether the end effector can reach poses in `base_link`.
pub trait ArmReachability {
    /// Whether there are joint angles for the first of `poses`, and for each other
    /// one near those of the pose before it, no joint changing by more than
    /// `max_joint_change` radians.
    fn follows(&mut self, poses: &[Isometry3<f64>], max_joint_change: f64) -> bool;
}

/// A pose of the chair for a grasp candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BasePlacement {
    /// The chair.
    pub chair: Pose2,
    /// Index of the grasp candidate that is planned from there.
    pub candidate: usize,
    /// The lower the better.
    cost: f64,
}

impl BasePlacement {
    /// The placement of a push, for the candidate with an index.
    #[must_use]
    pub fn from_push_stop(stop: &PushStop, candidate: usize) -> Self {
        Self {
            chair: stop.chair,
            candidate,
            cost: stop.push.cost,
        }
    }
}

/// Step of the sampled distances, metres.
const STEP: f64 = 0.025;
/// A hand from above is best this much nearer than a level one, metres.
const NEARER: f64 = 0.14;
/// Steps, as [`ARM_STEPS`], for a path on which the hand must stay level: near a singularity
/// the joints are too slow to keep it so.
pub const GENTLE: [f64; 2] = [0.04, 0.25];

/// A sampled direction of the chair for a candidate.
struct Direction {
    /// Of the chair, radians.
    heading: f64,
    /// Of the object from the arm's base against the chair's heading, radians.
    bearing: f64,
    cost: f64,
}

/// Directions for a candidate; with habits, the object at the wanted bearing and the hand
/// along the arm, but for the twist.
fn directions(candidate: &GraspCandidate, wanted: Option<(f64, f64)>) -> Vec<Direction> {
    let steps =
        |middle: f64, count: i32| (-count..=count).map(move |i| middle + f64::from(i) * 0.1);
    let mut directions = Vec::new();
    let mut push = |heading, bearing, cost| {
        directions.push(Direction {
            heading: wrap(heading),
            bearing,
            cost,
        });
    };
    let bearings = || match wanted {
        Some((bearing, _)) => steps(bearing, 1),
        None => steps(0.0, 4),
    };
    for bearing in bearings() {
        // Angle of the chair to the left of the hand, radians.
        let offs = match wanted {
            Some((_, twist)) => steps(twist - bearing, 3),
            None => steps(0.0, 6),
        };
        let cost = |off: f64| match wanted {
            Some((wanted, twist)) => {
                ((bearing - wanted) / 0.15).powi(2) + 0.5 * ((off + bearing - twist) / 0.3).powi(2)
            }
            None => {
                (off / 0.2).powi(2)
                    + ((bearing - off) / 0.2).powi(2)
                    + 0.5 * (bearing / 0.2).powi(2)
            }
        };
        match (candidate.heading(), wanted) {
            (Some(direction), _) => offs.for_each(|off| push(direction + off, bearing, cost(off))),
            (None, None) => {
                (0..24).for_each(|i| push(TAU * f64::from(i) / 24.0, bearing, cost(0.0)))
            }
            (None, Some((_, twist))) => {
                let cost = cost(twist - bearing);
                (0..24).for_each(|i| push(TAU * f64::from(i) / 24.0, bearing, cost));
            }
        }
    }
    directions
}

/// Placements of the chair, best first, the object `distance` metres from the arm's
/// base where that can be; not yet checked for room, reach or a path. With habits, only
/// those that suit them.
#[must_use]
pub fn placements(
    scene: &SceneModel,
    chair: &Pose2,
    candidates: &[GraspCandidate],
    habits: Option<&Habits>,
    distance: f64,
) -> Vec<BasePlacement> {
    let wanted = habits.map(|habits| (habits.bearing(scene.person.is_some()), habits.twist));
    let arm = scene.chair_from_base.translation;
    let [nearest, furthest] = scene.arm_range;
    let mut placements = Vec::new();
    for (index, candidate) in candidates.iter().enumerate() {
        let (grasp, distance) = match habits {
            Some(habits) => (candidate.wish, habits.distance),
            None => (candidate.cost, distance),
        };
        if grasp.is_infinite() {
            continue;
        }
        // The demonstrated pose of the chair is the first choice.
        if let Some(shown) = candidate.shown {
            let turned = wrap(shown.chair.heading - chair.heading).abs();
            placements.push(BasePlacement {
                chair: shown.chair,
                candidate: index,
                cost: candidate.cost + 0.5 * shown.chair.distance(chair) + 0.3 * turned,
            });
        }
        let point = candidate.point(&scene.hand);
        let furthest = furthest_at(point.z, furthest);
        let steps = ((furthest - nearest) / STEP).round() as usize;
        // The steeper the hand, the nearer the chair.
        let level = (candidate.grasp.rotation * Vector3::z()).xy().norm();
        let liked = distance - NEARER * (1.0 - level);
        for direction in directions(candidate, wanted) {
            let Direction {
                heading, bearing, ..
            } = direction;
            let (sin, cos) = exact::sin_cos(heading);
            for i in 0..=steps {
                let far = nearest + STEP * i as f64;
                // The object in the chair's frame.
                let ahead = arm.x + far * exact::cos(bearing);
                let left = arm.y + far * exact::sin(bearing);
                let pose = Pose2 {
                    x: point.x - ahead * cos + left * sin,
                    y: point.y - ahead * sin - left * cos,
                    heading,
                };
                let cost = grasp
                    + direction.cost
                    + ((far - liked) / 0.06).powi(2)
                    + 0.5 * pose.distance(chair)
                    + 0.3 * wrap(heading - chair.heading).abs();
                placements.push(BasePlacement {
                    chair: pose,
                    candidate: index,
                    cost,
                });
            }
        }
    }
    placements.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    placements
}

/// Whether the arm, from where it is, reaches all `poses` of the end effector
/// in `base_link` one after another, on straight lines, without folding over.
pub fn reaches(
    base_from_tool: &Isometry3<f64>,
    poses: &[Isometry3<f64>],
    reach: &mut dyn ArmReachability,
) -> bool {
    reaches_within(base_from_tool, poses, ARM_STEPS, reach)
}

/// The same with no joint changing by more than the second of `steps`, radians, in poses that
/// are the first, metres, from each other.
pub fn reaches_within(
    base_from_tool: &Isometry3<f64>,
    poses: &[Isometry3<f64>],
    [spacing, change]: [f64; 2],
    reach: &mut dyn ArmReachability,
) -> bool {
    let line = sampled_lines(base_from_tool, poses, spacing);
    reach.follows(&line, change)
}

/// Whether the arm of a chair at `house_from_chair` with the end effector at
/// `base_from_tool` reaches `poses` in `house` one after another.
pub fn reaches_from(
    scene: &SceneModel,
    house_from_chair: &Isometry3<f64>,
    base_from_tool: &Isometry3<f64>,
    poses: &[Isometry3<f64>],
    reach: &mut dyn ArmReachability,
) -> bool {
    let base_from_house = (house_from_chair * scene.chair_from_base).inverse();
    let poses: Vec<_> = poses.iter().map(|pose| base_from_house * pose).collect();
    reaches(base_from_tool, &poses, reach)
}

/// `wheelchair_root` in `house` for a place on the floor.
#[must_use]
pub fn standing(pose: &Pose2) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(pose.x, pose.y, 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.heading),
    )
}
