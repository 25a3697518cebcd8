//! Chair, wheels, camera pole and arm bracket. The meshes are in
//! `wheelchair_root`: x forward, y left, floor at z = 0.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::arm::Named;
use crate::solid::{Ring, Solid};

fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}

/// The same, turned about y (positive: front down).
fn pitched(x: f64, y: f64, z: f64, pitch: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch),
    )
}

/// Frame whose z axis is y.
fn sideways(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -FRAC_PI_2),
    )
}

pub fn meshes() -> Vec<Named> {
    let mut out = Vec::new();
    chair(&mut out);
    wheels(&mut out);
    pole_and_bracket(&mut out);
    out
}

fn chair(out: &mut Vec<Named>) {
    let mut body = Solid::default();
    // Drive unit with the battery: wide at the floor, narrow below the seat.
    let rings: Vec<Ring> = [
        [0.105, 0.150, 0.300, 0.170],
        [0.125, 0.150, 0.315, 0.182],
        [0.200, 0.160, 0.290, 0.184],
        [0.290, 0.180, 0.235, 0.178],
        [0.360, 0.195, 0.195, 0.170],
        [0.430, 0.200, 0.190, 0.175],
        [0.445, 0.200, 0.180, 0.165],
    ]
    .iter()
    .map(|&[z, x, half_x, half_y]| Ring {
        center: Point3::new(x, 0.0, z),
        across: Vector3::new(half_x, 0.0, 0.0),
        along: Vector3::new(0.0, half_y, 0.0),
        power: 6.0,
    })
    .collect();
    body.loft(&rings, 28);
    // Foot plate and the beam that carries it.
    body.block(&at(0.615, 0.0, 0.118), [0.175, 0.165, 0.013], 0.006);
    body.block(
        &pitched(0.440, 0.0, 0.190, 0.55),
        [0.090, 0.075, 0.030],
        0.010,
    );
    for side in [-1.0, 1.0] {
        // Side arms from the rear axle to the front axle.
        let y = |inner: f64, outer: f64| {
            if side < 0.0 {
                [-outer, -inner]
            } else {
                [inner, outer]
            }
        };
        body.strap(
            [[0.0, 0.1325, 0.062], [0.200, 0.250, 0.045]],
            y(0.180, 0.214),
        );
        body.strap(
            [[0.200, 0.250, 0.045], [0.630, 0.1325, 0.030]],
            y(0.180, 0.202),
        );
        // Armrest: a strut that rises from behind the seat, and its rail.
        body.strap(
            [[-0.030, 0.455, 0.026], [0.090, 0.690, 0.020]],
            y(0.224, 0.262),
        );
        body.block(
            &pitched(0.215, side * 0.245, 0.700, -0.06),
            [0.205, 0.022, 0.012],
            0.005,
        );
        body.block(
            &at(-0.035, side * 0.218, 0.470),
            [0.050, 0.030, 0.022],
            0.008,
        );
    }
    // Back of the backrest and its upright.
    body.block(
        &pitched(-0.085, 0.0, 0.640, -0.06),
        [0.016, 0.190, 0.200],
        0.012,
    );
    body.block(&at(-0.075, 0.0, 0.400), [0.022, 0.110, 0.180], 0.010);
    // Housings of joystick (right) and switches (left).
    body.block(
        &pitched(0.405, -0.245, 0.745, -0.06),
        [0.050, 0.033, 0.020],
        0.010,
    );
    body.block(
        &pitched(0.405, 0.245, 0.740, -0.06),
        [0.045, 0.030, 0.014],
        0.008,
    );
    out.push(("chair_body", "chair_body", body));

    let mut soft = Solid::default();
    soft.block(
        &pitched(0.200, 0.0, 0.487, -0.04),
        [0.218, 0.205, 0.042],
        0.024,
    );
    soft.block(
        &pitched(-0.042, 0.0, 0.700, -0.06),
        [0.030, 0.198, 0.150],
        0.022,
    );
    soft.block(
        &pitched(-0.036, 0.0, 0.570, -0.06),
        [0.020, 0.180, 0.060],
        0.015,
    );
    for side in [-1.0, 1.0] {
        soft.block(
            &pitched(0.195, side * 0.245, 0.724, -0.06),
            [0.160, 0.030, 0.014],
            0.010,
        );
    }
    out.push(("chair_seat", "chair_seat", soft));

    let mut accent = Solid::default();
    for side in [-1.0, 1.0] {
        // Guards over the rear wheels.
        let y = side * 0.2145;
        let band = if side < 0.0 {
            [y - 0.006, y]
        } else {
            [y, y + 0.006]
        };
        accent.strap([[0.012, 0.175, 0.078], [0.195, 0.262, 0.030]], band);
    }
    // Bow in front of the seat and the rim of the foot plate.
    accent.block(&at(0.400, 0.0, 0.440), [0.012, 0.150, 0.020], 0.006);
    accent.block(&at(0.786, 0.0, 0.118), [0.006, 0.150, 0.011], 0.004);
    out.push(("chair_accent", "chair_accent", accent));

    let mut stick = Solid::default();
    let foot = pitched(0.412, -0.245, 0.760, -0.06);
    let profile = [
        [0.0180, 0.000],
        [0.0150, 0.006],
        [0.0070, 0.010],
        [0.0050, 0.016],
        [0.0050, 0.036],
        [0.0120, 0.041],
        [0.0160, 0.048],
        [0.0160, 0.056],
        [0.0110, 0.063],
        [0.0040, 0.066],
    ];
    stick.turn(&foot, &profile, 16);
    out.push(("chair_joystick", "chair_seat", stick));
}

