//! Spatial relations (left, right, in front, behind, near and others), shared by
//! generator, parser and answers about recordings.
//!
//! All positions are in the frame of the area ([`crate::Area::from_viewer`]): x
//! inwards, away from the viewer; y to the left; z up; between the origins of the
//! entities' frames. Entities of two areas have no such relation.
//!
//! - *left of*: further left by at least [`STEP`], and by at least the difference in
//!   depth (within 45° of sideways); *right of* mirrored;
//! - *in front of*: closer to the edge by at least [`STEP`], and by more than the
//!   sideways difference; *behind* mirrored. So at most one of the four holds;
//! - the wider relation [`might`] extends each by [`LOOSE`]: the generator does not use
//!   "left of" when another entity might be meant too;
//! - in an order (first from the left, nearest, …) two entities closer than [`TIE`] are
//!   not distinguished.

use crate::scene::{Entity, Scene};

/// Smallest distance of two entities in a direction, metres.
pub const STEP: f64 = 0.06;
/// Smallest distance at which a person might still use the relation, metres, and how
/// much steeper than 45° it may be.
pub const LOOSE: (f64, f64) = (0.02, 1.5);
/// Smallest difference in an order, metres.
pub const TIE: f64 = 0.03;
/// Position of the chair's seat at an area, in the area's frame: from the reach of the
/// bundled robot. Metres.
pub const CHAIR: [f64; 2] = [-0.95, 0.0];
/// Position of the arm's base then, metres.
pub const ARM: [f64; 2] = [-0.53, 0.36];

/// A direction relative to a viewer of the area.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// To the left.
    Left,
    /// To the right.
    Right,
    /// Closer to the viewer.
    Front,
    /// Further away.
    Behind,
}

/// How far `a` is to that side of `b`, and the perpendicular distance, metres; `None`
/// for two areas.
fn along(a: &Entity, b: &Entity, side: Side) -> Option<(f64, f64)> {
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
pub fn is_on_side(a: &Entity, b: &Entity, side: Side) -> bool {
    along(a, b, side).is_some_and(|(by, beside)| match side {
        Side::Left | Side::Right => by >= STEP && by >= beside,
        Side::Front | Side::Behind => by >= STEP && by > beside,
    })
}

/// Whether a person might use the relation.
#[must_use]
pub fn might(a: &Entity, b: &Entity, side: Side) -> bool {
    along(a, b, side).is_some_and(|(by, beside)| by >= LOOSE.0 && by * LOOSE.1 >= beside)
}

/// Order of entities, smallest key first.
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
    /// The largest first.
    Large,
    /// The smallest first.
    Small,
}

impl Order {
    /// Key of the order, metres.
    #[must_use]
    pub fn key(self, entity: &Entity) -> f64 {
        let [deep, left, up] = entity.at;
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
            Self::Large => -entity.size,
            Self::Small => entity.size,
        }
    }

    /// Whether it needs the sizes of the entities.
    #[must_use]
    pub fn is_of_size(self) -> bool {
        matches!(self, Self::Large | Self::Small)
    }
}

/// Number `place` (0 is the first) of some entities in an order, including ties; empty
/// when there are fewer.
#[must_use]
pub fn at_place(scene: &Scene, among: &[usize], order: Order, place: usize) -> Vec<usize> {
    let is_unknown = |i: &usize| scene.entities[*i].size <= 0.0;
    if order.is_of_size() && among.iter().any(is_unknown) {
        return Vec::new();
    }
    let key = |i: usize| order.key(&scene.entities[i]);
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
