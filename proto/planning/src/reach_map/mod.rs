//! The reach map: where the hand of one robot gets to from a parked chair.
//!
//! A table of bits over the distance of the grasp point from the arm's base on the floor
//! plan, its height above that base, the pitch of the hand, and the direction of the hand
//! against the direction from the base to the point. The first and the last joint of an arm
//! turn without limit, so that neither the bearing of the point nor the roll of the hand
//! matters. The table knows nothing of obstacles: neither chair nor person nor furniture.
//!
//! `compute` fills it from the arm's kinematics once; `assets/robots/NAME/reach.bin` keeps it
//! (`file`). A look-up takes tens of nanoseconds.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Vector3};
use wheelarm_proto::digest::{self, Digest};
use wheelarm_proto::exact;

use super::footprint_check::wrap;

mod compute;
mod file;

pub use compute::{Arm, compute, hand_pose};
pub use file::{FILE_BYTES, ReachMapError};

/// Distances of the grasp point from the arm's base: first, step, metres, and number.
pub const DISTANCES: (f64, f64, usize) = (0.10, 0.025, 40);
/// Heights of the grasp point above the arm's base: first, step, metres, and number.
pub const HEIGHTS: (f64, f64, usize) = (-0.60, 0.025, 64);
/// Pitches of the hand, down is positive: first, step, radians, and number.
pub const PITCHES: (f64, f64, usize) = (-TAU / 8.0, TAU / 24.0, 10);
/// Directions of the hand on the floor plan, all around.
pub const DIRECTIONS: usize = 24;

/// Bits of one distance and height.
const BITS: usize = PITCHES.2 * DIRECTIONS;
/// Their bytes.
const CELL_BYTES: usize = BITS / 8;
/// Bytes of the table.
const TABLE_BYTES: usize = DISTANCES.2 * HEIGHTS.2 * CELL_BYTES;

/// The hand against the arm's base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandPlace {
    /// From the axis of the base to the grasp point on the floor plan, metres.
    pub distance: f64,
    /// Of the grasp point above the base, metres.
    pub height: f64,
    /// Of the hand, radians; 0 is level, π/2 is from above.
    pub pitch: f64,
    /// Of the hand against the direction from the base to the point, on the floor plan,
    /// radians; 0 leads away from the base, positive is to the left.
    pub direction: f64,
}

impl HandPlace {
    /// The place of an end effector in the arm's base, whose grasp point is `tool_length`
    /// metres along its z axis.
    #[must_use]
    pub fn from_tool(base_from_tool: &Isometry3<f64>, tool_length: f64) -> Self {
        let along = base_from_tool.rotation * Vector3::z();
        let point = base_from_tool.translation.vector + along * tool_length;
        let bearing = exact::atan2(point.y, point.x);
        Self {
            distance: exact::hypot(point.x, point.y),
            height: point.z,
            pitch: exact::atan2(-along.z, exact::hypot(along.x, along.y)),
            direction: wrap(exact::atan2(along.y, along.x) - bearing),
        }
    }
}

/// One entry of the table by its indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Of [`DISTANCES`].
    pub distance: usize,
    /// Of [`HEIGHTS`].
    pub height: usize,
    /// Of [`PITCHES`].
    pub pitch: usize,
    /// Of [`DIRECTIONS`].
    pub direction: usize,
}

impl Entry {
    /// Number of entries.
    pub const COUNT: usize = DISTANCES.2 * HEIGHTS.2 * BITS;

    /// The entry with this number, below [`Entry::COUNT`].
    #[must_use]
    pub fn numbered(number: usize) -> Self {
        let (cell, bit) = (number / BITS, number % BITS);
        Self {
            distance: cell / HEIGHTS.2,
            height: cell % HEIGHTS.2,
            pitch: bit / DIRECTIONS,
            direction: bit % DIRECTIONS,
        }
    }

    /// Its number.
    #[must_use]
    pub fn number(&self) -> usize {
        (self.distance * HEIGHTS.2 + self.height) * BITS + self.pitch * DIRECTIONS + self.direction
    }

    /// The entry whose middle is nearest; `None` outside the table.
    #[must_use]
    pub fn nearest(place: &HandPlace) -> Option<Self> {
        let index = |value: f64, (first, step, count): (f64, f64, usize)| {
            let index = ((value - first) / step).round();
            (index >= 0.0 && index < count as f64).then_some(index as usize)
        };
        let turn = (place.direction / TAU * DIRECTIONS as f64).round();
        // A direction that is not finite becomes 0.
        let direction = (turn as i64).rem_euclid(DIRECTIONS as i64) as usize;
        Some(Self {
            distance: index(place.distance, DISTANCES)?,
            height: index(place.height, HEIGHTS)?,
            pitch: index(place.pitch, PITCHES)?,
            direction,
        })
    }

