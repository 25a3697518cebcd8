//! Bathrooms and laundries.

use super::super::shape::{Design, Grip, Model, about};

pub fn basin(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    let front = depth / 2.0 - 0.03;
    // The cabinet leaves room for the knees of a seated user below it.
    let below = 0.46;
    m.block("carcass", [[x[0], front], y, [below, height - 0.05]]);
    let half = width / 2.0;
    if width > 0.75 {
        m.front(
            design,
            "front_bath",
            front,
            [-half, 0.0],
            [below, height - 0.05],
            Grip::Level,
        );
        m.front(
            design,
            "front_bath",
            front,
            [0.0, half],
            [below, height - 0.05],
            Grip::Level,
        );
    } else {
        m.front(
            design,
            "front_bath",
            front,
            y,
            [below, height - 0.05],
            Grip::Level,
        );
    }
    m.block("worktop_bath", [x, y, [height - 0.05, height]]);
    // The bowl at one side leaves a surface at the other.
    let bowl = [y[0] + 0.06, y[0] + 0.06 + 0.42_f64.min(width - 0.34)];
    let middle = f64::midpoint(bowl[0], bowl[1]);
    let radius = (bowl[1] - bowl[0]) / 2.0;
    m.turned(
        "ceramic_white",
        [0.02, middle, height],
        &[
            [0.0, 0.012],
            [radius * 0.70, 0.018],
            [radius * 0.93, 0.086],
            [radius, 0.10],
            [radius * 0.97, 0.0],
            [0.0, 0.0],
        ],
    );
    m.solid([about(0.02, 2.0 * radius), bowl, [height, height + 0.10]]);
    let tap = x[0] + 0.06;
    m.rod("chrome", [tap, middle, height], 0.020, 0.18);
    m.bar(
        "chrome",
        [tap + 0.06, middle, height + 0.17],
        0,
        [0.011, 0.14],
    );
    m.solid([
        [tap - 0.02, tap + 0.13],
        about(middle, 0.04),
        [height, height + 0.19],
    ]);
    m.surface("top", x, [bowl[1] + 0.01, y[1]], height);
}

pub fn toilet(m: &mut Model, [depth, width, height]: [f64; 3]) {
    let (back, front) = (-depth / 2.0, depth / 2.0);
    // A grab bar on either side, within the width.
    let (rail, width) = (width / 2.0 - 0.03, 0.37);
    let half = width / 2.0;
    m.cushion(
        "ceramic_white",
        [
            [back, back + 0.20],
            about(0.0, width),
            [height - 0.02, height + 0.38],
        ],
        0.025,
        0.0,
    );
    m.shown(
        "ceramic_white",
        [[back, back + 0.24], about(0.0, width * 0.62), [0.0, height]],
    );
    // The bowl: an oval of a polygon.
    let oval: Vec<[f64; 2]> = (0..16)
        .map(|i| {
            let angle = std::f64::consts::TAU * f64::from(i) / 16.0;
            let (sin, cos) = wheelarm_proto::exact::sin_cos(angle);
            let length = (front - back - 0.20) / 2.0;
            [front - length + length * cos, half * sin]
        })
        .collect();
    let scaled = |share: f64| -> Vec<[f64; 2]> {
        oval.iter()
            .map(|[x, y]| [(x - 0.05) * share + 0.05, y * share])
            .collect()
    };
    m.prism(
        "ceramic_white",
        &scaled(0.62),
        height * 0.5,
        [0.0, 0.0, 0.0],
        [0.0; 3],
    );
    m.prism(
        "ceramic_white",
        &scaled(0.92),
        height * 0.5 - 0.02,
        [0.0, 0.0, height * 0.5],
        [0.0; 3],
    );
    m.prism(
        "ceramic_white",
        &scaled(1.0),
        0.02,
        [0.0, 0.0, height - 0.02],
        [0.0; 3],
    );
    m.prism(
        "plastic_white",
        &scaled(0.98),
        0.022,
        [0.0, 0.0, height],
        [0.0; 3],
    );
    m.shown(
        "chrome",
        [
            [back + 0.08, back + 0.13],
            about(0.0, 0.08),
            [height + 0.378, height + 0.384],
        ],
    );
    m.solid([[back, front], about(0.0, width), [0.0, height + 0.02]]);
    m.solid([
        [back, back + 0.20],
        about(0.0, width),
        [height, height + 0.38],
    ]);
    m.bar(
        "chrome",
        [back + 0.32, rail, height + 0.28],
        0,
        [0.016, 0.60],
    );
    m.bar(
        "chrome",
        [back + 0.32, -rail, height + 0.28],
        0,
        [0.016, 0.60],
    );
}

