//! Places the furniture of a room: rows, then pieces and groups at walls, then the middle.
//!
//! A piece is on no other piece and not on the free floor of another one. Free floors may
//! overlap each other. Doors keep the floor of their way.

use std::collections::BTreeMap;

use super::files::{Anchor, FurnitureFile, GroupPlan, PiecePlan, RoomPlan, RowPlan};
use super::geometry::{Orientation, Rect, Side};
use super::placed::{Placed, at_wall, inside_of, is_solid, local, seats, zone_before};
use super::random::Random;

/// Trials of a room, and of one entry of its plan.
const ROOM_TRIALS: usize = 30;
const TRIALS: usize = 60;
/// A piece this close to a wall is at the wall, metres.
const AT_WALL: f64 = 0.03;

/// A part of a wall that tall pieces do not cover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pane {
    /// Side of the room.
    pub side: Side,
    /// Range along the wall, metres.
    pub range: [f64; 2],
    /// Lower edge, metres.
    pub sill: f64,
}

/// A room to be furnished.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    /// Floor between the walls.
    pub inside: Rect,
    /// Windows.
    pub panes: Vec<Pane>,
    /// Floor of doors.
    pub keep: Vec<Rect>,
    /// Orientation of the plan.
    pub orientation: Orientation,
}

/// The furniture of a room, with the floor that it keeps free.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Furnished {
    /// Furniture.
    pub placed: Vec<Placed>,
    /// Free floors.
    pub zones: Vec<Rect>,
}

/// Furnishes a room.
///
/// # Errors
/// The kind of a piece that found no place in the last trial.
pub fn furnish(
    plan: &RoomPlan,
    space: &Space,
    furniture: &FurnitureFile,
    heights: &BTreeMap<String, f64>,
    random: &mut Random,
) -> Result<Furnished, String> {
    let mut failure = String::new();
    for _ in 0..ROOM_TRIALS {
        let mut work = Work {
            space,
            furniture,
            heights,
            lengths: BTreeMap::new(),
            random,
            placed: Vec::new(),
            zones: space.keep.clone(),
        };
        match work.all(plan) {
            Ok(()) => {
                return Ok(Furnished {
                    placed: work.placed,
                    zones: work.zones,
                });
            }
            Err(kind) => failure = kind,
        }
    }
    Err(failure)
}

struct Work<'a> {
    space: &'a Space,
    furniture: &'a FurnitureFile,
    heights: &'a BTreeMap<String, f64>,
    /// Depth and width of the kinds in this room.
    lengths: BTreeMap<String, [f64; 2]>,
    random: &'a mut Random,
    placed: Vec<Placed>,
    zones: Vec<Rect>,
}

