//! Golden state hash of a short run; a change of the bits must be declared.

use nalgebra::Vector3;
use wheelarm_proto::PHYSICS_VERSION;

use super::{Scenario, Simulation};
use crate::robot::control::{ArmIntent, BaseIntent, ControlInput, GripperIntent, IntentFrame};

/// State hash of the run below and the physics version that produced it.
const KEPT: (u32, u64) = (9, 0xe5bc_dfbb_c8bd_4dd2);

/// Covers control, contacts, the gripper's friction and the kinematics.
#[test]
fn another_bit_is_another_physics_version() {
    let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    // No task: its sampling may change without a change of the physics.
    let scenario = Scenario {
        task: String::new(),
        cameras: Vec::new(),
        ..Scenario::default()
    };
    let mut sim = Simulation::new(&assets, scenario).expect("a simulation");
    for tick in 0..180 {
        let time = f64::from(tick) / 60.0;
        sim.step(&ControlInput {
            arm: Some(ArmIntent::Twist {
                frame: IntentFrame::ArmBase,
                linear: Vector3::new(0.05 - 0.05 * time, 0.1 * (1.0 - time), 0.05),
                angular: Vector3::new(0.1, 0.0, 0.3 - 0.2 * time),
            }),
            base: Some(BaseIntent {
                linear: 0.2,
                angular: 0.4 - 0.3 * time,
            }),
            gripper: (tick == 30).then_some(GripperIntent {
                knuckle: 0.7,
                max_force: None,
            }),
        });
    }
    let hash = sim.hash_due().expect("a whole second");
    assert_eq!(
        (PHYSICS_VERSION, hash),
        KEPT,
        "the state hash is {hash:#018x} now: if the bits are meant to change, raise \
         PHYSICS_VERSION, say so in the changelog, and keep both here"
    );
}

/// nalgebra's rotations use the same sine as all other code, not that of the C library.
#[test]
fn rotations_use_the_exact_sine() {
    let axis = Vector3::x_axis();
    for i in 0..5000 {
        let angle = f64::from(i) * 0.00113 - 2.8;
        let turn = nalgebra::UnitQuaternion::from_axis_angle(&axis, angle);
        let (sin, cos) = wheelarm_proto::exact::sin_cos(angle / 2.0);
        assert_eq!((turn.i, turn.w), (sin, cos), "at {angle} rad");
        let back = wheelarm_proto::exact::atan2(sin.abs(), cos.abs()) * 2.0;
        assert_eq!(turn.angle(), back, "at {angle} rad");
    }
}
