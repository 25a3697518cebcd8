//! Reads the elements of `Home.xml`.

use std::collections::BTreeMap;

use super::attributes::Reader;
use super::{
    Baseboard, Cover, Home, Level, LightSource, MaterialChange, Piece, PieceKind, Room, Texture,
    Wall,
};
use crate::error::ImportError;
use crate::xml::Element;

/// Largest number of pieces, walls or rooms.
const MOST: usize = 20_000;
/// Largest number of corners of a room.
const MOST_CORNERS: usize = 1_000;
/// Height of walls when the file names none.
const WALL_HEIGHT: f64 = 250.0;

/// Elements without effect on a home that is driven through.
const SILENT: [&str; 12] = [
    "property",
    "furnitureVisibleProperty",
    "environment",
    "backgroundImage",
    "print",
    "compass",
    "observerCamera",
    "camera",
    "dimensionLine",
    "label",
    "level",
    "polyline",
];

/// Reads the root element.
pub(super) fn home(file: &str, root: &Element) -> Result<Home, ImportError> {
    if root.name != "home" {
        return Err(ImportError::Xml {
            file: file.to_owned(),
            reason: format!("its root is {:?}, expected \"home\"", root.name),
        });
    }
    let at = Reader {
        file,
        element: root,
    };
    let mut home = Home {
        wall_height: at.length("wallHeight")?.unwrap_or(WALL_HEIGHT),
        selected_level: at.text("selectedLevel"),
        ..Home::default()
    };
    let mut unread: BTreeMap<String, usize> = BTreeMap::new();
    for property in root.all("property") {
        let value = property.attribute("value").map(str::to_owned);
        match property.attribute("name") {
            Some("Author") => home.author = value,
            Some("License") => home.license = value,
            _ => {}
        }
    }
    for element in &root.children {
        let at = Reader { file, element };
        match element.name.as_str() {
            "level" => home.levels.push(level(&at)?),
            "wall" => home.walls.push(wall(&at)?),
            "room" => home.rooms.push(room(&at)?),
            name if SILENT.contains(&name) => {}
            _ => pieces(&at, None, true, &mut home.pieces, &mut unread)?,
        }
    }
    // Stable: levels of one elevation keep the order of the file.
    home.levels
        .sort_by(|a, b| a.elevation.total_cmp(&b.elevation));
    home.unread = unread.into_iter().collect();
    for (what, count) in [
        ("walls", home.walls.len()),
        ("rooms", home.rooms.len()),
        ("pieces", home.pieces.len()),
    ] {
        if count > MOST {
            return Err(ImportError::Unsafe {
                file: file.to_owned(),
                reason: format!("{count} {what}, at most {MOST} are read; divide the home"),
            });
        }
    }
    Ok(home)
}

fn level(at: &Reader<'_>) -> Result<Level, ImportError> {
    let id = at.text("id").unwrap_or_default();
    Ok(Level {
        name: at.text("name").unwrap_or_else(|| id.clone()),
        id,
        elevation: at.place_or_zero("elevation")?,
        height: at.length("height")?.unwrap_or(WALL_HEIGHT),
        visible: at.flag("visible", true) && at.flag("viewable", true),
    })
}

fn texture(at: &Reader<'_>) -> Result<Option<Texture>, ImportError> {
    let Some(image) = at.text("image") else {
        return Ok(None);
    };
    Ok(Some(Texture {
        image,
        width: at.length("width")?.unwrap_or(100.0),
        height: at.length("height")?.unwrap_or(100.0),
    }))
}

/// The texture among the children, with the given `attribute` when there are several.
fn texture_of(at: &Reader<'_>, attribute: Option<&str>) -> Result<Option<Texture>, ImportError> {
    for element in at.element.all("texture") {
        if attribute.is_none() || element.attribute("attribute") == attribute {
            return texture(&Reader {
                file: at.file,
                element,
            });
        }
    }
    Ok(None)
}

fn cover(at: &Reader<'_>, prefix: &str) -> Result<Cover, ImportError> {
    let shininess = at.fraction(&format!("{prefix}Shininess"))?;
    Ok(Cover {
        colour: at.colour(&format!("{prefix}Color"))?,
        texture: texture_of(at, Some(&format!("{prefix}Texture")))?,
        shininess: shininess.unwrap_or(0.0),
    })
}

fn baseboard(at: &Reader<'_>, attribute: &str) -> Result<Option<Baseboard>, ImportError> {
    for element in at.element.all("baseboard") {
        if element.attribute("attribute") == Some(attribute) {
            let at = Reader {
                file: at.file,
                element,
            };
            return Ok(Some(Baseboard {
                height: at.size("height")?,
                thickness: at.size("thickness")?,
                colour: at.colour("color")?,
            }));
        }
    }
    Ok(None)
}

