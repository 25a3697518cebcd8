//! Rooms of the level: outlines without overlap, names; rooms that walls enclose where none is
//! drawn.

use std::collections::BTreeSet;

use crate::error::ImportError;
use crate::plan::{Plan, StraightWall};
use crate::polygon::{self, Point};
use crate::raster::Grid;
use crate::sh3d::Cover;
use crate::words;

/// Overlaps below this share of the smaller room are drawing errors and stay.
const OVERLAP: f64 = 0.02;
/// Side of the cells in which enclosed rooms are searched, metres.
const CELL: f64 = 0.05;
/// Least area of an enclosed room, square metres.
const LEAST_AREA: f64 = 1.5;
/// Greatest share of an enclosed area that drawn rooms cover, so that it becomes a room.
const MOST_DRAWN: f64 = 0.05;

/// A room, metres of the pack.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanRoom {
    /// Unique name.
    pub name: String,
    /// Kind in one word; empty when its name is not known.
    pub kind: String,
    /// Outline, counter-clockwise.
    pub outline: Vec<Point>,
    /// Floor.
    pub floor: Cover,
    /// Ceiling.
    pub ceiling: Cover,
    /// Whether it has a ceiling.
    pub has_ceiling: bool,
    /// Whether it is outside.
    pub is_outside: bool,
}

impl PlanRoom {
    /// Square metres.
    #[must_use]
    pub fn area(&self) -> f64 {
        polygon::area(&self.outline).abs()
    }
}

/// Gives unique names: `kitchen`, `kitchen_2`.
#[derive(Default)]
pub struct Names {
    used: BTreeSet<String>,
}

impl Names {
    /// A name from a text, or from `default` when the text has no letters.
    pub fn give(&mut self, text: &str, default: &str) -> String {
        let base = match words::slug(text, 48) {
            base if base.is_empty() => default.to_owned(),
            base => base,
        };
        if self.used.insert(base.clone()) {
            return base;
        }
        let mut number = 2;
        loop {
            let name = format!("{base}_{number}");
            if self.used.insert(name.clone()) {
                return name;
            }
            number += 1;
        }
    }
}

/// The rooms of the level, and notes on what was changed.
///
/// # Errors
/// When no room is drawn and the walls enclose none.
pub fn rooms(
    name: &str,
    plan: &Plan<'_>,
    walls: &[StraightWall],
    notes: &mut Vec<String>,
) -> Result<Vec<PlanRoom>, ImportError> {
    let mut names = Names::default();
    let mut all: Vec<PlanRoom> = Vec::new();
    // Later rooms are drawn over earlier ones, those without a floor below all.
    let mut drawn: Vec<(String, Vec<Point>, bool, usize)> = Vec::new();
    let mut skipped = 0;
    for (index, room) in plan.rooms() {
        let outline: Vec<Point> = room.points.iter().map(|&p| plan.place(p)).collect();
        let outline = polygon::cleaned(&outline, 0.002);
        if outline.len() < 3 || polygon::area(&outline).abs() < 0.05 {
            skipped += 1;
            continue;
        }
        drawn.push((room.name.clone(), outline, room.floor_visible, index));
    }
    if skipped > 0 {
        notes.push(format!("{skipped} rooms below 0.05 m² left out"));
    }
    for (order, (label, outline, has_floor, index)) in drawn.iter().enumerate() {
        let size = polygon::area(outline).abs();
        let over: Vec<&[Point]> = drawn
            .iter()
            .enumerate()
            .filter(|&(other, of)| {
                let is_over = if of.2 == *has_floor {
                    other > order
                } else {
                    of.2
                };
                other != order && is_over
            })
            .map(|(_, of)| of.1.as_slice())
            .filter(|other| {
                let least = OVERLAP * size.min(polygon::area(other).abs());
                common(outline, other) > least
            })
            .collect();
        let is_simple = is_valid(outline);
        let pieces = if over.is_empty() && is_simple {
            vec![outline.clone()]
        } else {
            polygon::joined(polygon::outside(outline, &over), is_valid)
        };
        let source = &plan.home.rooms[*index];
        if !has_floor && !over.is_empty() {
            let left: f64 = pieces.iter().map(|piece| polygon::area(piece).abs()).sum();
            notes.push(format!(
                "room {label:?} without a floor is a ceiling of {:.1} m² and left out ({left:.1} m² beside other rooms)",
                size
            ));
            continue;
        }
        let kind = words::room_kind(label);
        if !is_simple {
            notes.push(format!(
                "room {label:?} crosses or touches itself: divided into {} parts; draw it again",
                pieces.len()
            ));
        }
        for mut piece in pieces {
            if polygon::area(&piece).abs() < 0.02 {
                continue;
            }
            if !is_valid(&piece) {
                let lost = polygon::area(&piece).abs();
                notes.push(format!(
                    "{lost:.2} m² of room {label:?} left out: the outline is invalid or more than 50 m away; draw the room again"
                ));
                continue;
            }
            if polygon::area(&piece) < 0.0 {
                piece.reverse();
            }
            all.push(PlanRoom {
                name: names.give(label, if kind.is_empty() { "room" } else { kind }),
                kind: kind.to_owned(),
                outline: piece,
                floor: source.floor.clone(),
                ceiling: source.ceiling.clone(),
                has_ceiling: source.ceiling_visible && !words::is_outside(kind),
                is_outside: words::is_outside(kind),
            });
        }
    }
    let drawn = all.len();
    all.extend(enclosed(walls, &all, &mut names));
    let made = all.len() - drawn;
    if all.is_empty() {
        let [x, y] = open_end(walls);
        let name = name.to_owned();
        return Err(ImportError::NoRoom { name, x, y });
    }
    if drawn == 0 {
        notes.push(format!(
            "no room is drawn: {made} rooms made from the walls; draw rooms to name them"
        ));
    } else if made > 0 {
        notes.push(format!(
            "{made} rooms made from the walls, where walls enclose an area without a drawn room; draw rooms to name them"
        ));
    }
    Ok(all)
}

