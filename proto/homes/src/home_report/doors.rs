//! Clear widths of doors, and which of them the chair passes.

use serde::Serialize;
use wheelarm_planning::floor_space::Passage;
use wheelarm_proto::exact;

use super::floor::Floor;
use super::home::{Home, Opening, OpeningKind, Owner, Solid};

/// Clear width of doors by DIN 18040-2, metres: in a home that is barrier-free, and in one
/// for wheelchairs.
pub const DIN_DOORS: [f64; 2] = [0.80, 0.90];

/// Pieces this near to a wall may block its door, metres.
const BEFORE: f64 = 0.6;
/// Obstacles count between these heights, metres.
const HEIGHTS: [f64; 2] = [0.03, 1.9];
/// Rooms are looked for this far from the wall, metres.
const BESIDE: f64 = 0.25;
/// Two openings with their middles this close are one, metres.
const SAME: f64 = 0.1;
/// Rounding of widths, metres.
const ROUNDING: f64 = 1e-6;

/// A door in the report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DoorReport {
    /// Rooms on its sides; `outside` where there is none.
    pub between: [String; 2],
    /// Whether it has a door, or is an opening only.
    pub kind: &'static str,
    /// Middle, in `house`, metres.
    pub at: [f64; 2],
    /// Width of the opening in the wall, metres.
    pub opening: f64,
    /// Clear width, metres.
    pub clear_width: f64,
    /// Whether a leaf closes it: doors to the outside. They are not counted.
    pub closed: bool,
    /// Whether the chair drives through.
    pub passed: bool,
    /// Clear width of a barrier-free home by DIN 18040-2, 0.80 m.
    pub din_barrier_free: bool,
    /// Clear width for wheelchairs by DIN 18040-2, 0.90 m.
    pub din_wheelchair: bool,
    /// Names of pieces in or before the door.
    pub blocked_by: Vec<String>,
}

/// Tests every opening that a chair could drive through.
#[must_use]
pub fn test(home: &Home, floor: &Floor) -> Vec<DoorReport> {
    let solids: Vec<&Solid> = home.solids.iter().filter(|solid| counts(solid)).collect();
    let outlines: Vec<_> = solids.iter().map(|solid| solid.outline).collect();
    let places = floor.driven.places();
    let passages = passages(home);
    let door = |opening: &Opening| {
        let mut passage = Passage {
            centre: opening.centre,
            along: opening.along,
            width: opening.width,
            half_depth: opening.thickness / 2.0,
        };
        let clear_width = passage.gap(&outlines).width;
        passage.half_depth += BEFORE;
        let mut blocked_by: Vec<String> = Vec::new();
        for index in passage.gap(&outlines).blockers {
            let Owner::Piece(piece) = solids[index].owner else {
                continue;
            };
            let piece = &home.pieces[piece];
            // A leaf that closes a door is reported, its frame is not.
            let is_frame = clear_width > 0.0 && piece.is_of_opening();
            if !is_frame && !blocked_by.contains(&piece.name) {
                blocked_by.push(piece.name.clone());
            }
        }
        let mut places = places.iter();
        // A corner of the chair gets into a door that is too narrow; its driven axle does not
        // get to the middle of the wall.
        let passed = places.any(|place| {
            let [along, across] = opening.offset(place.at).map(f64::abs);
            along <= opening.width / 2.0 && across <= floor.driven.side() / 2.0 + ROUNDING
        });
        let side = |sign: f64| {
            let away = sign * (opening.thickness / 2.0 + BESIDE);
            let [x, y] = opening.along;
            let at = [opening.centre[0] - y * away, opening.centre[1] + x * away];
            let room = home.room_at(at).map(|room| home.rooms[room].name.clone());
            room.unwrap_or_else(|| "outside".to_owned())
        };
        DoorReport {
            between: [side(1.0), side(-1.0)],
            kind: match opening.kind {
                OpeningKind::Door => "door",
                OpeningKind::Frame => "opening",
                OpeningKind::Window => "French window",
            },
            at: opening.centre,
            opening: opening.width,
            clear_width,
            closed: opening.closed,
            passed,
            din_barrier_free: clear_width >= DIN_DOORS[0] - ROUNDING,
            din_wheelchair: clear_width >= DIN_DOORS[1] - ROUNDING,
            blocked_by,
        }
    };
    passages.into_iter().map(door).collect()
}

/// The openings that a chair could drive through. Of two at one place, a frame with a door of
/// its own, the first counts.
fn passages(home: &Home) -> Vec<&Opening> {
    let mut found: Vec<&Opening> = Vec::new();
    for opening in home.openings.iter().filter(|opening| opening.is_passage()) {
        let is_same = |other: &&Opening| {
            let [along, across] = other.offset(opening.centre).map(f64::abs);
            along < SAME && across < SAME && other.closed == opening.closed
        };
        if !found.iter().any(is_same) {
            found.push(opening);
        }
    }
    found
}

/// Whether a solid counts for the width of a door.
pub(super) fn counts(solid: &Solid) -> bool {
    solid.heights[0] < HEIGHTS[1] && solid.heights[1] > HEIGHTS[0]
}

impl DoorReport {
    /// Distance of its middle from a point, metres.
    #[must_use]
    pub fn distance(&self, [x, y]: [f64; 2]) -> f64 {
        exact::hypot(self.at[0] - x, self.at[1] - y)
    }
}