impl Work<'_> {
    fn all(&mut self, plan: &RoomPlan) -> Result<(), String> {
        for row in &plan.row {
            let is_wanted = row.chance >= 1.0 || self.random.happens(row.chance);
            let found = is_wanted && self.row(row);
            if !found && row.chance >= 1.0 {
                return Err(row.pieces.first().cloned().unwrap_or_default());
            }
        }
        for at_walls in [true, false] {
            for group in &plan.group {
                if (group.anchor != Anchor::Middle) != at_walls {
                    continue;
                }
                let is_wanted = group.chance >= 1.0 || self.random.happens(group.chance);
                let found = is_wanted && self.group(group);
                if !found && group.chance >= 1.0 {
                    return Err(group.pieces.first().cloned().unwrap_or_default());
                }
            }
            for piece in &plan.piece {
                if (piece.anchor != Anchor::Middle) != at_walls {
                    continue;
                }
                let is_wanted = piece.chance >= 1.0 || self.random.happens(piece.chance);
                let found = is_wanted && self.piece(piece);
                if !found && piece.chance >= 1.0 {
                    return Err(piece.kind.clone());
                }
            }
        }
        Ok(())
    }

    /// The size of a kind: depth, width, height.
    fn size(&mut self, kind: &str) -> Option<[f64; 3]> {
        let sizes = self.furniture.kind.get(kind)?;
        if !self.lengths.contains_key(kind) {
            let depth = self.random.length(sizes.depth);
            let width = self.random.length(sizes.width);
            self.lengths.insert(kind.to_owned(), [depth, width]);
        }
        let [depth, width] = self.lengths[kind];
        Some([depth, width, self.heights.get(kind).copied()?])
    }

    fn front(&self, kind: &str) -> f64 {
        self.furniture.kind.get(kind).map_or(0.0, |k| k.front)
    }

    /// The walls of a plan entry in random order.
    fn walls(&mut self, named: &[Side]) -> Vec<Side> {
        let turn = self.space.orientation;
        let mut walls: Vec<Side> = match named.is_empty() {
            true => Side::ALL.to_vec(),
            false => named.iter().map(|side| turn.side(*side)).collect(),
        };
        self.random.shuffle(&mut walls);
        walls
    }

    /// Whether a piece may be at `rect`.
    fn is_free(&self, rect: &Rect) -> bool {
        let meets = |other: &Rect| rect.overlaps(other);
        self.space.inside.contains(rect)
            && !self.placed.iter().any(|piece| meets(&piece.rect))
            && !self.zones.iter().any(meets)
    }

    /// Whether floor is free of furniture.
    fn is_open(&self, zone: &Rect) -> bool {
        let mut placed = self.placed.iter();
        self.space.inside.contains(zone) && !placed.any(|piece| zone.overlaps(&piece.rect))
    }

    /// Whether a piece of this height would cover a window.
    fn covers(&self, side: Side, [low, high]: [f64; 2], height: f64) -> bool {
        self.space.panes.iter().any(|pane| {
            pane.side == side
                && pane.sill < height
                && low < pane.range[1] + 0.02
                && pane.range[0] - 0.02 < high
        })
    }

    /// The start along a wall of what is `width` wide: in a corner, or anywhere.
    fn start(&mut self, side: Side, width: f64, corner: bool) -> Option<f64> {
        let [low, high] = side.range(&self.space.inside);
        let last = high - width;
        if last < low {
            return None;
        }
        let first = match self.random.index(if corner { 2 } else { 4 }) {
            0 => low,
            1 => last,
            _ => self.random.length([low, last]).clamp(low, last),
        };
        Some(first)
    }

    fn row(&mut self, row: &RowPlan) -> bool {
        let mut sizes = Vec::new();
        for kind in &row.pieces {
            match self.size(kind) {
                Some(size) => sizes.push((kind.clone(), size)),
                None => return false,
            }
        }
        let width: f64 = sizes.iter().map(|(_, size)| size[1]).sum();
        let deepest = sizes.iter().map(|(_, size)| size[0]).fold(0.0, f64::max);
        for _ in 0..TRIALS {
            let Some(&side) = self.walls(&row.wall).first() else {
                return false;
            };
            if self.random.happens(0.5) {
                sizes.reverse();
            }
            let Some(start) = self.start(side, width, false) else {
                continue;
            };
            let inside = self.space.inside;
            let mut at = start;
            let mut pieces = Vec::new();
            let mut zones = Vec::new();
            let last = sizes.len() - 1;
            let mut is_good = true;
            for (index, (kind, size)) in sizes.iter().enumerate() {
                let range = [at, at + size[1]];
                at = range[1];
                let rect = side.strip(&inside, range, [0.0, size[0]]);
                let (mut from, mut until) = (range, size[0] + row.front);
                if row.beside > 0.0 && size[0] < deepest {
                    // The chair drives along the deeper neighbour.
                    until = deepest + row.front;
                    if index == 0 {
                        from[0] -= row.beside;
                    }
                    if index == last {
                        from[1] += row.beside;
                    }
                }
                let zone = side.strip(&inside, from, [size[0], until]);
                let is_window = self.covers(side, range, size[2] + head(kind));
                is_good &= self.is_free(&rect) && self.is_open(&zone) && !is_window;
                zones.push(zone);
                pieces.push(at_wall(kind, *size, rect, side));
            }
            if is_good {
                self.placed.append(&mut pieces);
                self.zones.append(&mut zones);
                return true;
            }
        }
        false
    }

    fn piece(&mut self, plan: &PiecePlan) -> bool {
        let Some(size) = self.size(&plan.kind) else {
            return false;
        };
        let front = plan.front.unwrap_or_else(|| self.front(&plan.kind));
        for _ in 0..TRIALS {
            let found = match plan.anchor {
                Anchor::Middle => self.free_standing(&plan.kind, size, front),
                Anchor::Opposite => {
                    let to = plan.to.as_deref().unwrap_or_default();
                    let mut placed = self.placed.iter().rev();
                    let faced = placed.find(|piece| piece.kind == to && piece.side.is_some());
                    let faced = faced.and_then(|piece| Some((piece.side?, piece.at)));
                    faced.and_then(|(side, at)| {
                        let along = if side.is_along_x() { at[0] } else { at[1] };
                        let off = self.random.length([-0.3, 0.3]);
                        let start = along + off - size[1] / 2.0;
                        self.against(&plan.kind, size, side.opposite(), start)
                    })
                }
                anchor => {
                    let side = self.walls(&plan.wall).first().copied();
                    side.and_then(|side| {
                        let start = self.start(side, size[1], anchor == Anchor::Corner)?;
                        self.against(&plan.kind, size, side, start)
                    })
                }
            };
            let Some(piece) = found else {
                continue;
            };
            let zone = zone_before(&piece, front);
            if self.is_free(&piece.rect) && zone.is_none_or(|zone| self.is_open(&zone)) {
                self.zones.extend(zone);
                self.placed.push(piece);
                return true;
            }
        }
        false
    }

    /// A piece at a wall, unless it covers a window.
    fn against(&self, kind: &str, size: [f64; 3], side: Side, start: f64) -> Option<Placed> {
        let range = [start, start + size[1]];
        if self.covers(side, range, size[2]) {
            return None;
        }
        let rect = side.strip(&self.space.inside, range, [0.0, size[0]]);
        Some(at_wall(kind, size, rect, side))
    }

    /// A piece away from the walls.
    fn free_standing(&mut self, kind: &str, size: [f64; 3], around: f64) -> Option<Placed> {
        let quarter = self.random.index(4);
        let extents = match quarter % 2 {
            0 => [size[0], size[1]],
            _ => [size[1], size[0]],
        };
        let inside = self.space.inside.grown(-around);
        let place = |range: [f64; 2], length: f64, random: &mut Random| {
            let half = length / 2.0;
            let ends = [range[0] + half, range[1] - half];
            (ends[0] <= ends[1]).then(|| random.length(ends))
        };
        let x = place(inside.x, extents[0], self.random)?;
        let y = place(inside.y, extents[1], self.random)?;
        Some(Placed {
            kind: kind.to_owned(),
            size,
            at: [x, y],
            yaw_deg: [0.0, 90.0, 180.0, -90.0][quarter],
            rect: Rect::about([x, y], extents),
            side: None,
        })
    }

    fn group(&mut self, group: &GroupPlan) -> bool {
        let Some((leader, followers)) = group.pieces.split_first() else {
            return false;
        };
        let Some(size) = self.size(leader) else {
            return false;
        };
        for _ in 0..TRIALS {
            let found = match group.anchor {
                Anchor::Middle => self.free_standing(leader, size, group.around),
                anchor => {
                    let side = self.walls(&group.wall).first().copied();
                    side.and_then(|side| {
                        let start = self.start(side, size[1], anchor == Anchor::Corner)?;
                        self.against(leader, size, side, start)
                    })
                }
            };
            let Some(first) = found else {
                continue;
            };
            let mut pieces = vec![first];
            for word in followers {
                self.follow(&mut pieces, word);
            }
            let solid = pieces.iter().filter(|piece| is_solid(&piece.kind));
            let is_good = solid.clone().all(|piece| self.is_free(&piece.rect));
            let Some(bounds) = solid.map(|p| p.rect).reduce(|a, b| a.around(&b)) else {
                continue;
            };
            let zone = self.zone_around(&bounds, group.around);
            if is_good && self.is_open(&zone) {
                // Later pieces keep off the zone; the group is in it.
                self.zones.push(zone);
                self.placed.append(&mut pieces);
                return true;
            }
        }
        false
    }

    /// The rectangle with free floor around it, none at the walls that it is at.
    fn zone_around(&self, rect: &Rect, around: f64) -> Rect {
        let inside = &self.space.inside;
        let grown = rect.grown(around);
        let clip = |own: [f64; 2], grown: [f64; 2], room: [f64; 2]| {
            let low = if own[0] - room[0] < AT_WALL {
                room[0]
            } else {
                grown[0]
            };
            let high = if room[1] - own[1] < AT_WALL {
                room[1]
            } else {
                grown[1]
            };
            [low, high]
        };
        Rect {
            x: clip(rect.x, grown.x, inside.x),
            y: clip(rect.y, grown.y, inside.y),
        }
    }

    /// Adds the pieces of a word such as `chair*2..4` to a group.
    fn follow(&mut self, pieces: &mut Vec<Placed>, word: &str) {
        let (kind, count) = match word.split_once('*') {
            None => (word, 1),
            Some((kind, numbers)) => {
                let (least, most) = numbers.split_once("..").unwrap_or((numbers, numbers));
                let least: usize = least.parse().unwrap_or(1);
                let most: usize = most.parse().unwrap_or(least);
                (
                    kind,
                    least + self.random.index(most.saturating_sub(least) + 1),
                )
            }
        };
        let Some(size) = self.size(kind) else {
            return;
        };
        let leader = pieces[0].clone();
        match kind {
            "chair" => {
                let mut seats = seats(&leader, size);
                self.random.shuffle(&mut seats);
                for (at, yaw_deg, [x, y]) in seats.into_iter().take(count) {
                    // Most chairs are pushed in, some are off the table and turned a little.
                    let (off, turn) = match self.random.happens(0.65) {
                        true => (0.0, 0.0),
                        false => (
                            self.random.length([0.06, 0.26]),
                            self.random.length([-9.0, 9.0]),
                        ),
                    };
                    let at = [at[0] + off * x, at[1] + off * y];
                    pieces.push(inside_of(&leader, kind, size, at, yaw_deg + turn));
                }
            }
            "coffee_table" => {
                let gap = self.random.length([0.38, 0.50]);
                let at = [
                    leader.size[0] / 2.0 + gap + size[0] / 2.0,
                    self.random.length([-0.15, 0.15]),
                ];
                pieces.push(inside_of(&leader, kind, size, at, 0.0));
            }
            "armchair" => {
                let table = pieces.iter().find(|piece| piece.kind == "coffee_table");
                let (depth, width) = table.map_or((0.5, 0.9), |t| (t.size[0], t.size[1]));
                let sign = if self.random.happens(0.5) { 1.0 } else { -1.0 };
                let at = [
                    leader.size[0] / 2.0 + 0.45 + depth / 2.0,
                    sign * (width / 2.0 + 0.40 + size[0] / 2.0),
                ];
                let turn = self.random.length([-14.0, 14.0]);
                pieces.push(inside_of(&leader, kind, size, at, turn - sign * 90.0));
            }
            "rug" => {
                let table = pieces.iter().find(|piece| piece.kind == "coffee_table");
                let at = table.map_or(leader.at, |piece| piece.at);
                let mut rug = inside_of(&leader, kind, size, [0.0; 2], 0.0);
                let [x, y] = rug.rect.size();
                rug.at = at;
                rug.rect = Rect::about(at, [x, y]);
                pieces.push(rug);
            }
            _ => {
                // At an end of the leader that is free: side tables, lamps, plants.
                let used = pieces.iter().filter(|piece| is_beside(&piece.kind)).count();
                let sign = match used {
                    0 if self.random.happens(0.5) => 1.0,
                    0 => -1.0,
                    _ => {
                        let other = pieces.iter().rev().find(|piece| is_beside(&piece.kind));
                        let at = other.map_or([0.0; 2], |piece| local(&leader, piece.at));
                        -at[1].signum()
                    }
                };
                let at = [
                    (size[0] - leader.size[0]) / 2.0,
                    sign * (leader.size[1] / 2.0 + 0.04 + size[1] / 2.0),
                ];
                pieces.push(inside_of(&leader, kind, size, at, 0.0));
            }
        }
    }
}

/// Height of the head of a bed above its mattress, metres.
fn head(kind: &str) -> f64 {
    if kind.ends_with("bed") { 0.5 } else { 0.0 }
}

/// Whether a kind is at the ends of the leader of a group.
fn is_beside(kind: &str) -> bool {
    !matches!(kind, "chair" | "coffee_table" | "armchair" | "rug")
        && !matches!(kind, "sofa" | "table" | "round_table")
}
