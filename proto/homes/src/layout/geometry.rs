//! Level rectangles and the four sides of rooms.

use serde::Deserialize;

/// Rectangles that overlap by less than this touch only, metres.
const TOUCH: f64 = 1e-6;

/// A level rectangle along the axes, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Smallest and largest x.
    pub x: [f64; 2],
    /// Smallest and largest y.
    pub y: [f64; 2],
}

impl Rect {
    /// A rectangle about a middle.
    #[must_use]
    pub fn about([x, y]: [f64; 2], [along_x, along_y]: [f64; 2]) -> Self {
        Self {
            x: [x - along_x / 2.0, x + along_x / 2.0],
            y: [y - along_y / 2.0, y + along_y / 2.0],
        }
    }

    /// Its middle.
    #[must_use]
    pub fn middle(&self) -> [f64; 2] {
        [
            f64::midpoint(self.x[0], self.x[1]),
            f64::midpoint(self.y[0], self.y[1]),
        ]
    }

    /// Its lengths along x and y.
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        [self.x[1] - self.x[0], self.y[1] - self.y[0]]
    }

    /// Whether the insides of both meet.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        let meet = |a: [f64; 2], b: [f64; 2]| a[0] < b[1] - TOUCH && b[0] < a[1] - TOUCH;
        meet(self.x, other.x) && meet(self.y, other.y)
    }

    /// Whether `other` is in it.
    #[must_use]
    pub fn contains(&self, other: &Self) -> bool {
        let within = |a: [f64; 2], b: [f64; 2]| a[0] <= b[0] + TOUCH && b[1] <= a[1] + TOUCH;
        within(self.x, other.x) && within(self.y, other.y)
    }

    /// The rectangle with every side moved outwards.
    #[must_use]
    pub fn grown(&self, by: f64) -> Self {
        Self {
            x: [self.x[0] - by, self.x[1] + by],
            y: [self.y[0] - by, self.y[1] + by],
        }
    }

    /// The smallest rectangle around both.
    #[must_use]
    pub fn around(&self, other: &Self) -> Self {
        let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self {
            x: join(self.x, other.x),
            y: join(self.y, other.y),
        }
    }
}

/// A side of a room.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    South,
    East,
    North,
    West,
}

impl Side {
    /// All sides, counter-clockwise.
    pub const ALL: [Self; 4] = [Self::South, Self::East, Self::North, Self::West];

    /// Number of quarter turns, counter-clockwise, from the south.
    #[must_use]
    pub fn quarters(self) -> usize {
        self as usize
    }

    /// The side after some quarter turns, counter-clockwise.
    #[must_use]
    pub fn turned(self, quarters: usize) -> Self {
        Self::ALL[(self.quarters() + quarters) % 4]
    }

    /// The side across the room.
    #[must_use]
    pub fn opposite(self) -> Self {
        self.turned(2)
    }

    /// Whether the wall of this side runs along x.
    #[must_use]
    pub fn is_along_x(self) -> bool {
        matches!(self, Self::South | Self::North)
    }

    /// Rotation of a piece with its back at this side: its front is along its own x.
    #[must_use]
    pub fn yaw_deg(self) -> f64 {
        [90.0, 180.0, -90.0, 0.0][self.quarters()]
    }

    /// The coordinate of this side of a rectangle.
    #[must_use]
    pub fn line(self, of: &Rect) -> f64 {
        match self {
            Self::South => of.y[0],
            Self::North => of.y[1],
            Self::West => of.x[0],
            Self::East => of.x[1],
        }
    }

    /// The range of a rectangle along the wall of this side.
    #[must_use]
    pub fn range(self, of: &Rect) -> [f64; 2] {
        if self.is_along_x() { of.x } else { of.y }
    }

    /// The rectangle at this side of `room`: `along` its wall, from `near` to `far` metres off
    /// the wall.
    #[must_use]
    pub fn strip(self, room: &Rect, along: [f64; 2], [near, far]: [f64; 2]) -> Rect {
        let line = self.line(room);
        let across = match self {
            Self::South | Self::West => [line + near, line + far],
            Self::North | Self::East => [line - far, line - near],
        };
        if self.is_along_x() {
            Rect {
                x: along,
                y: across,
            }
        } else {
            Rect {
                x: across,
                y: along,
            }
        }
    }
}

/// Reflection and rotation of a whole plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Orientation {
    /// Whether x is reversed, before the rotation.
    pub mirrored: bool,
    /// Quarter turns, counter-clockwise.
    pub quarters: usize,
}

impl Orientation {
    /// A side of a room of the plan.
    #[must_use]
    pub fn side(self, side: Side) -> Side {
        let mirrored = match side {
            Side::East | Side::West if self.mirrored => side.opposite(),
            side => side,
        };
        mirrored.turned(self.quarters)
    }

    /// A point of the plan.
    #[must_use]
    pub fn point(self, [x, y]: [i32; 2]) -> [i32; 2] {
        let mut point = [if self.mirrored { -x } else { x }, y];
        for _ in 0..self.quarters % 4 {
            point = [-point[1], point[0]];
        }
        point
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_turn_with_their_points() {
        // A point in the middle of a side stays on that side.
        let points = [[0, -1], [1, 0], [0, 1], [-1, 0]];
        for mirrored in [false, true] {
            for quarters in 0..4 {
                let turn = Orientation { mirrored, quarters };
                for side in Side::ALL {
                    let point = turn.point(points[side.quarters()]);
                    assert_eq!(point, points[turn.side(side).quarters()]);
                }
            }
        }
    }

    #[test]
    fn strip_is_at_its_wall() {
        let room = Rect {
            x: [0.0, 4.0],
            y: [0.0, 3.0],
        };
        let strip = Side::North.strip(&room, [1.0, 2.0], [0.0, 0.6]);
        assert_eq!((strip.x, strip.y), ([1.0, 2.0], [2.4, 3.0]));
        let strip = Side::West.strip(&room, [1.0, 2.0], [0.1, 0.6]);
        assert_eq!((strip.x, strip.y), ([0.1, 0.6], [1.0, 2.0]));
        assert!(room.contains(&strip) && !strip.grown(0.2).overlaps(&room.grown(-1.5)));
    }
}
