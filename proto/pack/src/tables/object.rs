//! Tables of object files.

use serde::{Deserialize, Serialize};

use super::part::{PartEntry, is_default};

/// `objects/NAME.toml`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectFile {
    /// Origin of the object.
    pub origin: String,
    /// Its license.
    pub license: String,
    /// Category, in one word.
    #[serde(default, skip_serializing_if = "is_default")]
    pub category: String,
    /// Its color, in one word.
    #[serde(default, skip_serializing_if = "is_default")]
    pub colour: String,
    /// kg.
    pub mass: f64,
    /// Centre of mass in its own frame, metres.
    #[serde(default)]
    pub com: [f64; 3],
    /// Ixx, Iyy, Izz about the centre of mass along the body's axes, kg·m².
    pub inertia: [f64; 3],
    /// Coulomb coefficient.
    pub friction: f64,
    /// Default material of its parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Shapes.
    #[serde(default, skip_serializing_if = "is_default")]
    pub parts: Vec<PartEntry>,
    /// If given, these collide and the parts are only rendered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub collision: Option<Vec<PartEntry>>,
    /// Makes the object deformable: its lobes are its shape.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub soft: Option<SoftEntry>,
    /// Shape of a deformable.
    #[serde(default, skip_serializing_if = "is_default")]
    pub lobes: Vec<LobeEntry>,
    /// Grasps, in its own frame.
    #[serde(default, skip_serializing_if = "is_default")]
    pub grasps: Vec<GraspEntry>,
    /// Point to drink or eat from, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip: Option<[f64; 3]>,
    /// Placement by the tasks of every home; they do not place an object without it. Objects of
    /// the assets have theirs in `stocks.toml`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stock: Option<StockEntry>,
}

/// Placement of an object of a pack by the tasks of every home.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct StockEntry {
    /// Its name in sentences.
    pub words: String,
    /// Free height that it needs with the hand above it, metres.
    pub headroom: f64,
    /// Depth of a surface that it needs, metres.
    pub depth: f64,
    /// Largest rotation from the direction inwards; 180 for round objects.
    pub yaw_deg: f64,
    /// Kinds of rooms; every room when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rooms: Option<Vec<String>>,
    /// It is placed beside other objects, and no task requests it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub scenery: bool,
    /// For tests only: no training takes it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub held_out: bool,
    /// Result of `wheelarm object check`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trials: Option<TrialsEntry>,
}

/// Lifts of an object by the scripted operator.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TrialsEntry {
    /// Trials.
    pub of: u32,
    /// Trials in which it was lifted.
    pub lifted: u32,
}

/// Elasticity of a deformable.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SoftEntry {
    /// Pa.
    pub young_modulus: f64,
    /// Below 0.5.
    pub poisson_ratio: f64,
    /// Seconds.
    pub damping: f64,
    /// Edge of the cubes of its tetrahedra, metres.
    pub tet_pitch: f64,
    /// Width of its skin's triangles, metres.
    pub skin_pitch: f64,
}

/// An ellipsoid of a deformable, blended with the previous ones.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LobeEntry {
    /// Middle, metres.
    pub at: [f64; 3],
    /// Semi-axes, metres.
    pub radii: [f64; 3],
    /// Roll, pitch, yaw: turns about the fixed axes x, then y, then z.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rpy_deg: [f64; 3],
    /// Blending distance to the others, metres.
    pub blend: f64,
    /// Name of its material.
    pub material: String,
    /// Adds its mirror image about the plane x = 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub mirrored: bool,
}

/// A grasp of an object or of a handle.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct GraspEntry {
    /// Name, for example `side`.
    pub name: String,
    /// Point between the pads in the body's frame, metres.
    pub point: [f64; 3],
    /// Unit vector of the tool's approach.
    pub approach: [f64; 3],
    /// Unit vector across the approach, in which the fingers close.
    pub closing: [f64; 3],
    /// Distance between the pads, metres.
    pub width: f64,
    /// Whether any rotation about z is possible.
    #[serde(default, skip_serializing_if = "is_default")]
    pub symmetric: bool,
    /// Cap of the force at each pad, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force: Option<f64>,
    /// Only for approaches from above.
    #[serde(default, skip_serializing_if = "is_default")]
    pub from_above: bool,
}
