//! Pieces: kinds at poses, scaled, mirrored, with other materials.

use std::collections::BTreeMap;

use super::scaling::Scaling;
use super::{FILE, MOST_HULL_VERTICES, MOST_PARTS};
use crate::error::{PackError, Place};
use crate::{
    FurnitureEntry, HingeEntry, HomeFile, JointEntry, KindFile, PartEntry, PieceEntry, SlideEntry,
};

/// A piece as furniture.
pub(super) fn piece(
    home: &HomeFile,
    kinds: &BTreeMap<String, KindFile>,
    piece: &PieceEntry,
) -> Result<FurnitureEntry, PackError> {
    let place = Place::file(FILE).entry("piece", wheelarm_proto::check::beginning(&piece.name));
    place.key("name").name(&piece.name)?;
    let Some(kind) = kinds.get(&piece.kind) else {
        let known: Vec<&str> = kinds.keys().map(String::as_str).take(40).collect();
        return Err(place.key("kind").wrong(
            format!("{:?}", wheelarm_proto::check::beginning(&piece.kind)),
            format!("one of {}", known.join(", ")),
            "correct the name or add the file to kinds",
        ));
    };
    if let Some(room) = &piece.room
        && !home.room.iter().any(|known| known.name == *room)
    {
        return Err(place.key("room").wrong(
            format!("{:?}", wheelarm_proto::check::beginning(room)),
            "the name of a room",
            "correct the name or leave it out",
        ));
    }
    for value in piece.at {
        place
            .key("at")
            .within(value, -50.0, 50.0, "m", "positions are metres")?;
    }
    let scaling = Scaling::new(&place, piece)?;
    let kind_place = Place::file(format!("kinds/{}.toml", piece.kind));
    let scaled = |list: &str, parts: &[PartEntry]| -> Result<Vec<PartEntry>, PackError> {
        let place = kind_place.key(list);
        place.at_most(parts.len(), MOST_PARTS, "join parts")?;
        parts
            .iter()
            .enumerate()
            .map(|(i, part)| scaling.part(&kind_place.entry(list, i), part))
            .collect()
    };
    let mut parts = scaled("parts", &kind.parts)?;
    for part in &mut parts {
        part.material = part
            .material
            .take()
            .map(|name| piece.materials.get(&name).cloned().unwrap_or(name));
        if part.mesh.is_some() && kind.collision.is_none() {
            part.collide = Some(false);
        }
    }
    let collision = kind
        .collision
        .as_deref()
        .map(|collision| scaled("collision", collision))
        .transpose()?;
    let mut shapes = collision.iter().flatten().enumerate();
    if let Some((i, shape)) = shapes.find(|(_, shape)| shape.mesh.is_some()) {
        return Err(kind_place.entry("collision", i).key("mesh").wrong(
            format!(
                "{:?}",
                shape.mesh.as_ref().map_or("", |mesh| mesh.path.as_str())
            ),
            "a shape of decimal text: meshes of a pack are rendered only",
            "give `hull` with the points of its convex hull",
        ));
    }
    let (slide, hinge) = joint(&place, &kind_place, &scaling, kind, piece)?;
    let material = kind.material.clone();
    Ok(FurnitureEntry {
        name: piece.name.clone(),
        area: piece.area.clone(),
        category: kind.category.clone(),
        at: piece.at,
        yaw_deg: piece.yaw_deg,
        friction: kind.friction,
        material: material.map(|name| piece.materials.get(&name).cloned().unwrap_or(name)),
        like: None,
        parts,
        collision,
        surfaces: kind
            .surfaces
            .iter()
            .enumerate()
            .map(|(i, surface)| scaling.surface(&kind_place.entry("surfaces", i), surface))
            .collect::<Result<_, _>>()?,
        slide,
        hinge,
        grasps: kind
            .grasps
            .iter()
            .map(|grasp| scaling.grasp(grasp))
            .collect(),
        optional: piece.optional,
    })
}

/// The joint of a piece: it slides or turns on the piece that `on` names.
fn joint(
    place: &Place,
    kind_place: &Place,
    scaling: &Scaling,
    kind: &KindFile,
    piece: &PieceEntry,
) -> Result<(Option<SlideEntry>, Option<HingeEntry>), PackError> {
    let Some(joint) = &kind.joint else {
        return Ok((None, None));
    };
    let joint = scaling.joint(&kind_place.key("joint"), joint)?;
    let Some(on) = piece.on.clone() else {
        return Err(place.key("on").wrong(
            "absent",
            "the name of the piece on which its joint moves",
            "name an earlier piece",
        ));
    };
    let JointEntry {
        axis,
        mass,
        com,
        inertia,
        friction,
        damping,
        ..
    } = joint;
    let slide = joint.travel.map(|travel| SlideEntry {
        on: on.clone(),
        axis,
        travel,
        mass,
        com,
        inertia,
        friction,
        damping,
    });
    let hinge = joint.travel_deg.map(|travel_deg| HingeEntry {
        on,
        axis,
        travel_deg,
        mass,
        com,
        inertia,
        friction,
        damping,
    });
    Ok((slide, hinge))
}

/// Checks the number of points of a hull.
pub(super) fn check_hull(place: &Place, hull: &[[f64; 3]]) -> Result<(), PackError> {
    if (4..=MOST_HULL_VERTICES).contains(&hull.len()) {
        return Ok(());
    }
    Err(place.key("hull").wrong(
        format!("a list of {} points", hull.len()),
        format!("4 to {MOST_HULL_VERTICES} points"),
        "leave out points inside the hull, or split it",
    ))
}
