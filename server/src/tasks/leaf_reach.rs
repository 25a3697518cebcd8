//! Whether the robot pushes a door of furniture shut that its task opens: the chair has a path
//! to a base placement from which the arm follows the arc of the door. The scripted operator
//! pushes with the same hand.

use std::iter::once;

use nalgebra::{Isometry3, Point3};
use wheelarm_planning::floor_map::STOP_CLEARANCE;
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2};
use wheelarm_planning::hinged_leaf::{BEYOND, HingedLeaf};
use wheelarm_planning::leaf_push::{NoPush, PushingChair};
use wheelarm_planning::obb::Obb;
use wheelarm_proto::furniture::JointMotion;

use super::area::Range;
use super::floor::{Floor, collision_boxes, on_floor};
use super::goal::Goal;
use super::random::{number, stream};
use super::scene_sampling::SceneSample;
use super::spec::TaskSpec;
use crate::scene::{FurnitureJoint, Scene};

/// Base placements that are looked for, and that a door needs: the check knows nothing of the
/// way of the hand from home, which may fail from a single one.
const PLACEMENTS: [usize; 2] = [8, 3];
/// Where a door that is open as far as its task wants cannot be pushed shut, it is open less,
/// but at least by this angle, radians; and how many angles are tried.
const LEAST_OPEN: f64 = 0.55;
const ANGLES: usize = 5;
/// Furniture within this distance of a hinge may be in the way, metres.
const NEAR: f64 = 1.6;

impl Floor {
    /// Whether a chair that starts as sampled gets to where its arm pushes a door from an angle
    /// shut.
    fn can_push_shut(
        &self,
        spec: &TaskSpec,
        (leaf, around): (&HingedLeaf, &[Obb]),
        angle: f64,
        sample: &SceneSample,
    ) -> Result<bool, NoPush> {
        let Some(drivable) = self.drivable(&spec.area) else {
            return Ok(true);
        };
        let open = leaf.boxes_at(angle);
        let outlines = self.check.levels.iter();
        let outlines = outlines.map(|level| (level.top, level.outline));
        let mut beside = FootprintCheck::from_outlines(outlines);
        for obb in &open {
            beside.put(obb.rectangle(), obb.heights());
        }
        if !beside.is_free(&on_floor(&sample.start), 0.0) {
            return Ok(false);
        }
        let is_stop = |pose: &Pose2| beside.is_free(pose, STOP_CLEARANCE) && drivable.is_stop(pose);
        let mut reaches = |poses: &[Isometry3<f64>]| self.arm.follows(poses);
        let mut chair = PushingChair {
            mount: self.arm.mount,
            range: self.range,
            hand: &self.arm.hand,
            is_stop: &is_stop,
            reaches: &mut reaches,
        };
        let [most, least] = PLACEMENTS;
        let stops = leaf.placements([angle, 0.0], around, &mut chair, most)?;
        if stops.len() < least {
            return Err(NoPush::OutOfReach);
        }
        let stops: Vec<Pose2> = stops.iter().map(|stop| stop.chair).collect();
        let drivable = drivable.among(&open);
        Ok(self.has_path(&drivable, (&sample.start, sample.arm), &stops))
    }
}

/// Boxes of the furniture near the hinge of a joint, without what turns on it, and with or
/// without what carries it.
fn around(
    scene: &Scene,
    joint: &FurnitureJoint,
    leaf: &HingedLeaf,
    without_carrier: bool,
) -> Vec<Obb> {
    let hinge = Point3::from(leaf.rest.translation.vector);
    let furniture = scene.furniture.iter().enumerate();
    let others = furniture.filter(|(index, _)| *index != joint.furniture);
    let others = others.filter(|(index, _)| !without_carrier || *index != joint.carrier);
    let boxes = others.flat_map(|(_, body)| collision_boxes(body));
    boxes.filter(|obb| obb.distance(&hinge) < NEAR).collect()
}

