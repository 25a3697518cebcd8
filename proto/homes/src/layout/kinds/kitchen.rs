//! Kitchens: base cabinets below one worktop, sink, cooker, fridge, tall cabinet.

use super::super::shape::{Design, Grip, Model, about};

/// Thickness of a worktop, height of a plinth, metres.
const TOP: f64 = 0.038;
const PLINTH: f64 = 0.10;
/// Distance of the front of a carcass from that of the worktop, metres.
const RECESS: f64 = 0.036;

/// The carcass and the plinth of a base cabinet; returns the plane of its front and its height.
fn base(m: &mut Model, [depth, width, height]: [f64; 3]) -> (f64, f64) {
    let (back, front, top) = (-depth / 2.0, depth / 2.0 - RECESS, height - TOP);
    let y = about(0.0, width);
    m.block("carcass", [[back, front], y, [PLINTH, top]]);
    m.block("plinth", [[back, front - 0.05], y, [0.0, PLINTH]]);
    (front, top)
}

/// The worktop with a surface for objects.
fn worktop(m: &mut Model, [depth, width, height]: [f64; 3]) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.block("worktop", [x, y, [height - TOP, height]]);
    m.surface("top", x, y, height);
    splash(m, depth, width, height);
}

/// The tiles behind a worktop.
fn splash(m: &mut Model, depth: f64, width: f64, height: f64) {
    let x = [-depth / 2.0, -depth / 2.0 + 0.008];
    m.shown("splash", [x, about(0.0, width), [height, height + 0.50]]);
}

pub fn cabinet(m: &mut Model, size: [f64; 3], design: Design) {
    let (front, top) = base(m, size);
    let half = size[1] / 2.0;
    let drawer = top - 0.16;
    if size[1] > 0.70 {
        m.front(
            design,
            "front",
            front,
            [-half, 0.0],
            [PLINTH, drawer],
            Grip::Left,
        );
        m.front(
            design,
            "front",
            front,
            [0.0, half],
            [PLINTH, drawer],
            Grip::Right,
        );
    } else {
        m.front(
            design,
            "front",
            front,
            [-half, half],
            [PLINTH, drawer],
            Grip::Left,
        );
    }
    m.front(
        design,
        "front",
        front,
        [-half, half],
        [drawer, top],
        Grip::Level,
    );
    worktop(m, size);
}

pub fn drawers(m: &mut Model, size: [f64; 3], design: Design) {
    let (front, top) = base(m, size);
    let y = about(0.0, size[1]);
    let heights = [PLINTH, PLINTH + 0.30, PLINTH + 0.58, top];
    for pair in heights.windows(2) {
        m.front(design, "front", front, y, [pair[0], pair[1]], Grip::Level);
    }
    worktop(m, size);
}

/// The sink has no surface: its basin and drainer take the worktop.
pub fn sink(m: &mut Model, size: [f64; 3], design: Design) {
    let [depth, width, height] = size;
    let (front, top) = base(m, size);
    let half = width / 2.0;
    m.front(
        design,
        "front",
        front,
        [-half, 0.0],
        [PLINTH, top],
        Grip::Left,
    );
    m.front(
        design,
        "front",
        front,
        [0.0, half],
        [PLINTH, top],
        Grip::Right,
    );
    let (x, z) = (about(0.0, depth), [height - TOP, height]);
    let basin = [about(-0.01, 0.38), [-half + 0.10, -half + 0.52]];
    // The worktop around the basin.
    m.solid([x, about(0.0, width), z]);
    m.shown("worktop", [[x[0], basin[0][0]], about(0.0, width), z]);
    m.shown("worktop", [[basin[0][1], x[1]], about(0.0, width), z]);
    m.shown("worktop", [basin[0], [-half, basin[1][0]], z]);
    m.shown("worktop", [basin[0], [basin[1][1], half], z]);
    // The basin, a rim, the drainer.
    m.shown(
        "steel",
        [basin[0], basin[1], [height - 0.17, height - 0.165]],
    );
    for y in basin[1] {
        m.shown(
            "steel",
            [basin[0], about(y, 0.008), [height - 0.17, height + 0.003]],
        );
    }
    for x in basin[0] {
        m.shown(
            "steel",
            [about(x, 0.008), basin[1], [height - 0.17, height + 0.003]],
        );
    }
    let drainer = [basin[1][1] + 0.02, half - 0.04];
    m.shown("steel", [basin[0], drainer, [height, height + 0.004]]);
    for index in 0..5 {
        let at = drainer[0] + (drainer[1] - drainer[0]) * (f64::from(index) + 0.5) / 5.0;
        m.shown(
            "chrome",
            [
                about(-0.01, 0.32),
                about(at, 0.008),
                [height, height + 0.007],
            ],
        );
    }
    // The tap.
    let (x, y) = (basin[0][0] - 0.05, f64::midpoint(basin[1][0], basin[1][1]));
    m.rod("chrome", [x, y, height], 0.024, 0.02);
    m.rod("chrome", [x, y, height], 0.011, 0.24);
    m.bar("chrome", [x + 0.08, y, height + 0.24], 0, [0.010, 0.18]);
    m.rod("chrome", [x + 0.165, y, height + 0.20], 0.010, 0.04);
    m.solid([
        about(x + 0.07, 0.20),
        about(y, 0.05),
        [height, height + 0.25],
    ]);
    splash(m, depth, width, height);
}

