//! A place on a reached surface: the ranges in which the objects of tasks start.

use wheelarm_pack::{HomeFile, StartRangesEntry};

use crate::home_report::Strip;
use crate::home_report::home::{Home, Solid, Surface};
use crate::home_report::surfaces::{INWARDS, SPACING};

/// Least distance of an object's middle from the approach edge, metres.
const NEAREST: f64 = 0.09;
/// Greatest one, metres. The report tests points at 0.16 m.
const FURTHEST: f64 = 0.22;
/// Distance of an object's middle from the other edge, metres.
const BEHIND: f64 = 0.08;
/// Distance of an object's middle from what is higher than the surface, metres: its radius
/// and the gap that areas demand.
const APART: f64 = 0.08;
/// Height of a tall object, metres.
const TALL: f64 = 0.25;
/// At the ends of a reached strip the arm has few stops: objects stay this far inside, metres.
const END: f64 = 0.03;
/// Height over which what hangs above a surface is looked for, metres.
const ABOVE: f64 = 0.6;

/// Ranges of the start of the chair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Start {
    /// Metres.
    pub x: [f64; 2],
    /// Metres.
    pub y: [f64; 2],
    /// Degrees.
    pub yaw_deg: [f64; 2],
}

impl Start {
    /// The ranges in a file.
    pub(super) fn entry(&self) -> StartRangesEntry {
        StartRangesEntry {
            x: self.x,
            y: self.y,
            yaw_deg: self.yaw_deg,
        }
    }
}

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spot {
    /// Name of the piece.
    pub piece: String,
    /// Name of the surface on the piece.
    pub surface: String,
    /// Name of the room; `None` outside of rooms.
    pub room: Option<String>,
    /// Quarter turns from the approach edge of the surface to that of the spot.
    pub side: usize,
    /// Range from the approach edge inwards, metres.
    pub inwards: [f64; 2],
    /// Range along the edge from its middle, metres.
    pub along: [f64; 2],
    /// Free height above the surface, at most 0.6 m.
    pub headroom: f64,
    /// Middle of the spot in `house`, metres.
    pub at: [f64; 2],
    /// Stops of the chair for it: x, y, metres, and heading, radians.
    pub stops: Vec<[f64; 3]>,
    /// That for its middle.
    pub stop: [f64; 3],
    /// Start of the chair.
    pub start: Start,
    /// The chair does not get there from the start of the home.
    pub apart: bool,
}

