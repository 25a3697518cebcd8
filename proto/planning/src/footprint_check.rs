//! Footprint check: the chair's outline against the outlines of bodies on the floor.
//! Static plane geometry.

use std::f64::consts::{PI, TAU};

use wheelarm_proto::exact;

/// A pose of the chair: `wheelchair_root` in `house`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose2 {
    /// Metres in `house`.
    pub x: f64,
    /// Metres in `house`.
    pub y: f64,
    /// Direction of the chair's x axis in `house`, radians.
    pub heading: f64,
}

impl Pose2 {
    /// The point `(forward, left)` of the chair in `house`, metres.
    #[must_use]
    pub fn point(&self, forward: f64, left: f64) -> [f64; 2] {
        let (sin, cos) = exact::sin_cos(self.heading);
        [
            self.x + forward * cos - left * sin,
            self.y + forward * sin + left * cos,
        ]
    }

    /// `other` relative to this pose: forward, left, rotation.
    #[must_use]
    pub fn to(&self, other: &Self) -> [f64; 3] {
        let (sin, cos) = exact::sin_cos(self.heading);
        let (dx, dy) = (other.x - self.x, other.y - self.y);
        [
            dx * cos + dy * sin,
            -dx * sin + dy * cos,
            wrap(other.heading - self.heading),
        ]
    }

    /// The pose after rolling `length` metres on a circle of `curvature` 1/m
    /// (positive to the left; 0 is straight; negative lengths roll back).
    #[must_use]
    pub fn rolled(&self, length: f64, curvature: f64) -> Self {
        let turn = length * curvature;
        // Chord of the arc; the limit for small turns is the length itself.
        let chord = if turn.abs() < 1e-6 {
            length
        } else {
            2.0 / curvature * exact::sin(turn / 2.0)
        };
        let middle = self.heading + turn / 2.0;
        Self {
            x: self.x + chord * exact::cos(middle),
            y: self.y + chord * exact::sin(middle),
            heading: wrap(self.heading + turn),
        }
    }

    /// The pose after turning on the spot.
    #[must_use]
    pub fn turned(&self, angle: f64) -> Self {
        Self {
            heading: wrap(self.heading + angle),
            ..*self
        }
    }

    /// Distance of the origins, metres.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        exact::hypot(other.x - self.x, other.y - self.y)
    }
}

/// An angle within -π to π.
#[must_use]
pub fn wrap(angle: f64) -> f64 {
    let wrapped = (angle + PI).rem_euclid(TAU) - PI;
    if wrapped == -PI { PI } else { wrapped }
}

/// A rectangle on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Centre in `house`, metres.
    pub centre: [f64; 2],
    /// Half of the length and of the width, metres.
    pub half: [f64; 2],
    /// Unit vector along the length.
    pub along: [f64; 2],
}

impl Rectangle {
    /// Radius of its bounding circle, metres.
    #[must_use]
    pub fn radius(&self) -> f64 {
        exact::hypot(self.half[0], self.half[1])
    }

    /// Whether two rectangles overlap (separating axes).
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        let between = [
            other.centre[0] - self.centre[0],
            other.centre[1] - self.centre[1],
        ];
        // The squared sum of two radii is at most twice the sum of their squares: a
        // search calls this often, and a square root would dominate the cost.
        let squared = |v: [f64; 2]| v[0] * v[0] + v[1] * v[1];
        if squared(between) > 2.0 * (squared(self.half) + squared(other.half)) {
            return false;
        }
        let across = |v: [f64; 2]| [-v[1], v[0]];
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let extent = |r: &Self, axis: [f64; 2]| {
            r.half[0] * dot(r.along, axis).abs() + r.half[1] * dot(across(r.along), axis).abs()
        };
        [
            self.along,
            across(self.along),
            other.along,
            across(other.along),
        ]
        .into_iter()
        .all(|axis| dot(between, axis).abs() <= extent(self, axis) + extent(other, axis))
    }
}

