//! Hinges and rails that the groups of a model name.
//!
//! `sweethome3d_hinge_2` is a pin, `sweethome3d_opening_on_hinge_2_door` the leaf on it,
//! `…_handle` its handle; rails likewise. The longest side of a pin is the axis.

use std::collections::BTreeMap;

use crate::fit::{Fitted, bounds};
use crate::model::{Model, Triangle};
use crate::raster::Point3;

/// Kinds of joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum JointKind {
    /// A leaf that turns.
    Hinge,
    /// A drawer or a leaf that slides.
    Rail,
}

/// A joint of a model, in the frame of its kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Hinge or rail.
    pub kind: JointKind,
    /// Number in the names of the groups.
    pub number: u32,
    /// Middle of the pin.
    pub at: Point3,
    /// Axis of the longest side of the pin: 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Triangles that move, those of the handle included.
    pub leaf: Vec<usize>,
    /// Triangles of the handle.
    pub handle: Vec<usize>,
}

/// What a group is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Pin(JointKind, u32),
    Leaf(JointKind, u32),
}

/// Reads the name of a group.
fn part(name: &str) -> Option<Part> {
    // The library joins several group names with spaces; the first counts.
    let name = name.split_whitespace().next()?;
    let rest = name.strip_prefix("sweethome3d_")?;
    let of = |text: &str| {
        let (kind, rest) = if let Some(rest) = text.strip_prefix("hinge_") {
            (JointKind::Hinge, rest)
        } else {
            (JointKind::Rail, text.strip_prefix("rail_")?)
        };
        let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
        let ends = rest[digits.len()..].chars().next().is_none_or(|c| c == '_');
        let number = digits.parse().ok().filter(|_| ends)?;
        Some((kind, number))
    };
    for prefix in ["opening_on_", "window_pane_on_", "window_mirror_on_"] {
        if let Some(text) = rest.strip_prefix(prefix) {
            return of(text).map(|(kind, number)| Part::Leaf(kind, number));
        }
    }
    // One rail serves all drawers: number 0.
    if rest.starts_with("unique_rail") {
        return Some(Part::Pin(JointKind::Rail, 0));
    }
    of(rest).map(|(kind, number)| Part::Pin(kind, number))
}

/// Whether a group is a pane of glass.
#[must_use]
pub fn is_pane(group: &str) -> bool {
    group.starts_with("sweethome3d_window_pane")
}

/// Whether a group is a mirror.
#[must_use]
pub fn is_mirror(group: &str) -> bool {
    group.starts_with("sweethome3d_window_mirror")
}

/// The joints of a model, sorted by kind and number.
#[must_use]
pub fn joints(model: &Model, fitted: &Fitted) -> Vec<Joint> {
    let parts: Vec<Option<Part>> = model.groups.iter().map(|name| part(name)).collect();
    let is_handle: Vec<bool> = model
        .groups
        .iter()
        .map(|name| {
            let name = name.to_ascii_lowercase();
            ["handle", "poign", "knob", "griff"]
                .iter()
                .any(|word| name.contains(word))
        })
        .collect();
    let mut leaves: BTreeMap<(JointKind, u32), Vec<usize>> = BTreeMap::new();
    let mut pins: BTreeMap<(JointKind, u32), Vec<usize>> = BTreeMap::new();
    for (index, triangle) in model.triangles.iter().enumerate() {
        match parts.get(triangle.group as usize).copied().flatten() {
            Some(Part::Leaf(kind, number)) => {
                leaves.entry((kind, number)).or_default().push(index);
            }
            Some(Part::Pin(kind, number)) => pins.entry((kind, number)).or_default().push(index),
            None => {}
        }
    }
    let mut found = Vec::new();
    for ((kind, number), leaf) in leaves {
        let Some(pin) = pins.get(&(kind, number)).or_else(|| pins.get(&(kind, 0))) else {
            continue;
        };
        let (low, high) = extent(model, fitted, pin);
        let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        let longest = |best: usize, axis: usize| if size[axis] > size[best] { axis } else { best };
        let handle = leaf.iter().copied().filter(|&index| {
            let group = model.triangles[index].group as usize;
            is_handle.get(group).copied().unwrap_or(false)
        });
        found.push(Joint {
            kind,
            number,
            at: [0, 1, 2].map(|axis| 0.5 * (low[axis] + high[axis])),
            axis: [1, 2].into_iter().fold(0, longest),
            handle: handle.collect(),
            leaf,
        });
    }
    found
}

/// Smallest and largest coordinates of some triangles.
#[must_use]
pub fn extent(model: &Model, fitted: &Fitted, triangles: &[usize]) -> (Point3, Point3) {
    let of = |triangle: &Triangle| triangle.corners.map(|c| fitted.points[c as usize]);
    let points: Vec<Point3> = triangles
        .iter()
        .flat_map(|&index| of(&model.triangles[index]))
        .collect();
    bounds(&points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_groups_are_read() {
        use JointKind::{Hinge, Rail};
        for (name, expected) in [
            ("sweethome3d_hinge_1_2", Some(Part::Pin(Hinge, 1))),
            ("sweethome3d_hinge_1_1_Gond_3", Some(Part::Pin(Hinge, 1))),
            ("sweethome3d_unique_rail", Some(Part::Pin(Rail, 0))),
            (
                "sweethome3d_opening_on_hinge_12_door",
                Some(Part::Leaf(Hinge, 12)),
            ),
            (
                "sweethome3d_window_pane_on_rail_2",
                Some(Part::Leaf(Rail, 2)),
            ),
            ("sweethome3d_window_pane", None),
            ("sweethome3d_hinge_x", None),
            ("sweethome3d_hinge_99999999999", None),
            ("Corps", None),
            ("", None),
        ] {
            assert_eq!(part(name), expected, "{name}");
        }
    }
}
