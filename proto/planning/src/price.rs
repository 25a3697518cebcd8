//! Price of driving, in seconds: what a path search minimizes.

use super::hybrid_a_star::Segment;

/// Speeds, m/s, and turn rate, rad/s.
pub(super) const STRAIGHT: f64 = 0.45;
pub(super) const ARC: f64 = 0.35;
pub(super) const TURN: f64 = 0.5;
/// Factor for driving back.
pub(super) const BACK: f64 = 2.5;
/// Time lost by stopping between rolling and turning on the spot, s.
pub(super) const STOP: f64 = 1.5;
/// Cost of a change of curvature, s: fewer bends track better.
pub(super) const BEND: f64 = 0.3;

/// Motion of a chair along a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Forward, straight on or in an arc.
    Forward,
    /// Back.
    Back,
    /// On the spot.
    Turn,
}

impl Motion {
    /// In the order of their numbers.
    pub(super) const ALL: [Self; 3] = [Self::Forward, Self::Back, Self::Turn];

    /// The motion along a segment.
    #[must_use]
    pub fn along(segment: &Segment) -> Self {
        match *segment {
            Segment::Turn(_) => Self::Turn,
            Segment::Roll { length, .. } if length < 0.0 => Self::Back,
            Segment::Roll { .. } => Self::Forward,
        }
    }
}

/// Price of `segments` after `last`, seconds.
pub(super) fn seconds(last: Option<Segment>, segments: &[Segment]) -> f64 {
    let mut previous = last;
    let mut sum = 0.0;
    for segment in segments {
        let [stop, bend] = previous.map_or([0.0; 2], |previous| between(&previous, segment));
        sum += own(segment) + stop + bend;
        previous = Some(*segment);
    }
    sum
}

fn own(segment: &Segment) -> f64 {
    match *segment {
        Segment::Turn(angle) => angle.abs() / TURN,
        Segment::Roll { length, curvature } => {
            let speed = if curvature == 0.0 { STRAIGHT } else { ARC };
            length.abs() / speed * if length < 0.0 { BACK } else { 1.0 }
        }
    }
}

/// Price of a stop and of a bend between two segments, seconds.
fn between(previous: &Segment, segment: &Segment) -> [f64; 2] {
    let (stops, bends) = match (previous, segment) {
        (Segment::Turn(a), Segment::Turn(b)) => (a * b < 0.0, false),
        (
            Segment::Roll {
                length: a,
                curvature: from,
            },
            Segment::Roll {
                length: b,
                curvature: to,
            },
        ) => (a * b < 0.0, from != to),
        _ => (true, false),
    };
    [f64::from(stops) * STOP, f64::from(bends) * BEND]
}
