//! What hangs on walls and from the ceiling.

use super::super::random::Random;
use super::super::shape::{Design, Model, about};
use super::kitchen;

/// A piece on a wall: x points into the room, and x = 0 is the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WallPiece {
    /// A cabinet above a worktop, of a width.
    UpperCabinet(f64),
    /// The hood above a cooker, of a width.
    Hood(f64),
    /// A mirror, of a width.
    Mirror(f64),
    /// A framed image: width and height.
    Image([f64; 2]),
    /// A clock.
    Clock,
    /// Hooks with a coat.
    Hooks,
    /// A rail with a towel.
    TowelRail,
    /// A small shelf with books and a pot.
    Shelf(f64),
    /// A radiator, of a width.
    Radiator(f64),
    /// A lamp below the ceiling.
    Pendant,
}

impl WallPiece {
    /// Its category.
    #[must_use]
    pub fn category(self) -> &'static str {
        match self {
            Self::UpperCabinet(_) => "upper_cabinet",
            Self::Hood(_) => "hood",
            Self::Mirror(_) => "mirror",
            Self::Image(_) => "painting",
            Self::Clock => "clock",
            Self::Hooks => "hooks",
            Self::TowelRail => "towel",
            Self::Shelf(_) => "bracket_shelf",
            Self::Radiator(_) => "radiator",
            Self::Pendant => "lamp",
        }
    }

    /// Width along the wall, and lower and upper end, metres.
    #[must_use]
    pub fn extent(self) -> (f64, [f64; 2]) {
        match self {
            Self::UpperCabinet(width) => (width, [1.46, 2.10]),
            Self::Hood(width) => (width, [1.55, 2.4]),
            Self::Mirror(width) => (width, [0.98, 1.88]),
            Self::Image([width, height]) => (width, [1.52 - height / 2.0, 1.52 + height / 2.0]),
            Self::Clock => (0.30, [1.80, 2.10]),
            Self::Hooks => (0.80, [0.75, 1.75]),
            Self::TowelRail => (0.50, [0.60, 1.20]),
            Self::Shelf(width) => (width, [1.40, 1.75]),
            Self::Radiator(width) => (width, [0.14, 0.70]),
            Self::Pendant => (0.5, [1.9, 2.5]),
        }
    }
}

/// The shapes of a piece on a wall of a room of a height.
#[must_use]
pub fn wall_pieces(piece: WallPiece, room: f64, design: Design, random: &mut Random) -> Model {
    let mut m = Model::new(piece.category());
    let (width, z) = piece.extent();
    match piece {
        WallPiece::UpperCabinet(width) => kitchen::upper_cabinet(&mut m, width, z, design),
        WallPiece::Hood(width) => kitchen::hood(&mut m, width, room),
        WallPiece::Mirror(width) => {
            m.shown("metal_dark", [[0.0, 0.018], about(0.0, width), z]);
            m.shown(
                "mirror",
                [
                    [0.018, 0.021],
                    about(0.0, width - 0.03),
                    [z[0] + 0.015, z[1] - 0.015],
                ],
            );
            m.bar(
                "lampshade",
                [0.05, 0.0, z[1] + 0.05],
                1,
                [0.022, width * 0.6],
            );
        }
        WallPiece::Image(size) => image(&mut m, size, random),
        WallPiece::Clock => {
            let middle = f64::midpoint(z[0], z[1]);
            m.bar("metal_dark", [0.015, 0.0, middle], 0, [0.15, 0.03]);
            m.bar("paper", [0.031, 0.0, middle], 0, [0.137, 0.004]);
            m.shown(
                "plastic_dark",
                [[0.033, 0.036], about(0.0, 0.012), [middle, middle + 0.10]],
            );
            m.shown(
                "plastic_dark",
                [[0.033, 0.036], [0.0, 0.075], about(middle, 0.012)],
            );
        }
        WallPiece::Hooks => hooks(&mut m, width, z),
        WallPiece::TowelRail => {
            m.bar("chrome", [0.07, 0.0, z[1]], 1, [0.009, width]);
            for side in [-1.0, 1.0] {
                m.bar(
                    "chrome",
                    [0.035, side * (width / 2.0 - 0.02), z[1]],
                    0,
                    [0.008, 0.07],
                );
            }
            m.shown(
                "towel",
                [[0.078, 0.090], about(0.02, 0.38), [z[0], z[1] + 0.012]],
            );
            m.shown(
                "towel",
                [
                    [0.050, 0.062],
                    about(0.02, 0.38),
                    [z[0] + 0.12, z[1] + 0.012],
                ],
            );
            m.shown(
                "towel",
                [
                    [0.050, 0.090],
                    about(0.02, 0.38),
                    [z[1] + 0.008, z[1] + 0.018],
                ],
            );
        }
        WallPiece::Shelf(width) => {
            m.block(
                "wood",
                [[0.0, 0.20], about(0.0, width), [z[0], z[0] + 0.025]],
            );
            let top = z[0] + 0.025;
            super::storage::books(
                &mut m,
                [0.02, 0.17],
                [-width / 2.0 + 0.03, width * 0.12],
                top,
                0.24,
                random,
            );
            m.cone("ceramic_2", [0.10, width * 0.32, top], [0.045, 0.06], 0.10);
            super::living::leaves(&mut m, [0.10, width * 0.32, top + 0.10], 0.15, 9, random);
        }
        WallPiece::Radiator(width) => {
            m.solid([[0.0, 0.10], about(0.0, width), z]);
            let count = (width / 0.075).round();
            for index in 0..count as usize {
                let at = -width / 2.0 + width * (index as f64 + 0.5) / count;
                m.cushion("radiator", [[0.03, 0.10], about(at, 0.060), z], 0.014, 0.0);
            }
            m.shown(
                "radiator",
                [
                    [0.045, 0.086],
                    about(0.0, width),
                    [z[0] + 0.04, z[0] + 0.07],
                ],
            );
            m.shown(
                "radiator",
                [
                    [0.045, 0.086],
                    about(0.0, width),
                    [z[1] - 0.07, z[1] - 0.04],
                ],
            );
        }
        WallPiece::Pendant => {
            m.rod("metal_dark", [0.0, 0.0, room - 0.03], 0.05, 0.03);
            m.rod("metal_dark", [0.0, 0.0, room - 0.45], 0.006, 0.43);
            let shade = [
                [0.0, 0.20],
                [0.06, 0.20],
                [0.20, 0.05],
                [0.22, 0.0],
                [0.20, 0.0],
                [0.05, 0.18],
            ];
            m.turned("lampshade", [0.0, 0.0, room - 0.62], &shade);
        }
    }
    m
}

