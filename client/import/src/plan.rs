//! The plan of one level in metres of the pack: walls with openings, rooms, pieces.

use wheelarm_proto::exact;

use crate::error::ImportError;
use crate::fit::METRES;
use crate::polygon::{self, Point};
use crate::sh3d::{Home, Piece, PieceKind, Room, Wall};

/// Boxes of a round wall.
const ARC_PARTS: usize = 10;
/// Arcs below this are straight, radians.
const LEAST_ARC: f64 = 0.01;
/// What an end of a wall stays inside the outline of its neighbour, metres: their faces would
/// flicker in one plane.
const INSET: f64 = 0.001;
/// Least length of a wall, metres.
const LEAST_WALL: f64 = 0.01;
/// Bounds of packs for the thickness of a wall and for heights, metres.
const THICKNESS: (f64, f64) = (0.005, 5.0);
const TALLEST: f64 = 20.0;
/// Least height of a wall or an opening, metres.
const LOWEST: f64 = 0.02;

/// The selected level of a home.
pub struct Plan<'a> {
    /// The home.
    pub home: &'a Home,
    /// Index of the level; `None` for a home without levels.
    pub level: Option<usize>,
    /// Middle of the walls, centimetres of the file: the origin of the pack.
    pub middle: Point,
    /// Height of rooms, metres.
    pub height: f64,
}

/// A straight wall, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct StraightWall {
    /// Index of its wall in the home.
    pub source: usize,
    /// Start, joined to its neighbour.
    pub from: Point,
    /// End.
    pub to: Point,
    /// Thickness.
    pub thickness: f64,
    /// Height at the start.
    pub height: f64,
    /// Height at the end.
    pub end_height: f64,
}

impl StraightWall {
    /// Length, metres.
    #[must_use]
    pub fn length(&self) -> f64 {
        polygon::distance(self.from, self.to)
    }

    /// Unit vector from start to end.
    #[must_use]
    pub fn direction(&self) -> Point {
        let length = self.length().max(1.0e-9);
        [0, 1].map(|axis| (self.to[axis] - self.from[axis]) / length)
    }

    /// Corners in plan.
    #[must_use]
    pub fn outline(&self) -> [Point; 4] {
        let [x, y] = self.direction();
        let half = 0.5 * self.thickness;
        let side = [-y * half, x * half];
        let at = |p: Point, sign: f64| [p[0] + sign * side[0], p[1] + sign * side[1]];
        [
            at(self.from, -1.0),
            at(self.to, -1.0),
            at(self.to, 1.0),
            at(self.from, 1.0),
        ]
    }
}