/// A level shower: the chair drives in. A drawn curtain hangs at one side.
pub fn shower(m: &mut Model, [depth, width, height]: [f64; 3]) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.shown("shower_floor", [x, y, [0.0, 0.004]]);
    let drain = about(0.0, 0.12);
    m.shown("chrome", [drain, drain, [0.004, 0.006]]);
    // The rail around the shower, and the folds of the curtain at the wall.
    let top = 2.0;
    m.bar("chrome", [0.0, y[1] - 0.02, top], 0, [0.010, depth]);
    m.bar("chrome", [x[1] - 0.02, 0.0, top], 1, [0.010, width]);
    for index in 0..6 {
        let at = x[0] + 0.05 + 0.05 * f64::from(index);
        let off = if index % 2 == 0 { 0.012 } else { -0.012 };
        let fold = [about(at, 0.045), about(y[1] - 0.02 + off, 0.012)];
        m.shown("bedding_fold", [fold[0], fold[1], [0.06, top]]);
    }
    m.solid([[x[0], x[0] + 0.34], [y[1] - 0.04, y[1]], [0.06, top]]);
    // Rail, hand shower, head and tap at the wall.
    let shower = [x[0] + 0.05, y[0] + 0.30];
    m.rod("chrome", [shower[0], shower[1], 0.95], 0.010, height - 0.95);
    let middle = [x[0] + 0.17, shower[1], height - 0.02];
    m.bar("chrome", middle, 0, [0.010, 0.26]);
    m.rod(
        "chrome",
        [x[0] + 0.30, shower[1], height - 0.05],
        0.10,
        0.018,
    );
    m.bar("chrome", [shower[0], shower[1], 1.08], 1, [0.026, 0.26]);
    // A folded seat.
    let seat = [[x[0], x[0] + 0.05], about(y[0] + 0.62, 0.36), [0.48, 0.90]];
    m.shown("plastic_white", seat);
    m.solid([[x[0], x[0] + 0.08], about(0.0, width), [0.48, 1.95]]);
}

pub fn tub(m: &mut Model, [depth, width, height]: [f64; 3]) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.solid([x, y, [0.0, height]]);
    let rim = 0.07;
    m.shown("panel_bath", [x, y, [0.0, 0.06]]);
    for (across, along) in [
        ([x[0], x[0] + rim], y),
        ([x[1] - rim, x[1]], y),
        (x, [y[0], y[0] + rim]),
        (x, [y[1] - rim, y[1]]),
    ] {
        m.shown("panel_bath", [across, along, [0.0, height - 0.03]]);
        m.cushion(
            "ceramic_white",
            [across, along, [height - 0.05, height]],
            0.015,
            0.0,
        );
    }
    m.cushion(
        "ceramic_white",
        [
            [x[0] + 0.05, x[1] - 0.05],
            [y[0] + 0.05, y[1] - 0.05],
            [0.08, 0.16],
        ],
        0.03,
        0.0,
    );
    m.rod("chrome", [0.0, y[0] + 0.035, height], 0.018, 0.10);
    m.bar(
        "chrome",
        [0.0, y[0] + 0.10, height + 0.10],
        1,
        [0.014, 0.16],
    );
    m.bar(
        "chrome",
        [x[0] - 0.0 + 0.03, 0.0, height + 0.20],
        1,
        [0.016, 0.6],
    );
}

pub fn washing_machine(m: &mut Model, [depth, width, height]: [f64; 3]) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    let front = x[1] - 0.02;
    m.block("appliance", [[x[0], front], y, [0.02, height - 0.03]]);
    m.block("appliance", [x, y, [height - 0.03, height]]);
    m.shown(
        "plastic_grey",
        [
            [front, front + 0.006],
            about(0.0, width - 0.02),
            [height - 0.15, height - 0.04],
        ],
    );
    m.bar(
        "appliance",
        [front + 0.012, 0.18, height - 0.095],
        0,
        [0.028, 0.024],
    );
    m.shown(
        "plastic_dark",
        [
            [front + 0.006, front + 0.008],
            about(-0.12, 0.16),
            [height - 0.115, height - 0.075],
        ],
    );
    m.bar("chrome", [front + 0.006, 0.0, 0.42], 0, [0.19, 0.016]);
    m.bar("hob", [front + 0.010, 0.0, 0.42], 0, [0.155, 0.018]);
    m.shown(
        "chrome",
        [
            [front + 0.008, front + 0.022],
            about(-0.185, 0.03),
            about(0.42, 0.10),
        ],
    );
    m.surface("top", x, y, height);
}

pub fn laundry_basket(m: &mut Model, [depth, width, height]: [f64; 3]) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.cushion("basket", [x, y, [0.0, height - 0.04]], 0.03, 0.0);
    m.cushion("basket_dark", [x, y, [height - 0.05, height]], 0.02, 0.0);
    m.cushion(
        "towel",
        [
            about(0.03, depth * 0.7),
            about(0.0, width * 0.6),
            [height - 0.03, height + 0.05],
        ],
        0.03,
        6.0,
    );
    m.solid([x, y, [0.0, height]]);
}

pub fn bin(m: &mut Model, [depth, _, height]: [f64; 3]) {
    let radius = depth / 2.0;
    m.cone(
        "plastic_grey",
        [0.0, 0.0, 0.0],
        [radius * 0.8, radius],
        height - 0.02,
    );
    m.rod("plastic_dark", [0.0, 0.0, height - 0.02], radius, 0.02);
    m.solid([
        about(0.0, 1.8 * radius),
        about(0.0, 1.8 * radius),
        [0.0, height],
    ]);
}