/// A framed image of simple areas of color.
fn image(m: &mut Model, [width, height]: [f64; 2], random: &mut Random) {
    const ART: [&str; 4] = ["art_1", "art_2", "art_3", "art_4"];
    let z = about(1.52, height);
    m.shown("frame", [[0.0, 0.022], about(0.0, width), z]);
    m.shown(
        "paper",
        [
            [0.022, 0.025],
            about(0.0, width - 0.04),
            [z[0] + 0.02, z[1] - 0.02],
        ],
    );
    let margin = 0.075;
    let (y, z) = (
        about(0.0, width - 2.0 * margin),
        [z[0] + margin, z[1] - margin],
    );
    let mut order = ART;
    random.shuffle(&mut order);
    m.shown(order[0], [[0.025, 0.027], y, z]);
    let tall = z[1] - z[0];
    match random.index(3) {
        0 => {
            let horizon = z[0] + tall * random.number([0.25, 0.45]);
            m.shown(order[1], [[0.027, 0.028], y, [z[0], horizon]]);
            m.shown(
                order[2],
                [[0.027, 0.0285], y, [horizon, horizon + 0.10 * tall]],
            );
            let radius = 0.13 * (y[1] - y[0]).min(tall);
            let at = random.number([0.3, 0.7]) * (y[1] - y[0]) + y[0];
            m.bar(
                order[3],
                [0.028, at, z[1] - 0.26 * tall],
                0,
                [radius, 0.002],
            );
        }
        1 => {
            for (index, material) in order[1..].iter().enumerate() {
                let radius = (0.30 - 0.06 * index as f64) * (y[1] - y[0]).min(tall);
                let at = y[0] + (y[1] - y[0]) * random.number([0.35, 0.65]);
                let up = z[0] + tall * (0.25 + 0.25 * index as f64);
                let radius = radius
                    .min(at - y[0])
                    .min(y[1] - at)
                    .min(up - z[0])
                    .min(z[1] - up);
                let x = 0.028 + 0.001 * index as f64;
                m.bar(material, [x, at, up], 0, [radius.max(0.01), 0.002]);
            }
        }
        _ => {
            let count = 4;
            for index in 0..count {
                let step = (y[1] - y[0]) / f64::from(count);
                let from = y[0] + step * f64::from(index);
                let up = z[0] + tall * random.number([0.25, 0.95]);
                let material = order[1 + index as usize % 3];
                m.shown(
                    material,
                    [
                        [0.027, 0.028],
                        [from + 0.1 * step, from + 0.9 * step],
                        [z[0], up],
                    ],
                );
            }
        }
    }
}

fn hooks(m: &mut Model, width: f64, z: [f64; 2]) {
    m.shown(
        "wood",
        [[0.0, 0.02], about(0.0, width), [z[1] - 0.10, z[1]]],
    );
    for index in 0..5 {
        let at = -width / 2.0 + width * (f64::from(index) + 0.5) / 5.0;
        m.bar("handle", [0.045, at, z[1] - 0.06], 0, [0.007, 0.06]);
    }
    // Two coats: a body and a collar.
    for (index, material) in [(1, "coat"), (3, "blanket")] {
        let at = -width / 2.0 + width * (f64::from(index) + 0.5) / 5.0;
        m.cushion(
            material,
            [[0.02, 0.15], about(at, 0.30), [z[0], z[1] - 0.16]],
            0.06,
            0.0,
        );
        m.cushion(
            material,
            [[0.03, 0.13], about(at, 0.18), [z[1] - 0.24, z[1] - 0.08]],
            0.05,
            0.0,
        );
    }
    m.solid([[0.0, 0.14], about(0.0, width * 0.8), z]);
}
