//! The data of own homes: plans, styles and sizes of furniture, in `assets/homes`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use wheelarm_pack::MaterialEntry;

use super::geometry::Side;
use crate::asset_file::{self, AssetFileError};

/// Largest number of rooms of a plan.
pub const MOST_ROOMS: usize = 12;

/// `homes/plans/NAME.toml`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PlanFile {
    /// Origin of the plan.
    pub origin: String,
    /// Its license.
    pub license: String,
    /// Title in a few words.
    pub title: String,
    /// Whether it is for tests only: no policy is trained in it.
    #[serde(default)]
    pub held_out: bool,
    /// The room with the door to the outside.
    pub entrance: String,
    /// Rooms; the first is placed first.
    pub room: Vec<RoomPlan>,
    /// Further doors.
    #[serde(default)]
    pub door: Vec<DoorPlan>,
}

/// A room of a plan.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct RoomPlan {
    /// Unique name.
    pub name: String,
    /// Kind, one word; by default the name without its number.
    #[serde(default)]
    pub kind: String,
    /// Ranges of the lengths along x and y, metres.
    pub size: [[f64; 2]; 2],
    /// Its place beside an earlier room; absent for the first.
    pub beside: Option<Beside>,
    /// Furniture in rows along walls.
    #[serde(default)]
    pub row: Vec<RowPlan>,
    /// Single pieces of furniture.
    #[serde(default)]
    pub piece: Vec<PiecePlan>,
    /// Furniture around a first piece.
    #[serde(default)]
    pub group: Vec<GroupPlan>,
}

impl RoomPlan {
    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> &str {
        if self.kind.is_empty() {
            let digits = |c: char| c.is_ascii_digit() || c == '_';
            self.name.trim_end_matches(digits)
        } else {
            &self.kind
        }
    }
}

/// Place of a room beside an earlier one.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Beside {
    /// The earlier room.
    pub room: String,
    /// The side of it.
    pub wall: Side,
    /// Place along that wall.
    #[serde(default)]
    pub at: Align,
    /// A room at the same wall after which it begins, instead of `at`.
    pub after: Option<String>,
    /// Whether it ends where the earlier room ends; its size must allow that.
    #[serde(default)]
    pub fill: bool,
    /// Range of the width of the door, metres; without it there is none.
    pub door: Option<[f64; 2]>,
}

/// Place of a room along the wall of an earlier one.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Align {
    /// At the end with the smaller coordinate.
    Start,
    /// At the other end.
    End,
    /// Anywhere.
    #[default]
    Any,
}

/// A further door.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct DoorPlan {
    /// Two rooms that touch.
    pub between: [String; 2],
    /// Range of the width, metres.
    pub width: [f64; 2],
}

/// Furniture in a row along a wall.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct RowPlan {
    /// Walls that it may be at; absent: all.
    #[serde(default)]
    pub wall: Vec<Side>,
    /// Kinds in their order; the order may be reversed.
    pub pieces: Vec<String>,
    /// Floor that stays free before it, metres.
    pub front: f64,
    /// Least free floor beside its ends, metres: before a bedside table the chair needs more
    /// than its width.
    #[serde(default)]
    pub beside: f64,
    /// Probability; below 1 a row without room is left out.
    #[serde(default = "always")]
    pub chance: f64,
}

/// A single piece.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PiecePlan {
    /// Its kind.
    pub kind: String,
    /// Where it is.
    #[serde(default)]
    pub anchor: Anchor,
    /// Walls that it may be at; absent: all.
    #[serde(default)]
    pub wall: Vec<Side>,
    /// Floor that stays free before it; that of its kind when absent, metres.
    pub front: Option<f64>,
    /// The kind of an earlier piece that it faces, with the anchor `opposite`.
    pub to: Option<String>,
    /// Probability; below 1 a piece without room is left out.
    #[serde(default = "always")]
    pub chance: f64,
}

/// Where furniture is in its room.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Anchor {
    /// At a wall.
    #[default]
    Wall,
    /// In a corner.
    Corner,
    /// Across the room from another piece, facing it.
    Opposite,
    /// Away from walls.
    Middle,
}

/// Furniture around a first piece.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct GroupPlan {
    /// Kinds; `chair*2..4` is a number of them. The first is the leader.
    pub pieces: Vec<String>,
    /// Where the leader is.
    #[serde(default)]
    pub anchor: Anchor,
    /// Walls that it may be at; absent: all.
    #[serde(default)]
    pub wall: Vec<Side>,
    /// Floor that stays free around it, metres.
    pub around: f64,
    /// Probability; below 1 a group without room is left out.
    #[serde(default = "always")]
    pub chance: f64,
}

fn always() -> f64 {
    1.0
}

