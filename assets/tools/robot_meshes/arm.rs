//! Shells of the arm: smooth, tapered, with a dark band at every joint.
//! Sizes follow the bounding boxes of the maker's links.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::solid::{Ring, Solid};

/// Name of the mesh, material and solid.
pub type Named = (&'static str, &'static str, Solid);

/// Frame at a point whose z axis is y of the link (`true`) or z.
fn axis(y: f64, z: f64, about_y: bool) -> Isometry3<f64> {
    let turn = if about_y {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2)
    } else {
        UnitQuaternion::identity()
    };
    Isometry3::from_parts(Translation3::new(0.0, y, z), turn)
}

/// Rings along z: `[z, y of the center, half x, half y, power]`, z falling.
fn falling(rings: &[[f64; 5]]) -> Vec<Ring> {
    rings
        .iter()
        .map(|&[z, y, half_x, half_y, power]| Ring {
            center: Point3::new(0.0, y, z),
            across: Vector3::new(half_x, 0.0, 0.0),
            along: Vector3::new(0.0, -half_y, 0.0),
            power,
        })
        .collect()
}

/// Rings along y: `[y, z of the center, half x, half z, power]`; `sense` is 1
/// when y rises, -1 when it falls.
fn lengthwise(rings: &[[f64; 5]], sense: f64) -> Vec<Ring> {
    rings
        .iter()
        .map(|&[y, z, half_x, half_z, power]| Ring {
            center: Point3::new(0.0, y, z),
            across: Vector3::new(half_x, 0.0, 0.0),
            along: Vector3::new(0.0, 0.0, -sense * half_z),
            power,
        })
        .collect()
}

/// A head about z (or y): rounded on its outer side, flat where it meets the
/// next link at `inner`.
fn head(solid: &mut Solid, frame: &Isometry3<f64>, radius: f64, outer: f64, inner: f64) {
    let sense = (inner - outer).signum();
    let bend = 0.32 * radius;
    let mut profile: Vec<[f64; 2]> = (0..6)
        .map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::FRAC_PI_2 / 5.0).sin_cos();
            let height = outer + sense * bend * (1.0 - cos);
            [radius - bend * (1.0 - sin), height]
        })
        .collect();
    profile.push([radius, inner]);
    if sense < 0.0 {
        profile.reverse();
    }
    solid.turn(frame, &profile, 28);
}

