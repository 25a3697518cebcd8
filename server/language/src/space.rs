//! What left, right, in front, behind, near and the like mean, once for speaker,
//! parser and answers about recordings.
//!
//! Everything is measured in the frame of the area ([`crate::Area::seen`]): x
//! inwards, away from who looks; y to the left; z up; between the origins of the
//! things' frames. Things of two areas have no such relation.
//!
//! - *left of*: further left by [`STEP`] at least, and by at least as much as the
//!   two differ in depth (within 45° of sideways); *right of* mirrored;
//! - *in front of*: nearer to the edge by [`STEP`] at least, and by more than the
//!   two differ sideways; *behind* mirrored. So at most one of the four holds;
//! - what might still be called so ([`might`]) is wider, by [`LOOSE`]: nobody says
//!   "left of" where another thing might be meant too;
//! - in an order (first from the left, nearest, …) two things nearer than
//!   [`TIE`] are not told apart.

use crate::scene::{Scene, Thing};

/// Least distance of two things in a direction, metres.
pub const STEP: f64 = 0.06;
/// Least distance at which a person might still say so, metres, and how much
/// steeper than 45° it may lie.
pub const LOOSE: (f64, f64) = (0.02, 1.5);
/// Things that differ by less are not told apart in an order, metres.
pub const TIE: f64 = 0.03;
/// Where the chair's seat is while it stands at an area, in the area's frame:
/// that of the reach of the robot that ships. Metres.
pub const CHAIR: [f64; 2] = [-0.95, 0.0];
/// Where the arm's base is then, metres.
pub const ARM: [f64; 2] = [-0.53, 0.36];

/// A direction as who looks at the area means it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// To the left.
    Left,
    /// To the right.
    Right,
    /// Nearer to who looks.
    Front,
    /// Further away.
    Behind,
}

/// How far `a` lies to that side of `b`, and how far beside it, metres; `None` of
/// two areas.
fn along(a: &Thing, b: &Thing, side: Side) -> Option<(f64, f64)> {
    if a.area.is_none() || a.area != b.area {
        return None;
    }
    let (deep, left) = (a.at[0] - b.at[0], a.at[1] - b.at[1]);
    Some(match side {
        Side::Left => (left, deep.abs()),
        Side::Right => (-left, deep.abs()),
        Side::Front => (-deep, left.abs()),
        Side::Behind => (deep, left.abs()),
    })
}

/// Whether `a` is to that side of `b`.
#[must_use]
pub fn is(a: &Thing, b: &Thing, side: Side) -> bool {
    along(a, b, side).is_some_and(|(by, beside)| match side {
        Side::Left | Side::Right => by >= STEP && by >= beside,
        Side::Front | Side::Behind => by >= STEP && by > beside,
    })
}

/// Whether a person might call it so.
#[must_use]
pub fn might(a: &Thing, b: &Thing, side: Side) -> bool {
    along(a, b, side).is_some_and(|(by, beside)| by >= LOOSE.0 && by * LOOSE.1 >= beside)
}

/// By what things are put into an order, smallest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Order {
    /// From the left.
    Left,
    /// From the right.
    Right,
    /// From above.
    Top,
    /// From below.
    Bottom,
    /// From the approach edge.
    Edge,
    /// From [`CHAIR`], on the floor plan.
    Chair,
    /// From [`ARM`], on the floor plan.
    Arm,
    /// The furthest from [`CHAIR`] first.
    Far,
}

impl Order {
    /// What is compared, metres.
    #[must_use]
    pub fn key(self, thing: &Thing) -> f64 {
        let [deep, left, up] = thing.at;
        let from = |[x, y]: [f64; 2]| ((deep - x).powi(2) + (left - y).powi(2)).sqrt();
        match self {
            Self::Left => -left,
            Self::Right => left,
            Self::Top => -up,
            Self::Bottom => up,
            Self::Edge => deep,
            Self::Chair => from(CHAIR),
            Self::Arm => from(ARM),
            Self::Far => -from(CHAIR),
        }
    }
}

/// Number `place` (0 is the first) of some things in an order, with what is not
/// told apart from it; empty where there are not so many.
#[must_use]
pub fn at_place(scene: &Scene, among: &[usize], order: Order, place: usize) -> Vec<usize> {
    let key = |i: usize| order.key(&scene.things[i]);
    nth_of(among, key, place)
}

/// As [`at_place`], by any distance.
pub(crate) fn nth_of(among: &[usize], key: impl Fn(usize) -> f64, place: usize) -> Vec<usize> {
    let mut sorted = among.to_vec();
    sorted.sort_by(|&a, &b| key(a).total_cmp(&key(b)));
    let Some(&chosen) = sorted.get(place) else {
        return Vec::new();
    };
    let is_near = |i: &usize| (key(*i) - key(chosen)).abs() < TIE;
    sorted.into_iter().filter(is_near).collect()
}
