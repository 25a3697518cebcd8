//! Seats, rugs, lamps and plants.

use super::super::files::Legs;
use super::super::random::Random;
use super::super::shape::{Design, Model, about};

pub fn chair(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let seat = 0.46;
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.cushion("seat", [x, y, [seat - 0.05, seat]], 0.02, 0.0);
    m.shown(
        "wood_dark",
        [
            about(0.0, depth - 0.02),
            about(0.0, width - 0.02),
            [seat - 0.07, seat - 0.04],
        ],
    );
    let legs = Model::new("");
    let mut frame = legs;
    frame.legs(
        design,
        "wood_dark",
        [x[0] + 0.01, x[1] - 0.01],
        [y[0] + 0.01, y[1] - 0.01],
        seat - 0.06,
        0.036,
    );
    m.kind.parts.append(&mut frame.kind.parts);
    // One box for the chair and one for its back: a chair is an obstacle, not a shelf.
    m.solid([x, y, [0.0, seat]]);
    m.solid([[x[0], x[0] + 0.06], y, [seat, height]]);
    let post = 0.032;
    for at in [y[0] + 0.03, y[1] - 0.03] {
        m.shown(
            "wood_dark",
            [
                [x[0] + 0.005, x[0] + 0.005 + post],
                about(at, post),
                [seat - 0.06, height],
            ],
        );
    }
    let back = [x[0] + 0.008, x[0] + 0.030];
    let inner = [y[0] + 0.04, y[1] - 0.04];
    match design.legs {
        Legs::Square => {
            m.shown("wood_dark", [back, inner, [height - 0.14, height - 0.02]]);
            m.shown("wood_dark", [back, inner, [seat + 0.14, seat + 0.20]]);
        }
        Legs::Round => {
            for index in 0..4 {
                let at = inner[0] + (inner[1] - inner[0]) * (f64::from(index) + 0.5) / 4.0;
                m.rod(
                    "wood_dark",
                    [x[0] + 0.02, at, seat],
                    0.009,
                    height - seat - 0.04,
                );
            }
            m.shown("wood_dark", [back, inner, [height - 0.06, height - 0.01]]);
        }
        Legs::Tapered => {
            m.cushion(
                "seat",
                [[x[0], x[0] + 0.04], inner, [seat + 0.12, height - 0.02]],
                0.015,
                0.0,
            );
        }
    }
}

pub fn stool(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.cushion("seat", [x, y, [height - 0.08, height]], 0.03, 0.0);
    m.legs(design, "wood_dark", x, y, height - 0.06, 0.04);
    m.solid([x, y, [0.0, height]]);
}

pub fn sofa(m: &mut Model, [depth, width, height]: [f64; 3], design: Design, random: &mut Random) {
    let (back, front, half) = (-depth / 2.0, depth / 2.0, width / 2.0);
    let arm = 0.16;
    let seat = 0.44;
    m.solid([about(0.0, depth), about(0.0, width), [0.0, seat]]);
    m.solid([[back, back + 0.24], about(0.0, width), [seat, height]]);
    for side in [-1.0, 1.0] {
        let y = about(side * (half - arm / 2.0), arm);
        m.cushion("sofa", [[back + 0.02, front], y, [0.10, 0.62]], 0.05, 0.0);
        m.solid([about(0.0, depth), y, [seat, 0.62]]);
    }
    m.shown(
        "sofa",
        [[back, front - 0.02], about(0.0, width - 0.04), [0.10, 0.30]],
    );
    m.cushion(
        "sofa",
        [
            [back, back + 0.18],
            about(0.0, width - 0.02),
            [0.12, height - 0.02],
        ],
        0.05,
        0.0,
    );
    let inner = width - 2.0 * arm;
    let count = if inner > 1.7 { 3 } else { 2 };
    let step = inner / f64::from(count);
    for index in 0..count {
        let at = -inner / 2.0 + step * (f64::from(index) + 0.5);
        let y = about(at, step - 0.012);
        m.cushion(
            "sofa",
            [[back + 0.14, front + 0.005], y, [0.29, seat + 0.01]],
            0.045,
            0.0,
        );
        m.cushion(
            "sofa",
            [[back + 0.11, back + 0.29], y, [seat - 0.02, height + 0.03]],
            0.06,
            -9.0,
        );
    }
    small_legs(
        m,
        design,
        [back + 0.04, front - 0.06],
        [-half + 0.05, half - 0.05],
    );
    // Cushions and a blanket.
    for (side, material) in [(-1.0, "cushion_1"), (1.0, "cushion_2")] {
        let size = random.number([0.36, 0.44]);
        let y = about(
            side * (inner / 2.0 - size / 2.0 - random.number([0.0, 0.08])),
            size,
        );
        m.cushion(
            material,
            [[back + 0.29, back + 0.41], y, [seat, seat + size]],
            0.055,
            -20.0,
        );
    }
    if random.happens(0.5) {
        let y = about(random.number([-0.2, 0.2]) * inner, 0.45);
        m.shown(
            "blanket",
            [
                [back + 0.20, front + 0.012],
                y,
                [seat + 0.008, seat + 0.022],
            ],
        );
        m.shown(
            "blanket",
            [[front + 0.004, front + 0.014], y, [0.16, seat + 0.018]],
        );
    }
}

fn small_legs(m: &mut Model, design: Design, x: [f64; 2], y: [f64; 2]) {
    for at_x in x {
        for at_y in y {
            match design.legs {
                Legs::Square => m.shown(
                    "wood_dark",
                    [about(at_x, 0.05), about(at_y, 0.05), [0.0, 0.11]],
                ),
                Legs::Round => m.rod("wood_dark", [at_x, at_y, 0.0], 0.022, 0.11),
                Legs::Tapered => m.cone("wood_dark", [at_x, at_y, 0.0], [0.012, 0.024], 0.11),
            };
        }
    }
}

