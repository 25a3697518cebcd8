//! Starts from which a robot camera has the target in view.

use nalgebra::{Isometry3, Point3};
use wheelarm_planning::obb::Obb;

use super::scenario::Scenario;
use crate::robot::{CameraMount, RobotModel};
use crate::scene::Scene;
use crate::tasks::{Floor, TaskSpec, Variant, collision_boxes};

/// Smallest distance of the target's centre from the image border: share of its size.
const EDGE: f64 = 0.05;
/// Largest distance at which an object covers more than a few pixels, metres.
const FURTHEST: f64 = 3.5;
/// Samples of the line of sight.
const SAMPLES: u32 = 60;

/// Replaces a sampled start by one with the target in view, if one exists.
pub(super) fn choose(
    scenario: &mut Scenario,
    (task, variant): (&TaskSpec, &Variant),
    floor: &Floor,
    (model, scene): (&RobotModel, &Scene),
) {
    let Some(view) = View::new(scenario, model, scene) else {
        return;
    };
    let sees = |start: &Isometry3<f64>| view.sees(start);
    let draw = (scenario.seed, scenario.starts, scenario.arm);
    if let Some(start) = floor.start_in_view(&task.area, variant, scene, draw, &sees) {
        scenario.start = Some(start);
    }
}

/// The cameras and the bodies that could hide the target.
struct View<'a> {
    /// chair_from_optical of each camera.
    viewpoints: Vec<(Isometry3<f64>, &'a CameraMount)>,
    target: Point3<f64>,
    furniture: Vec<Obb>,
}

impl<'a> View<'a> {
    fn new(scenario: &Scenario, model: &'a RobotModel, scene: &Scene) -> Option<Self> {
        let mut positions = vec![0.0; model.joints.len()];
        let arm = scenario.arm.unwrap_or(model.settings.home);
        for (&joint, position) in model.roles.arm.iter().zip(arm) {
            positions[joint] = position;
        }
        let poses = model.link_poses(&positions);
        let cameras = model.settings.cameras.iter();
        let viewpoints = cameras.filter(|camera| !camera.on_request);
        let viewpoints = viewpoints
            .filter_map(|mount| Some((poses[model.link(&mount.link)?] * mount.pose, mount)));
        let target = target(scenario, scene)?;
        let boxes = scene.furniture.iter().flat_map(collision_boxes);
        Some(Self {
            viewpoints: viewpoints.collect(),
            furniture: boxes.filter(|obb| obb.distance(&target) > 0.0).collect(),
            target,
        })
    }

    /// Whether a robot at this pose has the target in the field of view of a camera.
    fn sees(&self, start: &Isometry3<f64>) -> bool {
        self.viewpoints.iter().any(|(eye, mount)| {
            let eye = start * eye;
            let point = eye.inverse_transform_point(&self.target);
            let in_image = |axis: usize| {
                let at = mount.principal[axis] + mount.focal[axis] * point[axis] / point.z;
                (EDGE..=1.0 - EDGE).contains(&(at / f64::from(mount.size[axis])))
            };
            point.z > 0.0
                && point.coords.norm() < FURTHEST
                && in_image(0)
                && in_image(1)
                && self.is_clear(&Point3::from(eye.translation.vector))
        })
    }

    /// Whether no furniture is between an eye and the target.
    fn is_clear(&self, from: &Point3<f64>) -> bool {
        let clear = |i: u32| {
            let at = from + (self.target - from) * (f64::from(i) / f64::from(SAMPLES));
            self.furniture.iter().all(|obb| obb.distance(&at) > 0.0)
        };
        (1..SAMPLES).all(clear)
    }
}

/// The centre of the target in `house`.
fn target(scenario: &Scenario, scene: &Scene) -> Option<Point3<f64>> {
    let placed = scenario
        .objects
        .iter()
        .find(|(name, _)| *name == scenario.target);
    if let Some((name, placement)) = placed {
        let body = &scene.objects[scene.object_named(name)?];
        let bounds = body.collision_bounds(&placement.pose)?;
        return Some(bounds.min + bounds.size() / 2.0);
    }
    let body = scene.furniture_named(&scenario.target)?;
    let joint = scene.joint_of(body)?;
    let body = &scene.furniture[body];
    let handle = body.grasps.first().map_or(Point3::origin(), |grasp| {
        Point3::from(grasp.pose.translation.vector)
    });
    Some(joint.pose(&body.pose, joint.start) * handle)
}
