//! The home: loads TOML files below `assets/` into validated types.
//!
//! Plain data without physics, rendering and network. Errors in a file are reported
//! here, with the file, the key, the value, the allowed values and the fix; later code
//! does not check the scene again.

mod bounds;
mod error;
mod file;
mod folder;
mod handles;
mod load;
mod material;
mod object;
mod packed;
mod part;
mod places;
mod soft;
mod urdf;

pub use bounds::Bounds;
pub(crate) use error::Place;
pub use error::SceneError;
pub use folder::{AssetText, texts};
pub(crate) use folder::{Files, did_you_mean, names, parse, parse_packed, provenance, text};
pub use handles::ReachedHandle;
pub use object::object;
pub use places::ReachedPlace;
pub(crate) use places::kind_name;
pub use soft::Soft;

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};
use wheelarm_pack::Pack;
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::settings::ObjectSplit;

use crate::geometry::{Part, Visual};

/// A furnished home with its objects, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name of the file below assets/scenes.
    pub name: String,
    /// Fixed bodies. Index 0 is the floor.
    pub furniture: Vec<Body>,
    /// Free bodies.
    pub objects: Vec<Body>,
    /// Surfaces for placing objects.
    pub surfaces: Vec<Surface>,
    /// Strips of surfaces that the robot reaches.
    pub places: Vec<ReachedPlace>,
    /// Doors and drawers of furniture that the robot opens and closes.
    pub handles: Vec<ReachedHandle>,
    /// Joints of furniture that slides or turns.
    pub joints: Vec<FurnitureJoint>,
    /// Light.
    pub lighting: Lighting,
    /// Start of the chair: pose of `wheelchair_root` in `house`.
    pub start: Isometry3<f64>,
    /// Camera of the room, off unless requested: world_from_optical and lens.
    pub room_camera: RoomCamera,
    /// Its text files, below the assets folder and sorted.
    pub files: Vec<String>,
    /// Its world pack; `None` for a scene of the assets.
    pub pack: Option<Arc<Pack>>,
    /// Further packs, whose objects are part of the stock of tasks.
    pub object_packs: Vec<Arc<Pack>>,
    /// Objects of the stock that tasks place.
    pub object_split: ObjectSplit,
}

/// A body of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Unique name.
    pub name: String,
    /// Its area (`coffee_table`, `kitchen_table`, `shelf`, `workstation`); empty
    /// elsewhere.
    pub area: String,
    /// Category in one word: `can`, `mug`, `drawer`; may be empty.
    pub category: String,
    /// Its colour in one word; may be empty.
    pub colour: String,
    /// Its own noun in sentences, of an object of a pack; may be empty.
    pub noun: String,
    /// world_from_body; for objects the default pose.
    pub pose: Isometry3<f64>,
    /// Mass properties; `None` for fixed bodies.
    pub mass: Option<MassProperties>,
    /// Coulomb friction coefficient (combined with the other body's by average).
    pub friction: f64,
    /// Colliding shapes; never `Shape::Mesh` or `Shape::Lathe`.
    pub collision: Vec<Part>,
    /// Colliding mesh files: each collides as the convex hull of these vertices, metres
    /// in the body frame.
    pub hulls: Vec<Vec<Point3<f64>>>,
    /// Rendered shapes.
    pub visual: Vec<Visual>,
    /// Elasticity of a deformable. Its `collision` is only its bounds at rest: its skin
    /// collides.
    pub soft: Option<Soft>,
    /// Grasps.
    pub grasps: Vec<Grasp>,
    /// Point to drink or eat from, in the body frame, for bringing to the mouth.
    pub tip: Option<Point3<f64>>,
    /// An object that is only present when a task samples it or a scenario places it,
    /// or furniture of some variants of an area.
    pub optional: bool,
}

/// A level part of furniture that carries objects and has an approach side.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Index into `Scene::furniture`.
    pub furniture: usize,
    /// Name within the furniture, for example `top`.
    pub name: String,
    /// world_from_edge: origin in the middle of the approach edge, x inwards, z up.
    pub edge: Isometry3<f64>,
    /// Extent inwards from the edge, metres.
    pub depth: f64,
    /// Extent along the edge, metres.
    pub width: f64,
}

/// Furniture on a joint: a drawer slides along an axis, a door turns about one.
#[derive(Clone, Debug, PartialEq)]
pub struct FurnitureJoint {
    /// Unique name, for example `drawer_1_joint`.
    pub name: String,
    /// Index into `Scene::furniture` of the moving body. Its pose there is that at
    /// joint position 0.
    pub furniture: usize,
    /// Index into `Scene::furniture` of the body that carries it.
    pub carrier: usize,
    /// Whether it slides or turns.
    pub motion: JointMotion,
    /// Direction of increasing positions in `house`, or the axis of positive angles
    /// through the origin of the moving body.
    pub axis: Unit<Vector3<f64>>,
    /// Largest position, metres or radians; the smallest is 0.
    pub travel: f64,
    /// Mass properties of the moving body.
    pub mass: MassProperties,
    /// Friction.
    pub resistance: Resistance,
    /// Initial position, metres or radians.
    pub start: f64,
}