impl<'a> Plan<'a> {
    /// Selects a level: by name, by identifier or by number from the lowest, 1 being the first;
    /// without a choice the level that was shown when the file was saved, if it has rooms,
    /// otherwise the one with the most walls.
    ///
    /// # Errors
    /// When the level does not exist, or has no walls.
    pub fn of(file: &str, home: &'a Home, choice: Option<&str>) -> Result<Self, ImportError> {
        let level = select(file, home, choice)?;
        let on = |id: &Option<String>| is_on(home, level, id.as_deref());
        let ends = home.walls.iter().filter(|wall| on(&wall.level));
        let ends: Vec<Point> = ends.flat_map(|wall| [wall.from, wall.to]).collect();
        let (low, high) = polygon::bounds(&ends);
        let height = level.map_or(home.wall_height, |index| home.levels[index].height);
        Ok(Self {
            home,
            level,
            middle: [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])],
            height: height * METRES,
        })
    }

    /// Name of the level; empty for a home without levels.
    #[must_use]
    pub fn level_name(&self) -> &str {
        self.level
            .map_or("", |index| self.home.levels[index].name.as_str())
    }

    /// Whether something of this level's identifier is on the level.
    #[must_use]
    pub fn is_on(&self, level: Option<&str>) -> bool {
        is_on(self.home, self.level, level)
    }

    /// A place of the file in metres of the pack.
    #[must_use]
    pub fn place(&self, at: Point) -> Point {
        [
            (at[0] - self.middle[0]) * METRES,
            (self.middle[1] - at[1]) * METRES,
        ]
    }

    /// The walls of the level as straight ones, joined at corners.
    #[must_use]
    pub fn walls(&self) -> Vec<StraightWall> {
        let mut all = Vec::new();
        for (source, wall) in self.home.walls.iter().enumerate() {
            if !self.is_on(wall.level.as_deref()) || wall.thickness * METRES < 0.001 {
                continue;
            }
            let height = wall.height.unwrap_or(self.home.wall_height) * METRES;
            let end_height = wall.height_at_end.map_or(height, |h| h * METRES);
            let (height, end_height) = (height.min(TALLEST), end_height.min(TALLEST));
            if height.max(end_height) < LOWEST {
                continue;
            }
            let mut points = self.centre_line(wall);
            let last = points.len() - 1;
            let at_start = self.extension(wall, wall.at_start.as_deref(), points[1], points[0]);
            let at_end =
                self.extension(wall, wall.at_end.as_deref(), points[last - 1], points[last]);
            points[0] = lengthened(points[1], points[0], at_start);
            points[last] = lengthened(points[last - 1], points[last], at_end);
            for (part, ends) in points.windows(2).enumerate() {
                let share = |k: usize| height + (end_height - height) * k as f64 / last as f64;
                let straight = StraightWall {
                    source,
                    from: ends[0],
                    to: ends[1],
                    thickness: (wall.thickness * METRES).clamp(THICKNESS.0, THICKNESS.1),
                    height: share(part),
                    end_height: share(part + 1),
                };
                if straight.length() >= LEAST_WALL {
                    all.push(straight);
                }
            }
        }
        all
    }

    /// Corners of the centre line: two, or those of an arc.
    fn centre_line(&self, wall: &Wall) -> Vec<Point> {
        let (a, b) = (self.place(wall.from), self.place(wall.to));
        let chord = polygon::distance(a, b);
        let extent = -wall.arc_extent;
        // A full circle has no centre.
        let is_arc = extent.abs() > LEAST_ARC && extent.abs() < 6.2 && chord > LEAST_WALL;
        if !is_arc {
            return vec![a, b];
        }
        let sign = extent.signum();
        let half = 0.5 * extent.abs();
        let radius = 0.5 * chord / exact::sin(half);
        let normal = [-(b[1] - a[1]) / chord * sign, (b[0] - a[0]) / chord * sign];
        let offset = radius * exact::cos(half);
        let centre = [0, 1].map(|axis| 0.5 * (a[axis] + b[axis]) + normal[axis] * offset);
        let spoke = [a[0] - centre[0], a[1] - centre[1]];
        let mut points = vec![a];
        for part in 1..ARC_PARTS {
            let angle = extent * part as f64 / ARC_PARTS as f64;
            let (sin, cos) = exact::sin_cos(angle);
            points.push([
                centre[0] + cos * spoke[0] - sin * spoke[1],
                centre[1] + sin * spoke[0] + cos * spoke[1],
            ]);
        }
        points.push(b);
        points
    }

    /// What a wall is longer at an end that is joined to another wall, metres: its corner
    /// reaches the outer corner of both.
    fn extension(&self, wall: &Wall, joined: Option<&str>, inner: Point, end: Point) -> f64 {
        let Some(id) = joined else {
            return 0.0;
        };
        let others = self.home.walls.iter();
        let mut others = others.filter(|w| w.id == id && w.id != wall.id);
        let Some(other) = others.next().filter(|w| self.is_on(w.level.as_deref())) else {
            return 0.0;
        };
        let line = self.centre_line(other);
        let near = |p: Point| polygon::distance(p, end);
        let (first, last) = (line[0], line[line.len() - 1]);
        let next = if near(first) <= near(last) {
            line[1]
        } else {
            line[line.len() - 2]
        };
        let (u, v) = (unit(inner, end), unit(end, next));
        // Tangent of half the turn: |cross| / (1 + dot).
        let (dot, cross) = (u[0] * v[0] + u[1] * v[1], (u[0] * v[1] - u[1] * v[0]).abs());
        if dot < -0.7 {
            return 0.0;
        }
        let reach = 0.5 * other.thickness * METRES * cross / (1.0 + dot);
        (reach.min(other.thickness * METRES) - INSET).max(0.0)
    }

    /// The rooms of the level that have a floor, with their indices in the home.
    pub fn rooms(&self) -> impl Iterator<Item = (usize, &'a Room)> {
        let on = |room: &Room| self.is_on(room.level.as_deref());
        let rooms = self.home.rooms.iter().enumerate();
        let rooms: Vec<_> = rooms
            .filter(|(_, r)| on(r) && r.points.len() >= 3)
            .collect();
        rooms.into_iter()
    }

    /// Outlines of openings in the floor: stairs of the level below that lead here.
    #[must_use]
    pub fn floor_openings(&self) -> Vec<Vec<Point>> {
        let Some(index) = self.level else {
            return Vec::new();
        };
        let floor = self.home.levels[index].elevation;
        let stairs = self.home.pieces.iter().filter(|piece| {
            let below = piece
                .level
                .as_deref()
                .and_then(|id| self.home.levels.iter().find(|level| level.id == id));
            let top = |elevation: f64| elevation + piece.elevation + piece.size[2];
            piece.cuts_floor
                && piece.visible
                && below.is_some_and(|b| b.elevation < floor && top(b.elevation) >= floor - 30.0)
        });
        stairs.map(|piece| self.footprint(piece).to_vec()).collect()
    }

    /// Corners of the rectangle that a piece covers.
    #[must_use]
    pub fn footprint(&self, piece: &Piece) -> [Point; 4] {
        let [x, y] = self.place(piece.at);
        let (sin, cos) = exact::sin_cos(-piece.angle);
        let half = [0.5 * piece.size[0] * METRES, 0.5 * piece.size[1] * METRES];
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| {
            let (u, v) = (a * half[0], b * half[1]);
            [x + cos * u - sin * v, y + sin * u + cos * v]
        })
    }
}

