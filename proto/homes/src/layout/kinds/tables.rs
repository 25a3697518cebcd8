//! Tables, desks and bedside tables.

use super::super::files::Legs;
use super::super::shape::{Design, Grip, Model, about};

/// A top on four legs with an apron.
fn on_legs(
    m: &mut Model,
    [depth, width, height]: [f64; 3],
    design: Design,
    materials: [&str; 2],
    top: f64,
) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    let [wood, legs] = materials;
    m.block(wood, [x, y, [height - top, height]]);
    let inset = 0.03;
    let (lx, ly) = (
        about(0.0, depth - 2.0 * inset),
        about(0.0, width - 2.0 * inset),
    );
    let thick = if height > 0.6 { 0.06 } else { 0.045 };
    m.legs(design, legs, lx, ly, height - top, thick);
    let z = [height - top - 0.06, height - top];
    if !matches!(design.legs, Legs::Round) {
        for at in [lx[0] + 0.03, lx[1] - 0.03] {
            m.shown(legs, [about(at, 0.018), [ly[0] + thick, ly[1] - thick], z]);
        }
        for at in [ly[0] + 0.03, ly[1] - 0.03] {
            m.shown(legs, [[lx[0] + thick, lx[1] - thick], about(at, 0.018), z]);
        }
    }
    m.surface("top", x, y, height);
}

pub fn table(m: &mut Model, size: [f64; 3], design: Design) {
    on_legs(m, size, design, ["wood", "wood_dark"], 0.035);
}

pub fn coffee_table(m: &mut Model, size: [f64; 3], design: Design) {
    on_legs(m, size, design, ["wood", "wood_dark"], 0.03);
    let [depth, width, _] = size;
    let shelf = [
        about(0.0, depth - 0.12),
        about(0.0, width - 0.12),
        [0.14, 0.158],
    ];
    m.shown("wood_dark", shelf);
}

pub fn console(m: &mut Model, size: [f64; 3], design: Design) {
    on_legs(m, size, design, ["wood", "wood_dark"], 0.03);
}

pub fn work_table(m: &mut Model, size: [f64; 3], design: Design) {
    on_legs(m, size, design, ["wood", "metal_dark"], 0.03);
    // A board at the back, above the knees.
    let [depth, width, height] = size;
    let x = about(-depth / 2.0 + 0.05, 0.016);
    m.block(
        "wood",
        [x, about(0.0, width - 0.20), [height - 0.33, height - 0.03]],
    );
}

pub fn round_table(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let radius = depth.min(width) / 2.0;
    m.rod("wood", [0.0, 0.0, height - 0.032], radius, 0.032);
    // The top collides as boxes within the circle.
    let side = radius * 1.414;
    let z = [height - 0.032, height];
    let square = about(0.0, side);
    m.solid([square, square, z]);
    let (long, short) = (
        about(0.0, 2.0 * radius * 0.94),
        about(0.0, 2.0 * radius * 0.34),
    );
    let below = [z[0], height - 0.004];
    m.solid([long, short, below]);
    m.solid([short, long, below]);
    let column = if matches!(design.legs, Legs::Square) {
        0.05
    } else {
        0.045
    };
    m.rod("wood_dark", [0.0, 0.0, 0.04], column, height - 0.072);
    m.cone("wood_dark", [0.0, 0.0, 0.0], [radius * 0.55, column], 0.05);
    m.solid([about(0.0, 0.10), about(0.0, 0.10), [0.0, height - 0.032]]);
    m.solid([about(0.0, radius), about(0.0, radius), [0.0, 0.03]]);
    m.surface("top", square, square, height);
}

pub fn side_table(m: &mut Model, [depth, width, height]: [f64; 3], _: Design) {
    let radius = depth.min(width) / 2.0;
    m.rod("wood", [0.0, 0.0, height - 0.022], radius, 0.022);
    m.rod("metal_dark", [0.0, 0.0, 0.018], 0.016, height - 0.04);
    m.rod("metal_dark", [0.0, 0.0, 0.0], radius * 0.65, 0.018);
    m.solid([
        about(0.0, 1.7 * radius),
        about(0.0, 1.7 * radius),
        [height - 0.022, height],
    ]);
    m.solid([
        about(0.0, radius),
        about(0.0, radius),
        [0.0, height - 0.022],
    ]);
}

pub fn nightstand(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let (front, foot) = (depth / 2.0 - 0.02, 0.12);
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.block("wood", [[x[0], front], y, [foot, height - 0.022]]);
    m.block("wood", [x, y, [height - 0.022, height]]);
    m.legs(design, "wood_dark", [x[0], front], y, foot, 0.04);
    let middle = f64::midpoint(foot, height - 0.022);
    m.front(
        design,
        "front_wood",
        front - 0.002,
        y,
        [foot, middle],
        Grip::Level,
    );
    m.front(
        design,
        "front_wood",
        front - 0.002,
        y,
        [middle, height - 0.022],
        Grip::Level,
    );
    m.surface("top", x, y, height);
}