/// The outline of the chair in `wheelchair_root`, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline {
    /// x min, x max, y min, y max.
    pub sides: [f64; 4],
}

impl Outline {
    /// Whether it is within another one.
    pub(super) fn is_within(&self, other: &Outline) -> bool {
        let ([back, front, right, left], others) = (self.sides, other.sides);
        back >= others[0] && front <= others[1] && right >= others[2] && left <= others[3]
    }

    /// The outline at a pose, extended by `margin` on every side.
    #[must_use]
    pub fn rectangle_at(&self, pose: &Pose2, margin: f64) -> Rectangle {
        self.rectangle_facing(pose, exact::sin_cos(pose.heading), margin)
    }

    /// The same, with sine and cosine of the pose's heading.
    pub(super) fn rectangle_facing(
        &self,
        pose: &Pose2,
        (sin, cos): (f64, f64),
        margin: f64,
    ) -> Rectangle {
        let [back, front, right, left] = self.sides;
        let (forward, aside) = ((back + front) / 2.0, (right + left) / 2.0);
        Rectangle {
            centre: [
                pose.x + forward * cos - aside * sin,
                pose.y + forward * sin + aside * cos,
            ],
            half: [(front - back) / 2.0 + margin, (left - right) / 2.0 + margin],
            along: [cos, sin],
        }
    }

    /// An outline that contains this one turned by up to `angle` radians either way.
    pub(super) fn swept(&self, angle: f64) -> Self {
        let [back, front, right, left] = self.sides;
        let (sin, cos) = exact::sin_cos(angle);
        // The farthest point of a side is that of its farther corner at the greatest
        // angle, or on the way there where the corner is nearly straight ahead.
        let reach = |side: f64, a: f64, b: f64| {
            let aside = a.abs().max(b.abs());
            match aside * cos < side * sin {
                true => exact::hypot(side, aside),
                false => side * cos + aside * sin,
            }
        };
        Self {
            sides: [
                -reach(-back, right, left),
                reach(front, right, left),
                -reach(-right, back, front),
                reach(left, back, front),
            ],
        }
    }
}

/// A capsule of the person in the chair, in `wheelchair_root`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limb {
    /// Ends of its axis, metres.
    pub ends: [[f64; 3]; 2],
    /// Metres.
    pub radius: f64,
}

/// Height of the slices in which an occupied chair is extended by the limbs, metres.
const SLICE: f64 = 0.1;
/// Sampling distance along a limb's axis, metres.
const LIMB_STEP: f64 = 0.02;
/// Smallest protrusion of a limb beyond the outline of an empty chair, metres.
const COVERED: f64 = 0.005;

impl Limb {
    /// Bounding rectangle between two heights: x min, x max, y min, y max, metres;
    /// `None` when the limb does not reach them.
    fn sides(&self, bottom: f64, top: f64) -> Option<[f64; 4]> {
        let [a, b] = self.ends;
        let along = [0, 1, 2].map(|i| b[i] - a[i]);
        let length = exact::hypot(exact::hypot(along[0], along[1]), along[2]);
        let steps = (length / LIMB_STEP).ceil().max(1.0) as usize;
        let mut sides: Option<[f64; 4]> = None;
        for step in 0..=steps {
            let share = step as f64 / steps as f64;
            let [x, y, z] = [0, 1, 2].map(|i| a[i] + along[i] * share);
            let off = (bottom - z).max(z - top).max(0.0);
            let left = self.radius * self.radius - off * off;
            if left > 0.0 {
                let r = left.sqrt();
                let s = sides.unwrap_or([x, x, y, y]);
                sides = Some([
                    s[0].min(x - r),
                    s[1].max(x + r),
                    s[2].min(y - r),
                    s[3].max(y + r),
                ]);
            }
        }
        sides
    }
}

