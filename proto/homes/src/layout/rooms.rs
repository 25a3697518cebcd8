//! Rooms of a layout: their rectangles, doors between them and windows, sampled from a plan.
//!
//! Rooms are rectangles between the middles of their walls, in whole centimetres, so that
//! sides of neighbours coincide exactly.

use super::files::{Align, Beside, PlanFile};
use super::geometry::{Orientation, Rect, Side};
use super::random::Random;
use super::rejected::Rejected;

/// Thickness of walls, metres.
pub const WALL: f64 = 0.12;
/// Trials of the rooms of one layout.
const TRIALS: usize = 200;
/// A side this close to another one is moved onto it, centimetres.
const SNAP: i32 = 40;
/// A size may leave its range by this much to meet another side, centimetres.
const GIVE: i32 = 15;
/// Least wall on either side of a door, metres.
const JAMB: f64 = 0.20;
/// Distance of a door from the next corner when it is near one, metres.
const NEAR_CORNER: [f64; 2] = [0.20, 0.45];

/// A room of a layout.
#[derive(Clone, Debug, PartialEq)]
pub struct RoomShape {
    /// Index of its plan.
    pub plan: usize,
    /// Smallest and largest x and y of the middles of its walls, centimetres.
    pub sides: [[i32; 2]; 2],
}

impl RoomShape {
    /// The rectangle between the middles of its walls, metres.
    #[must_use]
    pub fn outline(&self) -> Rect {
        let [x, y] = self.sides.map(|side| side.map(|at| f64::from(at) / 100.0));
        Rect { x, y }
    }

    /// The floor between its walls.
    #[must_use]
    pub fn inside(&self) -> Rect {
        self.outline().grown(-WALL / 2.0)
    }

    /// Area, square centimetres.
    fn area(&self) -> i64 {
        let [x, y] = self.sides.map(|[low, high]| i64::from(high - low));
        x * y
    }
}

/// A door between two rooms, or from a room to the outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Doorway {
    /// Index of a room.
    pub room: usize,
    /// The side of that room.
    pub side: Side,
    /// Index of the other room; `None` for the outside.
    pub other: Option<usize>,
    /// Middle along the wall, metres.
    pub at: f64,
    /// Width of the opening, metres.
    pub width: f64,
}

/// A window.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// Index of the room.
    pub room: usize,
    /// Side of the room.
    pub side: Side,
    /// Middle along the wall, metres.
    pub at: f64,
    /// Width, metres.
    pub width: f64,
    /// Height of its lower edge above the floor, and its height, metres.
    pub heights: [f64; 2],
}

/// The rooms of a layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Rooms {
    /// Orientation of the plan.
    pub orientation: Orientation,
    /// Rooms in the order of the plan.
    pub shapes: Vec<RoomShape>,
    /// Doors.
    pub doors: Vec<Doorway>,
    /// Windows.
    pub windows: Vec<Window>,
}

/// Samples the rooms of a plan.
///
/// # Errors
/// [`Rejected::Rooms`] when no trial meets the plan.
pub fn sample(plan: &PlanFile, random: &mut Random) -> Result<Rooms, Rejected> {
    let mut failure = String::new();
    for _ in 0..TRIALS {
        match trial(plan, random) {
            Ok(rooms) => return Ok(rooms),
            Err(room) => failure = room,
        }
    }
    Err(Rejected::Rooms { room: failure })
}

/// One trial; the error is the name of the room without a place.
fn trial(plan: &PlanFile, random: &mut Random) -> Result<Rooms, String> {
    let mut shapes: Vec<RoomShape> = Vec::new();
    for (index, room) in plan.room.iter().enumerate() {
        let failed = || room.name.clone();
        let size = room.size.map(|range| centimetres(random.length(range)));
        let limits = room.size.map(|range| range.map(centimetres));
        let sides = match &room.beside {
            None => size.map(|length| [0, length]),
            Some(beside) => {
                let find = |name: &str| plan.room.iter().position(|room| room.name == name);
                let base = find(&beside.room).and_then(|at| shapes.get(at));
                let after = beside.after.as_deref().and_then(find);
                let after = after.and_then(|at| shapes.get(at));
                let base = base.ok_or_else(failed)?;
                attach(beside, base, after, size, limits, random).ok_or_else(failed)?
            }
        };
        let sides = match room.beside {
            None => sides,
            Some(ref beside) => snapped(sides, beside.wall, limits, &shapes),
        };
        let shape = RoomShape { plan: index, sides };
        let meets = |other: &RoomShape| {
            (0..2).all(|axis| {
                let (a, b) = (shape.sides[axis], other.sides[axis]);
                a[0] < b[1] && b[0] < a[1]
            })
        };
        if shapes.iter().any(meets) {
            return Err(failed());
        }
        shapes.push(shape);
    }
    let orientation = Orientation {
        mirrored: random.happens(0.5),
        quarters: random.index(4),
    };
    for shape in &mut shapes {
        let corner = |end: usize| orientation.point([shape.sides[0][end], shape.sides[1][end]]);
        let (a, b) = (corner(0), corner(1));
        shape.sides = [0, 1].map(|axis| [a[axis].min(b[axis]), a[axis].max(b[axis])]);
    }
    centre(&mut shapes);
    let mut rooms = Rooms {
        orientation,
        shapes,
        doors: Vec::new(),
        windows: Vec::new(),
    };
    doors(plan, &mut rooms, random)?;
    windows(plan, &mut rooms, random);
    Ok(rooms)
}

