//! Layout of the TOML files: one struct per table, only the keys are checked.
//!
//! Lengths are metres, angles degrees (keys ending in `_deg`), masses kg.

use std::collections::BTreeMap;

use serde::Deserialize;

/// `assets/scenes/NAME.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFile {
    pub origin: String,
    pub license: String,
    pub light: LightEntry,
    pub room_camera: RoomCameraEntry,
    pub start: StartEntry,
    #[serde(default)]
    pub furniture: Vec<FurnitureEntry>,
    #[serde(default)]
    pub object: Vec<ObjectEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LightEntry {
    pub sun_direction: [f64; 3],
    pub sun: [f64; 3],
    pub sky: [f64; 3],
    pub ground: [f64; 3],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RoomCameraEntry {
    pub at: [f64; 3],
    pub look_at: [f64; 3],
    pub horizontal_fov_deg: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StartEntry {
    pub at: [f64; 2],
    pub yaw_deg: f64,
}

/// One `[[furniture]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FurnitureEntry {
    pub name: String,
    #[serde(default)]
    pub area: String,
    /// Category, in one word.
    #[serde(default)]
    pub category: String,
    pub at: [f64; 3],
    #[serde(default)]
    pub yaw_deg: f64,
    /// Coulomb coefficient.
    pub friction: Option<f64>,
    /// Default material of its parts.
    pub material: Option<String>,
    /// Copies parts, collision, friction, area and category of an earlier entry.
    pub like: Option<String>,
    #[serde(default)]
    pub parts: Vec<PartEntry>,
    /// If given, these collide and the parts are only rendered.
    pub collision: Option<Vec<PartEntry>>,
    #[serde(default)]
    pub surfaces: Vec<SurfaceEntry>,
    /// Furniture that slides.
    pub slide: Option<SlideEntry>,
    /// Furniture that turns; instead of `slide`.
    pub hinge: Option<HingeEntry>,
    /// Grasps, in its own frame; for furniture on a joint.
    #[serde(default)]
    pub grasps: Vec<GraspEntry>,
    /// Only present in variants of an area that name it.
    #[serde(default)]
    pub optional: bool,
}

/// Sliding of furniture; its pose is that at joint position 0.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SlideEntry {
    /// Earlier furniture in which it slides and with which it does not collide.
    pub on: String,
    /// Direction in its own frame.
    pub axis: [f64; 3],
    pub travel: f64,
    pub mass: f64,
    pub com: [f64; 3],
    /// Ixx, Iyy, Izz about the centre of mass along its axes.
    pub inertia: [f64; 3],
    /// Dry friction, N.
    pub friction: f64,
    /// N·s/m.
    pub damping: f64,
}

/// Turning of furniture about an axis through the origin of its frame; its pose is that
/// at joint position 0.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HingeEntry {
    /// Earlier furniture on which it turns and with which it does not collide.
    pub on: String,
    /// Axis in its own frame; positive angles are right-handed.
    pub axis: [f64; 3],
    /// Largest angle.
    pub travel_deg: f64,
    pub mass: f64,
    pub com: [f64; 3],
    /// Ixx, Iyy, Izz about the centre of mass along its axes.
    pub inertia: [f64; 3],
    /// Dry friction, N·m.
    pub friction: f64,
    /// N·m·s.
    pub damping: f64,
}

/// One shape; exactly one of the shape keys must be present.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartEntry {
    /// Full lengths along x, y, z.
    #[serde(rename = "box")]
    pub cuboid: Option<[f64; 3]>,
    pub rounded_box: Option<RoundedBoxEntry>,
    pub cylinder: Option<RoundEntry>,
    /// `height` is the full length, caps included.
    pub capsule: Option<RoundEntry>,
    pub sphere: Option<SphereEntry>,
    pub frustum: Option<FrustumEntry>,
    pub cup: Option<CupEntry>,
    /// `[radius, z]` points from bottom to top; for visuals only.
    pub lathe: Option<Vec<[f64; 2]>>,
    pub mesh: Option<MeshEntry>,
    /// Position in the body.
    pub at: Option<[f64; 3]>,
    /// Several positions: one copy each.
    pub places: Option<Vec<[f64; 3]>>,
    /// Roll, pitch, yaw: rotations about the fixed axes x, then y, then z.
    pub rpy_deg: Option<[f64; 3]>,
    pub material: Option<String>,
    /// Whether it is rendered.
    pub draw: Option<bool>,
    /// Whether it collides.
    pub collide: Option<bool>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example rounded_box = { size = [0.1, 0.1, 0.2], radius = 0.01 }"
)]
pub(super) struct RoundedBoxEntry {
    pub size: [f64; 3],
    pub radius: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example cylinder = { radius = 0.03, height = 0.1 }"
)]
pub(super) struct RoundEntry {
    pub radius: f64,
    pub height: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example sphere = { radius = 0.03 }"
)]
pub(super) struct SphereEntry {
    pub radius: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example frustum = { bottom_radius = 0.03, top_radius = 0.04, height = 0.1 }"
)]
pub(super) struct FrustumEntry {
    pub bottom_radius: f64,
    pub top_radius: f64,
    pub height: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example cup = { bottom_radius = 0.03, top_radius = 0.04, height = 0.1, wall = 0.003 }"
)]
pub(super) struct CupEntry {
    pub bottom_radius: f64,
    pub top_radius: f64,
    pub height: f64,
    pub wall: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example mesh = { path = \"meshes/cup.glb\", scale = 1.0 }"
)]
pub(super) struct MeshEntry {
    /// OBJ, glTF or GLB below the assets folder.
    pub path: String,
    /// Metres per unit of the file.
    #[serde(default = "one")]
    pub scale: f64,
}

