//! Which way to take an object, and where the chair has to stand for it.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::ground::{Ground, Pose2, wrap};
use super::scene::SceneModel;

/// Answers whether the end effector can reach a pose in `base_link`.
pub trait Reach {
    /// Joint angles that reach it, radians; `None` when it cannot be reached.
    fn reach(&mut self, base_from_tool: &Isometry3<f64>) -> Option<[f64; 6]>;
}

/// Where and how the hand goes, in `house`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// End effector before the object.
    pub before: Isometry3<f64>,
    /// End effector around the object.
    pub at: Isometry3<f64>,
    /// Distance between the pads at the grasp, metres.
    pub width: f64,
}

/// A place to stop for an approach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dock {
    /// The chair.
    pub chair: Pose2,
    /// The approach that is planned from there.
    pub approach: Approach,
    /// The lower the better.
    cost: f64,
}

/// What is preferred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraspStyle {
    /// The hand starts its straight way in this far before the grasp, metres.
    pub standoff: f64,
    /// Distance from the arm's base to the object on the floor plan, metres.
    pub distance: f64,
    /// The object is raised by this much, metres.
    pub lift: f64,
}

/// Room that the hand keeps from what it must not touch, metres: the first that
/// leaves a way is taken. The last one allows for the corners of boxes around
/// round things.
pub const HAND_MARGINS: [f64; 3] = [0.006, 0.0, -0.012];
/// Room that the chair keeps at its stop, metres.
const DOCK_MARGIN: f64 = 0.045;
/// Least and greatest distance from the arm's base to the object, metres.
const DISTANCES: [f64; 2] = [0.60, 0.88];
/// Greatest change of a joint on the straight way in, radians: more means
/// that the arm would have to fold over.
const JOINT_CHANGE: f64 = 1.0;

/// Every way to take the target as it lies now, the camera above the hand,
/// which keeps `margin` metres from everything else.
#[must_use]
pub fn approaches(
    scene: &SceneModel,
    target: usize,
    objects: &[Isometry3<f64>],
    style: &GraspStyle,
    margin: f64,
) -> Vec<Approach> {
    let Some(house_from_object) = objects.get(target) else {
        return Vec::new();
    };
    let mut ways = Vec::new();
    for grasp in scene.grasps.iter().filter(|grasp| grasp.object == target) {
        let turns = if grasp.symmetric { 24 } else { 1 };
        for turn in 0..turns {
            let turned = UnitQuaternion::from_axis_angle(
                &Vector3::z_axis(),
                TAU * f64::from(turn) / f64::from(turns),
            );
            // The hand looks the same after half a turn about its own axis.
            for half in [0.0, PI] {
                let flipped = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), half);
                let house_from_grasp =
                    house_from_object * turned * grasp.object_from_grasp * flipped;
                let at = house_from_grasp * Translation3::new(0.0, 0.0, -scene.tool_length);
                let forward = at.rotation * Vector3::z();
                let up = at.rotation * Vector3::y();
                // Not from below, and not with the camera below the hand.
                if forward.z > 0.3 || (forward.z > -0.8 && up.z < 0.3) {
                    continue;
                }
                let before = at * Translation3::new(0.0, 0.0, -style.standoff);
                if scene.hand_is_free(&before, &at, objects, Some(target), margin) {
                    ways.push(Approach {
                        before,
                        at,
                        width: grasp.width,
                    });
                }
            }
        }
    }
    ways
}

/// Places to stop, best first; not yet checked for reach.
#[must_use]
pub fn docks(
    scene: &SceneModel,
    ground: &Ground,
    chair: &Pose2,
    approaches: &[Approach],
    style: &GraspStyle,
) -> Vec<Dock> {
    let arm = scene.chair_from_base.translation;
    let mut docks = Vec::new();
    for approach in approaches {
        let forward = approach.at.rotation * Vector3::z();
        let point = approach.at * Translation3::new(0.0, 0.0, scene.tool_length);
        // A hand that comes from above has no direction on the floor plan.
        let level = forward.xy().norm() > 0.3;
        let headings: Vec<(f64, f64)> = if level {
            let direction = forward.y.atan2(forward.x);
            (-6..=6)
                .map(|i| f64::from(i) * 0.1)
                .map(|off| (wrap(direction + off), off))
                .collect()
        } else {
            (0..24).map(|i| (TAU * f64::from(i) / 24.0, 0.0)).collect()
        };
        for (heading, off) in headings {
            for side in -4..=4 {
                let bearing = f64::from(side) * 0.1;
                for i in 0..=14 {
                    let distance = DISTANCES[0] + f64::from(i) * 0.02;
                    // The object in the chair's frame.
                    let ahead = arm.x + distance * bearing.cos();
                    let left = arm.y + distance * bearing.sin();
                    let (sin, cos) = heading.sin_cos();
                    let pose = Pose2 {
                        x: point.translation.x - ahead * cos + left * sin,
                        y: point.translation.y - ahead * sin - left * cos,
                        heading,
                    };
                    if distance > DISTANCES[1] || !ground.is_free(&pose, DOCK_MARGIN) {
                        continue;
                    }
                    let cost = ((distance - style.distance) / 0.06).powi(2)
                        + (off / 0.2).powi(2)
                        + ((bearing - off) / 0.2).powi(2)
                        + 0.5 * (bearing / 0.2).powi(2)
                        + 0.5 * pose.distance(chair)
                        + 0.3 * wrap(heading - chair.heading).abs();
                    docks.push(Dock {
                        chair: pose,
                        approach: *approach,
                        cost,
                    });
                }
            }
        }
    }
    docks.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    docks
}

/// Whether the arm of a chair at `house_from_chair` can do the whole approach:
/// before, halfway, at the object, and raised with it.
pub fn can_do(
    scene: &SceneModel,
    house_from_chair: &Isometry3<f64>,
    approach: &Approach,
    style: &GraspStyle,
    reach: &mut dyn Reach,
) -> bool {
    let base_from_house = (house_from_chair * scene.chair_from_base).inverse();
    let raised = |height: f64| Translation3::new(0.0, 0.0, height) * approach.at;
    let way = [
        approach.before,
        approach.before.lerp_slerp(&approach.at, 0.5),
        approach.at,
        raised(style.lift / 2.0),
        raised(style.lift),
    ];
    let mut last: Option<[f64; 6]> = None;
    for pose in way {
        let Some(joints) = reach.reach(&(base_from_house * pose)) else {
            return false;
        };
        if let Some(last) = last {
            let change = last
                .iter()
                .zip(&joints)
                .map(|(a, b)| wrap(a - b).abs())
                .fold(0.0, f64::max);
            if change > JOINT_CHANGE {
                return false;
            }
        }
        last = Some(joints);
    }
    true
}

/// `wheelchair_root` in `house` for a place on the floor.
#[must_use]
pub fn standing(pose: &Pose2) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(pose.x, pose.y, 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.heading),
    )
}

/// How well an approach fits the direction in which the chair looks, radians.
#[must_use]
pub fn off_axis(approach: &Approach, chair: &Pose2) -> f64 {
    let forward = approach.at.rotation * Vector3::z();
    if forward.xy().norm() < 0.3 {
        return FRAC_PI_2;
    }
    wrap(forward.y.atan2(forward.x) - chair.heading).abs()
}
