//! Furniture and objects in the engine.

use nalgebra::{Isometry3, Point3, Vector3};
use rapier3d::prelude::{
    ColliderBuilder, Group, InteractionGroups, InteractionTestMode, PhysicsWorld, RigidBodyBuilder,
    RigidBodyHandle,
};

use super::WorldError;
use super::body::{FLOOR_GROUP, SCENE_GROUP};
use super::contact::tag;
use super::convert::{mass_properties, pose, real};
use super::furniture_joint::MovingFurniture;
use super::health::CHAIR_HEIGHT;
use super::mass::Mass;
use super::shape::{hull_of, solids};
use crate::scene::{Body, Placement, Scene};
use crate::snapshot::{Anomaly, BodyRef};

/// Distance beyond the furniture, sideways and down, at which an object counts as
/// escaped, metres.
const ESCAPE_MARGIN: f64 = 1.0;
/// The same upwards, where there may be no ceiling, metres.
const ESCAPE_HEIGHT: f64 = 4.0;

/// Furniture and objects of the home in the engine.
#[derive(Clone, Debug)]
pub(super) struct SceneBodies {
    /// Engine bodies, in the order of `Scene::objects`.
    pub objects: Vec<RigidBodyHandle>,
    /// Their masses, kg; 0 for a deformable.
    pub masses: Vec<f64>,
    /// Furniture on joints, in the order of `Scene::joints`.
    pub moving: Vec<MovingFurniture>,
    /// Corners of the bounding box of all furniture, metres.
    bounds: (Point3<f64>, Point3<f64>),
    /// Height of the floor's top, metres.
    floor: f64,
}

impl SceneBodies {
    /// Inserts the furniture of a scene and its objects, as placed, into the engine.
    pub(super) fn insert(
        physics: &mut PhysicsWorld,
        scene: &Scene,
        placements: &[Placement],
    ) -> Result<Self, WorldError> {
        if placements.len() != scene.objects.len() {
            return Err(WorldError::Placements {
                scene: scene.name.clone(),
                objects: scene.objects.len(),
                placements: placements.len(),
            });
        }
        let mut furniture = Vec::new();
        for (index, body) in scene.furniture.iter().enumerate() {
            let builder = match scene.joint_of(index) {
                Some(joint) => MovingFurniture::body(joint, body),
                None => RigidBodyBuilder::fixed().pose(pose(&body.pose)),
            };
            let handle = physics.insert_body(builder);
            furniture.push(handle);
            insert_parts(
                physics,
                body,
                handle,
                body.friction,
                BodyRef::Furniture(index),
            )?;
        }
        let moving = scene.joints.iter().map(|joint| {
            let at = |i: usize| (furniture[i], &scene.furniture[i].pose);
            MovingFurniture::insert(physics, joint, at(joint.carrier), at(joint.furniture))
        });
        let moving = moving.collect();
        let mut bounds = (Point3::from([f64::MAX; 3]), Point3::from([f64::MIN; 3]));
        for (_, collider) in physics.colliders.iter() {
            let aabb = collider.compute_aabb();
            for i in 0..3 {
                bounds.0[i] = bounds.0[i].min(f64::from(aabb.mins[i]));
                bounds.1[i] = bounds.1[i].max(f64::from(aabb.maxs[i]));
            }
        }
        // The first piece of furniture is the floor.
        let floor = furniture.first().and_then(|&floor| {
            let colliders = physics.bodies.get(floor)?.colliders().iter();
            let tops = colliders.filter_map(|c| Some(physics.colliders.get(*c)?.compute_aabb()));
            tops.map(|aabb| f64::from(aabb.maxs[2])).reduce(f64::max)
        });
        let mut objects = Vec::new();
        let mut masses = vec![0.0; scene.objects.len()];
        for (index, (body, placement)) in scene.objects.iter().zip(placements).enumerate() {
            if body.soft.is_some() {
                // A deformable is not simulated by the engine; its fixed body keeps the
                // order of the list.
                objects.push(physics.insert_body(RigidBodyBuilder::fixed()));
                continue;
            }
            let mass = placed_mass(body, placement)?;
            masses[index] = mass.mass;
            let handle = physics.insert_body(
                RigidBodyBuilder::dynamic()
                    .pose(pose(&placement.pose))
                    .can_sleep(true)
                    .additional_mass_properties(mass_properties(&mass)),
            );
            insert_parts(
                physics,
                body,
                handle,
                placement.friction,
                BodyRef::Object(index),
            )?;
            objects.push(handle);
        }
        let margin = Vector3::repeat(ESCAPE_MARGIN);
        let height = Vector3::new(ESCAPE_MARGIN, ESCAPE_MARGIN, ESCAPE_HEIGHT);
        Ok(Self {
            objects,
            masses,
            moving,
            bounds: (bounds.0 - margin, bounds.1 + height),
            floor: floor.unwrap_or(0.0),
        })
    }

