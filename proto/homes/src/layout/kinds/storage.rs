//! Wardrobes, chests of drawers, bookcases and boards.

use super::super::random::Random;
use super::super::shape::{Design, Grip, Model, about};

pub fn wardrobe(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let front = depth / 2.0 - 0.022;
    let y = about(0.0, width);
    m.block("wardrobe", [[-depth / 2.0, front], y, [0.06, height]]);
    m.block("plinth", [[-depth / 2.0, front - 0.03], y, [0.0, 0.06]]);
    let count = (width / 0.5).round().max(2.0);
    let step = width / count;
    for index in 0..count as usize {
        let from = y[0] + step * index as f64;
        let grip = if index % 2 == 0 {
            Grip::Left
        } else {
            Grip::Right
        };
        m.front(
            design,
            "front_wardrobe",
            front,
            [from, from + step],
            [0.06, height],
            grip,
        );
    }
}

/// A chest of drawers: three rows in two columns.
pub fn dresser(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let (front, foot) = (depth / 2.0 - 0.02, 0.12);
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.block("wood", [[x[0], front], y, [foot, height - 0.025]]);
    m.block("wood", [x, y, [height - 0.025, height]]);
    m.legs(design, "wood_dark", [x[0], front], y, foot, 0.045);
    let step = (height - 0.025 - foot) / 3.0;
    for row in 0..3 {
        let from = foot + step * f64::from(row);
        for y in [[y[0], 0.0], [0.0, y[1]]] {
            m.front(
                design,
                "front_wood",
                front - 0.002,
                y,
                [from, from + step],
                Grip::Level,
            );
        }
    }
    m.surface("top", x, y, height);
}

/// A low board with an open compartment between two doors.
pub fn tv_board(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let (front, foot) = (depth / 2.0 - 0.02, 0.10);
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.solid([[x[0], front], y, [foot, height - 0.03]]);
    m.block("wood", [x, y, [height - 0.03, height]]);
    m.shown("wood", [[x[0], front], y, [foot, foot + 0.02]]);
    m.shown("wood", [[x[0], x[0] + 0.012], y, [foot, height - 0.03]]);
    let third = width / 3.0;
    for at in [y[0], y[0] + third, y[1] - third, y[1] - 0.02] {
        m.shown(
            "wood",
            [[x[0], front], [at, at + 0.02], [foot, height - 0.03]],
        );
    }
    m.legs(design, "wood_dark", [x[0], front], y, foot, 0.045);
    let z = [foot, height - 0.03];
    m.front(
        design,
        "front_wood",
        front - 0.002,
        [y[0], y[0] + third],
        z,
        Grip::Left,
    );
    m.front(
        design,
        "front_wood",
        front - 0.002,
        [y[1] - third, y[1]],
        z,
        Grip::Right,
    );
    // A box and its lights in the compartment.
    m.shown(
        "plastic_dark",
        [
            about(-0.02, 0.22),
            about(0.0, 0.30),
            [foot + 0.02, foot + 0.08],
        ],
    );
    m.surface("top", x, y, height);
}

/// Rows of books between two ends of a board.
pub fn books(m: &mut Model, x: [f64; 2], y: [f64; 2], z: f64, height: f64, random: &mut Random) {
    const SPINES: [&str; 6] = [
        "book_red",
        "book_blue",
        "book_cream",
        "book_ochre",
        "art_teal",
        "art_sage",
    ];
    let mut at = y[0];
    while at < y[1] - 0.02 {
        let thick = random.number([0.022, 0.050]).min(y[1] - at);
        let tall = height * random.number([0.72, 1.0]);
        let deep = (x[1] - x[0]) * random.number([0.80, 1.0]);
        let material = random.one(&SPINES).unwrap_or("book_blue");
        m.shown(
            material,
            [[x[0], x[0] + deep], [at, at + thick - 0.002], [z, z + tall]],
        );
        at += thick;
    }
}

/// The boards of a bookcase: sides, back and levels; the middle one is free when `open`.
fn boards(m: &mut Model, [depth, width, height]: [f64; 3], levels: &[f64]) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    for at in [y[0], y[1] - 0.022] {
        m.shown("wood", [x, [at, at + 0.022], [0.0, height]]);
    }
    m.shown("wood", [[x[0], x[0] + 0.008], y, [0.04, height]]);
    for &level in levels {
        m.shown("wood", [x, y, [level - 0.022, level]]);
    }
    m.shown("wood_dark", [[x[0], x[1] - 0.02], y, [0.0, 0.04]]);
}

