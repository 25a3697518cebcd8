//! Small objects on furniture, which show that the home is lived in. They do not move.

use super::super::random::Random;
use super::super::shape::{Model, about};

/// A small object: its name, and its half lengths along x and y.
#[derive(Clone, Debug)]
pub struct SmallObject {
    /// Name of its kind.
    pub name: &'static str,
    /// Half of the lengths along x and y, metres.
    pub half: [f64; 2],
}

const fn small(name: &'static str, half: [f64; 2]) -> SmallObject {
    SmallObject { name, half }
}

/// What may be on a kind of furniture. The first is always there.
#[must_use]
pub fn on(kind: &str) -> &'static [SmallObject] {
    const WORKTOP: &[SmallObject] = &[
        small("kettle", [0.09, 0.08]),
        small("jars", [0.05, 0.16]),
        small("toaster", [0.09, 0.14]),
        small("cutting_board", [0.05, 0.16]),
        small("knife_block", [0.07, 0.05]),
        small("fruit_bowl", [0.13, 0.13]),
        small("herb_pot", [0.07, 0.07]),
        small("paper_roll", [0.07, 0.07]),
    ];
    const TABLE: &[SmallObject] = &[
        small("fruit_bowl", [0.13, 0.13]),
        small("vase", [0.07, 0.07]),
        small("candles", [0.07, 0.10]),
    ];
    const DESK: &[SmallObject] = &[
        small("monitor", [0.10, 0.28]),
        small("desk_lamp", [0.08, 0.08]),
        small("books_stack", [0.10, 0.13]),
        small("pen_cup", [0.045, 0.045]),
    ];
    const NIGHTSTAND: &[SmallObject] = &[
        small("table_lamp", [0.08, 0.08]),
        small("alarm_clock", [0.03, 0.05]),
    ];
    const TV: &[SmallObject] = &[
        small("television", [0.10, 0.50]),
        small("herb_pot", [0.07, 0.07]),
        small("speaker", [0.07, 0.06]),
    ];
    const DRESSER: &[SmallObject] = &[
        small("photo_frame", [0.05, 0.10]),
        small("vase", [0.07, 0.07]),
        small("table_lamp", [0.08, 0.08]),
        small("books_stack", [0.10, 0.13]),
        small("jewel_box", [0.06, 0.09]),
    ];
    const COFFEE: &[SmallObject] = &[
        small("magazines", [0.12, 0.15]),
        small("books_stack", [0.10, 0.13]),
        small("candles", [0.07, 0.10]),
    ];
    const BASIN: &[SmallObject] = &[
        small("toothbrush_cup", [0.04, 0.04]),
        small("soap", [0.035, 0.035]),
    ];
    const LAUNDRY: &[SmallObject] = &[
        small("towels", [0.12, 0.16]),
        small("detergent", [0.05, 0.08]),
    ];
    const CONSOLE: &[SmallObject] = &[
        small("key_bowl", [0.08, 0.08]),
        small("vase", [0.07, 0.07]),
        small("photo_frame", [0.05, 0.10]),
    ];
    const HOB: &[SmallObject] = &[small("pot", [0.12, 0.16])];
    match kind {
        "cabinet" | "drawers" | "dishwasher" => WORKTOP,
        "cooker" => HOB,
        "table" | "round_table" => TABLE,
        "desk" => DESK,
        "nightstand" => NIGHTSTAND,
        "tv_board" => TV,
        "dresser" => DRESSER,
        "coffee_table" => COFFEE,
        "side_table" => NIGHTSTAND,
        "basin" => BASIN,
        "washing_machine" => LAUNDRY,
        "console" | "shoe_cabinet" => CONSOLE,
        _ => &[],
    }
}

