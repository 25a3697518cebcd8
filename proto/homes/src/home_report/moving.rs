//! Which pieces to move: those whose removal lets the chair into more rooms, or the arm to
//! more surfaces.

use std::collections::BTreeMap;

use serde::Serialize;

use super::HomeReport;
use super::doors;
use super::floor::Floor;
use super::home::Home;
use super::robot::RobotFacts;
use super::rooms;
use super::surfaces;

/// Pieces that are tried: those that are in the way most often.
const TRIED: usize = 10;
/// Pieces in the report.
const NAMED: usize = 5;
/// A door counts as much as this many surfaces, and a room as this many.
const WORTH: [usize; 2] = [2, 4];

/// A piece to move.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MoveReport {
    /// Name.
    pub piece: String,
    /// Rooms entered in addition.
    pub rooms: Vec<String>,
    /// Number of doors passed in addition.
    pub doors: usize,
    /// Surfaces reached in addition, as `piece/surface`.
    pub surfaces: Vec<String>,
}

impl MoveReport {
    fn gain(&self) -> usize {
        self.surfaces.len() + WORTH[0] * self.doors + WORTH[1] * self.rooms.len()
    }
}

/// Tries to remove what is in the way, one piece at a time. The best come first.
#[must_use]
pub fn test(home: &Home, robot: &RobotFacts, report: &HomeReport) -> Vec<MoveReport> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let of_doors = report.doors.iter().filter(|door| !door.passed);
    let of_doors = of_doors.flat_map(|door| door.blocked_by.iter().map(|name| (name, 3)));
    let of_surfaces = report.surfaces.iter().filter(|s| s.strip.is_none());
    let of_surfaces = of_surfaces.flat_map(|s| s.blocked_by.iter().map(|name| (name, 1)));
    for (name, weight) in of_doors.chain(of_surfaces) {
        *counts.entry(name).or_default() += weight;
    }
    let mut pieces: Vec<(usize, usize)> = Vec::new();
    for (index, piece) in home.pieces.iter().enumerate() {
        if let Some(count) = counts.get(piece.name.as_str())
            && piece.is_movable()
        {
            pieces.push((index, *count));
        }
    }
    pieces.sort_by_key(|(index, count)| (std::cmp::Reverse(*count), *index));
    pieces.truncate(TRIED);
    let tried = pieces
        .into_iter()
        .map(|(index, _)| without(home, robot, report, index));
    let mut moves: Vec<MoveReport> = tried.filter(|m| m.gain() > 0).collect();
    moves.sort_by_key(|m| std::cmp::Reverse(m.gain()));
    moves.truncate(NAMED);
    moves
}

/// The gain of a home without one piece.
fn without(home: &Home, robot: &RobotFacts, report: &HomeReport, index: usize) -> MoveReport {
    let changed = home.without(&[index]);
    let floor = Floor::new(&changed, robot);
    let rooms = rooms::test(&changed, &floor).into_iter().zip(&report.rooms);
    let rooms = rooms.filter(|(now, before)| now.entered && !before.entered && !now.outdoors);
    let doors = doors::test(&changed, &floor).into_iter().zip(&report.doors);
    let doors = doors.filter(|(now, before)| now.passed && !before.passed);
    let mut gained = Vec::new();
    for surface in &changed.surfaces {
        let piece = &home.pieces[surface.piece].name;
        let is_new = report.surfaces.iter().any(|before| {
            before.strip.is_none() && before.piece == *piece && before.surface == surface.name
        });
        if is_new
            && surfaces::test(&changed, &floor, robot, surface)
                .strip
                .is_some()
        {
            gained.push(format!("{piece}/{}", surface.name));
        }
    }
    MoveReport {
        piece: home.pieces[index].name.clone(),
        rooms: rooms.map(|(now, _)| now.name).collect(),
        doors: doors.count(),
        surfaces: gained,
    }
}
