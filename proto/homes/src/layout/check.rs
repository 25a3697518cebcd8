//! Checks of a plan: names that it refers to, and numbers.

use super::files::{Anchor, Catalog, CatalogError, MOST_ROOMS, PlanFile, RoomPlan};

/// Longest side of a room, metres.
const LONGEST: f64 = 15.0;
/// Shortest side of a room, metres.
const SHORTEST: f64 = 1.2;

/// Checks a plan against the furniture of the catalog.
///
/// # Errors
/// [`CatalogError::Value`] with the place and the fix.
pub fn check(catalog: &Catalog, name: &str, plan: &PlanFile) -> Result<(), CatalogError> {
    let wrong = |place: String, found: String, cure: &str| CatalogError::Value {
        file: format!("homes/plans/{name}.toml"),
        place,
        found,
        cure: cure.to_owned(),
    };
    if plan.room.is_empty() || plan.room.len() > MOST_ROOMS {
        let found = format!("{} rooms", plan.room.len());
        return Err(wrong("room".into(), found, "a plan has 1 to 12 rooms"));
    }
    let known = |word: &str| plan.room.iter().any(|room| room.name == word);
    let doors = plan.door.iter().flat_map(|door| &door.between);
    for word in std::iter::once(&plan.entrance).chain(doors) {
        if !known(word) {
            let found = format!("no room named {word:?}");
            return Err(wrong(
                "entrance, door".into(),
                found,
                "name a room of the plan",
            ));
        }
    }
    for (index, room) in plan.room.iter().enumerate() {
        let at = |key: &str| format!("room {}: {key}", room.name);
        if wheelarm_proto::keys::check_name(&room.name).is_err() {
            let found = format!("{:?} is not a name", room.name);
            return Err(wrong(
                at("name"),
                found,
                "1 to 64 letters, digits, `-` or `_`",
            ));
        }
        let is_twice = plan.room[..index]
            .iter()
            .any(|other| other.name == room.name);
        if is_twice {
            return Err(wrong(
                at("name"),
                "it is used twice".into(),
                "give each room its own name",
            ));
        }
        for range in room.size {
            let is_range = range[0] >= SHORTEST && range[0] <= range[1] && range[1] <= LONGEST;
            if !is_range {
                let found = format!("{range:?} m is not a range");
                return Err(wrong(at("size"), found, "rising lengths of 1.2 to 15 m"));
            }
        }
        let earlier = |word: &str| plan.room[..index].iter().any(|other| other.name == word);
        match &room.beside {
            None if index > 0 => {
                let cure = "every room but the first is beside an earlier one";
                return Err(wrong(at("beside"), "absent".into(), cure));
            }
            Some(beside) => {
                for word in std::iter::once(&beside.room).chain(&beside.after) {
                    if !earlier(word) {
                        let found = format!("no earlier room named {word:?}");
                        return Err(wrong(at("beside"), found, "name an earlier room"));
                    }
                }
            }
            None => {}
        }
        for (kind, key) in kinds(room) {
            let bare = kind.split('*').next().unwrap_or_default();
            if !catalog.furniture.kind.contains_key(bare) {
                let all: Vec<&str> = catalog.furniture.kind.keys().map(String::as_str).collect();
                let found = format!("no kind named {bare:?} in homes/furniture.toml");
                return Err(wrong(
                    at(key),
                    found,
                    &format!("available: {}", all.join(", ")),
                ));
            }
        }
        let mut pieces = room.piece.iter();
        if pieces.any(|piece| piece.anchor == Anchor::Opposite && piece.to.is_none()) {
            let cure = "name the kind that it faces, for example to = \"sofa\"";
            return Err(wrong(
                at("piece"),
                "anchor opposite without `to`".into(),
                cure,
            ));
        }
    }
    Ok(())
}

/// The kinds that a room names, with the key.
fn kinds(room: &RoomPlan) -> Vec<(&str, &'static str)> {
    let rows = room.row.iter().flat_map(|row| &row.pieces);
    let rows = rows.map(|kind| (kind.as_str(), "row"));
    let groups = room.group.iter().flat_map(|group| &group.pieces);
    let groups = groups.map(|kind| (kind.as_str(), "group"));
    let pieces = room
        .piece
        .iter()
        .map(|piece| (piece.kind.as_str(), "piece"));
    rows.chain(groups).chain(pieces).collect()
}