fn wall(at: &Reader<'_>) -> Result<Wall, ImportError> {
    Ok(Wall {
        id: at.text("id").unwrap_or_default(),
        at_start: at.text("wallAtStart"),
        at_end: at.text("wallAtEnd"),
        from: [at.place("xStart")?, at.place("yStart")?],
        to: [at.place("xEnd")?, at.place("yEnd")?],
        thickness: at.size("thickness")?,
        height: at.length("height")?,
        height_at_end: at.length("heightAtEnd")?,
        arc_extent: at.angle("arcExtent")?,
        left: cover(at, "leftSide")?,
        right: cover(at, "rightSide")?,
        left_baseboard: baseboard(at, "leftSideBaseboard")?,
        right_baseboard: baseboard(at, "rightSideBaseboard")?,
        level: at.text("level"),
    })
}

fn room(at: &Reader<'_>) -> Result<Room, ImportError> {
    let mut points = Vec::new();
    for element in at.element.all("point") {
        let at = Reader {
            file: at.file,
            element,
        };
        points.push([at.place("x")?, at.place("y")?]);
    }
    if points.len() > MOST_CORNERS {
        return Err(ImportError::Unsafe {
            file: at.file.to_owned(),
            reason: format!(
                "a room has {} corners, at most {MOST_CORNERS} are read; draw it simpler",
                points.len()
            ),
        });
    }
    Ok(Room {
        name: at.text("name").unwrap_or_default(),
        points,
        floor: cover(at, "floor")?,
        ceiling: cover(at, "ceiling")?,
        floor_visible: at.flag("floorVisible", true),
        ceiling_visible: at.flag("ceilingVisible", true),
        level: at.text("level"),
    })
}

/// Adds a piece, or those of a group. The depth of groups is bounded by that of the XML.
fn pieces(
    at: &Reader<'_>,
    level: Option<&str>,
    shown: bool,
    all: &mut Vec<Piece>,
    unread: &mut BTreeMap<String, usize>,
) -> Result<(), ImportError> {
    let level = at.element.attribute("level").or(level);
    let shown = shown && at.flag("visible", true);
    let kind = match at.element.name.as_str() {
        "pieceOfFurniture" => PieceKind::Furniture,
        "doorOrWindow" => PieceKind::DoorOrWindow,
        "light" => PieceKind::Light,
        "furnitureGroup" => {
            for element in &at.element.children {
                let file = at.file;
                if ["property", "textStyle"].contains(&element.name.as_str()) {
                    continue;
                }
                pieces(&Reader { file, element }, level, shown, all, unread)?;
            }
            return Ok(());
        }
        other => {
            *unread.entry(other.to_owned()).or_default() += 1;
            return Ok(());
        }
    };
    let mut piece = piece(at, kind)?;
    piece.visible = shown;
    piece.level = level.map(str::to_owned);
    all.push(piece);
    Ok(())
}

fn piece(at: &Reader<'_>, kind: PieceKind) -> Result<Piece, ImportError> {
    let mut materials = Vec::new();
    let mut lights = Vec::new();
    for element in &at.element.children {
        let of = Reader {
            file: at.file,
            element,
        };
        match element.name.as_str() {
            "material" => materials.push(MaterialChange {
                name: of.text("name").unwrap_or_default(),
                colour: of.colour("color")?,
                texture: texture_of(&of, None)?,
                shininess: of.fraction("shininess")?,
            }),
            "lightSource" => lights.push(LightSource {
                at: [
                    of.place_or_zero("x")?,
                    of.place_or_zero("y")?,
                    of.place_or_zero("z")?,
                ],
                colour: of.colour("color")?,
            }),
            _ => {}
        }
    }
    Ok(Piece {
        kind,
        catalogue: at.text("catalogId").unwrap_or_default(),
        name: at.text("name").unwrap_or_default(),
        creator: at.text("creator"),
        license: at.text("license"),
        model: at.text("model"),
        at: [at.place("x")?, at.place("y")?],
        elevation: at.place_or_zero("elevation")?,
        angle: at.angle("angle")?,
        pitch: at.angle("pitch")?,
        roll: at.angle("roll")?,
        size: [at.size("width")?, at.size("depth")?, at.size("height")?],
        mirrored: at.flag("modelMirrored", false),
        rotation: at.matrix("modelRotation")?,
        back_face_shown: at.flag("backFaceShown", false),
        colour: at.colour("color")?,
        texture: texture_of(at, None)?,
        shininess: at.fraction("shininess")?,
        materials,
        lights,
        visible: true,
        cuts_floor: at.element.attribute("staircaseCutOutShape").is_some(),
        height_in_plan: at.number("heightInPlan")?.filter(|height| *height >= 0.0),
        level: None,
    })
}
