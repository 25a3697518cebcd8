//! Walls between the rooms of a layout, with the holes of doors and windows.

use std::collections::BTreeSet;

use wheelarm_pack::{OpeningEntry, OpeningKind, WallEntry};

use super::geometry::Side;
use super::rooms::{Doorway, RoomShape, Rooms, WALL, Window};

/// Height of doors, metres.
pub const DOOR: f64 = 2.06;

/// A wall between two rooms, or a room and the outside.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Wall {
    is_along_x: bool,
    /// Coordinate across the wall, and its range along it, centimetres.
    line: i32,
    range: [i32; 2],
    /// Rooms on its left, looking towards rising coordinates, and on its right.
    rooms: [Option<usize>; 2],
}

/// Materials of the walls of a layout.
pub struct WallMaterials<'a> {
    /// Of each room.
    pub rooms: &'a [String],
    /// Of the outside.
    pub outside: &'a str,
}

/// Walls and openings. `leaf` is the name of the piece that closes a door to the outside.
#[must_use]
pub fn build(
    rooms: &Rooms,
    height: f64,
    materials: &WallMaterials<'_>,
    leaf: &str,
) -> (Vec<WallEntry>, Vec<OpeningEntry>) {
    let walls = walls(&rooms.shapes);
    let entries = walls.iter().map(|wall| {
        let point = |along: i32| {
            let (along, line) = (f64::from(along) / 100.0, f64::from(wall.line) / 100.0);
            if wall.is_along_x {
                [along, line]
            } else {
                [line, along]
            }
        };
        let material = |room: Option<usize>| match room {
            Some(room) => materials.rooms[room].clone(),
            None => materials.outside.to_owned(),
        };
        WallEntry {
            from: point(wall.range[0]),
            to: point(wall.range[1]),
            thickness: WALL,
            height,
            end_height: None,
            base: 0.0,
            material_left: material(wall.rooms[0]),
            material_right: material(wall.rooms[1]),
        }
    });
    let mut openings = Vec::new();
    for door in &rooms.doors {
        if let Some((wall, at)) = find(&walls, &rooms.shapes[door.room], door.side, door.at) {
            openings.push(of_door(door, wall, at, leaf));
        }
    }
    for window in &rooms.windows {
        if let Some((wall, at)) = find(&walls, &rooms.shapes[window.room], window.side, window.at) {
            openings.push(of_window(window, wall, at));
        }
    }
    (entries.collect(), openings)
}

fn of_door(door: &Doorway, wall: usize, at: f64, leaf: &str) -> OpeningEntry {
    let is_closed = door.other.is_none();
    OpeningEntry {
        wall,
        at,
        width: door.width,
        height: DOOR,
        sill: 0.0,
        kind: if is_closed {
            OpeningKind::Door
        } else {
            OpeningKind::Frame
        },
        leaf: is_closed.then(|| leaf.to_owned()),
    }
}

fn of_window(window: &Window, wall: usize, at: f64) -> OpeningEntry {
    OpeningEntry {
        wall,
        at,
        width: window.width,
        height: window.heights[1],
        sill: window.heights[0],
        kind: OpeningKind::Window,
        leaf: None,
    }
}

/// The wall at a place of a side of a room, and the distance from its start.
fn find(walls: &[Wall], room: &RoomShape, side: Side, at: f64) -> Option<(usize, f64)> {
    let across = usize::from(side.is_along_x());
    let end = usize::from(matches!(side, Side::North | Side::East));
    let line = room.sides[across][end];
    let index = walls.iter().position(|wall| {
        let [low, high] = wall.range.map(|end| f64::from(end) / 100.0);
        wall.is_along_x == side.is_along_x() && wall.line == line && low < at && at < high
    })?;
    let from = f64::from(walls[index].range[0]) / 100.0;
    Some((index, ((at - from) * 1e4).round() / 1e4))
}

/// The walls around all rooms: each has one room, or none, on either side.
fn walls(shapes: &[RoomShape]) -> Vec<Wall> {
    let mut walls: Vec<Wall> = Vec::new();
    for is_along_x in [true, false] {
        let (along, across) = if is_along_x { (0, 1) } else { (1, 0) };
        let lines: BTreeSet<i32> = shapes.iter().flat_map(|s| s.sides[across]).collect();
        for line in lines {
            let beside = |shape: &&RoomShape| shape.sides[across].contains(&line);
            let ends = shapes.iter().filter(beside).flat_map(|s| s.sides[along]);
            let ends: Vec<i32> = ends.collect::<BTreeSet<_>>().into_iter().collect();
            for pair in ends.windows(2) {
                let range = [pair[0], pair[1]];
                // The room that ends at the line, and the one that begins there.
                let room = |end: usize| {
                    let mut all = shapes.iter();
                    all.position(|s| {
                        let [low, high] = s.sides[along];
                        s.sides[across][end] == line && low <= range[0] && range[1] <= high
                    })
                };
                let (below, above) = (room(1), room(0));
                if below.is_none() && above.is_none() {
                    continue;
                }
                // Looking along x, larger y is on the left; looking along y, smaller x.
                let rooms = if is_along_x {
                    [above, below]
                } else {
                    [below, above]
                };
                let wall = Wall {
                    is_along_x,
                    line,
                    range,
                    rooms,
                };
                match walls.last_mut() {
                    Some(last)
                        if last.is_along_x == is_along_x
                            && last.line == line
                            && last.range[1] == range[0]
                            && last.rooms == rooms =>
                    {
                        last.range[1] = range[1];
                    }
                    _ => walls.push(wall),
                }
            }
        }
    }
    walls
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_share_one_wall() {
        let shape = |plan, sides| RoomShape { plan, sides };
        let shapes = [
            shape(0, [[0, 400], [0, 300]]),
            shape(1, [[400, 700], [0, 200]]),
        ];
        let walls = walls(&shapes);
        let shared: Vec<_> = walls
            .iter()
            .filter(|wall| wall.rooms.iter().all(Option::is_some))
            .collect();
        assert_eq!(shared.len(), 1);
        assert_eq!((shared[0].line, shared[0].range), (400, [0, 200]));
        assert_eq!(shared[0].rooms, [Some(0), Some(1)]);
        // South walls of both rooms, north walls of both, west, east, shared, and the rest of
        // the east side of the first.
        assert_eq!(walls.len(), 8);
    }
}
