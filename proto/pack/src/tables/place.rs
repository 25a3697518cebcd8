//! Tables of the places and handles of a home, `[[place]]` and `[[handle]]`.

use serde::{Deserialize, Serialize};

use super::part::is_default;

/// A strip of a surface that the robot reaches, and where the chair starts near it. The import
/// of a home writes them from its report.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PlaceEntry {
    /// Furniture that has the surface.
    pub on: String,
    /// Surface of the furniture.
    pub surface: String,
    /// Kind of the furniture, one word; its category when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// Room of the surface: in `home.toml` the name of one of its rooms, in a scene file its
    /// kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub room: Option<String>,
    /// Range of an object's middle from the approach edge inwards, metres.
    pub inwards: [f64; 2],
    /// Range of an object's middle along the edge from its middle, metres.
    pub along: [f64; 2],
    /// Free height above the surface, metres.
    pub headroom: f64,
    /// The chair does not get there from the start of the home: it starts in the room.
    #[serde(default, skip_serializing_if = "is_default")]
    pub apart: bool,
    /// Start of the chair near the place.
    pub start: StartRangesEntry,
}

/// Furniture on a joint that the robot opens and closes by its handle, and where the chair starts
/// near it. The import of a home writes them from its report.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct HandleEntry {
    /// Furniture on a joint: a door or a drawer.
    pub on: String,
    /// Kind of the furniture that carries it, one word; its category when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// Room before the handle: in `home.toml` the name of one of its rooms, in a scene file its
    /// kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub room: Option<String>,
    /// The chair does not get there from the start of the home: it starts in the room.
    #[serde(default, skip_serializing_if = "is_default")]
    pub apart: bool,
    /// Start of the chair near the handle.
    pub start: StartRangesEntry,
}

/// Ranges of a start of the chair: smallest and largest value.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct StartRangesEntry {
    /// Metres.
    pub x: [f64; 2],
    /// Metres.
    pub y: [f64; 2],
    /// Degrees.
    pub yaw_deg: [f64; 2],
}