/// Fills a compartment: books, a basket, a vase, or little.
fn fill(m: &mut Model, x: [f64; 2], y: [f64; 2], z: [f64; 2], random: &mut Random) {
    let height = z[1] - z[0];
    let width = y[1] - y[0];
    match random.index(6) {
        0 if height > 0.2 => {
            let basket = [
                [x[0] + 0.02, x[1] - 0.03],
                [y[0] + 0.03, y[0] + 0.03 + 0.8 * width],
                [z[0], z[0] + 0.62 * height],
            ];
            m.cushion("basket", basket, 0.02, 0.0);
        }
        1 => {
            let at = [f64::midpoint(x[0], x[1]), f64::midpoint(y[0], y[1]), z[0]];
            let s = (height * 0.75).min(0.24);
            m.turned(
                "ceramic_1",
                at,
                &[
                    [0.0, 0.0],
                    [0.24 * s, 0.0],
                    [0.34 * s, 0.32 * s],
                    [0.2 * s, 0.72 * s],
                    [0.12 * s, 0.88 * s],
                    [0.16 * s, s],
                ],
            );
        }
        2 => {
            let half = y[0] + 0.55 * width;
            books(
                m,
                [x[0] + 0.02, x[1] - 0.04],
                [y[0] + 0.01, half],
                z[0],
                height * 0.86,
                random,
            );
            let at = [f64::midpoint(x[0], x[1]), half + 0.18 * width, z[0]];
            m.cone("ceramic_2", at, [0.035, 0.055], (height * 0.4).min(0.12));
        }
        _ => {
            let until = y[0] + width * random.number([0.6, 0.97]);
            books(
                m,
                [x[0] + 0.02, x[1] - 0.04],
                [y[0] + 0.01, until],
                z[0],
                height * 0.88,
                random,
            );
        }
    }
}

pub fn bookcase(m: &mut Model, size: [f64; 3], random: &mut Random) {
    let [depth, width, height] = size;
    let count = ((height - 0.08) / 0.34).round().max(3.0);
    let step = (height - 0.08) / count;
    let levels: Vec<f64> = (0..=count as usize)
        .map(|i| 0.08 + step * i as f64)
        .collect();
    boards(m, size, &levels);
    let x = about(0.0, depth);
    let columns = if width > 0.9 { 2 } else { 1 };
    let wide = (width - 0.044) / f64::from(columns);
    for pair in levels.windows(2) {
        for column in 0..columns {
            let from = -width / 2.0 + 0.022 + wide * f64::from(column);
            fill(
                m,
                x,
                [from, from + wide],
                [pair[0], pair[1] - 0.022],
                random,
            );
        }
    }
    m.solid([x, about(0.0, width), [0.0, height]]);
}

/// A shelf with a free board at the height of a hand.
pub fn shelf(m: &mut Model, size: [f64; 3], random: &mut Random) {
    let [depth, width, height] = size;
    let board = 0.78;
    let levels = [0.08, 0.42, board, 1.24, height];
    boards(m, size, &levels);
    let x = about(0.0, depth);
    let half = width / 2.0 - 0.022;
    for pair in [[0.08, 0.42], [0.42, board], [1.24, height]] {
        for y in [[-half, -0.01], [0.01, half]] {
            fill(m, x, y, [pair[0], pair[1] - 0.022], random);
        }
    }
    let y = about(0.0, width);
    m.solid([x, y, [0.0, board]]);
    m.solid([x, y, [1.24 - 0.022, height]]);
    m.solid([[x[0], x[0] + 0.01], y, [board, 1.24]]);
    for at in [y[0], y[1] - 0.022] {
        m.solid([x, [at, at + 0.022], [board, 1.24]]);
    }
    m.surface(
        "board",
        [x[0] + 0.01, x[1]],
        [y[0] + 0.022, y[1] - 0.022],
        board,
    );
}

pub fn shoe_cabinet(m: &mut Model, [depth, width, height]: [f64; 3], design: Design) {
    let front = depth / 2.0 - 0.02;
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.block("carcass", [[x[0], front], y, [0.06, height - 0.025]]);
    m.block("plinth", [[x[0], front - 0.03], y, [0.0, 0.06]]);
    m.block("wood", [x, y, [height - 0.025, height]]);
    let middle = f64::midpoint(0.06, height - 0.025);
    for z in [[0.06, middle], [middle, height - 0.025]] {
        m.front(design, "front", front - 0.002, y, z, Grip::Level);
    }
    m.surface("top", x, y, height);
}

pub fn toy_box(m: &mut Model, [depth, width, height]: [f64; 3]) {
    let (x, y) = (about(0.0, depth), about(0.0, width));
    m.solid([x, y, [0.0, height]]);
    m.shown("wood", [x, y, [0.0, 0.02]]);
    for at in [y[0], y[1] - 0.018] {
        m.shown("wood", [x, [at, at + 0.018], [0.0, height]]);
    }
    for at in [x[0], x[1] - 0.018] {
        m.shown("wood", [[at, at + 0.018], y, [0.0, height]]);
    }
    let toys = [
        ([-0.05, -0.14], 0.075, "cushion_1"),
        ([0.06, 0.02], 0.09, "cushion_2"),
        ([-0.06, 0.16], 0.07, "art_teal"),
    ];
    for (at, radius, material) in toys {
        m.ball(material, [at[0], at[1], height - 0.03], radius);
    }
}
