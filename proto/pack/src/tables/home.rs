//! Table of a home, `home.toml`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::part::is_default;
use super::place::{HandleEntry, PlaceEntry};
use super::scene::{LightEntry, ObjectEntry, RoomCameraEntry, StartEntry};

/// `home.toml`: a home in metres and degrees; x east, y north, z up, the floor at z = 0.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct HomeFile {
    /// Origin of the home.
    pub origin: String,
    /// Its license: SPDX identifier or `unknown`.
    pub license: String,
    /// Light of the home.
    pub light: LightEntry,
    /// Camera of the room; inside a room.
    pub room_camera: RoomCameraEntry,
    /// Start of the chair.
    pub start: StartEntry,
    /// Rooms; at least one.
    #[serde(default, skip_serializing_if = "is_default")]
    pub room: Vec<RoomEntry>,
    /// Walls.
    #[serde(default, skip_serializing_if = "is_default")]
    pub wall: Vec<WallEntry>,
    /// Holes in walls.
    #[serde(default, skip_serializing_if = "is_default")]
    pub opening: Vec<OpeningEntry>,
    /// Furniture.
    #[serde(default, skip_serializing_if = "is_default")]
    pub piece: Vec<PieceEntry>,
    /// Objects on the surfaces of pieces.
    #[serde(default, skip_serializing_if = "is_default")]
    pub object: Vec<ObjectEntry>,
    /// Places for objects of tasks.
    #[serde(default, skip_serializing_if = "is_default")]
    pub place: Vec<PlaceEntry>,
    /// Doors and drawers of furniture that the robot opens and closes.
    #[serde(default, skip_serializing_if = "is_default")]
    pub handle: Vec<HandleEntry>,
}

/// A room: a floor and a ceiling with an outline.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RoomEntry {
    /// Unique name: 1 to 64 letters, digits, `-` or `_`.
    pub name: String,
    /// Kind in one word, for example `kitchen`; may be empty.
    #[serde(default, skip_serializing_if = "is_default")]
    pub kind: String,
    /// Corners `[x, y]` of a polygon that does not cross itself, in either direction, metres.
    pub outline: Vec<[f64; 2]>,
    /// Material of the floor.
    pub floor_material: String,
    /// Height of the ceiling, metres.
    pub height: f64,
    /// Whether it has a ceiling.
    #[serde(default = "yes")]
    pub ceiling: bool,
    /// Material of the ceiling.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ceiling_material: Option<String>,
}

/// A straight wall with vertical sides.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct WallEntry {
    /// Start of the centre line `[x, y]`, metres.
    pub from: [f64; 2],
    /// End of the centre line `[x, y]`, metres.
    pub to: [f64; 2],
    /// Metres.
    pub thickness: f64,
    /// Height of the top at `from` above the floor, metres.
    pub height: f64,
    /// Height of the top at `to`; equal to `height` when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_height: Option<f64>,
    /// Height of its underside above the floor, metres.
    #[serde(default, skip_serializing_if = "is_default")]
    pub base: f64,
    /// Material of the side that is left of the direction from `from` to `to`.
    pub material_left: String,
    /// Material of the other side.
    pub material_right: String,
}

/// A hole in a wall.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct OpeningEntry {
    /// Index of the wall, from 0.
    pub wall: usize,
    /// Distance of its middle from the wall's `from` along the centre line, metres.
    pub at: f64,
    /// Metres.
    pub width: f64,
    /// Metres.
    pub height: f64,
    /// Height of its lower edge above the floor, metres.
    #[serde(default, skip_serializing_if = "is_default")]
    pub sill: f64,
    /// What it is for.
    pub kind: OpeningKind,
    /// Name of the piece that is its leaf.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leaf: Option<String>,
}

/// Kind of an opening.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OpeningKind {
    /// A door.
    Door,
    /// A passage without a leaf.
    Frame,
    /// A window.
    Window,
}

/// A piece of furniture: a kind at a pose.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PieceEntry {
    /// Unique name: 1 to 64 letters, digits, `-` or `_`.
    pub name: String,
    /// Name of the file in `kinds`.
    pub kind: String,
    /// Position of the kind's origin, metres.
    pub at: [f64; 3],
    /// Rotation about z, degrees.
    #[serde(default, skip_serializing_if = "is_default")]
    pub yaw_deg: f64,
    /// Name of its room.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub room: Option<String>,
    /// Area of tasks; empty elsewhere.
    #[serde(default, skip_serializing_if = "is_default")]
    pub area: String,
    /// Scale along x, y, z of the kind; 1 when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<[f64; 3]>,
    /// Whether y of the kind is reversed, before scaling.
    #[serde(default, skip_serializing_if = "is_default")]
    pub mirror: bool,
    /// Earlier piece against which its joint moves and with which it does not collide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<String>,
    /// Replaces materials of the kind: `{ from = "to" }`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub materials: BTreeMap<String, String>,
    /// Only present in variants of an area that name it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub optional: bool,
}

fn yes() -> bool {
    true
}