/// Outlines of an occupied chair, bottom up: those of the empty chair, extended in thin
/// slices by protruding limbs (knees, shins, feet, elbows). Without protruding limbs
/// the outlines are unchanged.
#[must_use]
pub fn occupied(outlines: &[(f64, Outline)], limbs: &[Limb]) -> Vec<(f64, Outline)> {
    let mut grown: Vec<(f64, Outline)> = Vec::new();
    let mut bottom = FLOOR;
    for &(top, outline) in outlines {
        let slices = ((top - bottom) / SLICE).round().max(1.0) as usize;
        let height = (top - bottom) / slices as f64;
        let first = grown.len();
        for slice in 1..=slices {
            let low = bottom + height * (slice - 1) as f64;
            let high = match slice == slices {
                true => top,
                false => bottom + height * slice as f64,
            };
            let mut sides = outline.sides;
            for limb in limbs.iter().filter_map(|limb| limb.sides(low, high)) {
                for (side, sign) in [(0, -1.0), (1, 1.0), (2, -1.0), (3, 1.0)] {
                    let out = sign * (limb[side] - sides[side]);
                    if out > COVERED {
                        sides[side] = limb[side];
                    }
                }
            }
            match grown[first..].last() {
                Some((_, below)) if below.sides == sides => {
                    let last = grown.len() - 1;
                    grown[last].0 = high;
                }
                _ => grown.push((high, Outline { sides })),
            }
        }
        bottom = top;
    }
    grown
}

/// Obstacles of the chair's footprint.
#[derive(Clone, Debug, PartialEq)]
pub struct FootprintCheck {
    /// The robot by height, bottom up, with the obstacles at each level.
    pub levels: Vec<Level>,
}

/// The robot between two heights.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// It reaches from this height above the floor, metres,
    pub bottom: f64,
    /// to this one.
    pub top: f64,
    /// Its outline.
    pub outline: Outline,
    /// Obstacles for that outline.
    pub obstacles: Vec<Rectangle>,
}

/// Height below which a body is part of the floor, metres.
const FLOOR: f64 = 0.03;
/// A box whose top is lower than this is below the floor, metres.
const UNDER: f64 = -0.05;
/// Obstacles around a floor: their width, and their height, at which the wheels are, metres.
const EDGE: f64 = 0.1;
const WHEELS: f64 = 0.2;

impl FootprintCheck {
    /// A robot on a free floor: its outlines, bottom up, each with its upper height,
    /// metres.
    #[must_use]
    pub fn from_outlines(outlines: impl IntoIterator<Item = (f64, Outline)>) -> Self {
        let mut bottom = FLOOR;
        let levels = outlines.into_iter().map(|(top, outline)| Level {
            bottom: std::mem::replace(&mut bottom, top),
            top,
            outline,
            obstacles: Vec::new(),
        });
        Self {
            levels: levels.collect(),
        }
    }

    /// Whether the chair with `margin` around it is collision-free at `pose`.
    #[must_use]
    pub fn is_free(&self, pose: &Pose2, margin: f64) -> bool {
        self.levels.iter().all(|level| {
            let outline = level.outline.rectangle_at(pose, margin);
            !level.obstacles.iter().any(|o| o.overlaps(&outline))
        })
    }

    /// Adds an obstacle between two heights, metres. It is checked at every level that
    /// it reaches, except at those whose outline is within that of another one.
    pub fn put(&mut self, obstacle: Rectangle, heights: [f64; 2]) {
        for level in self.levels_at(heights) {
            self.levels[level].obstacles.push(obstacle);
        }
    }