/// `homes/styles/NAME.toml`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct StyleFile {
    /// Origin of the style.
    pub origin: String,
    /// Its license.
    pub license: String,
    /// Title in a few words.
    pub title: String,
    /// Whether it is for tests only: no policy is trained in it.
    #[serde(default)]
    pub held_out: bool,
    /// Fronts of cabinets.
    pub front: Front,
    /// Handles of cabinets.
    pub handle: Handle,
    /// Legs of tables and seats.
    pub legs: Legs,
    /// Colors of walls; rooms sample from them.
    pub walls: Vec<String>,
    /// Materials by their role.
    pub material: BTreeMap<String, MaterialEntry>,
}

/// Design of fronts.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Front {
    /// A plain panel.
    Plain,
    /// A panel in a frame.
    Framed,
    /// Narrow upright boards.
    Boards,
}

/// Design of handles.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Handle {
    /// A round bar on two posts.
    Bar,
    /// A knob.
    Knob,
    /// A strip along the upper edge.
    Strip,
}

/// Design of legs.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Legs {
    /// Square ones.
    Square,
    /// Cylinders.
    Round,
    /// Cones that narrow downwards.
    Tapered,
}

/// `homes/furniture.toml`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct FurnitureFile {
    /// Origin of the sizes.
    pub origin: String,
    /// Their license.
    pub license: String,
    /// Kinds by name.
    pub kind: BTreeMap<String, KindSizes>,
}

/// Sizes of a kind of furniture.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct KindSizes {
    /// Category, one word.
    pub category: String,
    /// Range of the length from back to front, metres.
    pub depth: [f64; 2],
    /// Range of the length from side to side, metres.
    pub width: [f64; 2],
    /// Range of the height, metres.
    pub height: [f64; 2],
    /// The kind whose height it has: worktops of a kitchen are level.
    pub level_with: Option<String>,
    /// Floor that stays free before it, metres.
    #[serde(default)]
    pub front: f64,
}

/// Plans, styles and sizes of furniture.
#[derive(Clone, Debug, PartialEq)]
pub struct Catalog {
    /// Plans by name.
    pub plans: BTreeMap<String, PlanFile>,
    /// Styles by name.
    pub styles: BTreeMap<String, StyleFile>,
    /// Sizes of furniture.
    pub furniture: FurnitureFile,
}

/// Data of own homes that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CatalogError {
    /// A file or folder cannot be read, or a file is malformed.
    #[error(transparent)]
    File(#[from] AssetFileError),
    /// A value is invalid.
    #[error("{file}: {place}: {found}; {cure}")]
    Value {
        /// File.
        file: String,
        /// Table and key.
        place: String,
        /// What is wrong.
        found: String,
        /// The fix.
        cure: String,
    },
    /// An unknown plan or style.
    #[error("no {what} named {name:?}; available: {known}")]
    Unknown {
        /// `plan` or `style`.
        what: &'static str,
        /// The name.
        name: String,
        /// Known names.
        known: String,
    },
}

impl Catalog {
    /// Reads `homes` below the assets folder.
    ///
    /// # Errors
    /// [`CatalogError`] with the file and the fix.
    pub fn read(assets: &Path) -> Result<Self, CatalogError> {
        let folder = assets.join("homes");
        Ok(Self {
            plans: all(&folder.join("plans"))?,
            styles: all(&folder.join("styles"))?,
            furniture: asset_file::table(&folder.join("furniture.toml"))?,
        })
    }

    /// The plan of a name.
    ///
    /// # Errors
    /// [`CatalogError::Unknown`].
    pub fn plan(&self, name: &str) -> Result<&PlanFile, CatalogError> {
        self.plans
            .get(name)
            .ok_or_else(|| unknown("plan", name, self.plans.keys()))
    }

    /// The style of a name.
    ///
    /// # Errors
    /// [`CatalogError::Unknown`].
    pub fn style(&self, name: &str) -> Result<&StyleFile, CatalogError> {
        self.styles
            .get(name)
            .ok_or_else(|| unknown("style", name, self.styles.keys()))
    }
}

fn unknown<'a>(
    what: &'static str,
    name: &str,
    known: impl Iterator<Item = &'a String>,
) -> CatalogError {
    let known: Vec<&str> = known.map(String::as_str).collect();
    CatalogError::Unknown {
        what,
        name: name.to_owned(),
        known: known.join(", "),
    }
}

/// All TOML files of a folder by their names.
fn all<T: DeserializeOwned>(folder: &Path) -> Result<BTreeMap<String, T>, CatalogError> {
    let failed = |source| AssetFileError::Read {
        path: folder.to_owned(),
        source,
    };
    let mut tables = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let is_toml = path.extension().is_some_and(|ending| ending == "toml");
        let stem = path.file_stem().map(|stem| stem.to_string_lossy());
        if let (true, Some(stem)) = (is_toml, stem) {
            tables.insert(stem.into_owned(), asset_file::table(&path)?);
        }
    }
    Ok(tables)
}