/// The shapes of a small object, its base at z = 0.
#[must_use]
pub fn small_objects(name: &str, random: &mut Random) -> Model {
    let mut model = Model::new("decoration");
    let m = &mut model;
    match name {
        "kettle" => {
            m.turned(
                "chrome",
                [0.0; 3],
                &[
                    [0.0, 0.0],
                    [0.075, 0.0],
                    [0.078, 0.03],
                    [0.055, 0.19],
                    [0.0, 0.20],
                ],
            );
            m.rod("plastic_dark", [0.0, 0.0, 0.20], 0.014, 0.02);
            m.rod("plastic_dark", [-0.01, 0.086, 0.04], 0.010, 0.14);
            m.bar("plastic_dark", [-0.01, 0.07, 0.175], 1, [0.009, 0.05]);
            m.rod("plastic_dark", [0.0; 3], 0.08, 0.012);
            m.solid([about(0.0, 0.15), about(0.01, 0.17), [0.0, 0.21]]);
        }
        "jars" => {
            for (index, height) in [(0, 0.20), (1, 0.16), (2, 0.13)] {
                let y = -0.11 + 0.105 * f64::from(index);
                m.rod("ceramic_1", [0.0, y, 0.0], 0.045, height - 0.02);
                m.rod("wood", [0.0, y, height - 0.02], 0.040, 0.022);
            }
            m.solid([about(0.0, 0.09), about(-0.005, 0.30), [0.0, 0.18]]);
        }
        "toaster" => {
            m.cushion(
                "appliance",
                [about(0.0, 0.17), about(0.0, 0.27), [0.01, 0.19]],
                0.03,
                0.0,
            );
            m.shown(
                "plastic_dark",
                [about(0.0, 0.03), about(0.0, 0.20), [0.188, 0.192]],
            );
            m.shown(
                "chrome",
                [about(0.0, 0.03), about(0.14, 0.02), [0.10, 0.12]],
            );
            m.solid([about(0.0, 0.17), about(0.0, 0.28), [0.0, 0.19]]);
        }
        "cutting_board" => {
            m.cushion(
                "wood",
                [about(-0.02, 0.02), about(0.0, 0.26), [0.0, 0.36]],
                0.008,
                -6.0,
            );
            m.solid([about(-0.015, 0.06), about(0.0, 0.27), [0.0, 0.36]]);
        }
        "knife_block" => {
            m.cushion(
                "wood_dark",
                [about(0.0, 0.10), about(0.0, 0.09), [0.0, 0.21]],
                0.01,
                -10.0,
            );
            for y in [-0.025, 0.0, 0.025] {
                m.rod("plastic_dark", [-0.015, y, 0.20], 0.009, 0.086);
            }
            m.solid([about(0.0, 0.13), about(0.0, 0.09), [0.0, 0.28]]);
        }
        "fruit_bowl" => {
            m.turned(
                "ceramic_2",
                [0.0; 3],
                &[
                    [0.0, 0.008],
                    [0.05, 0.01],
                    [0.11, 0.055],
                    [0.125, 0.07],
                    [0.118, 0.072],
                    [0.045, 0.0],
                    [0.0, 0.0],
                ],
            );
            let fruit = [
                ([0.035, 0.02], "apple"),
                ([-0.04, 0.03], "lemon"),
                ([0.0, -0.05], "apple"),
                ([0.06, -0.03], "lemon"),
            ];
            for (at, material) in fruit {
                m.ball(material, [at[0], at[1], 0.062], 0.036);
            }
            m.solid([about(0.0, 0.22), about(0.0, 0.22), [0.0, 0.086]]);
        }
        "herb_pot" => {
            m.cone("ceramic_1", [0.0; 3], [0.045, 0.06], 0.10);
            super::living::leaves(m, [0.0, 0.0, 0.095], 0.14, 13, random);
            m.solid([about(0.0, 0.12), about(0.0, 0.12), [0.0, 0.20]]);
        }
        "paper_roll" => {
            m.rod("wood_dark", [0.0; 3], 0.065, 0.012);
            m.rod("paper", [0.0, 0.0, 0.012], 0.055, 0.22);
            m.rod("wood_dark", [0.0, 0.0, 0.23], 0.010, 0.05);
            m.solid([about(0.0, 0.12), about(0.0, 0.12), [0.0, 0.27]]);
        }
        "vase" => {
            m.turned(
                "ceramic_2",
                [0.0; 3],
                &[
                    [0.0, 0.0],
                    [0.040, 0.0],
                    [0.058, 0.04],
                    [0.062, 0.08],
                    [0.045, 0.13],
                    [0.026, 0.165],
                    [0.030, 0.18],
                    [0.024, 0.178],
                ],
            );
            for (at, tall) in [
                ([0.012, 0.0], 0.17),
                ([-0.014, 0.012], 0.15),
                ([0.002, -0.016], 0.13),
            ] {
                m.rod("leaves", [at[0], at[1], 0.17], 0.003, tall);
                m.ball("flower", [at[0] * 1.4, at[1] * 1.4, 0.17 + tall], 0.026);
            }
            super::living::leaves(m, [0.0, 0.0, 0.19], 0.11, 5, random);
            m.solid([about(0.0, 0.12), about(0.0, 0.12), [0.0, 0.34]]);
        }
        "candles" => {
            m.cushion(
                "wood_dark",
                [about(0.0, 0.13), about(0.0, 0.20), [0.0, 0.012]],
                0.005,
                0.0,
            );
            m.rod("candle", [0.0, -0.05, 0.012], 0.032, 0.075);
            m.rod("candle", [0.01, 0.045, 0.012], 0.032, 0.05);
            m.solid([about(0.0, 0.13), about(0.0, 0.20), [0.0, 0.086]]);
        }
        "monitor" => {
            m.shown(
                "plastic_dark",
                [about(-0.05, 0.14), about(0.0, 0.22), [0.0, 0.012]],
            );
            m.shown(
                "plastic_dark",
                [about(-0.08, 0.03), about(0.0, 0.06), [0.01, 0.22]],
            );
            m.shown(
                "plastic_dark",
                [about(-0.05, 0.025), about(0.0, 0.55), [0.10, 0.43]],
            );
            m.shown(
                "screen",
                [[-0.0375, -0.036], about(0.0, 0.53), [0.115, 0.42]],
            );
            m.solid([about(-0.06, 0.12), about(0.0, 0.55), [0.0, 0.43]]);
        }
        "desk_lamp" => {
            m.rod("metal_dark", [0.0; 3], 0.07, 0.018);
            m.rod("metal_dark", [-0.02, 0.0, 0.018], 0.008, 0.36);
            m.bar("metal_dark", [0.03, 0.0, 0.375], 0, [0.007, 0.11]);
            m.cone("accent", [0.07, 0.0, 0.31], [0.07, 0.03], 0.08);
            m.solid([about(0.02, 0.16), about(0.0, 0.13), [0.0, 0.39]]);
        }
        "table_lamp" => {
            m.turned(
                "ceramic_1",
                [0.0; 3],
                &[
                    [0.0, 0.0],
                    [0.05, 0.0],
                    [0.055, 0.03],
                    [0.03, 0.12],
                    [0.012, 0.15],
                    [0.0, 0.15],
                ],
            );
            m.rod("metal_dark", [0.0, 0.0, 0.14], 0.006, 0.06);
            m.cone("lampshade", [0.0, 0.0, 0.17], [0.086, 0.060], 0.15);
            m.solid([about(0.0, 0.14), about(0.0, 0.14), [0.0, 0.32]]);
        }
        "alarm_clock" => {
            m.cushion(
                "plastic_dark",
                [about(0.0, 0.04), about(0.0, 0.09), [0.0, 0.06]],
                0.01,
                -6.0,
            );
            m.shown("screen", [[0.019, 0.021], about(0.0, 0.07), [0.015, 0.045]]);
            m.solid([about(0.0, 0.045), about(0.0, 0.09), [0.0, 0.06]]);
        }
        "books_stack" => {
            let mut z = 0.0;
            for (index, material) in ["book_blue", "book_ochre", "book_red"].iter().enumerate() {
                let thick = random.number([0.022, 0.036]);
                let shrink = 0.012 * index as f64;
                m.shown(
                    material,
                    [
                        about(0.0, 0.18 - shrink),
                        about(0.004 * index as f64, 0.245 - shrink),
                        [z, z + thick],
                    ],
                );
                z += thick;
            }
            m.solid([about(0.0, 0.18), about(0.0, 0.25), [0.0, z]]);
        }
        "magazines" => {
            m.shown("art_1", [about(0.0, 0.21), about(0.0, 0.28), [0.0, 0.005]]);
            m.shown(
                "art_3",
                [about(0.012, 0.20), about(0.02, 0.27), [0.005, 0.010]],
            );
            m.shown(
                "paper",
                [about(0.012, 0.12), about(0.02, 0.16), [0.010, 0.0105]],
            );
            m.solid([about(0.0, 0.22), about(0.0, 0.30), [0.0, 0.010]]);
        }
        "pen_cup" => {
            m.cone("accent", [0.0; 3], [0.036, 0.040], 0.10);
            for (at, material) in [
                ([0.01, 0.01], "wood"),
                ([-0.012, 0.006], "plastic_dark"),
                ([0.0, -0.014], "accent"),
            ] {
                m.rod(material, [at[0], at[1], 0.05], 0.004, 0.11);
            }
            m.solid([about(0.0, 0.08), about(0.0, 0.08), [0.0, 0.15]]);
        }
        "television" => {
            m.shown(
                "plastic_dark",
                [about(-0.02, 0.16), about(0.0, 0.40), [0.0, 0.012]],
            );
            m.shown(
                "plastic_dark",
                [about(-0.04, 0.04), about(0.0, 0.10), [0.01, 0.09]],
            );
            m.cushion(
                "plastic_dark",
                [about(-0.04, 0.04), about(0.0, 0.98), [0.07, 0.64]],
                0.008,
                0.0,
            );
            m.shown(
                "screen",
                [[-0.0205, -0.019], about(0.0, 0.95), [0.086, 0.625]],
            );
            m.solid([about(-0.03, 0.10), about(0.0, 0.98), [0.0, 0.64]]);
        }
        "speaker" => {
            m.cushion(
                "wood_dark",
                [about(0.0, 0.13), about(0.0, 0.11), [0.0, 0.20]],
                0.008,
                0.0,
            );
            m.bar("plastic_dark", [0.066, 0.0, 0.07], 0, [0.04, 0.004]);
            m.bar("plastic_dark", [0.066, 0.0, 0.15], 0, [0.02, 0.004]);
            m.solid([about(0.0, 0.13), about(0.0, 0.11), [0.0, 0.20]]);
        }
        "photo_frame" => {
            m.cushion(
                "frame",
                [about(-0.01, 0.016), about(0.0, 0.18), [0.0, 0.23]],
                0.005,
                -10.0,
            );
            m.cushion(
                "art_2",
                [about(-0.002, 0.006), about(0.0, 0.13), [0.025, 0.20]],
                0.002,
                -10.0,
            );
            m.solid([about(-0.01, 0.06), about(0.0, 0.18), [0.0, 0.23]]);
        }
        "jewel_box" => {
            m.cushion(
                "wood_dark",
                [about(0.0, 0.12), about(0.0, 0.18), [0.0, 0.09]],
                0.01,
                0.0,
            );
            m.bar("handle", [0.062, 0.0, 0.06], 0, [0.008, 0.012]);
            m.solid([about(0.0, 0.12), about(0.0, 0.18), [0.0, 0.09]]);
        }
        "toothbrush_cup" => {
            m.cone("ceramic_1", [0.0; 3], [0.030, 0.035], 0.10);
            m.rod("accent", [0.012, 0.0, 0.02], 0.004, 0.16);
            m.rod("plastic_white", [-0.008, 0.012, 0.02], 0.004, 0.155);
            m.solid([about(0.0, 0.07), about(0.0, 0.07), [0.0, 0.18]]);
        }
        "soap" => {
            m.rod("accent", [0.0; 3], 0.030, 0.13);
            m.rod("chrome", [0.0, 0.0, 0.13], 0.008, 0.035);
            m.bar("chrome", [0.018, 0.0, 0.165], 0, [0.006, 0.045]);
            m.solid([about(0.0, 0.06), about(0.0, 0.06), [0.0, 0.17]]);
        }
        "towels" => {
            for (index, material) in ["towel", "bedding", "towel"].iter().enumerate() {
                let z = 0.06 * index as f64;
                m.cushion(
                    material,
                    [about(0.0, 0.23), about(0.0, 0.31), [z, z + 0.062]],
                    0.025,
                    0.0,
                );
            }
            m.solid([about(0.0, 0.23), about(0.0, 0.31), [0.0, 0.18]]);
        }
        "detergent" => {
            m.cushion(
                "accent",
                [about(0.0, 0.09), about(0.0, 0.15), [0.0, 0.22]],
                0.02,
                0.0,
            );
            m.rod("plastic_white", [0.0, -0.04, 0.22], 0.024, 0.04);
            m.solid([about(0.0, 0.09), about(0.0, 0.15), [0.0, 0.26]]);
        }
        "key_bowl" => {
            m.turned(
                "ceramic_1",
                [0.0; 3],
                &[
                    [0.0, 0.006],
                    [0.04, 0.008],
                    [0.075, 0.04],
                    [0.08, 0.042],
                    [0.035, 0.0],
                    [0.0, 0.0],
                ],
            );
            m.bar("brass", [0.01, 0.0, 0.018], 1, [0.004, 0.06]);
            m.solid([about(0.0, 0.14), about(0.0, 0.14), [0.0, 0.045]]);
        }
        "pot" => {
            m.rod("steel", [0.0; 3], 0.105, 0.13);
            m.turned(
                "steel",
                [0.0, 0.0, 0.13],
                &[[0.108, 0.0], [0.10, 0.012], [0.02, 0.03], [0.0, 0.03]],
            );
            m.rod("plastic_dark", [0.0, 0.0, 0.155], 0.016, 0.03);
            for side in [-1.0, 1.0] {
                m.bar("plastic_dark", [0.0, side * 0.12, 0.105], 1, [0.010, 0.05]);
            }
            m.solid([about(0.0, 0.21), about(0.0, 0.29), [0.0, 0.185]]);
        }
        _ => {}
    }
    model
}