pub fn armchair(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let (back, front, half) = (-depth / 2.0, depth / 2.0, width / 2.0);
    let seat = 0.44;
    m.solid([about(0.0, depth), about(0.0, width), [0.0, seat]]);
    m.solid([[back, back + 0.24], about(0.0, width), [seat, height]]);
    let arm = 0.12;
    for side in [-1.0, 1.0] {
        let y = about(side * (half - arm / 2.0), arm);
        m.cushion(
            "armchair",
            [[back + 0.03, front], y, [0.12, 0.60]],
            0.045,
            0.0,
        );
        m.solid([about(0.0, depth), y, [seat, 0.60]]);
    }
    let y = about(0.0, width - 2.0 * arm);
    m.shown("armchair", [[back + 0.05, front - 0.03], y, [0.13, 0.32]]);
    m.cushion(
        "armchair",
        [[back + 0.12, front], y, [0.30, seat + 0.01]],
        0.045,
        0.0,
    );
    m.cushion(
        "armchair",
        [
            [back, back + 0.20],
            about(0.0, width - 0.03),
            [0.20, height],
        ],
        0.06,
        -8.0,
    );
    m.cushion(
        "cushion_3",
        [
            [back + 0.22, back + 0.33],
            about(0.0, 0.38),
            [seat, seat + 0.34],
        ],
        0.05,
        -18.0,
    );
    small_legs(
        m,
        design,
        [back + 0.08, front - 0.06],
        [-half + 0.06, half - 0.06],
    );
}

/// A rug: thin enough to be driven over, without collision.
pub fn rug(m: &mut Model, [depth, width, _]: [f64; 3]) {
    let layers = [
        ("rug_border", 0.0, 0.0040),
        ("rug", 0.09, 0.0048),
        ("rug_border", 0.22, 0.0056),
        ("rug", 0.26, 0.0064),
    ];
    for (material, inset, height) in layers {
        m.shown(
            material,
            [
                about(0.0, depth - 2.0 * inset),
                about(0.0, width - 2.0 * inset),
                [0.0, height],
            ],
        );
    }
}

pub fn floor_lamp(m: &mut Model, [depth, _, height]: [f64; 3], design: Design) {
    m.rod("metal_dark", [0.0, 0.0, 0.0], depth * 0.42, 0.022);
    if matches!(design.legs, Legs::Tapered) {
        m.cone("wood_dark", [0.0, 0.0, 0.02], [0.022, 0.012], height - 0.20);
    } else {
        m.rod("metal_dark", [0.0, 0.0, 0.02], 0.012, height - 0.20);
    }
    m.cone(
        "lampshade",
        [0.0, 0.0, height - 0.28],
        [depth * 0.5, depth * 0.34],
        0.28,
    );
    m.solid([
        about(0.0, depth * 0.7),
        about(0.0, depth * 0.7),
        [0.0, 0.03],
    ]);
    m.solid([about(0.0, 0.05), about(0.0, 0.05), [0.0, height - 0.28]]);
    m.solid([
        about(0.0, depth * 0.8),
        about(0.0, depth * 0.8),
        [height - 0.28, height],
    ]);
}

/// The outline of a leaf along x, metres per metre.
const LEAF: [[f64; 2]; 8] = [
    [0.0, -0.02],
    [0.25, -0.13],
    [0.55, -0.17],
    [0.85, -0.10],
    [1.0, 0.0],
    [0.85, 0.10],
    [0.55, 0.17],
    [0.25, 0.13],
];

/// Adds leaves around a point.
pub fn leaves(m: &mut Model, at: [f64; 3], length: f64, count: usize, random: &mut Random) {
    for index in 0..count {
        let yaw = 360.0 * index as f64 * 0.381_966;
        let pitch = -random.number([8.0, 78.0]);
        let scale = length * random.number([0.72, 1.0]);
        let outline = LEAF.map(|point| point.map(|c| c * scale));
        let lift = random.number([-0.06, 0.06]) * length;
        let rpy = [
            random.number([-12.0, 12.0]),
            pitch,
            yaw - 360.0 * (yaw / 360.0).round(),
        ];
        let rpy = rpy.map(|angle| (angle * 10.0).round() / 10.0 + 0.0);
        m.prism("leaves", &outline, 0.003, [at[0], at[1], at[2] + lift], rpy);
    }
}

pub fn plant(m: &mut Model, [depth, _, height]: [f64; 3], random: &mut Random) {
    let pot = (0.30 * height).min(0.34);
    let radius = depth * 0.36;
    m.turned(
        "pot",
        [0.0; 3],
        &[
            [0.0, 0.0],
            [radius * 0.72, 0.0],
            [radius, pot],
            [radius * 0.92, pot],
            [radius * 0.88, pot - 0.03],
            [0.0, pot - 0.03],
        ],
    );
    m.rod("soil", [0.0, 0.0, pot - 0.04], radius * 0.88, 0.015);
    m.rod(
        "trunk",
        [0.0, 0.0, pot - 0.04],
        0.014,
        (height - pot) * 0.55,
    );
    let top = height - pot;
    leaves(m, [0.0, 0.0, pot + top * 0.30], depth * 0.62, 9, random);
    leaves(m, [0.0, 0.0, pot + top * 0.50], top * 0.48, 11, random);
    m.solid([
        about(0.0, 1.8 * radius),
        about(0.0, 1.8 * radius),
        [0.0, pot],
    ]);
    m.solid([
        about(0.0, depth * 0.7),
        about(0.0, depth * 0.7),
        [pot, height],
    ]);
}