/// Whether the door of a sampled task opens as far as the task wants without meeting furniture
/// or walls; or the robot pushes it shut, and it is then open by an angle that makes this
/// possible. True of other tasks, and without maps.
pub(super) fn choose_angle(
    spec: &TaskSpec,
    (scene, target): (&Scene, &str),
    sample: &mut SceneSample,
    seed: u64,
    floor: &Floor,
) -> bool {
    let (Goal::Close(bounds) | Goal::Open(bounds), Some(joint)) =
        (&spec.goal, scene.joint_of_furniture(target))
    else {
        return true;
    };
    let mut slides = spec.area.slides.iter();
    let slide = slides.find(|slide| slide.joint == joint.name);
    let index = scene.joint_named(&joint.name);
    let (JointMotion::Turns, Some((slide, index))) = (joint.motion, slide.zip(index)) else {
        return true;
    };
    let body = &scene.furniture[joint.furniture];
    let boxes = body.collision_boxes().map(|(pose, half)| Obb {
        pose,
        half,
        round: false,
    });
    let leaf = HingedLeaf {
        rest: body.pose,
        axis: joint.axis,
        boxes: boxes.collect(),
    };
    if floor.drivable(&spec.area).is_none() {
        return true;
    }
    let beside = around(scene, joint, &leaf, true);
    if matches!(spec.goal, Goal::Open(_)) {
        return leaf.swings_free(bounds.angle + BEYOND, &beside);
    }
    let around = around(scene, joint, &leaf, false);
    let mut random = stream(&spec.area.name, seed, "angle of a door");
    let less = Range {
        min: LEAST_OPEN.min(slide.position.max),
        max: slide.position.max,
    };
    let others = (0..ANGLES).map(|_| number(&mut random, less));
    let found = once(sample.positions[index]).chain(others).find(|angle| {
        if !leaf.swings_free(*angle, &beside) {
            return false;
        }
        let pushed = floor.can_push_shut(spec, (&leaf, &around), *angle, sample);
        pushed.unwrap_or_else(|why| {
            tracing::debug!("{target} open by {:.0}°: {why}", angle.to_degrees());
            false
        })
    });
    if let Some(angle) = found {
        sample.positions[index] = angle;
    }
    found.is_some()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use nalgebra::Vector3;
    use wheelarm_planning::leaf_push::PushStop;

    use super::super::floor::outlines;

    use super::super::pushing_arm::PushingArm;
    use super::*;
    use crate::robot::RobotModel;

    const OPEN: f64 = 0.95;

    /// A door of 0.45 x 0.7 m, from a height on, of a cupboard along the wall y = 0, whose room
    /// has negative y.
    fn door(height: f64) -> HingedLeaf {
        HingedLeaf {
            rest: Isometry3::translation(0.0, 0.0, height),
            axis: -Vector3::z_axis(),
            boxes: vec![Obb {
                pose: Isometry3::translation(0.225, 0.01, 0.35),
                half: Vector3::new(0.22, 0.01, 0.34),
                round: false,
            }],
        }
    }

    /// Placements before the cupboard, which has further boxes around it.
    fn placements(leaf: &HingedLeaf, others: &[Obb]) -> Result<Vec<PushStop>, NoPush> {
        let assets = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let model = RobotModel::load(&assets, "wheelarm").expect("the robot");
        let arm = PushingArm::new(&model);
        let mut check = FootprintCheck::from_outlines(outlines(&model.settings.outlines));
        let cupboard = Obb::between([-2.0, 0.021, 0.0], [2.0, 0.5, 1.2]);
        let around = [&[cupboard], others].concat();
        for obb in leaf.boxes_at(OPEN).iter().chain(&around) {
            check.put(obb.rectangle(), obb.heights());
        }
        let mut chair = PushingChair {
            mount: arm.mount,
            range: [0.42, 0.8],
            hand: &arm.hand,
            is_stop: &|pose| check.is_free(pose, STOP_CLEARANCE),
            reaches: &mut |poses: &[Isometry3<f64>]| arm.follows(poses),
        };
        leaf.placements([OPEN, 0.0], &around, &mut chair, 3)
    }

    #[test]
    fn arm_pushes_an_open_door_shut_where_there_is_floor() {
        let stops = placements(&door(0.4), &[]).expect("placements");
        assert_eq!(stops.len(), 3);
        // A wall 0.7 m before the cupboard leaves none, and an upper cabinet is too high.
        let wall = Obb::between([-2.0, -0.8, 0.0], [2.0, -0.7, 2.5]);
        assert_eq!(placements(&door(0.4), &[wall]), Err(NoPush::NoFloor));
        assert_eq!(placements(&door(1.3), &[]), Err(NoPush::NoFace));
    }
}
