//! Tables of shapes, which furniture kinds and objects share.

use serde::{Deserialize, Serialize};

/// One shape; exactly one of the shape keys must be present.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PartEntry {
    /// Full lengths along x, y, z, metres.
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub cuboid: Option<[f64; 3]>,
    /// Box with rounded edges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rounded_box: Option<RoundedBoxEntry>,
    /// Cylinder about z, centred.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cylinder: Option<RoundEntry>,
    /// Capsule about z, centred; `height` is the full length, caps included.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub capsule: Option<RoundEntry>,
    /// Sphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sphere: Option<SphereEntry>,
    /// Truncated cone about z, centred.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frustum: Option<FrustumEntry>,
    /// Open cup about z, its base at z = 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cup: Option<CupEntry>,
    /// `[radius, z]` points from bottom to top; rendered only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lathe: Option<Vec<[f64; 2]>>,
    /// Polygon with a thickness; rendered only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prism: Option<PrismEntry>,
    /// Mesh file. In a pack it is rendered only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<MeshEntry>,
    /// Convex hull of 4 to [`MOST_HULL_VERTICES`](crate::MOST_HULL_VERTICES) points, metres;
    /// collides only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hull: Option<Vec<[f64; 3]>>,
    /// Position in the body, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<[f64; 3]>,
    /// Several positions: one copy each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub places: Option<Vec<[f64; 3]>>,
    /// Roll, pitch, yaw: rotations about the fixed axes x, then y, then z.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rpy_deg: Option<[f64; 3]>,
    /// Name of its material; that of the body when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Whether it is rendered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub draw: Option<bool>,
    /// Whether it collides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub collide: Option<bool>,
}

/// Box with rounded edges.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example rounded_box = { size = [0.1, 0.1, 0.2], radius = 0.01 }"
)]
pub struct RoundedBoxEntry {
    /// Full lengths along x, y, z, metres.
    pub size: [f64; 3],
    /// Radius of the rounding, metres.
    pub radius: f64,
}

/// Cylinder or capsule.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example cylinder = { radius = 0.03, height = 0.1 }"
)]
pub struct RoundEntry {
    /// Metres.
    pub radius: f64,
    /// Full length, metres.
    pub height: f64,
}

/// Sphere.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example sphere = { radius = 0.03 }"
)]
pub struct SphereEntry {
    /// Metres.
    pub radius: f64,
}

/// Truncated cone.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example frustum = { bottom_radius = 0.03, top_radius = 0.04, height = 0.1 }"
)]
pub struct FrustumEntry {
    /// Radius of the lower end, metres.
    pub bottom_radius: f64,
    /// Radius of the upper end, metres.
    pub top_radius: f64,
    /// Full height, metres.
    pub height: f64,
}

/// Open cup.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example cup = { bottom_radius = 0.03, top_radius = 0.04, height = 0.1, wall = 0.003 }"
)]
pub struct CupEntry {
    /// Outer radius at the floor, metres.
    pub bottom_radius: f64,
    /// Outer radius at the rim, metres.
    pub top_radius: f64,
    /// Outer height, metres.
    pub height: f64,
    /// Thickness, metres.
    pub wall: f64,
}

/// Polygon with a thickness: from z = 0 to z = `height`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example prism = { outline = [[0, 0], [1, 0], [0, 1]], height = 0.02 }"
)]
pub struct PrismEntry {
    /// Corners `[x, y]` of a polygon that does not cross itself, in either direction, metres.
    pub outline: Vec<[f64; 2]>,
    /// Metres.
    pub height: f64,
}

/// Mesh file.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table, for example mesh = { path = \"meshes/cup.glb\", scale = 1.0 }"
)]
pub struct MeshEntry {
    /// OBJ, glTF or GLB below the pack or the assets folder; a pack holds OBJ and GLB.
    pub path: String,
    /// Metres per unit of the file.
    #[serde(default)]
    pub scale: MeshScale,
}

/// Metres per unit of a mesh file.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(
    untagged,
    expecting = "a number of metres per unit, or one for each of x, y, z"
)]
pub enum MeshScale {
    /// Equal along all axes.
    Uniform(f64),
    /// Along x, y, z of the mesh with z up. A negative number mirrors.
    Axes([f64; 3]),
}

impl Default for MeshScale {
    fn default() -> Self {
        Self::Uniform(1.0)
    }
}

impl MeshScale {
    /// Along x, y, z.
    #[must_use]
    pub fn axes(self) -> [f64; 3] {
        match self {
            Self::Uniform(scale) => [scale; 3],
            Self::Axes(axes) => axes,
        }
    }
}

/// Whether a number is 0 or a list is empty: such keys are left out of a file.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