    /// Its middle.
    #[must_use]
    pub fn place(&self) -> HandPlace {
        let value = |index: usize, (first, step, _): (f64, f64, usize)| first + step * index as f64;
        HandPlace {
            distance: value(self.distance, DISTANCES),
            height: value(self.height, HEIGHTS),
            pitch: value(self.pitch, PITCHES),
            direction: wrap(self.direction as f64 / DIRECTIONS as f64 * TAU),
        }
    }
}

/// See the module.
#[derive(Clone, PartialEq)]
pub struct ReachMap {
    /// The arm's base in the chair (chair_from_base).
    mount: Isometry3<f64>,
    /// Of the robot that it was computed from, see [`ReachMap::source_of`].
    source: Digest,
    table: Vec<u8>,
}

impl std::fmt::Debug for ReachMap {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("ReachMap")
            .field("mount", &self.mount)
            .field("reached", &self.len())
            .finish_non_exhaustive()
    }
}

impl ReachMap {
    /// Digest of what a map is computed from: the text of the robot's URDF, and the
    /// distance from the end effector to the grasp point, metres.
    #[must_use]
    pub fn source_of(urdf_text: &str, tool_length: f64) -> Digest {
        digest::of_message([&tool_length.to_le_bytes()[..], urdf_text.as_bytes()])
    }

    /// Whether the hand gets to a place. Outside the table it does not.
    #[must_use]
    pub fn reaches(&self, place: &HandPlace) -> bool {
        Entry::nearest(place).is_some_and(|entry| self.contains(entry))
    }

    /// Whether an entry is reached.
    #[must_use]
    pub fn contains(&self, entry: Entry) -> bool {
        let number = entry.number();
        self.table
            .get(number / 8)
            .is_some_and(|byte| byte >> (number % 8) & 1 == 1)
    }

    /// The arm's base in the chair (chair_from_base).
    #[must_use]
    pub fn mount(&self) -> &Isometry3<f64> {
        &self.mount
    }

    /// Digest of what it was computed from, see [`ReachMap::source_of`].
    #[must_use]
    pub fn source(&self) -> &Digest {
        &self.source
    }

    /// Number of reached entries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.table.iter().map(|b| b.count_ones() as usize).sum()
    }

    /// Whether no entry is reached.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.table.iter().all(|byte| *byte == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_the_nearest_to_its_middle() {
        for number in (0..Entry::COUNT).step_by(7) {
            let entry = Entry::numbered(number);
            assert_eq!(entry.number(), number);
            assert_eq!(Entry::nearest(&entry.place()), Some(entry), "{entry:?}");
        }
        assert_eq!(BITS % 8, 0, "entries of a cell are whole bytes");
    }

    #[test]
    fn places_outside_the_table_are_not_reached() {
        let place = HandPlace {
            distance: 0.6,
            height: 0.2,
            pitch: 0.0,
            direction: 0.0,
        };
        let map = ReachMap {
            mount: Isometry3::identity(),
            source: [0; 32],
            table: vec![0xff; TABLE_BYTES],
        };
        assert!(map.reaches(&place));
        let far = HandPlace {
            distance: 1.2,
            ..place
        };
        let low = HandPlace {
            height: -0.7,
            ..place
        };
        let up = HandPlace {
            pitch: -1.2,
            ..place
        };
        let nan = HandPlace {
            distance: f64::NAN,
            ..place
        };
        for outside in [far, low, up, nan] {
            assert!(!map.reaches(&outside), "{outside:?}");
        }
        let behind = HandPlace {
            direction: -100.0,
            ..place
        };
        assert!(map.reaches(&behind), "directions wrap");
    }

    #[test]
    fn place_of_a_tool_is_that_of_its_grasp_point() {
        for number in (0..Entry::COUNT).step_by(1013) {
            let place = Entry::numbered(number).place();
            let found = HandPlace::from_tool(&hand_pose(&place, 0.12), 0.12);
            assert!((found.distance - place.distance).abs() < 1e-9);
            assert!((found.height - place.height).abs() < 1e-9);
            assert!((found.pitch - place.pitch).abs() < 1e-7);
            // From above, the direction is lost.
            if place.pitch < 1.5 {
                assert!(wrap(found.direction - place.direction).abs() < 1e-9);
            }
        }
    }
}