/// Whether a pack accepts an outline.
fn is_valid(outline: &[Point]) -> bool {
    let rounded: Vec<Point> = outline.iter().map(|&p| crate::build::rounded2(p)).collect();
    wheelarm_pack::check_outline("room", &rounded).is_ok()
}

/// Common area of two polygons, square metres.
fn common(a: &[Point], b: &[Point]) -> f64 {
    let (a_low, a_high) = polygon::bounds(a);
    let (b_low, b_high) = polygon::bounds(b);
    if (0..2).any(|axis| a_high[axis] <= b_low[axis] || b_high[axis] <= a_low[axis]) {
        return 0.0;
    }
    let left: f64 = polygon::outside(a, &[b])
        .iter()
        .map(|piece| polygon::area(piece).abs())
        .sum();
    polygon::area(a).abs() - left
}

/// Rooms that walls enclose and that are not among the `drawn` ones: parts of a grid that the outside does not
/// reach, openings of doors being closed.
fn enclosed(walls: &[StraightWall], drawn: &[PlanRoom], names: &mut Names) -> Vec<PlanRoom> {
    let corners: Vec<Point> = walls.iter().flat_map(StraightWall::outline).collect();
    if corners.is_empty() {
        return Vec::new();
    }
    let (low, high) = polygon::bounds(&corners);
    if high[0] - low[0] > 100.0 || high[1] - low[1] > 100.0 {
        return Vec::new();
    }
    let around = |p: Point, by: f64| p.map(|c| c + by);
    let grid = Grid::covering(around(low, -0.2), around(high, 0.2), CELL);
    let mut free = vec![true; grid.len()];
    for wall in walls
        .iter()
        .filter(|wall| wall.height.max(wall.end_height) > 1.0)
    {
        let outline = wall.outline().map(|[x, y]| [x, y, 0.0]);
        grid.cover(&outline, |cell, _| free[cell] = false);
    }
    let mut rooms = Vec::new();
    for part in grid.components(&free) {
        let size = part.len() as f64 * CELL * CELL;
        let is_open = part.first() == Some(&0);
        let is_drawn = |cell: &&usize| {
            let middle = grid.middle(**cell);
            drawn.iter().any(|r| polygon::contains(&r.outline, middle))
        };
        if is_open || size < LEAST_AREA {
            continue;
        }
        let covered = part.iter().filter(is_drawn).count();
        if covered as f64 > MOST_DRAWN * part.len() as f64 {
            continue;
        }
        let outline = trace(&grid, &part);
        if outline.len() >= 4 && polygon::is_simple(&outline) {
            rooms.push(PlanRoom {
                name: names.give("room", "room"),
                kind: String::new(),
                outline,
                floor: Cover::default(),
                ceiling: Cover::default(),
                has_ceiling: true,
                is_outside: false,
            });
        }
    }
    rooms
}

