//! Frames of doors, the front door, windows with curtains. Their y is along the wall, and x
//! points into the room.

use super::super::random::Random;
use super::super::shape::{Model, about};

/// The lining and both casings of a door. It does not collide: the hole of the wall counts.
#[must_use]
pub fn door_frame(width: f64, height: f64, wall: f64) -> Model {
    let mut m = Model::new("doorway");
    let half = width / 2.0;
    let deep = about(0.0, wall + 0.004);
    for side in [-1.0, 1.0] {
        m.shown(
            "trim",
            [
                deep,
                about(side * (half - 0.006), 0.012),
                [0.0, height - 0.012],
            ],
        );
    }
    m.shown("trim", [deep, about(0.0, width), [height - 0.012, height]]);
    for x in [wall / 2.0 + 0.006, -wall / 2.0 - 0.006] {
        let x = about(x, 0.012);
        for side in [-1.0, 1.0] {
            m.shown(
                "trim",
                [x, about(side * (half + 0.03), 0.065), [0.0, height + 0.06]],
            );
        }
        m.shown(
            "trim",
            [
                x,
                about(0.0, width + 0.125),
                [height - 0.005, height + 0.06],
            ],
        );
    }
    m
}

/// The door to the outside: closed.
#[must_use]
pub fn front_door(width: f64, height: f64, wall: f64) -> Model {
    let mut m = door_frame(width, height, wall);
    m.kind.category = "door".to_owned();
    let y = about(0.0, width - 0.02);
    m.block("front_door", [about(0.0, 0.05), y, [0.0, height - 0.01]]);
    for z in [[0.20, 0.90], [1.10, height - 0.20]] {
        m.shown("trim_door", [[0.025, 0.032], about(0.0, width - 0.30), z]);
        m.shown(
            "front_door",
            [
                [0.030, 0.036],
                about(0.0, width - 0.38),
                [z[0] + 0.04, z[1] - 0.04],
            ],
        );
    }
    let at = width / 2.0 - 0.09;
    m.bar("chrome", [0.045, at, 1.02], 0, [0.012, 0.04]);
    m.bar("chrome", [0.065, at - 0.05, 1.02], 1, [0.009, 0.13]);
    m.shown("doormat", [[0.15, 0.60], about(0.0, 0.72), [0.0, 0.006]]);
    m
}

/// A window with its sill; curtains hang beside it where `curtains` is their lower end.
#[must_use]
pub fn window(
    width: f64,
    [sill, height]: [f64; 2],
    wall: f64,
    curtains: Option<f64>,
    random: &mut Random,
) -> Model {
    let mut m = Model::new("window");
    let (y, z) = (about(0.0, width), [sill, sill + height]);
    let frame = about(-0.01, 0.06);
    m.solid([about(0.0, 0.06), y, z]);
    m.shown("window_pane", [about(-0.03, 0.008), y, z]);
    for at in [z[0] + 0.03, z[1] - 0.03] {
        m.shown("trim", [frame, y, about(at, 0.06)]);
    }
    let panes = if width > 1.5 {
        3
    } else if width > 0.8 {
        2
    } else {
        1
    };
    for index in 0..=panes {
        let at = y[0] + 0.03 + (width - 0.06) * f64::from(index) / f64::from(panes);
        m.shown("trim", [frame, about(at, 0.06), z]);
    }
    m.shown(
        "trim",
        [
            [-wall / 2.0 - 0.02, wall / 2.0 + 0.06],
            about(0.0, width + 0.06),
            [z[0] - 0.025, z[0]],
        ],
    );
    let Some(lower) = curtains else {
        return m;
    };
    let top = z[1] + 0.12;
    let x = wall / 2.0 + 0.075;
    m.bar("metal_dark", [x, 0.0, top], 1, [0.011, width + 0.70]);
    for side in [-1.0, 1.0] {
        m.ball("metal_dark", [x, side * (width / 2.0 + 0.35), top], 0.022);
        // Folds: narrow boards that turn to and fro.
        let count = 5;
        for index in 0..count {
            let at = side * (width / 2.0 - 0.10 + 0.086 * f64::from(index));
            let lean =
                if index % 2 == 0 { 34.0 } else { -34.0 } + random.number([-5.0, 5.0]).round();
            let part = wheelarm_pack::PartEntry {
                cuboid: Some([0.010, 0.105, super::super::shape::rounded(top - lower)]),
                at: Some(super::super::shape::rounded3([
                    x,
                    at,
                    f64::midpoint(top, lower),
                ])),
                rpy_deg: Some([0.0, 0.0, lean]),
                ..wheelarm_pack::PartEntry::default()
            };
            m.part("curtain", part);
        }
    }
    m
}