fn wheels(out: &mut Vec<Named>) {
    let hub = sideways(0.0, 0.0, 0.0);
    let mut tyre = Solid::default();
    let profile = [
        [0.0960, -0.0230],
        [0.1080, -0.0250],
        [0.1220, -0.0235],
        [0.1295, -0.0180],
        [0.1325, -0.0090],
        [0.1325, 0.0090],
        [0.1295, 0.0180],
        [0.1220, 0.0235],
        [0.1080, 0.0250],
        [0.0960, 0.0230],
    ];
    tyre.turn(&hub, &profile, 40);
    out.push(("rear_tyre", "tyre", tyre));

    let mut rim = Solid::default();
    for side in [-1.0, 1.0] {
        let y = if side < 0.0 {
            [-0.0268, -0.0225]
        } else {
            [0.0225, 0.0268]
        };
        for spoke in 0..5 {
            let (sin, cos) = (TAU * f64::from(spoke) / 5.0 + 0.3).sin_cos();
            let (near, far) = (0.022, 0.088);
            rim.strap(
                [
                    [near * cos, near * sin, 0.015],
                    [far * cos, far * sin, 0.008],
                ],
                y,
            );
        }
    }
    rim.cylinder(&hub, 0.026, [-0.0295, 0.0295], 0.003);
    out.push(("rear_rim", "rim", rim));

    // Omni wheel: two rows of barrels whose axes run around the wheel.
    let mut rollers = Solid::default();
    let (count, thick) = (12, 0.0140);
    for row in 0..2 {
        let y = if row == 0 { -0.0120 } else { 0.0120 };
        for i in 0..count {
            let turn = TAU * (f64::from(i) + 0.5 * f64::from(row)) / f64::from(count);
            let frame = Isometry3::rotation(Vector3::new(0.0, turn, 0.0))
                * Isometry3::from_parts(
                    Translation3::new(0.1325 - thick, y, 0.0),
                    UnitQuaternion::identity(),
                );
            let profile = [
                [0.0085, -0.028],
                [thick, -0.010],
                [thick, 0.010],
                [0.0085, 0.028],
            ];
            rollers.turn(&frame, &profile, 8);
        }
    }
    out.push(("omni_rollers", "tyre", rollers));
    let mut disc = Solid::default();
    disc.cylinder(&hub, 0.110, [-0.0235, 0.0235], 0.004);
    out.push(("omni_disc", "chair_body", disc));
    let mut cap = Solid::default();
    cap.cylinder(&hub, 0.060, [-0.0260, 0.0260], 0.004);
    out.push(("omni_cap", "rim", cap));
}

fn pole_and_bracket(out: &mut Vec<Named>) {
    let mut pole = Solid::default();
    pole.cylinder(&at(0.0, 0.0, 0.0), 0.0125, [-1.040, 0.0125], 0.001);
    pole.block(&at(0.0, 0.0, -1.000), [0.020, 0.030, 0.030], 0.004);
    // The boom over the head, and a gusset below its bend.
    let ahead = Isometry3::rotation(Vector3::new(0.0, FRAC_PI_2, 0.0));
    pole.cylinder(&ahead, 0.0125, [-0.0125, 0.212], 0.001);
    pole.block(
        &pitched(0.035, 0.0, -0.035, FRAC_PI_4),
        [0.046, 0.006, 0.006],
        0.002,
    );
    // Camera body 52 degrees down, its lenses 0.24 m ahead of the pole.
    let down = Isometry3::translation(0.24, 0.0, 0.0)
        * pitched(0.0, 0.0, 0.0, 52_f64.to_radians())
        * at(-0.0245, 0.0, 0.0);
    pole.block(&down, [0.014, 0.055, 0.015], 0.004);
    out.push(("pole", "arm_ring", pole));
    let mut lens = Solid::default();
    for y in [-0.0375, 0.0, 0.0375] {
        let forward =
            down * at(0.0, y, 0.0) * Isometry3::rotation(Vector3::new(0.0, FRAC_PI_2, 0.0));
        lens.cylinder(&forward, 0.0070, [0.0100, 0.0152], 0.0008);
    }
    out.push(("pole_lens", "lens", lens));

    let mut bracket = Solid::default();
    bracket.block(&at(0.0, 0.0, -0.010), [0.050, 0.050, 0.010], 0.003);
    bracket.block(&at(-0.050, -0.050, -0.045), [0.025, 0.100, 0.025], 0.004);
    bracket.block(&at(-0.025, 0.0, -0.026), [0.030, 0.020, 0.010], 0.003);
    out.push(("bracket", "steel", bracket));
}
