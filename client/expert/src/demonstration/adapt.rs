//! Adapts demonstrations to a scene: poses of the hand for an object at another pose,
//! and for the region.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use wheelarm_planning::footprint_check::Pose2;
use wheelarm_proto::exact;

use super::{Demonstration, Demonstrations, Putting};
use crate::goal::Goal;
use crate::grasp_candidate::{GraspCandidate, MARGINS, Shown, surroundings};
use crate::scene::{Grasp, SceneModel};

/// Number of sampled turns of a round object.
const TURNS: u8 = 24;
/// Two grasps are the same within this, metres and radians.
const SAME: [f64; 2] = [0.004, 0.05];
/// Spacing of the checked poses of a track, metres.
pub const SPACING: f64 = 0.03;
/// A demonstrated hand may overlap the support of the object by this much, metres.
const TOUCHES: f64 = 0.012;

/// Rotation about the vertical of an object, by radians.
#[must_use]
pub fn turned(turn: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn)
}

/// Every demonstrated grasp of the goal's object at its present pose that keeps
/// `margin` metres from obstacles.
#[must_use]
pub fn candidates(
    scene: &SceneModel,
    goal: &Goal,
    poses: &[Isometry3<f64>],
    shown: &Demonstrations,
    margin: f64,
) -> Vec<GraspCandidate> {
    let Some(house_from_item) = poses.get(goal.item()) else {
        return Vec::new();
    };
    let turns = turns(scene, goal.item());
    // A person may have come closer to obstacles than a plan would.
    let margin = match margin <= MARGINS[MARGINS.len() - 1] {
        true => margin.min(-TOUCHES),
        false => margin,
    };
    let mut candidates = Vec::new();
    for (index, (one, cost)) in shown.list.iter().zip(shown.costs()).enumerate() {
        let Some([pregrasp, grasp]) = one.approach.ends() else {
            continue;
        };
        for turn in &turns {
            let frame = house_from_item * turned(*turn);
            let at = frame * grasp;
            let around = surroundings(scene, goal, poses, &point(scene, one, &at));
            let stops = one.approach.stops(&frame, SPACING);
            let hand = &scene.hand;
            if around.hand_is_free(hand, one.width, &[at], margin)
                && around.hand_is_free(hand, one.opening, &stops, margin)
            {
                candidates.push(GraspCandidate {
                    pregrasp: frame * pregrasp,
                    grasp: at,
                    opening: one.opening,
                    width: one.width,
                    force: None,
                    lean: 0.0,
                    backoff: 0.0,
                    cost,
                    wish: cost,
                    shown: Some(Shown {
                        index,
                        turn: *turn,
                        chair: on_floor(&(frame * one.object_from_chair)),
                    }),
                    push: None,
                });
            }
        }
    }
    candidates
}

/// Point where the pads meet, for a hand at `house_from_tool`.
fn point(scene: &SceneModel, one: &Demonstration, house_from_tool: &Isometry3<f64>) -> Point3<f64> {
    house_from_tool * Point3::new(0.0, 0.0, scene.hand.pads(one.width))
}

fn on_floor(house_from_chair: &Isometry3<f64>) -> Pose2 {
    let forward = house_from_chair.rotation * Vector3::x();
    Pose2 {
        x: house_from_chair.translation.x,
        y: house_from_chair.translation.y,
        heading: exact::atan2(forward.y, forward.x),
    }
}

/// Turns about its vertical that leave the grasps of an object the same, radians: any
/// turn of a round object, else the symmetries of its grasps.
fn turns(scene: &SceneModel, item: usize) -> Vec<f64> {
    let grasps: Vec<&Grasp> = scene.grasps.iter().filter(|g| g.item == item).collect();
    if grasps.iter().any(|grasp| grasp.symmetric) {
        return (0..TURNS)
            .map(|i| TAU * f64::from(i) / f64::from(TURNS))
            .collect();
    }
    let is_there = |pose: &Isometry3<f64>| {
        grasps.iter().any(|grasp| {
            let known = &grasp.item_from_grasp;
            // The hand looks the same after half a turn about its own axis.
            let flipped = known * turned(PI);
            let off = (known.translation.vector - pose.translation.vector).norm();
            off < SAME[0]
                && [known, &flipped].map(|k| k.rotation.angle_to(&pose.rotation) < SAME[1])
                    != [false, false]
        })
    };
    let keeps = |turn: &f64| {
        grasps
            .iter()
            .all(|grasp| is_there(&(turned(*turn) * grasp.item_from_grasp)))
    };
    let others = [PI, FRAC_PI_2, -FRAC_PI_2].into_iter();
    std::iter::once(0.0)
        .chain(others.filter(|turn| !grasps.is_empty() && keeps(turn)))
        .collect()
}

/// Correction after each pose of a putting's track, in the end effector's frame, for an
/// object with the pose `tool_from_item` in the hand that was grasped after a turn. The
/// object, not the hand, then follows the demonstrated path.
#[must_use]
pub fn correction(putting: &Putting, tool_from_item: &Isometry3<f64>, turn: f64) -> Isometry3<f64> {
    putting.tool_from_object * (tool_from_item * turned(turn)).inverse()
}

