//! Leaves on hinges and rails as kinds of their own: joint, collision shapes, grasps.

use wheelarm_pack::{GraspEntry, JointEntry, KindFile};
use wheelarm_proto::exact;

use crate::build::kinds::{FRICTION, shape};
use crate::build::painter::Part;
use crate::build::{rounded, rounded3};
use crate::fit::Fitted;
use crate::joints::{Joint, JointKind, extent};
use crate::model::Model;
use crate::raster::Point3;
use crate::solid::Solid;

/// Largest opening of a leaf, degrees.
const OPENING_DEG: f64 = 100.0;
/// Least number of triangles of a leaf.
const LEAST_LEAF: usize = 8;
/// Least length of a leaf along the front, metres.
const LEAST_SIDE: f64 = 0.10;

/// Thickness of the front of a drawer, metres.
const FRONT: f64 = 0.02;

/// Friction of a flap over the torque of its weight.
const HOLD: f64 = 1.1;
/// m/s².
const GRAVITY: f64 = 9.81;

/// Whether a leaf is worth a joint: an upright or level hinge across the front, or a rail
/// that leads to the front.
pub(super) fn is_useful(joint: &Joint, model: &Model, fitted: &Fitted) -> bool {
    let (low, high) = extent(model, fitted, &joint.leaf);
    let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    let is_large = size[1] > LEAST_SIDE && size[2] > 0.05;
    let is_thin = size[0] < size[1];
    let turns = joint.kind == JointKind::Hinge && joint.axis != 0 && is_thin;
    let slides = joint.kind == JointKind::Rail && joint.axis == 0;
    joint.leaf.len() >= LEAST_LEAF && is_large && (turns || slides)
}

/// Origin of a leaf in the frame of its carrier: on the axis of a hinge, at the leaf's foot.
pub(super) fn origin(joint: &Joint, model: &Model, fitted: &Fitted) -> Point3 {
    let (low, high) = extent(model, fitted, &joint.leaf);
    match (joint.kind, joint.axis) {
        (JointKind::Hinge, 2) => [joint.at[0], joint.at[1], low[2]],
        (JointKind::Hinge, _) => [joint.at[0], 0.5 * (low[1] + high[1]), joint.at[2]],
        (JointKind::Rail, _) => [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]],
    }
}

/// The kind of a leaf: its joint, a box for the leaf and one for its handle, grasps.
pub(super) fn leaf_kind(
    joint: &Joint,
    model: &Model,
    fitted: &Fitted,
    parts: Vec<Part>,
) -> (KindFile, Vec<Solid>) {
    let o = origin(joint, model, fitted);
    let relative = |p: Point3| [0, 1, 2].map(|axis| p[axis] - o[axis]);
    let panel: Vec<usize> = joint
        .leaf
        .iter()
        .copied()
        .filter(|index| joint.handle.binary_search(index).is_err())
        .collect();
    let panel = if panel.is_empty() {
        &joint.leaf
    } else {
        &panel
    };
    let (low, high) = extent(model, fitted, panel);
    let (low, high) = (relative(low), relative(high));
    let mut shapes = Vec::new();
    match joint.kind {
        JointKind::Hinge => {
            // Two millimetres less on each side: the leaf moves past its frame.
            let gap = 0.002;
            shapes.push(Solid::cuboid(
                [low[0], low[1] + gap, low[2] + gap],
                [high[0], high[1] - gap, high[2] - gap],
            ));
        }
        JointKind::Rail => {
            let front = (high[0] - FRONT).max(low[0]);
            let gap = 0.002;
            shapes.push(Solid::cuboid(
                [front, low[1] + gap, low[2] + gap],
                [high[0], high[1] - gap, high[2] - gap],
            ));
        }
    }
    let size = [0, 1, 2].map(|axis| (high[axis] - low[axis]).max(0.015));
    // Scenes bound the centre of mass and the inertia by the collision shapes. A drawer only
    // moves along x, so its front may have them.
    let heavy_low = match joint.kind {
        JointKind::Hinge => low,
        JointKind::Rail => [(high[0] - FRONT).max(low[0]), low[1], low[2]],
    };
    let com = [0, 1, 2].map(|axis| 0.5 * (heavy_low[axis] + high[axis]));
    let volume = size[0] * size[1] * size[2];
    let mut grasps = Vec::new();
    if !joint.handle.is_empty() {
        let (low, high) = extent(model, fitted, &joint.handle);
        let (low, high) = (relative(low), relative(high));
        shapes.push(Solid::cuboid(low, high));
        grasps = handle_grasps(low, high);
    }
    let (axis, mass, friction, damping) = match joint.kind {
        JointKind::Hinge => {
            let axis = if joint.axis == 2 {
                // The free edge moves to the front.
                [0.0, 0.0, if com[1] > 0.0 { -1.0 } else { 1.0 }]
            } else {
                [0.0, if com[2] > 0.0 { 1.0 } else { -1.0 }, 0.0]
            };
            let mass = (250.0 * volume).clamp(1.5, 20.0);
            // Flaps of dishwashers and ovens have springs: friction holds them at every angle.
            let arm = exact::hypot(com[0], com[2]);
            let friction = match joint.axis {
                2 => 1.0,
                _ => rounded(1.0 + HOLD * mass * GRAVITY * arm),
            };
            (axis, mass, friction, 0.5)
        }
        JointKind::Rail => ([1.0, 0.0, 0.0], 2.5, 5.0, 10.0),
    };
    let square = |axis: usize| {
        let side = (high[axis] - heavy_low[axis]).max(0.015);
        side * side
    };
    // The smallest eigenvalues of thin plates are raised: rounding must keep
    // Ixx + Iyy >= Izz in every order.
    let inertia = [(1, 2), (0, 2), (0, 1)].map(|(a, b)| {
        let whole = mass / 12.0 * (square(a) + square(b)) + 1.0e-4;
        (whole * 1.0e6).round() / 1.0e6
    });
    let slides = joint.kind == JointKind::Rail;
    let kind = KindFile {
        category: if slides {
            "drawer".into()
        } else {
            "door".into()
        },
        friction: Some(FRICTION),
        parts: parts.into_iter().map(|part| part.entry).collect(),
        collision: Some(shapes.iter().map(shape).collect()),
        joint: Some(JointEntry {
            turns: !slides,
            axis,
            travel: slides.then(|| rounded((0.8 * size[0]).clamp(0.05, 0.40))),
            travel_deg: (!slides).then_some(OPENING_DEG),
            mass: rounded(mass),
            com: rounded3(com),
            inertia,
            friction,
            damping,
        }),
        grasps,
        ..KindFile::default()
    };
    (kind, shapes)
}

/// Grasps of a handle from the front, across its thin sides.
fn handle_grasps(low: Point3, high: Point3) -> Vec<GraspEntry> {
    let middle = [0, 1, 2].map(|axis| 0.5 * (low[axis] + high[axis]));
    let mut grasps = Vec::new();
    for (name, axis) in [("across", 1), ("along", 2)] {
        let width = (high[axis] - low[axis]).max(0.012);
        if width >= 0.075 {
            continue;
        }
        let mut closing = [0.0; 3];
        closing[axis] = 1.0;
        grasps.push(GraspEntry {
            name: format!("handle_{name}"),
            point: rounded3([middle[0] + 0.028, middle[1], middle[2]]),
            approach: [-1.0, 0.0, 0.0],
            closing,
            width: rounded(width),
            symmetric: false,
            force: None,
            from_above: false,
        });
    }
    grasps
}
