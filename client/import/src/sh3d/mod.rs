//! A home of Sweet Home 3D as its file describes it: centimetres, y down, angles clockwise.

mod attributes;
mod materials;
mod read;

use crate::archive::Archive;
use crate::error::ImportError;

pub use materials::{default_colour, transparency};

/// A color, sRGB.
pub type Rgb = [u8; 3];

/// A home.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Home {
    /// Its author, when the file names one.
    pub author: Option<String>,
    /// Its license as the file words it.
    pub license: Option<String>,
    /// Default height of walls.
    pub wall_height: f64,
    /// Level that was shown when the file was saved.
    pub selected_level: Option<String>,
    /// Levels from the lowest to the highest; empty when the home has one level.
    pub levels: Vec<Level>,
    /// Walls of all levels.
    pub walls: Vec<Wall>,
    /// Rooms of all levels.
    pub rooms: Vec<Room>,
    /// Furniture, doors, windows and lights of all levels; groups are resolved.
    pub pieces: Vec<Piece>,
    /// Elements that are not read, with their numbers, for example polylines.
    pub unread: Vec<(String, usize)>,
}

/// A level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Level {
    /// Identifier in the file.
    pub id: String,
    /// Name.
    pub name: String,
    /// Height of its floor.
    pub elevation: f64,
    /// Height of its rooms.
    pub height: f64,
    /// Whether it is shown.
    pub visible: bool,
}

/// An image on a wall, floor or material.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Texture {
    /// Path in the archive.
    pub image: String,
    /// Width of one repetition.
    pub width: f64,
    /// Height of one repetition.
    pub height: f64,
}

/// A side of a wall, a floor or a ceiling.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cover {
    /// Color.
    pub colour: Option<Rgb>,
    /// Image, which replaces the color.
    pub texture: Option<Texture>,
    /// 0 (matt) to 1.
    pub shininess: f64,
}

/// A baseboard of a wall.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Baseboard {
    /// Height.
    pub height: f64,
    /// Thickness.
    pub thickness: f64,
    /// Color; that of the wall when absent.
    pub colour: Option<Rgb>,
}

/// A wall.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wall {
    /// Identifier in the file.
    pub id: String,
    /// Wall that is joined at the start.
    pub at_start: Option<String>,
    /// Wall that is joined at the end.
    pub at_end: Option<String>,
    /// Start of the centre line.
    pub from: [f64; 2],
    /// End of the centre line.
    pub to: [f64; 2],
    /// Thickness.
    pub thickness: f64,
    /// Height at the start; the home's when absent.
    pub height: Option<f64>,
    /// Height at the end, of a sloping wall.
    pub height_at_end: Option<f64>,
    /// Angle of an arc, radians; 0 for a straight wall.
    pub arc_extent: f64,
    /// Left side, seen from the start in the plan.
    pub left: Cover,
    /// Right side.
    pub right: Cover,
    /// Baseboard of the left side.
    pub left_baseboard: Option<Baseboard>,
    /// Baseboard of the right side.
    pub right_baseboard: Option<Baseboard>,
    /// Level.
    pub level: Option<String>,
}

/// A room.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Room {
    /// Name, which may be empty.
    pub name: String,
    /// Corners.
    pub points: Vec<[f64; 2]>,
    /// Floor.
    pub floor: Cover,
    /// Ceiling.
    pub ceiling: Cover,
    /// Whether the floor is shown.
    pub floor_visible: bool,
    /// Whether the ceiling is shown.
    pub ceiling_visible: bool,
    /// Level.
    pub level: Option<String>,
}

/// Kinds of pieces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PieceKind {
    /// Furniture.
    #[default]
    Furniture,
    /// A door or a window.
    DoorOrWindow,
    /// A lamp.
    Light,
}

/// A change of one material of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialChange {
    /// Name in the model.
    pub name: String,
    /// New color.
    pub colour: Option<Rgb>,
    /// New image.
    pub texture: Option<Texture>,
    /// New shininess.
    pub shininess: Option<f64>,
}

/// A source of light of a lamp, in fractions of the piece's size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightSource {
    /// Position.
    pub at: [f64; 3],
    /// Color.
    pub colour: Option<Rgb>,
}

/// A piece of furniture, a door, a window or a lamp.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Piece {
    /// What it is.
    pub kind: PieceKind,
    /// Identifier in its catalogue, for example `eTeks#fridge`.
    pub catalogue: String,
    /// Name.
    pub name: String,
    /// Author of the model.
    pub creator: Option<String>,
    /// License of the model, as its catalogue words it.
    pub license: Option<String>,
    /// Path of the model in the archive.
    pub model: Option<String>,
    /// Middle in the plan.
    pub at: [f64; 2],
    /// Height of its foot above the floor.
    pub elevation: f64,
    /// Rotation, clockwise, radians.
    pub angle: f64,
    /// Rotation about its width, radians.
    pub pitch: f64,
    /// Rotation about its depth, radians.
    pub roll: f64,
    /// Width, depth, height.
    pub size: [f64; 3],
    /// Whether its model is mirrored left to right.
    pub mirrored: bool,
    /// Rotation of the model, row by row.
    pub rotation: Option<[f64; 9]>,
    /// Whether faces are shown from both sides.
    pub back_face_shown: bool,
    /// Color of the whole piece.
    pub colour: Option<Rgb>,
    /// Image on the whole piece.
    pub texture: Option<Texture>,
    /// Shininess of the whole piece.
    pub shininess: Option<f64>,
    /// Changed materials.
    pub materials: Vec<MaterialChange>,
    /// Sources of light.
    pub lights: Vec<LightSource>,
    /// Whether it is shown.
    pub visible: bool,
    /// Whether it cuts an opening into the floor of the level above.
    pub cuts_floor: bool,
    /// Height in which it is drawn when it is tilted.
    pub height_in_plan: Option<f64>,
    /// Level.
    pub level: Option<String>,
}

/// Opens the bytes of a `.sh3d` file: its home, and the archive with the models.
///
/// # Errors
/// When the bytes are not such a file, or above a limit.
pub fn open(file: &str, bytes: Vec<u8>) -> Result<(Home, Archive), ImportError> {
    let mut archive = Archive::open(file, bytes)?;
    let Some(xml) = archive.read("Home.xml")? else {
        let file = file.to_owned();
        return Err(if archive.has("Home") {
            ImportError::Serialized { file }
        } else {
            ImportError::NoHome { file }
        });
    };
    let home = parse(file, &xml)?;
    Ok((home, archive))
}

/// Reads the text of a `Home.xml`.
///
/// # Errors
/// When it is damaged, or a value is invalid.
pub fn parse(file: &str, xml: &[u8]) -> Result<Home, ImportError> {
    let root = crate::xml::parse(xml).map_err(|reason| ImportError::Xml {
        file: file.to_owned(),
        reason,
    })?;
    read::home(file, &root)
}
