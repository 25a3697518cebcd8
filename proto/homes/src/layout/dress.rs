//! What shows that a home is lived in: small objects on furniture, and what hangs on walls.

use super::furnish::Space;
use super::geometry::{Rect, Side};
use super::kinds::{SmallObject, WallPiece, on};
use super::placed::Placed;
use super::random::Random;
use super::rooms::Rooms;

/// Trials of a place.
const TRIALS: usize = 16;
/// Distance of a small object from the edges of its surface, metres.
const EDGE: f64 = 0.02;
/// What is this close to a wall is at it, metres.
const AT_WALL: f64 = 0.30;

/// A small object on a piece, in its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct OnPiece {
    /// Name of its kind.
    pub name: &'static str,
    /// Place on the floor plan of the piece's frame, and height, metres.
    pub at: [f64; 3],
    /// Rotation against the piece, degrees.
    pub yaw_deg: f64,
}

/// Small objects on a surface of a piece: `x` and `y` are its ranges in the piece's frame.
pub fn small_objects(
    piece: &Placed,
    x: [f64; 2],
    y: [f64; 2],
    height: f64,
    random: &mut Random,
) -> Vec<OnPiece> {
    let all = on(&piece.kind);
    let Some((first, others)) = all.split_first() else {
        return Vec::new();
    };
    let has_first = match piece.kind.as_str() {
        "cabinet" | "drawers" | "dishwasher" => random.happens(0.35),
        "cooker" => random.happens(0.6),
        "table" | "round_table" | "coffee_table" => random.happens(0.7),
        _ => true,
    };
    let mut chosen: Vec<&SmallObject> = Vec::new();
    if has_first {
        chosen.push(first);
    }
    let most = match piece.kind.as_str() {
        // Tasks put objects beside these.
        "nightstand" | "side_table" => 0,
        "coffee_table" if has_first => 0,
        "washing_machine" | "basin" | "console" | "shoe_cabinet" => 1,
        "table" | "round_table" | "coffee_table" | "tv_board" => 1,
        "cabinet" | "drawers" | "dishwasher" if random.happens(0.4) => 0,
        "cabinet" | "drawers" | "dishwasher" => 1,
        _ => 2,
    };
    let mut rest: Vec<&SmallObject> = others.iter().collect();
    random.shuffle(&mut rest);
    chosen.extend(rest.into_iter().take(most));
    let is_free_standing = piece.side.is_none()
        && matches!(
            piece.kind.as_str(),
            "table" | "round_table" | "coffee_table"
        );
    let mut taken: Vec<Rect> = Vec::new();
    let mut placed = Vec::new();
    for object in chosen {
        let [half_x, half_y] = object.half;
        let ends = [y[0] + half_y + EDGE, y[1] - half_y - EDGE];
        if ends[0] > ends[1] || 2.0 * half_x + EDGE > x[1] - x[0] {
            continue;
        }
        for _ in 0..TRIALS {
            let along = match object.name {
                "television" => f64::midpoint(y[0], y[1]),
                "monitor" => random.number([-0.1, 0.1]).clamp(ends[0], ends[1]),
                "pot" => [-0.13, 0.13][random.index(2)],
                _ if piece.kind == "coffee_table" => ends[random.index(2)],
                _ if is_free_standing => 0.6 * random.number(ends),
                _ if random.happens(0.7) => ends[random.index(2)],
                _ => random.number(ends),
            };
            let across = match object.name {
                "pot" => [-0.13, 0.13][random.index(2)],
                _ if is_free_standing => f64::midpoint(x[0], x[1]) - 0.05,
                _ => x[0] + half_x + EDGE,
            };
            let rect = Rect::about([across, along], [2.0 * half_x, 2.0 * half_y]);
            if taken.iter().any(|other| rect.grown(0.015).overlaps(other)) {
                continue;
            }
            taken.push(rect);
            let turn = match object.name {
                "television" | "monitor" | "pot" | "jars" | "cutting_board" => 0.0,
                _ => random.number([-14.0, 14.0]).round(),
            };
            placed.push(OnPiece {
                name: object.name,
                at: [across, along, height],
                yaw_deg: turn,
            });
            break;
        }
    }
    placed
}

/// A piece on a wall of a room, or below its ceiling.
#[derive(Clone, Debug, PartialEq)]
pub struct Hung {
    /// The piece.
    pub piece: WallPiece,
    /// The wall; `None` for the ceiling.
    pub side: Option<Side>,
    /// Place on the floor plan, metres.
    pub at: [f64; 2],
}

/// A part of a wall that is taken.
struct Taken {
    side: Side,
    range: [f64; 2],
    heights: [f64; 2],
}

struct Walls<'a> {
    space: &'a Space,
    taken: Vec<Taken>,
    hung: Vec<Hung>,
}

