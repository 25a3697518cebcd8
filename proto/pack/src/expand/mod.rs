//! A home as the furniture of a scene file: the floor first, then ceilings, walls that are
//! split at their openings, and pieces. Arithmetic on `f64` that gives the same bits on every
//! machine.

mod pieces;
mod rooms;
mod scaling;
mod walls;

use std::collections::{BTreeMap, BTreeSet};

use crate::error::{PackError, Place};
use crate::{FurnitureEntry, HomeFile, KindFile, polygon};

/// Largest number of vertices of one colliding hull.
pub const MOST_HULL_VERTICES: usize = 64;
/// Largest number of rooms, walls, openings, pieces and objects, each.
const MOST_ENTRIES: usize = 4096;
/// Largest number of parts of a kind, and of its colliding shapes.
const MOST_PARTS: usize = 2048;
/// Name of the home's table, for error messages.
const FILE: &str = "home.toml";

/// The furniture of a home. The first entry is the floor.
///
/// # Errors
/// [`PackError::Value`] when a value of the home or of a kind is invalid.
pub fn expand(
    home: &HomeFile,
    kinds: &BTreeMap<String, KindFile>,
) -> Result<Vec<FurnitureEntry>, PackError> {
    check_home(home)?;
    let mut furniture = vec![rooms::floor(home)];
    furniture.extend(rooms::ceiling(home));
    furniture.extend(walls::walls(home)?);
    for piece in &home.piece {
        furniture.push(pieces::piece(home, kinds, piece)?);
    }
    let mut names = BTreeSet::new();
    for name in furniture
        .iter()
        .map(|f| &f.name)
        .chain(home.object.iter().map(|o| &o.name))
    {
        if !names.insert(name) {
            return Err(Place::file(FILE).entry("piece", name).key("name").wrong(
                format!("{name:?}, which is used twice"),
                "a unique name; `floor`, `ceiling` and `wall_0`, `wall_1`, … are taken",
                "rename one of them",
            ));
        }
    }
    Ok(furniture)
}

fn check_home(home: &HomeFile) -> Result<(), PackError> {
    let place = Place::file(FILE);
    for (list, length) in [
        ("room", home.room.len()),
        ("wall", home.wall.len()),
        ("opening", home.opening.len()),
        ("piece", home.piece.len()),
        ("object", home.object.len()),
        ("place", home.place.len()),
        ("handle", home.handle.len()),
    ] {
        place
            .key(list)
            .at_most(length, MOST_ENTRIES, "leave some out")?;
    }
    if home.room.is_empty() {
        return Err(place.key("room").wrong(
            "empty",
            "at least one room",
            "add a [[room]] with name, outline, floor_material and height",
        ));
    }
    let mut names = BTreeSet::new();
    for room in &home.room {
        let place = place.entry("room", wheelarm_proto::check::beginning(&room.name));
        place.key("name").name(&room.name)?;
        if !names.insert(&room.name) {
            return Err(place.key("name").wrong(
                "used twice",
                "a unique name",
                "rename one of the rooms",
            ));
        }
        polygon::check(&place.key("outline"), &room.outline)?;
        place
            .key("height")
            .within(room.height, 0.5, 20.0, "m", "lengths are metres")?;
    }
    let places = home.place.iter();
    let places = places.map(|entry| ("place", &entry.on, &entry.room));
    let handles = home.handle.iter();
    let handles = handles.map(|entry| ("handle", &entry.on, &entry.room));
    for (list, on, room) in places.chain(handles) {
        let place = place.entry(list, wheelarm_proto::check::beginning(on));
        let unknown = room.as_ref().filter(|room| !names.contains(room));
        if let Some(room) = unknown {
            return Err(place.key("room").wrong(
                format!("{:?}", wheelarm_proto::check::beginning(room)),
                "the name of a room",
                "correct the name or leave it out",
            ));
        }
    }
    Ok(())
}