pub fn meshes() -> Vec<Named> {
    let mut out = Vec::new();
    let origin = Isometry3::identity();

    let mut shell = Solid::default();
    let foot = [
        [0.0520, 0.0],
        [0.0535, 0.0015],
        [0.0535, 0.010],
        [0.0520, 0.0125],
        [0.0505, 0.030],
        [0.0485, 0.075],
        [0.0465, 0.115],
        [0.0460, 0.150],
    ];
    shell.turn(&origin, &foot, 28);
    let mut dark = Solid::default();
    dark.band(&origin, 0.0455, [0.149, 0.1575]);
    // Connectors at the back of the base.
    let back = Isometry3::translation(-0.046, 0.0, 0.045);
    dark.block(&back, [0.010, 0.020, 0.026], 0.003);
    out.push(("base_shell", "arm_shell", shell));
    out.push(("base_dark", "arm_ring", dark));

    let mut shell = Solid::default();
    let neck = falling(&[
        [-0.003, 0.0, 0.0460, 0.0460, 2.0],
        [-0.030, 0.0, 0.0460, 0.0455, 2.0],
        [-0.055, -0.003, 0.0458, 0.0430, 2.0],
        [-0.080, -0.010, 0.0456, 0.0370, 2.1],
        [-0.105, -0.020, 0.0455, 0.0280, 2.4],
        [-0.12838, -0.0285, 0.0450, 0.0190, 2.8],
    ]);
    shell.loft(&neck, 24);
    head(
        &mut shell,
        &axis(0.0, -0.12838, true),
        0.0458,
        -0.0487,
        -0.0125,
    );
    let mut dark = Solid::default();
    dark.band(&axis(0.0, -0.12838, true), 0.0452, [-0.013, -0.0085]);
    dark.cylinder(
        &axis(0.0, -0.12838, true),
        0.0235,
        [-0.0502, -0.0470],
        0.001,
    );
    out.push(("shoulder_shell", "arm_shell", shell));
    out.push(("shoulder_dark", "arm_ring", dark));

    let mut shell = Solid::default();
    let tube = lengthwise(
        &[
            [0.0, -0.0195, 0.0450, 0.0300, 3.0],
            [-0.035, -0.0205, 0.0435, 0.0295, 2.8],
            [-0.075, -0.0220, 0.0385, 0.0275, 2.5],
            [-0.130, -0.0235, 0.0350, 0.0255, 2.3],
            [-0.205, -0.0245, 0.0340, 0.0250, 2.3],
            [-0.280, -0.0255, 0.0350, 0.0250, 2.3],
            [-0.335, -0.0265, 0.0385, 0.0255, 2.5],
            [-0.375, -0.0270, 0.0435, 0.0255, 2.8],
            [-0.410, -0.0270, 0.0450, 0.0250, 3.0],
        ],
        -1.0,
    );
    shell.loft(&tube, 24);
    head(&mut shell, &axis(0.0, 0.0, false), 0.0458, -0.0528, 0.0100);
    head(
        &mut shell,
        &axis(-0.41, 0.0, false),
        0.0458,
        -0.0528,
        -0.0040,
    );
    let mut dark = Solid::default();
    dark.band(&axis(0.0, 0.0, false), 0.0452, [0.0095, 0.0142]);
    dark.band(&axis(-0.41, 0.0, false), 0.0452, [-0.0045, -0.0002]);
    dark.cylinder(&axis(0.0, 0.0, false), 0.0235, [-0.0543, -0.0510], 0.001);
    dark.cylinder(&axis(-0.41, 0.0, false), 0.0235, [-0.0543, -0.0510], 0.001);
    out.push(("bicep_shell", "arm_shell", shell));
    out.push(("bicep_dark", "arm_ring", dark));

    let mut shell = Solid::default();
    let tube = lengthwise(
        &[
            [0.0, -0.0290, 0.0450, 0.0250, 3.0],
            [0.035, -0.0280, 0.0430, 0.0260, 2.8],
            [0.070, -0.0235, 0.0395, 0.0285, 2.4],
            [0.110, -0.0160, 0.0365, 0.0320, 2.1],
            [0.150, -0.0090, 0.0350, 0.0345, 2.0],
            [0.180, -0.0064, 0.0350, 0.0350, 2.0],
            [0.203, -0.0064, 0.0350, 0.0350, 2.0],
        ],
        1.0,
    );
    shell.loft(&tube, 24);
    head(&mut shell, &axis(0.0, 0.0, false), 0.0458, -0.0559, -0.0040);
    let mut dark = Solid::default();
    dark.band(&axis(0.0, 0.0, false), 0.0452, [-0.0045, -0.0002]);
    dark.cylinder(&axis(0.0, 0.0, false), 0.0235, [-0.0574, -0.0540], 0.001);
    dark.band(&axis(0.0, -0.006375, true), 0.0345, [0.202, 0.2095]);
    out.push(("forearm_shell", "arm_shell", shell));
    out.push(("forearm_dark", "arm_ring", dark));

    let mut shell = Solid::default();
    let neck = falling(&[
        [-0.002, 0.0, 0.0350, 0.0350, 2.0],
        [-0.025, 0.0, 0.0350, 0.0350, 2.0],
        [-0.050, 0.004, 0.0350, 0.0330, 2.0],
        [-0.075, 0.014, 0.0348, 0.0290, 2.2],
        [-0.10593, 0.0285, 0.0345, 0.0200, 2.8],
    ]);
    shell.loft(&neck, 24);
    head(
        &mut shell,
        &axis(0.0, -0.10593, true),
        0.0350,
        0.0530,
        0.0040,
    );
    let mut dark = Solid::default();
    dark.band(&axis(0.0, -0.10593, true), 0.0345, [0.0002, 0.0045]);
    dark.cylinder(&axis(0.0, -0.10593, true), 0.0180, [0.0512, 0.0543], 0.001);
    out.push(("wrist_1_shell", "arm_shell", shell));
    out.push(("wrist_1_dark", "arm_ring", dark));

    let mut shell = Solid::default();
    let neck = lengthwise(
        &[
            [0.0, -0.0285, 0.0345, 0.0200, 2.8],
            [0.030, -0.0150, 0.0348, 0.0285, 2.2],
            [0.055, -0.0045, 0.0350, 0.0330, 2.0],
            [0.078, 0.0, 0.0350, 0.0350, 2.0],
            [0.1015, 0.0, 0.0350, 0.0350, 2.0],
        ],
        1.0,
    );
    shell.loft(&neck, 24);
    head(&mut shell, &axis(0.0, 0.0, false), 0.0350, -0.0533, -0.0040);
    let mut dark = Solid::default();
    dark.band(&axis(0.0, 0.0, false), 0.0345, [-0.0045, -0.0002]);
    dark.cylinder(&axis(0.0, 0.0, false), 0.0180, [-0.0546, -0.0515], 0.001);
    dark.band(&axis(0.0, 0.0, true), 0.0345, [0.1005, 0.1065]);
    out.push(("wrist_2_shell", "arm_shell", shell));
    out.push(("wrist_2_dark", "arm_ring", dark));

    let mut shell = Solid::default();
    let body = [
        [0.0355, -0.0600],
        [0.0375, -0.0570],
        [0.0375, -0.0160],
        [0.0360, -0.0060],
        [0.0350, -0.0010],
    ];
    shell.turn(&origin, &body, 28);
    let mut dark = Solid::default();
    dark.band(&origin, 0.0372, [-0.0615, -0.0595]);
    // Vision module above the hand, its face towards the tool.
    let module = Isometry3::translation(0.0, 0.0560, -0.0475);
    dark.block(&module, [0.0455, 0.0187, 0.0105], 0.004);
    let bridge = Isometry3::translation(0.0, 0.0360, -0.0460);
    dark.block(&bridge, [0.0300, 0.0120, 0.0090], 0.003);
    let mut lens = Solid::default();
    for (x, y, radius) in [
        (0.0, 0.05639, 0.0075),
        (0.0275, 0.0630, 0.0055),
        (-0.0275, 0.0630, 0.0055),
    ] {
        let place = Isometry3::translation(x, y, 0.0);
        lens.cylinder(&place, radius, [-0.0590, -0.0560], 0.0006);
    }
    out.push(("bracelet_shell", "arm_shell", shell));
    out.push(("bracelet_dark", "arm_ring", dark));
    out.push(("bracelet_lens", "lens", lens));
    out
}