/// An opening that a door or a window cuts into a wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Opening {
    /// Index of the straight wall.
    pub wall: usize,
    /// Distance of its middle from the wall's start, metres.
    pub at: f64,
    /// Metres.
    pub width: f64,
    /// Metres.
    pub height: f64,
    /// Height of the lower edge, metres.
    pub sill: f64,
    /// Index of the piece in the home.
    pub piece: usize,
}

/// The openings of all doors and windows of the level.
#[must_use]
pub fn openings(plan: &Plan<'_>, walls: &[StraightWall]) -> Vec<Opening> {
    let mut all = Vec::new();
    for (index, piece) in plan.home.pieces.iter().enumerate() {
        let cuts = piece.kind == PieceKind::DoorOrWindow && piece.visible;
        if !cuts || !plan.is_on(piece.level.as_deref()) {
            continue;
        }
        let middle = plan.place(piece.at);
        let (sin, cos) = exact::sin_cos(-piece.angle);
        let [width, depth, height] = piece.size.map(|length| length * METRES);
        for (number, wall) in walls.iter().enumerate() {
            let [x, y] = wall.direction();
            let (dx, dy) = (middle[0] - wall.from[0], middle[1] - wall.from[1]);
            let (along, off) = (dx * x + dy * y, (dx * y - dy * x).abs());
            let is_parallel = (cos * x + sin * y).abs() > 0.97;
            let is_near = off < 0.5 * (wall.thickness + depth);
            let (start, end) = (along - 0.5 * width, along + 0.5 * width);
            let (start, end) = (start.max(0.0), end.min(wall.length()));
            if !is_parallel || !is_near || end - start < 0.02 {
                continue;
            }
            let sill = (piece.elevation * METRES).max(0.0);
            let top = wall.height.max(wall.end_height);
            if sill > top - LOWEST || height < LOWEST {
                continue;
            }
            all.push(Opening {
                wall: number,
                at: 0.5 * (start + end),
                width: end - start,
                height: height.min(top - sill),
                sill: if sill < 0.02 { 0.0 } else { sill },
                piece: index,
            });
        }
    }
    all
}

fn unit(a: Point, b: Point) -> Point {
    let length = polygon::distance(a, b).max(1.0e-9);
    [(b[0] - a[0]) / length, (b[1] - a[1]) / length]
}

/// `end`, moved away from `inner` by a length.
fn lengthened(inner: Point, end: Point, by: f64) -> Point {
    let [x, y] = unit(inner, end);
    [end[0] + x * by, end[1] + y * by]
}

fn is_on(home: &Home, level: Option<usize>, id: Option<&str>) -> bool {
    match (level, id) {
        (None, _) => true,
        // What names no level is on the lowest.
        (Some(index), None) => index == 0,
        (Some(index), Some(id)) => home.levels[index].id == id,
    }
}

fn select(file: &str, home: &Home, choice: Option<&str>) -> Result<Option<usize>, ImportError> {
    let walls = |index: usize| {
        let on = |wall: &&Wall| is_on(home, Some(index), wall.level.as_deref());
        home.walls.iter().filter(on).count()
    };
    let list = |only_walls: bool| {
        let all = (0..home.levels.len()).filter(|&index| !only_walls || walls(index) > 0);
        let names: Vec<String> = all
            .map(|index| format!("{} ({})", home.levels[index].name, walls(index)))
            .collect();
        if names.is_empty() {
            "none".to_owned()
        } else {
            names.join(", ")
        }
    };
    if home.levels.is_empty() {
        return match choice {
            None | Some("1") if !home.walls.is_empty() => Ok(None),
            None | Some("1") => Err(ImportError::NoWalls {
                level: "the home".into(),
                levels: list(true),
            }),
            Some(level) => Err(ImportError::NoLevel {
                file: file.to_owned(),
                level: level.to_owned(),
                levels: "this home has no levels; leave out --level".into(),
            }),
        };
    }
    let rooms = |index: usize| {
        let id = |room: &&Room| is_on(home, Some(index), room.level.as_deref());
        home.rooms.iter().filter(id).count()
    };
    let index = match choice {
        Some(choice) => {
            let named = |level: &crate::sh3d::Level| {
                level.id == choice || level.name.eq_ignore_ascii_case(choice)
            };
            let by_name = home.levels.iter().position(named);
            let number = choice.parse::<usize>().ok();
            let by_number = number
                .and_then(|n| n.checked_sub(1))
                .filter(|&n| n < home.levels.len());
            by_name.or(by_number).ok_or_else(|| ImportError::NoLevel {
                file: file.to_owned(),
                level: choice.to_owned(),
                levels: list(false),
            })?
        }
        None => {
            let shown = home.selected_level.as_deref();
            let shown = home
                .levels
                .iter()
                .position(|level| Some(level.id.as_str()) == shown);
            let lived_in = shown.filter(|&index| walls(index) > 0 && rooms(index) > 0);
            let most = (0..home.levels.len())
                .rev()
                .max_by_key(|&index| walls(index));
            lived_in.or(most).unwrap_or(0)
        }
    };
    if walls(index) == 0 {
        return Err(ImportError::NoWalls {
            level: home.levels[index].name.clone(),
            levels: list(true),
        });
    }
    Ok(Some(index))
}