impl FurnitureJoint {
    /// Pose of the moving body in `house` at a position, metres or radians; `rest` is
    /// that at position 0.
    #[must_use]
    pub fn pose(&self, rest: &Isometry3<f64>, position: f64) -> Isometry3<f64> {
        self.motion.pose(&self.axis, rest, position)
    }
}

/// Friction of furniture on a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resistance {
    /// Dry friction, N or N·m.
    pub friction: f64,
    /// Viscous friction, N·s/m or N·m·s.
    pub damping: f64,
}

/// Mass properties of a free body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// kg.
    pub mass: f64,
    /// Centre of mass in the body frame, metres.
    pub com: Point3<f64>,
    /// Inertia about the centre of mass along the body axes, kg·m².
    pub inertia: Matrix3<f64>,
}

/// A grasp of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// Name, for example `side`.
    pub name: String,
    /// Pose of the tool's grasp point in the object's frame: z is the approach
    /// direction of the tool, x the closing direction of the fingers.
    pub pose: Isometry3<f64>,
    /// Distance between the pads at the grasp, metres.
    pub width: f64,
    /// Whether any rotation about the object's z axis is possible.
    pub symmetric: bool,
    /// Cap of the force at each pad for a deformable, N; 0 for none.
    pub force: f64,
    /// Only for approaches from above, for a fallen object.
    pub from_above: bool,
}

/// Light of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// Unit vector towards the sun (window light).
    pub sun_direction: [f32; 3],
    /// Sun colour times intensity, linear RGB.
    pub sun: [f32; 3],
    /// Light from above, linear RGB.
    pub sky: [f32; 3],
    /// Light from below, linear RGB.
    pub ground: [f32; 3],
}

/// The room camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoomCamera {
    /// world_from_optical.
    pub pose: Isometry3<f64>,
    /// Horizontal field of view, radians.
    pub horizontal_fov: f64,
}

/// Sampled values of one object, in the order of `Scene::objects`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Initial world_from_object.
    pub pose: Isometry3<f64>,
    /// kg; the inertia scales with it.
    pub mass: f64,
    /// Coulomb friction coefficient.
    pub friction: f64,
}

impl Placement {
    /// The body at its pose in the scene, with the mass and friction of its file.
    #[must_use]
    pub fn from_body(body: &Body) -> Self {
        Self {
            pose: body.pose,
            mass: body.mass.map_or(0.0, |mass| mass.mass),
            friction: body.friction,
        }
    }
}

impl Scene {
    /// Furniture of this name.
    #[must_use]
    pub fn furniture_named(&self, name: &str) -> Option<usize> {
        self.furniture.iter().position(|body| body.name == name)
    }

    /// Removes the optional furniture except the named pieces.
    pub fn keep_optional(&mut self, wanted: &[String]) {
        let stays = |body: &Body| !body.optional || wanted.contains(&body.name);
        let stays: Vec<bool> = self.furniture.iter().map(stays).collect();
        let index = |old: usize| stays[..old].iter().filter(|stays| **stays).count();
        self.surfaces.retain(|surface| stays[surface.furniture]);
        for surface in &mut self.surfaces {
            surface.furniture = index(surface.furniture);
        }
        self.joints
            .retain(|joint| stays[joint.furniture] && stays[joint.carrier]);
        for joint in &mut self.joints {
            joint.furniture = index(joint.furniture);
            joint.carrier = index(joint.carrier);
        }
        let mut kept = stays.iter();
        self.furniture.retain(|_| *kept.next().unwrap_or(&true));
    }

    /// Object of this name.
    #[must_use]
    pub fn object_named(&self, name: &str) -> Option<usize> {
        self.objects.iter().position(|body| body.name == name)
    }

    /// Joint of furniture of this name.
    #[must_use]
    pub fn joint_named(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Joint of sliding furniture; `None` for fixed furniture.
    #[must_use]
    pub fn joint_of(&self, furniture: usize) -> Option<&FurnitureJoint> {
        self.joints.iter().find(|j| j.furniture == furniture)
    }

    /// Surface `surface` of `furniture`, or its first one without a name.
    #[must_use]
    pub fn surface_named(&self, furniture: &str, surface: Option<&str>) -> Option<&Surface> {
        let furniture = self.furniture_named(furniture)?;
        self.surfaces
            .iter()
            .find(|s| s.furniture == furniture && surface.is_none_or(|name| s.name == name))
    }
}

impl Surface {
    /// world_from_centre: the middle of the surface, x inwards, z up.
    #[must_use]
    pub fn centre(&self) -> Isometry3<f64> {
        self.standing(self.depth / 2.0, 0.0, 0.0)
    }

    /// Whether a point of `house` is above or below the surface.
    #[must_use]
    pub fn spans(&self, point: &Point3<f64>) -> bool {
        let on = self.edge.inverse_transform_point(point);
        (0.0..=self.depth).contains(&on.x) && on.y.abs() <= self.width / 2.0
    }

    /// world_from_body of a body on the surface: `inwards` from the approach edge,
    /// `along` from its middle, rotated by `yaw` relative to the inward direction.
    #[must_use]
    pub fn standing(&self, inwards: f64, along: f64, yaw: f64) -> Isometry3<f64> {
        self.edge * Isometry3::new(Vector3::new(inwards, along, 0.0), Vector3::z() * yaw)
    }
}

#[cfg(test)]
pub(crate) mod tests;