/// Hangs pieces on the walls of a room.
pub fn walls(
    rooms: &Rooms,
    room: usize,
    kind: &str,
    space: &Space,
    placed: &[Placed],
    random: &mut Random,
) -> Vec<Hung> {
    let mut walls = Walls {
        space,
        taken: taken(rooms, room, space, placed),
        hung: Vec::new(),
    };
    let uppers = random.happens(0.75);
    for piece in placed {
        let Some(side) = piece.side else {
            continue;
        };
        let along = if side.is_along_x() {
            piece.at[0]
        } else {
            piece.at[1]
        };
        let width = piece.size[1];
        match piece.kind.as_str() {
            "cooker" => walls.hang(WallPiece::Hood(width), side, along),
            "cabinet" | "drawers" | "dishwasher" | "sink" if uppers && random.happens(0.7) => {
                walls.hang(WallPiece::UpperCabinet(width), side, along)
            }
            "basin" => walls.hang(WallPiece::Mirror((width - 0.1).min(0.9)), side, along),
            "sofa" | "bed" | "single_bed" | "dresser" | "console" => {
                let count = if width > 1.5 && random.happens(0.6) {
                    2
                } else {
                    1
                };
                let height = random.length([0.45, 0.75]);
                let size = [random.length([0.40, 0.60]), height];
                for index in 0..count {
                    let off = (f64::from(index) - f64::from(count - 1) / 2.0) * (size[0] + 0.12);
                    walls.hang(WallPiece::Image(size), side, along + off);
                }
                true
            }
            "desk" if random.happens(0.6) => walls.hang(WallPiece::Shelf(0.8), side, along),
            _ => false,
        };
    }
    for pane in &space.panes {
        let wide = (pane.range[1] - pane.range[0] - 0.2).clamp(0.4, 1.2);
        let middle = f64::midpoint(pane.range[0], pane.range[1]);
        if pane.sill > 0.75 {
            walls.hang(WallPiece::Radiator(wide), pane.side, middle);
        }
    }
    let extra: &[WallPiece] = match kind {
        "hall" | "corridor" => &[
            WallPiece::Hooks,
            WallPiece::Mirror(0.5),
            WallPiece::Image([0.5, 0.4]),
        ],
        "kitchen" | "dining_room" => &[WallPiece::Clock, WallPiece::Image([0.4, 0.5])],
        "bathroom" | "toilet" => &[WallPiece::TowelRail],
        "laundry" | "storage" => &[WallPiece::Shelf(0.8)],
        _ => &[WallPiece::Image([0.6, 0.8]), WallPiece::Image([0.5, 0.4])],
    };
    for &piece in extra {
        walls.hang_anywhere(piece, random);
    }
    let middle = space.inside.middle();
    walls.hung.push(Hung {
        piece: WallPiece::Pendant,
        side: None,
        at: middle,
    });
    walls.hung
}

fn taken(rooms: &Rooms, room: usize, space: &Space, placed: &[Placed]) -> Vec<Taken> {
    let mut taken = Vec::new();
    for door in &rooms.doors {
        let side = match door.other {
            _ if door.room == room => door.side,
            Some(other) if other == room => door.side.opposite(),
            _ => continue,
        };
        let half = door.width / 2.0 + 0.12;
        taken.push(Taken {
            side,
            range: [door.at - half, door.at + half],
            heights: [0.0, 2.3],
        });
    }
    for pane in &space.panes {
        taken.push(Taken {
            side: pane.side,
            range: [pane.range[0] - 0.12, pane.range[1] + 0.12],
            heights: [pane.sill - 0.06, 2.4],
        });
    }
    for piece in placed {
        for side in Side::ALL {
            let strip = side.strip(&space.inside, side.range(&space.inside), [0.0, AT_WALL]);
            if strip.overlaps(&piece.rect) {
                let splash = if piece.kind == "sofa" { 0.05 } else { 0.0 };
                taken.push(Taken {
                    side,
                    range: side.range(&piece.rect),
                    heights: [0.0, piece.size[2] + splash],
                });
            }
        }
    }
    taken
}

impl Walls<'_> {
    /// Hangs a piece at a place of a wall, unless it is taken. Returns whether it hangs there.
    fn hang(&mut self, piece: WallPiece, side: Side, along: f64) -> bool {
        let (width, heights) = piece.extent();
        let range = [along - width / 2.0, along + width / 2.0];
        let [low, high] = side.range(&self.space.inside);
        let mut taken = self.taken.iter();
        let meets = |taken: &Taken| {
            taken.side == side
                && taken.range[0] < range[1] - 1e-6
                && range[0] + 1e-6 < taken.range[1]
                && taken.heights[0] < heights[1]
                && heights[0] < taken.heights[1]
        };
        if range[0] < low - 1e-6 || range[1] > high + 1e-6 || taken.any(meets) {
            return false;
        }
        let line = side.line(&self.space.inside);
        self.hung.push(Hung {
            piece,
            side: Some(side),
            at: if side.is_along_x() {
                [along, line]
            } else {
                [line, along]
            },
        });
        self.taken.push(Taken {
            side,
            range: [range[0] - 0.04, range[1] + 0.04],
            heights,
        });
        true
    }

    fn hang_anywhere(&mut self, piece: WallPiece, random: &mut Random) {
        let (width, _) = piece.extent();
        for _ in 0..TRIALS {
            let side = Side::ALL[random.index(4)];
            let [low, high] = side.range(&self.space.inside);
            let ends = [low + width / 2.0 + 0.10, high - width / 2.0 - 0.10];
            if ends[0] < ends[1] && self.hang(piece, side, random.length(ends)) {
                return;
            }
        }
    }
}
