//! Beds.

use super::super::files::Front;
use super::super::shape::{Design, Model, about};

/// A bed with its head at the back.
pub fn bed(m: &mut Model, [depth, width, height]: [f64; 3], design: Design, double: bool) {
    let (back, front) = (-depth / 2.0, depth / 2.0);
    let (x, y) = ([back + 0.06, front], about(0.0, width));
    let mattress = height - 0.06;
    m.solid([about(0.0, depth), y, [0.08, mattress]]);
    m.solid([[back, back + 0.06], y, [0.0, height + 0.50]]);
    m.legs(
        design,
        "wood_dark",
        [x[0], x[1] - 0.02],
        [y[0] + 0.02, y[1] - 0.02],
        0.10,
        0.06,
    );
    m.shown("wood", [x, y, [0.10, 0.30]]);
    // The head.
    m.shown("wood", [[back, back + 0.05], y, [0.06, height + 0.50]]);
    match design.front {
        Front::Framed => {
            m.cushion(
                "headboard",
                [
                    [back + 0.04, back + 0.10],
                    about(0.0, width - 0.10),
                    [height - 0.05, height + 0.46],
                ],
                0.03,
                0.0,
            );
        }
        Front::Boards => {
            let count = (width / 0.14).round();
            for index in 0..count as usize {
                let at = y[0] + width * (index as f64 + 0.5) / count;
                m.shown(
                    "wood_dark",
                    [
                        [back + 0.05, back + 0.058],
                        about(at, 0.10),
                        [height - 0.10, height + 0.46],
                    ],
                );
            }
        }
        Front::Plain => {}
    }
    m.cushion(
        "pillow",
        [
            [x[0], x[1] - 0.02],
            about(0.0, width - 0.06),
            [0.28, mattress],
        ],
        0.05,
        0.0,
    );
    // The cover, with a folded edge, and a blanket at the foot.
    m.cushion(
        "bedding",
        [
            [back + 0.62, x[1] - 0.005],
            about(0.0, width - 0.01),
            [mattress - 0.20, mattress + 0.035],
        ],
        0.035,
        0.0,
    );
    m.cushion(
        "bedding_fold",
        [
            [back + 0.56, back + 0.78],
            about(0.0, width - 0.02),
            [mattress - 0.04, mattress + 0.055],
        ],
        0.03,
        0.0,
    );
    m.shown(
        "blanket",
        [
            [front - 0.58, front - 0.18],
            about(0.0, width + 0.004),
            [mattress - 0.12, mattress + 0.045],
        ],
    );
    let places: &[f64] = if double { &[-0.25, 0.25] } else { &[0.0] };
    for share in places {
        let wide = if double { width * 0.40 } else { width * 0.66 };
        let y = about(share * width, wide);
        m.cushion(
            "pillow",
            [
                [back + 0.12, back + 0.50],
                y,
                [mattress - 0.01, mattress + 0.13],
            ],
            0.06,
            -12.0,
        );
    }
}
