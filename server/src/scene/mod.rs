//! What stands in the home: TOML files below `assets/` become validated types.
//!
//! Data only: no physics, no drawing, no network.

use nalgebra::{Isometry3, Matrix3, Point3};

use crate::geometry::{Part, Visual};

/// A furnished home with its objects, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name of the file below assets/scenes.
    pub name: String,
    /// Bodies that never move. Index 0 is the floor.
    pub furniture: Vec<Body>,
    /// Bodies that move freely.
    pub objects: Vec<Body>,
    /// Light.
    pub lighting: Lighting,
    /// Where the chair starts: pose of `wheelchair_root` in `house`.
    pub start: Isometry3<f64>,
    /// Camera of the room, off unless asked: world_from_optical and lens.
    pub room_camera: RoomCamera,
}

/// A body of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Unique name.
    pub name: String,
    /// Area it belongs to (`coffee_table`, `kitchen_table`, `shelf`, `workstation`); empty elsewhere.
    pub area: String,
    /// world_from_body; for objects the default place.
    pub pose: Isometry3<f64>,
    /// Mass properties; `None` for bodies that never move.
    pub mass: Option<MassProperties>,
    /// Coulomb friction coefficient (combined with the other body's by average).
    pub friction: f64,
    /// Shapes that touch.
    pub collision: Vec<Part>,
    /// Shapes that are drawn.
    pub visual: Vec<Visual>,
    /// How the end effector can take it.
    pub grasps: Vec<Grasp>,
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

/// One way to take an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// Name, for example `side`.
    pub name: String,
    /// Grasp point in the object's frame: z is the approach direction of the
    /// tool, x the direction along which the fingers close.
    pub pose: Isometry3<f64>,
    /// Distance between the pads at the grasp, metres.
    pub width: f64,
    /// Any turn about the object's z axis will do.
    pub symmetric: bool,
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

/// What was drawn for one object, in the order of `Scene::objects`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// world_from_object at the start.
    pub pose: Isometry3<f64>,
    /// kg; the inertia scales with it.
    pub mass: f64,
    /// Coulomb friction coefficient.
    pub friction: f64,
}