fn one() -> f64 {
    1.0
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SurfaceEntry {
    pub name: String,
    /// Middle of the approach edge in the furniture's frame.
    pub edge: [f64; 3],
    /// Direction from the edge inwards.
    pub inwards_deg: f64,
    pub depth: f64,
    pub width: f64,
}

/// One `[[object]]` of a scene: its object file and default place.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectEntry {
    pub name: String,
    /// Name of the file in assets/objects; the object's name when absent.
    pub kind: Option<String>,
    /// Furniture and surface that carry it.
    pub on: String,
    pub surface: Option<String>,
    /// Distance from the approach edge inwards, and along the edge from its middle.
    pub at: [f64; 2],
    #[serde(default)]
    pub yaw_deg: f64,
    /// Only present when a task samples it or a scenario places it.
    #[serde(default)]
    pub optional: bool,
}

/// `assets/objects/NAME.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectFile {
    pub origin: String,
    pub license: String,
    /// Category, in one word.
    #[serde(default)]
    pub category: String,
    /// In one word.
    #[serde(default)]
    pub colour: String,
    pub mass: f64,
    #[serde(default)]
    pub com: [f64; 3],
    /// Ixx, Iyy, Izz about the centre of mass along the body's axes.
    pub inertia: [f64; 3],
    pub friction: f64,
    pub material: Option<String>,
    #[serde(default)]
    pub parts: Vec<PartEntry>,
    pub collision: Option<Vec<PartEntry>>,
    /// Makes the object deformable: its lobes are its shape.
    pub soft: Option<SoftEntry>,
    #[serde(default)]
    pub lobes: Vec<LobeEntry>,
    #[serde(default)]
    pub grasps: Vec<GraspEntry>,
    /// Point to drink or eat from.
    pub tip: Option<[f64; 3]>,
}

/// Elasticity of a deformable.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SoftEntry {
    /// Pa.
    pub young_modulus: f64,
    pub poisson_ratio: f64,
    /// Seconds.
    pub damping: f64,
    pub tet_pitch: f64,
    pub skin_pitch: f64,
}

/// An ellipsoid of a deformable, blended with the previous ones.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LobeEntry {
    pub at: [f64; 3],
    /// Semi-axes.
    pub radii: [f64; 3],
    /// Roll, pitch, yaw: turns about the fixed axes x, then y, then z.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Blending distance to the others.
    pub blend: f64,
    pub material: String,
    /// Adds its mirror image about the plane x = 0.
    #[serde(default)]
    pub mirrored: bool,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GraspEntry {
    pub name: String,
    pub point: [f64; 3],
    pub approach: [f64; 3],
    pub closing: [f64; 3],
    pub width: f64,
    #[serde(default)]
    pub symmetric: bool,
    /// Cap of the force at each pad, N.
    pub force: Option<f64>,
    /// Only for approaches from above.
    #[serde(default)]
    pub from_above: bool,
}

/// `assets/materials/*.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialFile {
    pub origin: String,
    pub license: String,
    pub material: BTreeMap<String, MaterialEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialEntry {
    /// sRGB as `#rrggbb`.
    pub color: String,
    pub roughness: f64,
    #[serde(default)]
    pub metallic: f64,
    #[serde(default)]
    pub emission: f64,
    pub texture: Option<TextureEntry>,
    pub family: Option<crate::geometry::Family>,
    #[serde(default)]
    pub transmission: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TextureEntry {
    pub pattern: String,
    pub metres: f64,
}
