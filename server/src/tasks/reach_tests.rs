//! Every sample of every task has a grasp that the arm reaches from a valid pose of the
//! chair.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2};

use super::*;
use crate::robot::RobotModel;
use crate::robot::kinematics::ArmKinematics;
use crate::scene::tests::{assets, home};
use crate::scene::{Grasp, Scene};

/// Clearance between chair and furniture, metres.
const MARGIN: f64 = 0.03;

/// A scene and the arm that must reach its objects.
struct Reach {
    arm: ArmKinematics,
    root_from_base: Isometry3<f64>,
    tool: Translation3<f64>,
    home: [f64; 6],
    check: FootprintCheck,
}

impl Reach {
    fn new(scene: &Scene) -> Self {
        let model = RobotModel::load(&assets(), "wheelarm").unwrap();
        let base = model.link(&model.settings.arm_base_link).unwrap();
        Self {
            arm: ArmKinematics::new(&model),
            root_from_base: model.link_poses(&vec![0.0; model.joints.len()])[base],
            tool: Translation3::new(0.0, 0.0, model.settings.tool_length),
            home: model.settings.home,
            check: Floor::new(&model, scene).check,
        }
    }

    /// Whether a chair at this pose is collision-free; its foot plate may be below a
    /// table.
    fn is_collision_free(&self, house_from_chair: &Isometry3<f64>) -> bool {
        let forward = house_from_chair.rotation * Vector3::x();
        let place = Pose2 {
            x: house_from_chair.translation.x,
            y: house_from_chair.translation.y,
            heading: forward.y.atan2(forward.x),
        };
        self.check.is_free(&place, MARGIN)
    }

    /// A chair pose facing `inwards` from which the arm reaches one of the grasps and
    /// its approach point.
    fn stop(
        &self,
        house_from_body: &Isometry3<f64>,
        grasps: &[Grasp],
        inwards: &Vector3<f64>,
        before: f64,
    ) -> Option<Isometry3<f64>> {
        let heading =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), inwards.y.atan2(inwards.x));
        for grasp in grasps {
            let turns = if grasp.symmetric { 12 } else { 1 };
            for turn in 0..2 * turns {
                let about = |angle: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
                let turned = about(std::f64::consts::TAU * f64::from(turn / 2) / f64::from(turns));
                let half = about(std::f64::consts::PI * f64::from(turn % 2));
                let grasp = house_from_body * turned * grasp.pose * half;
                let steep = (grasp.rotation * Vector3::z()).z < -0.8;
                // From above the hand may lean with its camera upwards, as the
                // operator's does.
                let leans: &[f64] = match (steep, at_floor(&grasp)) {
                    (true, _) => &[0.0, -0.25, -0.5],
                    (false, false) => &[0.0],
                    // A level hand leans as the operator's does.
                    (false, true) => &[0.0, 0.25, 0.5, 0.75],
                };
                for lean in leans {
                    let leaned = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), *lean);
                    let at = grasp * leaned * self.tool.inverse();
                    let forward = at.rotation * Vector3::z();
                    let sideways = forward.xy().norm() > 0.6;
                    if sideways
                        && (forward.dot(inwards) < 0.7 || (at.rotation * Vector3::y()).z < -0.3)
                    {
                        continue;
                    }
                    for far in [0.70, 0.60, 0.80, 0.50, 0.90, 0.40, 0.30, 0.20] {
                        for side in [0.0, 0.15, -0.15, 0.3, -0.3, 0.45, -0.45] {
                            let base = self.root_from_base.translation.vector;
                            let point = (at * self.tool).translation.vector
                                - heading * Vector3::new(base.x + far, base.y + side, 0.0);
                            let chair = Isometry3::from_parts(
                                Translation3::new(point.x, point.y, 0.0),
                                heading,
                            );
                            let from_base = (chair * self.root_from_base).inverse();
                            let way = [at * Translation3::new(0.0, 0.0, -before), at];
                            let reached = || {
                                way.iter().all(|pose| {
                                    self.arm.solve(&(from_base * pose), &self.home).is_ok()
                                })
                            };
                            if self.is_collision_free(&chair) && reached() {
                                return Some(chair);
                            }
                        }
                    }
                }
            }
        }
        None
    }
}

/// Whether a grasp is for an object on the floor.
fn at_floor(grasp: &Isometry3<f64>) -> bool {
    grasp.translation.z < 0.35
}

#[test]
fn every_possible_target_is_reachable_in_every_scene() {
    for spec in list(&assets(), &super::tests::hand()).unwrap_or_else(|error| panic!("{error}")) {
        for variant in spec.variants() {
            let mut scene = home();
            scene.keep_optional(&variant.furniture);
            let reach = Reach::new(&scene);
            for seed in 0..12 {
                let drawn = sample(&spec, variant, &scene, seed, None);
                let (pose, grasps, inwards) = match scene.object_named(&drawn.target) {
                    Some(object) => {
                        let place = variant.place(&drawn.target).unwrap();
                        let surface = scene.surface_named(&place.on, None).unwrap();
                        (
                            drawn.scene.placements[object].unwrap().pose,
                            &scene.objects[object].grasps,
                            surface.edge.rotation * Vector3::x(),
                        )
                    }
                    None => {
                        let body = scene.furniture_named(&drawn.target).unwrap();
                        let joint = scene.joint_of(body).unwrap();
                        let index = scene.joint_named(&joint.name).unwrap();
                        let out = joint.axis.scale(drawn.scene.positions[index]);
                        let body = &scene.furniture[body];
                        let pose = Translation3::from(out) * body.pose;
                        (pose, &body.grasps, -joint.axis.into_inner())
                    }
                };
                // An object on the floor is reachable from all sides.
                let ways = if spec.area.name == "floor" { 8 } else { 1 };
                let stop = (0..ways).find_map(|way| {
                    let turn = std::f64::consts::FRAC_PI_4 * f64::from(way);
                    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
                    reach.stop(&pose, grasps, &(turn * inwards), 0.08)
                });
                let name = &drawn.target;
                assert!(
                    stop.is_some(),
                    "{} seed {seed}: {name} is unreachable",
                    spec.name
                );
                if let Some(region) = spec.region(&scene) {
                    // As it was, or rotated by a quarter turn.
                    let stop = [0.0, FRAC_PI_2, -FRAC_PI_2].into_iter().find_map(|turn| {
                        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
                        let there = Isometry3::from_parts(
                            region.centre().translation,
                            turn * pose.rotation,
                        );
                        reach.stop(&there, grasps, &inwards, 0.08)
                    });
                    assert!(stop.is_some(), "{}: the region is unreachable", spec.name);
                }
            }
        }
    }
}