    /// Adds obstacles for the wheels around the floor, which is what `boxes` are of whose top
    /// is at its height: beyond its edge a chair falls. Each has an outline and its heights,
    /// metres. Adds nothing without a floor.
    pub fn put_edges(&mut self, boxes: impl IntoIterator<Item = (Rectangle, [f64; 2])>) {
        let floor = boxes
            .into_iter()
            .filter(|(_, [_, top])| (UNDER..FLOOR).contains(top));
        let Some([x0, x1, y0, y1]) = bounds_of(floor.map(|(outline, _)| outline)) else {
            return;
        };
        let [wide, long] = [x1 - x0, y1 - y0].map(|side| side / 2.0 + EDGE);
        let [x, y] = [f64::midpoint(x0, x1), f64::midpoint(y0, y1)];
        let half = EDGE / 2.0;
        for (centre, half) in [
            ([x0 - half, y], [half, long]),
            ([x1 + half, y], [half, long]),
            ([x, y0 - half], [wide, half]),
            ([x, y1 + half], [wide, half]),
        ] {
            let along = [1.0, 0.0];
            let edge = Rectangle {
                centre,
                half,
                along,
            };
            self.put(edge, [0.0, WHEELS]);
        }
    }

    /// Indices of the levels at which an obstacle between two heights, metres, is checked.
    pub(super) fn levels_at(&self, [low, high]: [f64; 2]) -> Vec<usize> {
        let meets = |level: &Level| low <= level.top && high > level.bottom;
        let met: Vec<Outline> = self
            .levels
            .iter()
            .filter(|level| meets(level))
            .map(|level| level.outline)
            .collect();
        let counts = |level: &Level| {
            let inner = |other: &Outline| *other != level.outline && level.outline.is_within(other);
            meets(level) && !met.iter().any(inner)
        };
        let levels = self.levels.iter().enumerate();
        let levels = levels.filter(|(_, level)| counts(level));
        levels.map(|(index, _)| index).collect()
    }

    /// Bounding box of all obstacles: x min, x max, y min, y max, metres.
    #[must_use]
    pub fn bounds(&self) -> [f64; 4] {
        let start = [
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ];
        self.levels
            .iter()
            .flat_map(|level| &level.obstacles)
            .fold(start, |b, o| {
                let r = o.radius();
                [
                    b[0].min(o.centre[0] - r),
                    b[1].max(o.centre[0] + r),
                    b[2].min(o.centre[1] - r),
                    b[3].max(o.centre[1] + r),
                ]
            })
    }

    /// The smallest box around all obstacles: x min, x max, y min, y max, metres.
    #[must_use]
    pub fn extent(&self) -> [f64; 4] {
        let obstacles = self.levels.iter().flat_map(|level| &level.obstacles);
        bounds_of(obstacles.copied()).unwrap_or([
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ])
    }
}