/// The outer outline of connected cells, counter-clockwise and simplified.
fn trace(grid: &Grid, part: &[usize]) -> Vec<Point> {
    let mut mask = vec![false; grid.len()];
    for &cell in part {
        mask[cell] = true;
    }
    let set = |i: isize, j: isize| {
        let inside =
            i >= 0 && j >= 0 && (i as usize) < grid.count[0] && (j as usize) < grid.count[1];
        inside && mask[grid.index(i as usize, j as usize)]
    };
    let Some(&first) = part.first() else {
        return Vec::new();
    };
    // From the lower left corner of the lowest cell along its lower side, the part on the left.
    let (i, j) = grid.place(first);
    let start = (i as isize, j as isize);
    let (mut at, mut step) = (start, (1, 0));
    let mut outline = Vec::new();
    for _ in 0..4 * grid.len() + 4 {
        outline.push(grid.low.map(|_| 0.0));
        let last = outline.len() - 1;
        outline[last] = [
            grid.low[0] + at.0 as f64 * grid.cell,
            grid.low[1] + at.1 as f64 * grid.cell,
        ];
        at = (at.0 + step.0, at.1 + step.1);
        if at == start {
            break;
        }
        // Cells ahead on the left and on the right of the step.
        let (ahead_left, ahead_right) = match step {
            (1, 0) => (set(at.0, at.1), set(at.0, at.1 - 1)),
            (0, 1) => (set(at.0 - 1, at.1), set(at.0, at.1)),
            (-1, 0) => (set(at.0 - 1, at.1 - 1), set(at.0 - 1, at.1)),
            _ => (set(at.0, at.1 - 1), set(at.0 - 1, at.1 - 1)),
        };
        step = match (ahead_left, ahead_right) {
            (false, _) => (-step.1, step.0),
            (true, false) => step,
            (true, true) => (step.1, -step.0),
        };
    }
    polygon::cleaned(&outline, 0.6 * grid.cell)
}

/// The end of a wall that is the farthest from all other walls.
fn open_end(walls: &[StraightWall]) -> Point {
    let mut best = (-1.0, [0.0, 0.0]);
    for (index, wall) in walls.iter().enumerate() {
        for end in [wall.from, wall.to] {
            let others = walls
                .iter()
                .enumerate()
                .filter(|&(other, _)| other != index);
            let gap = others.fold(f64::INFINITY, |least, (_, other)| {
                least.min(polygon::distance_to_side(end, other.from, other.to))
            });
            if gap > best.0 {
                best = (gap, end);
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(from: Point, to: Point) -> StraightWall {
        StraightWall {
            source: 0,
            from,
            to,
            thickness: 0.1,
            height: 2.5,
            end_height: 2.5,
        }
    }

    #[test]
    fn walls_enclose_rooms() {
        let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
        let mut walls: Vec<_> = (0..4)
            .map(|i| wall(corners[i], corners[(i + 1) % 4]))
            .collect();
        walls.push(wall([2.0, 0.0], [2.0, 3.0]));
        let rooms = enclosed(&walls, &[], &mut Names::default());
        assert_eq!(rooms.len(), 2);
        assert_eq!(
            (rooms[0].name.as_str(), rooms[1].name.as_str()),
            ("room", "room_2")
        );
        for room in &rooms {
            assert!((room.area() - 1.9 * 2.9).abs() < 0.6, "{}", room.area());
            assert!(room.outline.len() <= 6, "{:?}", room.outline);
        }
        // Only the area without a drawn room becomes another one.
        let other = enclosed(&walls, &rooms[..1], &mut Names::default());
        assert_eq!(other.len(), 1);
        assert_eq!(other[0].outline, rooms[1].outline);
        walls.remove(3);
        walls.remove(3);
        assert!(enclosed(&walls, &[], &mut Names::default()).is_empty());
        let [x, y] = open_end(&walls);
        assert!((x - 0.0).abs() < 0.1 && (y - 0.0).abs() < 3.2);
    }

    #[test]
    fn names_are_unique() {
        let mut names = Names::default();
        assert_eq!(names.give("Bad", "room"), "bad");
        assert_eq!(names.give("bad", "room"), "bad_2");
        assert_eq!(names.give("日本", "room"), "room");
    }
}
