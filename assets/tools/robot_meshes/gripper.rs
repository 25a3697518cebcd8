//! Parts of the gripper in their link frames. Pins are along y; those of the
//! right finger are the left ones mirrored.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::arm::Named;
use crate::solid::{Ring, Solid};

pub fn meshes() -> Vec<Named> {
    let mut out = Vec::new();
    let origin = Isometry3::identity();

    let mut body = Solid::default();
    // Round at the wrist, a flat cross-head at the fingers.
    let rings: Vec<Ring> = [
        [0.0000, 0.0375, 0.0375, 2.0],
        [0.0120, 0.0375, 0.0375, 2.0],
        [0.0300, 0.0372, 0.0370, 2.1],
        [0.0450, 0.0385, 0.0330, 2.6],
        [0.0600, 0.0415, 0.0240, 3.6],
        [0.0720, 0.0425, 0.0160, 4.5],
        [0.0840, 0.0405, 0.0120, 5.0],
        [0.0880, 0.0370, 0.0100, 5.0],
        [0.0890, 0.0330, 0.0080, 5.0],
    ]
    .iter()
    .map(|&[z, x, y, power]| Ring {
        center: Point3::new(0.0, 0.0, z),
        across: Vector3::new(x, 0.0, 0.0),
        along: Vector3::new(0.0, y, 0.0),
        power,
    })
    .collect();
    body.loft(&rings, 32);
    let mut trim = Solid::default();
    trim.band(&origin, 0.0379, [0.0105, 0.0135]);
    for x in [-0.03060114, -0.0127, 0.0127, 0.03060114] {
        let z = if f64::abs(x) > 0.02 {
            0.05490452
        } else {
            0.06142
        };
        let pin = [[x - 0.0001, z, 0.0042], [x + 0.0001, z, 0.0042]];
        trim.strap(pin, [-0.0270, 0.0270]);
    }
    out.push(("hand_body", "gripper_body", body));
    out.push(("hand_trim", "steel", trim));

    let mut knuckle = Solid::default();
    let pins = [[0.0, 0.0, 0.0078], [0.03152616, -0.00376347, 0.0072]];
    knuckle.strap(pins, [-0.0081, 0.0085]);
    sides(
        &mut out,
        ["left_knuckle", "right_knuckle"],
        "gripper_body",
        knuckle,
    );

    let mut finger = Solid::default();
    let pins = [[0.0, 0.0, 0.0068], [0.00563134, 0.04718515, 0.0060]];
    finger.strap(pins, [-0.0144, -0.0085]);
    finger.strap(pins, [0.0085, 0.0128]);
    finger.strap(
        [[0.0065, 0.004, 0.0055], [0.0095, 0.036, 0.0045]],
        [-0.0085, 0.0085],
    );
    sides(
        &mut out,
        ["left_finger", "right_finger"],
        "gripper_body",
        finger,
    );

    let mut inner = Solid::default();
    let pins = [[-0.0371575, -0.04342168, 0.0060], [0.0, 0.0, 0.0058]];
    inner.strap(pins, [-0.0174, -0.0128]);
    inner.strap(pins, [0.0128, 0.0174]);
    inner.strap(
        [[-0.0270, -0.0316, 0.0045], [-0.0120, -0.0140, 0.0045]],
        [-0.0128, 0.0128],
    );
    sides(
        &mut out,
        ["left_inner", "right_inner"],
        "gripper_body",
        inner,
    );

    let mut tip = Solid::default();
    let foot = [
        [0.0, -0.0060],
        [0.0055, -0.0030],
        [0.0060, 0.0030],
        [0.0030, 0.0120],
        [-0.0172, 0.0120],
        [-0.0222, 0.0085],
        [-0.0235, 0.0030],
        [-0.0205, -0.0030],
        [-0.0150, -0.0060],
    ];
    tip.prism(&foot, [-0.0125, 0.0125]);
    let blade = [
        [-0.0172, 0.0115],
        [0.0025, 0.0115],
        [-0.0015, 0.0220],
        [-0.0080, 0.0440],
        [-0.0125, 0.0505],
        [-0.0172, 0.0510],
    ];
    tip.prism(&blade, [-0.0118, 0.0118]);
    sides(&mut out, ["left_tip", "right_tip"], "gripper_body", tip);
    out
}

fn sides(
    out: &mut Vec<Named>,
    [left, right]: [&'static str; 2],
    appearance: &'static str,
    solid: Solid,
) {
    out.push((right, appearance, solid.mirrored()));
    out.push((left, appearance, solid));
}