impl Spot {
    /// The spot on a reached surface, without a start.
    ///
    /// # Errors
    /// The reason when objects have no room.
    pub(super) fn new(
        home: &Home,
        file: &HomeFile,
        surface: &Surface,
        strip: &Strip,
    ) -> Result<Self, &'static str> {
        let piece = &home.pieces[surface.piece];
        let entry = file.piece.iter().find(|entry| entry.name == piece.name);
        if strip.side != 0 && entry.is_none_or(|entry| entry.mirror || entry.scale.is_some()) {
            return Err("its piece is scaled or mirrored");
        }
        let last = strip.depth - BEHIND;
        let inwards = match last > NEAREST {
            true => [NEAREST, last.min(FURTHEST)],
            false => [strip.depth / 2.0; 2],
        };
        let edge = Frame::new(surface, strip);
        let solids: Vec<[[f64; 2]; 2]> = home
            .solids
            .iter()
            .filter(|s| {
                s.heights[1] > surface.height + 1e-3 && s.heights[0] < surface.height + TALL
            })
            .map(bounds)
            .collect();
        let has_room = |along: f64| {
            let middle = INWARDS.clamp(inwards[0], inwards[1]);
            [inwards[0], middle, inwards[1]].iter().all(|&inwards| {
                let at = edge.at(along, inwards);
                solids.iter().all(|[low, high]| {
                    (0..2).any(|i| at[i] + APART <= low[i] || at[i] - APART >= high[i])
                })
            })
        };
        let points = strip.points.iter().zip(&strip.stops);
        let points = points.filter(|(along, _)| has_room(**along));
        let points: Vec<(f64, [f64; 3])> = points.map(|(along, stop)| (*along, *stop)).collect();
        let run = longest_run(&points);
        let (Some(first), Some(last)) = (run.first(), run.last()) else {
            return Err("something stands beside every reached point");
        };
        let along = match last.0 - first.0 > 2.0 * END {
            true => [first.0 + END, last.0 - END],
            false => [f64::midpoint(first.0, last.0); 2],
        };
        let middle = run[run.len() / 2];
        let at = edge.at(middle.0, INWARDS.clamp(inwards[0], inwards[1]));
        let over = home.solids.iter().filter(|solid| {
            let [low, high] = bounds(solid);
            solid.heights[0] > surface.height + 0.02
                && (0..2).all(|i| at[i] + APART > low[i] && at[i] - APART < high[i])
        });
        let lowest = over.map(|solid| solid.heights[0] - surface.height);
        let room = home.room_at(at).or_else(|| home.room_at(surface.centre));
        Ok(Self {
            piece: piece.name.clone(),
            surface: surface.name.clone(),
            room: room.map(|room| home.rooms[room].name.clone()),
            side: strip.side,
            inwards: inwards.map(rounded),
            along: along.map(rounded),
            headroom: lowest.fold(ABOVE, f64::min),
            at,
            stops: run.iter().map(|(_, stop)| *stop).collect(),
            stop: middle.1,
            start: Start::default(),
            apart: false,
        })
    }

    /// A spot in tests.
    #[cfg(test)]
    pub(super) fn test(piece: &str, surface: &str) -> Self {
        Self {
            piece: piece.into(),
            surface: surface.into(),
            room: Some("kitchen".into()),
            side: 0,
            inwards: [0.1, 0.2],
            along: [0.0, 0.2],
            headroom: 0.35,
            at: [0.0; 2],
            stops: Vec::new(),
            stop: [0.0; 3],
            start: Start::default(),
            apart: false,
        }
    }
}

/// The frame of an approach edge in `house`.
struct Frame {
    middle: [f64; 2],
    inwards: [f64; 2],
}

impl Frame {
    fn new(surface: &Surface, strip: &Strip) -> Self {
        let (sin, cos) = wheelarm_proto::exact::sin_cos(strip.inwards);
        Self {
            middle: [
                surface.centre[0] - cos * strip.depth / 2.0,
                surface.centre[1] - sin * strip.depth / 2.0,
            ],
            inwards: [cos, sin],
        }
    }

    /// A point, metres.
    fn at(&self, along: f64, inwards: f64) -> [f64; 2] {
        let [cos, sin] = self.inwards;
        [
            self.middle[0] + inwards * cos - along * sin,
            self.middle[1] + inwards * sin + along * cos,
        ]
    }
}

/// The longest part of rising points without a gap.
fn longest_run(points: &[(f64, [f64; 3])]) -> &[(f64, [f64; 3])] {
    let runs = points.chunk_by(|a, b| b.0 - a.0 < 1.5 * SPACING);
    // The first of equal ones.
    runs.rev().max_by_key(|run| run.len()).unwrap_or_default()
}

/// The level box around a solid along x and y, as areas take furniture: smallest and largest
/// coordinates, metres.
fn bounds(solid: &Solid) -> [[f64; 2]; 2] {
    let outline = &solid.outline;
    let [cos, sin] = outline.along.map(f64::abs);
    let half = [
        outline.half[0] * cos + outline.half[1] * sin,
        outline.half[0] * sin + outline.half[1] * cos,
    ];
    [-1.0, 1.0].map(|sign| [0, 1].map(|i| outline.centre[i] + sign * half[i]))
}

/// Rounds to a millimetre; negative zero becomes zero.
pub(super) fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longest_run_has_no_gap() {
        let points: Vec<(f64, [f64; 3])> = [-0.3, -0.2, 0.0, 0.1, 0.2, 0.4]
            .map(|along| (along, [0.0; 3]))
            .to_vec();
        let run: Vec<f64> = longest_run(&points).iter().map(|p| p.0).collect();
        assert_eq!(run, [0.0, 0.1, 0.2]);
        assert!(longest_run(&[]).is_empty());
    }
}
