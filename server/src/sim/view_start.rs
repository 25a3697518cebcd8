//! Starts from which the chair's camera has the target in view.

use nalgebra::{Isometry3, Point3, Translation3};
use wheelarm_route::obb::Obb;

use super::scenario::Scenario;
use crate::geometry::bounds;
use crate::robot::RobotModel;
use crate::scene::Scene;
use crate::tasks::{Floor, TaskSpec, Variant};

/// Camera that has to see the target.
const CAMERA: &str = "wheelchair";
/// The target is this much nearer to the middle of the image than to its edge: share of
/// half the image.
const INSIDE: f64 = 0.9;
/// Furthest distance at which an object is more than a few pixels, metres.
const FURTHEST: f64 = 3.5;
/// Samples of the line of sight.
const SAMPLES: u32 = 60;

/// Replaces a drawn start by one that sees the target, where there is one.
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
    let draw = (scenario.seed, scenario.starts);
    if let Some(start) = floor.start_in_view(&task.area, variant, scene, draw, &sees) {
        scenario.start = Some(start);
    }
}

/// The chair's camera and what could hide the target.
struct View {
    chair_from_optical: Isometry3<f64>,
    /// Half of the image over the focal length, horizontal and vertical.
    half: [f64; 2],
    target: Point3<f64>,
    furniture: Vec<Obb>,
}

impl View {
    fn new(scenario: &Scenario, model: &RobotModel, scene: &Scene) -> Option<Self> {
        let mount = model.settings.cameras.iter().find(|c| c.name == CAMERA)?;
        let link = model.link(&mount.link)?;
        let poses = model.link_poses(&vec![0.0; model.joints.len()]);
        let target = target(scenario, scene)?;
        let boxes = scene.furniture.iter().flat_map(|body| {
            body.collision.iter().filter_map(|part| {
                let (centre, half) = bounds(&part.shape)?;
                Some(Obb {
                    pose: body.pose * part.pose * Translation3::from(centre),
                    half,
                    round: false,
                })
            })
        });
        Some(Self {
            chair_from_optical: poses[link] * mount.pose,
            half: std::array::from_fn(|i| f64::from(mount.size[i]) / 2.0 / mount.focal[i]),
            furniture: boxes.filter(|obb| obb.distance(&target) > 0.0).collect(),
            target,
        })
    }

    /// Whether a chair at this pose has the target in its camera's field of view.
    fn sees(&self, start: &Isometry3<f64>) -> bool {
        let eye = start * self.chair_from_optical;
        let seen = eye.inverse_transform_point(&self.target);
        let inside = |along: f64, half: f64| (along / seen.z).abs() < half * INSIDE;
        let in_image = seen.z > 0.0 && inside(seen.x, self.half[0]) && inside(seen.y, self.half[1]);
        if !in_image || seen.coords.norm() > FURTHEST {
            return false;
        }
        let from = Point3::from(eye.translation.vector);
        let clear = |i: u32| {
            let at = from + (self.target - from) * (f64::from(i) / f64::from(SAMPLES));
            self.furniture.iter().all(|obb| obb.distance(&at) > 0.0)
        };
        (1..SAMPLES).all(clear)
    }
}

/// The middle of the target in `house`.
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
    Some(body.pose * handle + joint.axis.scale(joint.start))
}