fn centimetres(length: f64) -> i32 {
    (length * 100.0).round() as i32
}

/// The sides of a room beside `base`; `None` when it does not fit there.
fn attach(
    beside: &Beside,
    base: &RoomShape,
    after: Option<&RoomShape>,
    size: [i32; 2],
    limits: [[i32; 2]; 2],
    random: &mut Random,
) -> Option<[[i32; 2]; 2]> {
    let along = usize::from(!beside.wall.is_along_x());
    let across = 1 - along;
    let mut sides = [[0; 2]; 2];
    sides[across] = match beside.wall {
        Side::North | Side::East => {
            let line = base.sides[across][1];
            [line, line + size[across]]
        }
        Side::South | Side::West => {
            let line = base.sides[across][0];
            [line - size[across], line]
        }
    };
    let [low, high] = base.sides[along];
    let start = match (after, beside.at) {
        (Some(room), _) => room.sides[along][1],
        (None, Align::Start) => low,
        (None, Align::End) => high - size[along],
        (None, Align::Any) => {
            // The door needs a metre of common wall, and corners a metre less.
            let door = 140.min(size[along]).min(high - low);
            let first = low - size[along] + door;
            first + random.index((high - door - first).max(0) as usize + 1) as i32
        }
    };
    let length = if beside.fill {
        let length = high - start;
        let [least, most] = limits[along];
        if !(least - GIVE..=most + GIVE).contains(&length) {
            return None;
        }
        length
    } else {
        size[along]
    };
    sides[along] = [start, start + length];
    Some(sides)
}

/// Moves the far sides of a room onto near sides of others: walls have no steps of a few
/// centimetres.
fn snapped(
    mut sides: [[i32; 2]; 2],
    wall: Side,
    limits: [[i32; 2]; 2],
    others: &[RoomShape],
) -> [[i32; 2]; 2] {
    for axis in 0..2 {
        for end in 0..2 {
            let is_common = match wall {
                Side::North => (axis, end) == (1, 0),
                Side::South => (axis, end) == (1, 1),
                Side::East => (axis, end) == (0, 0),
                Side::West => (axis, end) == (0, 1),
            };
            if is_common {
                continue;
            }
            let lines = others.iter().flat_map(|other| other.sides[axis]);
            let near = lines.min_by_key(|line| (line - sides[axis][end]).abs());
            let Some(line) = near.filter(|line| (line - sides[axis][end]).abs() <= SNAP) else {
                continue;
            };
            let mut moved = sides[axis];
            moved[end] = line;
            let length = moved[1] - moved[0];
            let [least, most] = limits[axis];
            if (least - GIVE..=most + GIVE).contains(&length) {
                sides[axis] = moved;
            }
        }
    }
    sides
}

/// Moves the middle of all rooms to the origin.
fn centre(shapes: &mut [RoomShape]) {
    for axis in 0..2 {
        let lows = shapes.iter().map(|shape| shape.sides[axis][0]);
        let highs = shapes.iter().map(|shape| shape.sides[axis][1]);
        let (low, high) = (lows.min().unwrap_or(0), highs.max().unwrap_or(0));
        let middle = i32::midpoint(low, high);
        for shape in shapes.iter_mut() {
            shape.sides[axis] = shape.sides[axis].map(|at| at - middle);
        }
    }
}

/// The side of room `a` at which room `b` is, with the common range, metres.
fn common(a: &RoomShape, b: &RoomShape) -> Option<(Side, [f64; 2])> {
    let overlap = |axis: usize| {
        let (a, b) = (a.sides[axis], b.sides[axis]);
        [a[0].max(b[0]), a[1].min(b[1])]
    };
    for side in Side::ALL {
        let across = usize::from(side.is_along_x());
        let (own, its) = match side {
            Side::South | Side::West => (0, 1),
            Side::North | Side::East => (1, 0),
        };
        let [low, high] = overlap(1 - across);
        if a.sides[across][own] == b.sides[across][its] && low < high {
            return Some((side, [f64::from(low) / 100.0, f64::from(high) / 100.0]));
        }
    }
    None
}