/// Demonstrated ways to put down an object with the pose `tool_from_item` in the hand;
/// the demonstration of `taken` is first.
#[must_use]
pub fn puttings(
    shown: &Demonstrations,
    goal: &Goal,
    tool_from_item: &Isometry3<f64>,
    taken: &Shown,
) -> Vec<GraspCandidate> {
    let Some(region) = goal.region() else {
        return Vec::new();
    };
    let mut indices: Vec<usize> = (0..shown.list.len()).collect();
    indices.sort_by_key(|index| *index != taken.index);
    let candidate = |index: usize| {
        let one = &shown.list[index];
        let putting = one.putting.as_ref()?;
        let after = correction(putting, tool_from_item, taken.turn);
        let frame = region.pose;
        let [first, _] = putting.track.ends()?;
        let release = putting.track.at(putting.release)?;
        Some(GraspCandidate {
            pregrasp: frame * first * after,
            grasp: frame * release * after,
            opening: one.width,
            width: one.width,
            force: None,
            lean: 0.0,
            backoff: 0.0,
            cost: f64::from(u8::from(index != taken.index)),
            wish: 0.0,
            shown: Some(Shown { index, ..*taken }),
            push: None,
        })
    };
    indices.into_iter().filter_map(candidate).collect()
}

/// Poses of the end effector in `house` along the lift of an object at
/// `house_from_item` that was grasped as `taken`; empty when it was not demonstrated.
#[must_use]
pub fn lift_stops(
    shown: &Demonstrations,
    taken: &Shown,
    house_from_item: &Isometry3<f64>,
) -> Vec<Isometry3<f64>> {
    let one = shown.list.get(taken.index);
    let frame = house_from_item * turned(taken.turn);
    one.map_or(Vec::new(), |one| one.lift.stops(&frame, SPACING))
}

/// The same along the approach.
#[must_use]
pub fn approach_stops(
    shown: &Demonstrations,
    taken: &Shown,
    house_from_item: &Isometry3<f64>,
) -> Vec<Isometry3<f64>> {
    let one = shown.list.get(taken.index);
    let frame = house_from_item * turned(taken.turn);
    one.map_or(Vec::new(), |one| one.approach.stops(&frame, SPACING))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demonstration::{Sample, Track};
    use nalgebra::Translation3;

    fn track(poses: &[Isometry3<f64>]) -> Track {
        let sample = |(i, pose): (usize, &Isometry3<f64>)| Sample {
            time: i as f64,
            frame_from_tool: *pose,
            opening: None,
        };
        Track {
            samples: poses.iter().enumerate().map(sample).collect(),
        }
    }

    #[test]
    fn object_that_slipped_in_the_hand_is_put_at_the_demonstrated_pose() {
        let held = Isometry3::new(Vector3::new(0.0, 0.01, 0.12), Vector3::new(1.2, 0.0, 0.3));
        let lies = Isometry3::new(Vector3::new(0.03, 0.0, 0.02), Vector3::new(0.0, 0.0, 0.4));
        let one = Demonstration {
            source: String::new(),
            approach: Track::default(),
            closing: Track::default(),
            lift: Track::default(),
            putting: Some(Putting {
                track: track(&[lies * held.inverse()]),
                release: 0.0,
                tool_from_object: held,
            }),
            object_from_chair: Isometry3::identity(),
            opening: 0.08,
            width: 0.05,
        };
        let region = Isometry3::new(Vector3::new(5.0, 1.0, 0.8), Vector3::new(0.0, 0.0, -1.0));
        // As it was taken after a turn, a little off.
        let turn = 0.8;
        let slip = Isometry3::new(Vector3::new(0.004, 0.0, -0.01), Vector3::new(0.0, 0.2, 0.0));
        let held_now = slip * held * turned(turn).inverse();
        let putting = one.putting.as_ref().unwrap();
        let after = correction(putting, &held_now, turn);
        let tool = region * putting.track.at(0.0).unwrap() * after;
        let object = tool * held_now * turned(turn);
        let wanted = region * lies;
        let off = wanted.inv_mul(&object);
        assert!(off.translation.vector.norm() < 1e-9 && off.rotation.angle() < 1e-9);
    }

    #[test]
    fn box_with_grasps_on_two_sides_may_be_turned_by_half() {
        let grasp = |yaw: f64, symmetric| Grasp {
            item: 0,
            name: "side".to_owned(),
            item_from_grasp: Isometry3::from_parts(
                Translation3::identity(),
                turned(yaw)
                    * UnitQuaternion::from_basis_unchecked(&[
                        Vector3::y(),
                        Vector3::z(),
                        Vector3::x(),
                    ]),
            ),
            width: 0.05,
            symmetric,
            from_above: false,
            force: None,
        };
        let mut scene = crate::tests::home_scene();
        scene.grasps = vec![grasp(0.0, false), grasp(PI, false)];
        assert_eq!(turns(&scene, 0), [0.0, PI]);
        scene.grasps = vec![grasp(0.0, false)];
        assert_eq!(turns(&scene, 0), [0.0]);
        scene.grasps = vec![grasp(0.0, true)];
        assert_eq!(turns(&scene, 0).len(), usize::from(TURNS));
    }
}
