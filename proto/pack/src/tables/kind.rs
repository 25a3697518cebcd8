//! Table of a furniture kind, `kinds/NAME.toml`.

use serde::{Deserialize, Serialize};

use super::object::GraspEntry;
use super::part::{PartEntry, is_default};
use super::scene::SurfaceEntry;

/// `kinds/NAME.toml`: furniture that pieces of a home copy. Its front is along x, its base at
/// z = 0.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KindFile {
    /// Category in one word, for example `table`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub category: String,
    /// Default material of its parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Coulomb coefficient; 0.6 when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// Rendered shapes; they collide when `collision` is absent. Meshes never collide.
    #[serde(default, skip_serializing_if = "is_default")]
    pub parts: Vec<PartEntry>,
    /// Colliding shapes. An empty list: nothing collides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub collision: Option<Vec<PartEntry>>,
    /// Level places for objects.
    #[serde(default, skip_serializing_if = "is_default")]
    pub surfaces: Vec<SurfaceEntry>,
    /// Makes its pieces movable against the piece that their key `on` names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<JointEntry>,
    /// Grasps of its handles, in its own frame.
    #[serde(default, skip_serializing_if = "is_default")]
    pub grasps: Vec<GraspEntry>,
}

/// Joint of a kind. The pose of a piece is that at joint position 0.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct JointEntry {
    /// Whether it turns about `axis` through the origin of the kind, as a door leaf does;
    /// otherwise it slides along `axis`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub turns: bool,
    /// Direction in its own frame: of sliding, or of the axis of positive rotation.
    pub axis: [f64; 3],
    /// Largest position of a sliding joint, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub travel: Option<f64>,
    /// Largest position of a turning joint, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub travel_deg: Option<f64>,
    /// kg.
    pub mass: f64,
    /// Centre of mass in its own frame, metres.
    pub com: [f64; 3],
    /// Ixx, Iyy, Izz about the centre of mass along its axes, kg·m².
    pub inertia: [f64; 3],
    /// Dry friction: N when it slides, N·m when it turns.
    pub friction: f64,
    /// Viscous friction: N·s/m when it slides, N·m·s/rad when it turns.
    pub damping: f64,
}
