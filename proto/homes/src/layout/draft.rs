//! A layout: rooms and furniture of a plan for a seed, before it is a pack.

use std::collections::BTreeMap;

use super::files::{Catalog, FurnitureFile, PlanFile};
use super::furnish::{Furnished, Pane, Space, furnish};
use super::geometry::{Rect, Side};
use super::placed::Placed;
use super::random::Random;
use super::rejected::Rejected;
use super::rooms::{self, Rooms};

/// Trials of a layout: rooms and all their furniture.
const TRIALS: usize = 12;
/// Width of the free floor of a door, and its depth in each room, metres.
const WAY: [f64; 2] = [1.20, 1.25];
/// Depth of the free floor behind the door to the outside, metres.
const ENTRANCE: f64 = 0.90;
/// A piece that moved by this much makes another layout, metres.
const MOVED: f64 = 0.20;

/// Rooms and furniture.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Rooms.
    pub rooms: Rooms,
    /// The furniture of each room.
    pub furnished: Vec<Furnished>,
}

/// Samples the layout of a plan for a seed. It is equal on every machine.
///
/// # Errors
/// [`Rejected`] when rooms or furniture have no place.
pub fn draft(
    catalog: &Catalog,
    name: &str,
    plan: &PlanFile,
    seed: u64,
) -> Result<Layout, Rejected> {
    let mut random = Random::for_purpose(name, seed, "layout");
    let heights = heights(&catalog.furniture, &mut random);
    let mut failure = Rejected::Start;
    for _ in 0..TRIALS {
        let rooms = rooms::sample(plan, &mut random)?;
        match all(plan, &rooms, &catalog.furniture, &heights, &mut random) {
            Ok(furnished) => return Ok(Layout { rooms, furnished }),
            Err(rejected) => failure = rejected,
        }
    }
    Err(failure)
}

/// A height for each kind.
fn heights(furniture: &FurnitureFile, random: &mut Random) -> BTreeMap<String, f64> {
    let kinds = furniture.kind.iter();
    let own: BTreeMap<String, f64> = kinds
        .map(|(name, sizes)| (name.clone(), random.length(sizes.height)))
        .collect();
    let level = |(name, sizes): (&String, &super::files::KindSizes)| {
        let with = sizes.level_with.as_ref().unwrap_or(name);
        let height = own.get(with).or_else(|| own.get(name));
        (name.clone(), height.copied().unwrap_or_default())
    };
    furniture.kind.iter().map(level).collect()
}

fn all(
    plan: &PlanFile,
    rooms: &Rooms,
    furniture: &FurnitureFile,
    heights: &BTreeMap<String, f64>,
    random: &mut Random,
) -> Result<Vec<Furnished>, Rejected> {
    let mut furnished = Vec::new();
    for (index, room) in plan.room.iter().enumerate() {
        let space = space(rooms, index);
        let found = furnish(room, &space, furniture, heights, random);
        furnished.push(found.map_err(|piece| Rejected::Furniture {
            room: room.name.clone(),
            piece,
        })?);
    }
    Ok(furnished)
}

/// The free floor of a door within a room.
fn way(inside: &Rect, side: Side, at: f64, width: f64, depth: f64) -> Rect {
    let wide = width.max(WAY[0]) / 2.0;
    side.strip(inside, [at - wide, at + wide], [0.0, depth])
}

/// A room before it is furnished.
#[must_use]
pub fn space(rooms: &Rooms, room: usize) -> Space {
    let inside = rooms.shapes[room].inside();
    let mut keep = Vec::new();
    for door in &rooms.doors {
        let depth = if door.other.is_none() {
            ENTRANCE
        } else {
            WAY[1]
        };
        if door.room == room {
            keep.push(way(&inside, door.side, door.at, door.width, depth));
        } else if door.other == Some(room) {
            keep.push(way(
                &inside,
                door.side.opposite(),
                door.at,
                door.width,
                depth,
            ));
        }
    }
    let windows = rooms.windows.iter().filter(|window| window.room == room);
    Space {
        inside,
        panes: windows
            .map(|window| Pane {
                side: window.side,
                range: [
                    window.at - window.width / 2.0,
                    window.at + window.width / 2.0,
                ],
                sill: window.heights[0],
            })
            .collect(),
        keep,
        orientation: rooms.orientation,
    }
}

impl Layout {
    /// Whether it is another layout than `other`: a piece moved by 0.20 m or more, is at
    /// another wall, or is in one of them only.
    #[must_use]
    pub fn differs_from(&self, other: &Self) -> bool {
        if self.furnished.len() != other.furnished.len() {
            return true;
        }
        let mut rooms = self.furnished.iter().zip(&other.furnished);
        rooms.any(|(own, its)| {
            own.placed.len() != its.placed.len()
                || own.placed.iter().any(|piece| !is_among(piece, &its.placed))
        })
    }
}

/// Whether a piece of the same kind is at the same place.
fn is_among(piece: &Placed, others: &[Placed]) -> bool {
    others.iter().any(|other| {
        let far = (0..2).any(|i| (piece.at[i] - other.at[i]).abs() >= MOVED);
        piece.kind == other.kind && piece.side == other.side && !far
    })
}
