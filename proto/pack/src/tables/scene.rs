//! Tables of scene files.

use serde::{Deserialize, Serialize};

use super::object::GraspEntry;
use super::part::{PartEntry, is_default};
use super::place::{HandleEntry, PlaceEntry};

/// `assets/scenes/NAME.toml`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// Origin of the scene.
    pub origin: String,
    /// Its license.
    pub license: String,
    /// Light of the scene.
    pub light: LightEntry,
    /// Camera of the room.
    pub room_camera: RoomCameraEntry,
    /// Start of the chair.
    pub start: StartEntry,
    /// Fixed and sliding bodies; the first is the floor.
    #[serde(default)]
    pub furniture: Vec<FurnitureEntry>,
    /// Free bodies.
    #[serde(default)]
    pub object: Vec<ObjectEntry>,
    /// Places for objects of tasks.
    #[serde(default, skip_serializing_if = "is_default")]
    pub place: Vec<PlaceEntry>,
    /// Doors and drawers of furniture that the robot opens and closes.
    #[serde(default, skip_serializing_if = "is_default")]
    pub handle: Vec<HandleEntry>,
}

/// Light of a scene, linear RGB times intensity.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LightEntry {
    /// Direction towards the sun, z above 0.
    pub sun_direction: [f64; 3],
    /// Light of the sun.
    pub sun: [f64; 3],
    /// Light from above.
    pub sky: [f64; 3],
    /// Light from below.
    pub ground: [f64; 3],
}

/// Camera of the room.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RoomCameraEntry {
    /// Position, metres.
    pub at: [f64; 3],
    /// Point in the middle of its image, metres.
    pub look_at: [f64; 3],
    /// Degrees.
    pub horizontal_fov_deg: f64,
}

/// Start of the chair.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct StartEntry {
    /// Position on the floor, metres.
    pub at: [f64; 2],
    /// Direction of its front, degrees.
    pub yaw_deg: f64,
}

/// One `[[furniture]]`.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FurnitureEntry {
    /// Unique name.
    pub name: String,
    /// Area of tasks; empty elsewhere.
    #[serde(default, skip_serializing_if = "is_default")]
    pub area: String,
    /// Category, in one word.
    #[serde(default, skip_serializing_if = "is_default")]
    pub category: String,
    /// Position, metres.
    pub at: [f64; 3],
    /// Rotation about z, degrees.
    #[serde(default, skip_serializing_if = "is_default")]
    pub yaw_deg: f64,
    /// Coulomb coefficient.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// Default material of its parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Copies parts, collision, friction, area and category of an earlier entry.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub like: Option<String>,
    /// Shapes.
    #[serde(default, skip_serializing_if = "is_default")]
    pub parts: Vec<PartEntry>,
    /// If given, these collide and the parts are only rendered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub collision: Option<Vec<PartEntry>>,
    /// Level places for objects.
    #[serde(default, skip_serializing_if = "is_default")]
    pub surfaces: Vec<SurfaceEntry>,
    /// Furniture that slides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slide: Option<SlideEntry>,
    /// Furniture that turns; instead of `slide`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hinge: Option<HingeEntry>,
    /// Grasps, in its own frame; for furniture on a joint.
    #[serde(default, skip_serializing_if = "is_default")]
    pub grasps: Vec<GraspEntry>,
    /// Only present in variants of an area that name it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub optional: bool,
}

/// Sliding of furniture; its pose is that at joint position 0.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SlideEntry {
    /// Earlier furniture in which it slides and with which it does not collide.
    pub on: String,
    /// Direction in its own frame.
    pub axis: [f64; 3],
    /// Largest position, metres.
    pub travel: f64,
    /// kg.
    pub mass: f64,
    /// Centre of mass in its own frame, metres.
    pub com: [f64; 3],
    /// Ixx, Iyy, Izz about the centre of mass along its axes, kg·m².
    pub inertia: [f64; 3],
    /// Dry friction, N.
    pub friction: f64,
    /// N·s/m.
    pub damping: f64,
}

/// Turning of furniture about an axis through the origin of its frame; its pose is that at
/// joint position 0.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct HingeEntry {
    /// Earlier furniture on which it turns and with which it does not collide.
    pub on: String,
    /// Axis in its own frame; positive angles are right-handed.
    pub axis: [f64; 3],
    /// Largest angle, degrees.
    pub travel_deg: f64,
    /// kg.
    pub mass: f64,
    /// Centre of mass in its own frame, metres.
    pub com: [f64; 3],
    /// Ixx, Iyy, Izz about the centre of mass along its axes, kg·m².
    pub inertia: [f64; 3],
    /// Dry friction, N·m.
    pub friction: f64,
    /// N·m·s.
    pub damping: f64,
}

/// A level place for objects.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceEntry {
    /// Name within the furniture, for example `top`.
    pub name: String,
    /// Middle of the approach edge in the furniture's frame, metres.
    pub edge: [f64; 3],
    /// Direction from the edge inwards, degrees.
    pub inwards_deg: f64,
    /// Extent inwards, metres.
    pub depth: f64,
    /// Extent along the edge, metres.
    pub width: f64,
}

/// One `[[object]]` of a scene: its object file and default place.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectEntry {
    /// Unique name.
    pub name: String,
    /// Name of its file in `objects`; the object's name when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// Furniture that carries it.
    pub on: String,
    /// Surface of the furniture; its first one when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<String>,
    /// Distance from the approach edge inwards, and along the edge from its middle, metres.
    pub at: [f64; 2],
    /// Degrees, relative to the inward direction.
    #[serde(default, skip_serializing_if = "is_default")]
    pub yaw_deg: f64,
    /// Only present when a task samples it or a scenario places it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub optional: bool,
}