/// Middle of an opening in a range of a wall: often near one of its ends, so that long parts of
/// the wall stay free.
fn middle(range: [f64; 2], width: f64, random: &mut Random) -> Option<f64> {
    let least = width / 2.0 + WALL / 2.0 + JAMB;
    let ends = [range[0] + least, range[1] - least];
    if ends[0] > ends[1] + 1e-9 {
        return None;
    }
    let off = random.length([0.0, NEAR_CORNER[1] - NEAR_CORNER[0]]);
    let at = match random.index(5) {
        0 | 1 => (ends[0] + off).min(ends[1]),
        2 | 3 => (ends[1] - off).max(ends[0]),
        _ => random.length(ends),
    };
    Some((at * 100.0).round() / 100.0)
}

fn doors(plan: &PlanFile, rooms: &mut Rooms, random: &mut Random) -> Result<(), String> {
    let find = |name: &str| plan.room.iter().position(|room| room.name == name);
    let mut wanted: Vec<(usize, usize, [f64; 2])> = Vec::new();
    for (index, room) in plan.room.iter().enumerate() {
        if let Some(beside) = &room.beside
            && let (Some(other), Some(width)) = (find(&beside.room), beside.door)
        {
            wanted.push((index, other, width));
        }
    }
    for door in &plan.door {
        let [a, b] = &door.between;
        if let (Some(a), Some(b)) = (find(a), find(b)) {
            wanted.push((a, b, door.width));
        }
    }
    for (room, other, width) in wanted {
        let failed = || plan.room[room].name.clone();
        let width = random.length(width);
        let found = common(&rooms.shapes[room], &rooms.shapes[other]);
        let (side, range) = found.ok_or_else(failed)?;
        let at = middle(range, width, random).ok_or_else(failed)?;
        rooms.doors.push(Doorway {
            room,
            side,
            other: Some(other),
            at,
            width,
        });
    }
    let entrance = find(&plan.entrance).ok_or_else(|| plan.entrance.clone())?;
    let mut walls = outer(&rooms.shapes, entrance);
    random.shuffle(&mut walls);
    let width = 0.96;
    for (side, range) in walls {
        if let Some(at) = middle(range, width, random) {
            rooms.doors.push(Doorway {
                room: entrance,
                side,
                other: None,
                at,
                width,
            });
            return Ok(());
        }
    }
    Err(plan.entrance.clone())
}

/// The parts of the walls of a room with nothing behind them, metres.
pub fn outer(shapes: &[RoomShape], room: usize) -> Vec<(Side, [f64; 2])> {
    let own = &shapes[room];
    let mut parts = Vec::new();
    for side in Side::ALL {
        let range = side.range(&own.outline());
        let mut taken: Vec<[f64; 2]> = Vec::new();
        for (index, other) in shapes.iter().enumerate() {
            if let Some((_, range)) = common(own, other).filter(|(at, _)| *at == side)
                && index != room
            {
                taken.push(range);
            }
        }
        taken.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut from = range[0];
        taken.push([range[1]; 2]);
        for [low, high] in taken {
            if low > from + 1e-9 {
                parts.push((side, [from, low]));
            }
            from = from.max(high);
        }
    }
    parts
}

/// Size of windows by the kind of the room: number, range of the width, lower edge and height,
/// metres.
fn windows_of(kind: &str) -> (usize, [f64; 2], [f64; 2]) {
    match kind {
        "living_room" => (3, [1.2, 2.0], [0.85, 1.35]),
        "bathroom" | "toilet" | "laundry" => (1, [0.6, 0.9], [1.35, 0.80]),
        "kitchen" => (1, [1.0, 1.5], [1.10, 1.05]),
        "hall" | "corridor" | "storage" | "dressing_room" => (0, [0.6, 0.8], [1.10, 1.05]),
        _ => (2, [1.0, 1.6], [0.88, 1.30]),
    }
}

fn windows(plan: &PlanFile, rooms: &mut Rooms, random: &mut Random) {
    for room in 0..rooms.shapes.len() {
        let (most, widths, heights) = windows_of(plan.room[room].kind());
        let mut walls = outer(&rooms.shapes, room);
        random.shuffle(&mut walls);
        let mut count = 0;
        for (side, range) in walls {
            let is_full = count >= most || (count > 0 && random.happens(0.4));
            let length = range[1] - range[0];
            let width = random.length(widths).min(length - 0.7);
            // A wall keeps its front door to itself.
            let mut doors = rooms.doors.iter();
            let has_door =
                doors.any(|door| door.room == room && door.side == side && door.other.is_none());
            if is_full || width < widths[0] - 1e-9 || has_door {
                continue;
            }
            let play = (length - width - 0.7) / 2.0;
            let at =
                f64::midpoint(range[0], range[1]) + random.length([-play, play].map(|p| p * 0.6));
            rooms.windows.push(Window {
                room,
                side,
                at: (at * 100.0).round() / 100.0,
                width,
                heights,
            });
            count += 1;
        }
    }
}

/// Index of the largest room.
#[must_use]
pub fn largest(shapes: &[RoomShape]) -> usize {
    let all = shapes.iter().enumerate();
    let largest = all.max_by_key(|(index, shape)| (shape.area(), std::cmp::Reverse(*index)));
    largest.map_or(0, |(index, _)| index)
}