/// The smallest box around outlines: x min, x max, y min, y max, metres.
fn bounds_of(outlines: impl Iterator<Item = Rectangle>) -> Option<[f64; 4]> {
    outlines.fold(None, |bounds, o| {
        let [along, across] = o.along.map(f64::abs);
        let x = o.half[0] * along + o.half[1] * across;
        let y = o.half[0] * across + o.half[1] * along;
        let [x0, x1] = [o.centre[0] - x, o.centre[0] + x];
        let [y0, y1] = [o.centre[1] - y, o.centre[1] + y];
        let b = bounds.unwrap_or([x0, x1, y0, y1]);
        Some([b[0].min(x0), b[1].max(x1), b[2].min(y0), b[3].max(y1)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(centre: [f64; 2], half: [f64; 2], yaw: f64) -> Rectangle {
        Rectangle {
            centre,
            half,
            along: [exact::cos(yaw), exact::sin(yaw)],
        }
    }

    #[test]
    fn rotated_rectangles_overlap_exactly() {
        let unit = rectangle([0.0, 0.0], [0.5, 0.5], 0.0);
        let turned = |x: f64| rectangle([x, 0.0], [0.5, 0.5], PI / 4.0);
        // The corner of the rotated one is 0.7071 from its centre.
        assert!(unit.overlaps(&turned(1.2)));
        assert!(!unit.overlaps(&turned(1.21)));
        // Beside each other's corners: the bounding boxes overlap, the rectangles do
        // not.
        let corner = rectangle([0.95, 0.95], [0.5, 0.5], PI / 4.0);
        assert!(!unit.overlaps(&corner));
    }

    #[test]
    fn knees_extend_the_outline_only_at_their_height() {
        let sides = |front| Outline {
            sides: [-0.2, front, -0.3, 0.4],
        };
        let empty = [(0.33, sides(0.8)), (0.93, sides(0.5)), (1.5, sides(0.98))];
        assert_eq!(occupied(&empty, &[]), empty);
        // A thigh that ends 0.12 m in front of the seat, 0.55 to 0.65 m above the
        // floor.
        let thigh = Limb {
            ends: [[0.1, 0.1, 0.6], [0.57, 0.1, 0.6]],
            radius: 0.05,
        };
        let grown = occupied(&empty, &[thigh]);
        let front_at = |z: f64| {
            let band = grown.iter().find(|(top, _)| z <= *top).expect("a band");
            band.1.sides[1]
        };
        assert_eq!(
            [0.2, 0.4, 0.75, 1.2].map(front_at),
            [0.8, 0.5, 0.5, 0.98],
            "{grown:?}"
        );
        assert!((front_at(0.6) - 0.62).abs() < 1e-9);
        // A table top at the height of the knees is an obstacle in front of the seat,
        // one above them is not.
        let top_at = |z: f64| {
            let mut check = FootprintCheck::from_outlines(grown.iter().copied());
            check.put(rectangle([0.75, 0.0], [0.16, 0.5], 0.0), [z, z + 0.02]);
            check.is_free(
                &Pose2 {
                    x: 0.0,
                    y: 0.0,
                    heading: 0.0,
                },
                0.0,
            )
        };
        assert!(!top_at(0.6) && top_at(0.75));
    }

    #[test]
    fn chair_stays_on_the_floor() {
        let wheels = (
            0.3,
            Outline {
                sides: [-0.2, 0.8, -0.3, 0.4],
            },
        );
        let hand = (
            1.5,
            Outline {
                sides: [-0.2, 1.2, -0.3, 0.4],
            },
        );
        let mut check = FootprintCheck::from_outlines([wheels, hand]);
        // A rug does not make the floor larger, and a table does not count.
        let floor = (rectangle([2.0, 1.0], [2.0, 1.5], 0.0), [-0.1, 0.0]);
        let rug = (rectangle([2.0, 1.0], [0.5, 0.5], 0.3), [0.0, 0.01]);
        let table = (rectangle([9.0, 1.0], [0.5, 0.5], 0.0), [0.7, 0.75]);
        check.put_edges([floor, rug, table]);
        let at = |x: f64, heading: f64| Pose2 { x, y: 1.0, heading };
        // The hand may be over the edge, the wheels may not.
        assert!(check.is_free(&at(3.1, 0.0), 0.05));
        assert!(!check.is_free(&at(3.1, 0.0), 0.15));
        assert!(!check.is_free(&at(3.3, 0.0), 0.0));
        assert!(check.is_free(&at(0.3, 0.0), 0.05) && !check.is_free(&at(0.1, 0.0), 0.0));
        let mut without = FootprintCheck::from_outlines([wheels]);
        without.put_edges([table]);
        assert!(without.levels[0].obstacles.is_empty());
    }

    #[test]
    fn rolling_a_quarter_circle_ends_to_the_side() {
        let start = Pose2 {
            x: 1.0,
            y: 2.0,
            heading: 0.0,
        };
        let end = start.rolled(PI / 2.0 * 0.8, -1.0 / 0.8);
        assert!((end.x - 1.8).abs() < 1e-9 && (end.y - 1.2).abs() < 1e-9);
        assert!((end.heading + PI / 2.0).abs() < 1e-9);
        let back = end.rolled(-PI / 2.0 * 0.8, -1.0 / 0.8);
        assert!(back.distance(&start) < 1e-9);
    }
}