pub fn cooker(m: &mut Model, size: [f64; 3]) {
    let [depth, width, height] = size;
    let (front, top) = base(m, size);
    let y = about(0.0, width - 0.004);
    m.shown("steel", [[front, front + 0.02], y, [PLINTH, top]]);
    m.shown(
        "hob",
        [
            [front + 0.02, front + 0.024],
            about(0.0, width - 0.10),
            [0.24, 0.62],
        ],
    );
    m.bar(
        "chrome",
        [front + 0.055, 0.0, 0.68],
        1,
        [0.009, width - 0.14],
    );
    for index in 0..5 {
        let at = -0.18 + 0.09 * f64::from(index);
        m.bar(
            "plastic_dark",
            [front + 0.032, at, top - 0.06],
            0,
            [0.018, 0.026],
        );
    }
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.block("worktop", [x, y, [height - TOP, height]]);
    m.shown(
        "hob",
        [
            about(0.0, depth - 0.08),
            about(0.0, width - 0.04),
            [height, height + 0.005],
        ],
    );
    for (at, radius) in [
        ([0.13, 0.13], 0.075),
        ([0.13, -0.13], 0.09),
        ([-0.13, 0.13], 0.09),
        ([-0.13, -0.13], 0.075),
    ] {
        m.rod(
            "plastic_grey",
            [at[0], at[1], height + 0.005],
            radius,
            0.0006,
        );
        m.rod(
            "hob",
            [at[0], at[1], height + 0.005],
            radius - 0.004,
            0.0009,
        );
    }
    splash(m, depth, width, height);
}

pub fn dishwasher(m: &mut Model, size: [f64; 3]) {
    let (front, top) = base(m, size);
    let y = about(0.0, size[1] - 0.004);
    m.shown("steel", [[front, front + 0.02], y, [PLINTH, top]]);
    m.shown(
        "plastic_dark",
        [
            [front + 0.02, front + 0.022],
            about(0.0, 0.16),
            [top - 0.07, top - 0.04],
        ],
    );
    m.bar(
        "chrome",
        [front + 0.050, 0.0, top - 0.11],
        1,
        [0.009, size[1] - 0.14],
    );
    worktop(m, size);
}

pub fn fridge(m: &mut Model, size: [f64; 3]) {
    let [depth, width, height] = size;
    let front = depth / 2.0 - 0.06;
    let y = about(0.0, width);
    m.block("fridge", [[-depth / 2.0, front], y, [0.03, height]]);
    m.solid([[front, depth / 2.0 - 0.03], y, [0.05, height]]);
    let middle = 0.38 * height;
    for z in [[0.06, middle - 0.004], [middle + 0.004, height - 0.004]] {
        let y = about(0.0, width - 0.004);
        m.cushion("fridge", [[front - 0.01, front + 0.03], y, z], 0.012, 0.0);
    }
    let y = width / 2.0 - 0.05;
    m.rod("chrome", [front + 0.055, y, middle - 0.40], 0.010, 0.34);
    m.rod("chrome", [front + 0.055, y, middle + 0.06], 0.010, 0.40);
    for z in [middle - 0.36, middle - 0.10, middle + 0.10, middle + 0.42] {
        m.bar("chrome", [front + 0.042, y, z], 0, [0.007, 0.026]);
    }
}

pub fn tall_cabinet(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let front = depth / 2.0 - RECESS;
    let y = about(0.0, width);
    m.block("carcass", [[-depth / 2.0, front], y, [PLINTH, height]]);
    m.block("plinth", [[-depth / 2.0, front - 0.05], y, [0.0, PLINTH]]);
    m.front(design, "front", front, y, [PLINTH, 0.86], Grip::Left);
    m.front(design, "front", front, y, [0.86, height], Grip::Left);
}

/// A cabinet above a worktop; its origin is on the floor.
pub fn upper_cabinet(m: &mut Model, width: f64, z: [f64; 2], design: Design) {
    let half = width / 2.0;
    // Its back is the wall, at x = 0.
    m.block("carcass", [[0.0, 0.31], about(0.0, width), z]);
    if width > 0.70 {
        m.front(design, "front_upper", 0.31, [-half, 0.0], z, Grip::Left);
        m.front(design, "front_upper", 0.31, [0.0, half], z, Grip::Right);
    } else {
        m.front(design, "front_upper", 0.31, [-half, half], z, Grip::Left);
    }
}

/// The hood above a cooker.
pub fn hood(m: &mut Model, width: f64, room: f64) {
    let z = 1.55;
    m.block("steel", [[0.0, 0.48], about(0.0, width), [z, z + 0.06]]);
    m.block("steel", [[0.0, 0.27], about(0.0, 0.26), [z + 0.06, room]]);
    m.shown(
        "lampshade",
        [[0.15, 0.35], about(0.0, 0.30), [z - 0.002, z]],
    );
}