    /// Whether the chair's frame can be at a position: between the walls, neither
    /// airborne nor under the floor. A scene without furniture has no bounds.
    pub(super) fn holds_chair(&self, at: &Vector3<f64>) -> bool {
        let (min, max) = &self.bounds;
        if min.x > max.x {
            return at.iter().all(|x| x.is_finite());
        }
        let [below, above] = CHAIR_HEIGHT;
        let height = at.z - self.floor;
        (0..2).all(|i| (min[i]..=max[i]).contains(&at[i])) && (below..=above).contains(&height)
    }

    /// The anomaly of a body at a pose, if any.
    pub(super) fn anomaly(
        &self,
        physics: &PhysicsWorld,
        handle: RigidBodyHandle,
        body: BodyRef,
        frame: &Isometry3<f64>,
    ) -> Option<Anomaly> {
        let engine_body = physics.bodies.get(handle)?;
        let finite = engine_body.position().is_finite()
            && engine_body.linvel().is_finite()
            && engine_body.angvel().is_finite()
            && frame.translation.vector.iter().all(|x| x.is_finite());
        if !finite || !engine_body.is_enabled() {
            return Some(Anomaly::NotFinite(body));
        }
        let p = frame.translation.vector;
        let inside = (0..3).all(|i| (self.bounds.0[i]..=self.bounds.1[i]).contains(&p[i]));
        let object = matches!(body, BodyRef::Object(_));
        (object && !inside).then_some(Anomaly::Escaped(body))
    }
}

/// The body's mass properties scaled to the sampled mass.
fn placed_mass(body: &Body, placement: &Placement) -> Result<Mass, WorldError> {
    let refuse = |mass| WorldError::Mass {
        body: body.name.clone(),
        mass,
    };
    let nominal = body.mass.ok_or_else(|| refuse(placement.mass))?;
    let scale = placement.mass / nominal.mass;
    let mass = Mass {
        mass: placement.mass,
        com: nominal.com,
        inertia: nominal.inertia * scale,
    };
    if mass.is_physical() {
        Ok(mass)
    } else {
        Err(refuse(placement.mass))
    }
}

fn insert_parts(
    physics: &mut PhysicsWorld,
    body: &Body,
    handle: RigidBodyHandle,
    friction: f64,
    reference: BodyRef,
) -> Result<(), WorldError> {
    let group = match reference {
        BodyRef::Furniture(0) => FLOOR_GROUP,
        _ => SCENE_GROUP,
    };
    let refuse = |problem| WorldError::Shape {
        body: body.name.clone(),
        problem,
    };
    let mut all = Vec::new();
    for part in &body.collision {
        all.extend(solids(part, 0.0).map_err(refuse)?);
    }
    for points in &body.hulls {
        all.push(hull_of(points).map_err(refuse)?);
    }
    for (body_from_solid, shape) in all {
        physics.insert_collider(
            ColliderBuilder::new(shape)
                .position(body_from_solid)
                .density(0.0)
                .friction(real(friction))
                .collision_groups(InteractionGroups::new(
                    group,
                    Group::ALL,
                    InteractionTestMode::And,
                ))
                .user_data(tag(reference)),
            Some(handle),
        );
    }
    Ok(())
}
