//! Tests of the kinematics against the chained URDF transforms and the manufacturer's
//! named poses.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::robot::RobotModel;

fn model() -> RobotModel {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    RobotModel::load(&assets, "wheelarm").unwrap()
}

/// In-limit joint positions; continuous joints within half a turn.
fn random_joints(arm: &ArmKinematics, random: &mut ChaCha8Rng) -> [f64; 6] {
    std::array::from_fn(|i| {
        let (lower, upper) = (arm.lower[i].max(-PI), arm.upper[i].min(PI));
        random.random_range(lower..upper)
    })
}

/// End effector in the arm's base by chaining the URDF's transforms.
fn chained(model: &RobotModel, joints: &[f64; 6]) -> Isometry3<f64> {
    let mut positions = vec![0.0; model.joints.len()];
    for (joint, position) in model.roles.arm.into_iter().zip(joints) {
        positions[joint] = *position;
    }
    let poses = model.link_poses(&positions);
    poses[model.roles.arm_base].inv_mul(&poses[model.roles.end_effector])
}

#[test]
fn forward_equals_the_chained_transforms() {
    let (model, mut random) = (model(), ChaCha8Rng::seed_from_u64(1));
    let arm = ArmKinematics::new(&model);
    for _ in 0..2000 {
        let joints = random_joints(&arm, &mut random);
        let (pose, expected) = (arm.forward(&joints), chained(&model, &joints));
        let difference = pose.to_homogeneous() - expected.to_homogeneous();
        assert!(
            difference.amax() < 1e-12,
            "{joints:?}: {}",
            difference.amax()
        );
    }
}

#[test]
fn jacobian_is_the_derivative_of_forward() {
    let (model, mut random) = (model(), ChaCha8Rng::seed_from_u64(2));
    let arm = ArmKinematics::new(&model);
    for _ in 0..100 {
        let joints = random_joints(&arm, &mut random);
        let jacobian = arm.jacobian_body(&joints);
        for i in 0..6 {
            let (mut ahead, mut behind) = (joints, joints);
            ahead[i] += 1e-5;
            behind[i] -= 1e-5;
            let motion = arm.forward(&behind).inv_mul(&arm.forward(&ahead));
            let (angular, linear) = screw::logarithm(&motion);
            for row in 0..3 {
                assert!((angular[row] / 2e-5 - jacobian[(row, i)]).abs() < 1e-8);
                assert!((linear[row] / 2e-5 - jacobian[(row + 3, i)]).abs() < 1e-8);
            }
        }
    }
}

#[test]
fn named_poses_of_the_manufacturer_are_reproduced() {
    let arm = ArmKinematics::new(&model());
    // Positions of the end effector in m and quaternions xyzw; joints in rad.
    let table = [
        ([0.0; 6], [0.0, 0.00135, 1.17662], [0.0, 0.0, 1.0, 0.0]),
        (
            [0.0, 0.261, 2.27, 0.0, -0.43, -FRAC_PI_2],
            [-0.34631, 0.00135, 0.54616],
            [0.50205, -0.50205, -0.49794, 0.49795],
        ),
        (
            [0.0, 0.261, -2.27, 0.0, 0.96, FRAC_PI_2],
            [0.45349, 0.00135, 0.42333],
            [0.50005, 0.50005, 0.49995, 0.49995],
        ),
        (
            [0.0, -0.35, -2.54, 0.0, -0.87, FRAC_PI_2],
            [0.12906, 0.00135, 0.32060],
            [0.70652, 0.70652, 0.02884, 0.02884],
        ),
    ];
    for (joints, position, [x, y, z, w]) in table {
        let pose = arm.forward(&joints);
        let distance = (pose.translation.vector - Vector3::from(position)).norm();
        let expected = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let angle = pose.rotation.angle_to(&expected);
        assert!(
            distance < 1e-4 && angle < 1e-4,
            "{joints:?}: {distance} {angle}"
        );
    }
}

#[test]
fn inverse_after_forward_reaches_the_pose_within_the_limits() {
    let model = model();
    let (arm, mut random) = (ArmKinematics::new(&model), ChaCha8Rng::seed_from_u64(3));
    let count = 10_000;
    let mut solved = 0;
    for _ in 0..count {
        let target = arm.forward(&random_joints(&arm, &mut random));
        let Ok(solution) = arm.solve(&target, &model.settings.home) else {
            continue;
        };
        let error = arm.forward(&solution.joints).inv_mul(&target);
        assert!(error.translation.vector.norm() < 1e-6 && error.rotation.angle() < 1e-6);
        for i in 0..6 {
            let position = solution.joints[i];
            assert!(arm.lower[i] <= position && position <= arm.upper[i]);
            let turns = (position - model.settings.home[i]).abs();
            assert!(arm.lower[i].is_finite() || turns < PI + 1e-9);
        }
        solved += 1;
    }
    assert!(solved * 1000 >= count * 999, "{solved} of {count} solved");
}

#[test]
fn a_near_target_is_solved_on_the_same_branch() {
    let (arm, mut random) = (ArmKinematics::new(&model()), ChaCha8Rng::seed_from_u64(4));
    let mut solved = 0;
    for _ in 0..2000 {
        let joints = random_joints(&arm, &mut random);
        // Shifted by two turns: the solution stays there.
        let guess = joints.map(|position| position + 0.01);
        let mut far = guess;
        far[5] += 2.0 * std::f64::consts::TAU;
        let target = arm.forward(&joints);
        if let Ok(solution) = arm.solve_local(&target, &far, 0.2) {
            assert!((0..6).all(|i| (solution.joints[i] - far[i]).abs() <= 0.2));
            solved += 1;
        }
    }
    // The others are at singularities, where a small step needs a large rotation.
    assert!(solved > 1900, "{solved} of 2000 solved");
}

#[test]
fn unreachable_poses_have_a_reason() {
    let model = model();
    let arm = ArmKinematics::new(&model);
    let far = Isometry3::translation(1.5, 0.0, 0.5);
    let answer = arm.solve(&far, &model.settings.home).unwrap_err();
    assert!(matches!(answer.reason, Reason::TooFar { distance, reach }
        if distance > 1.5 && (reach - 0.8919).abs() < 1e-3));
    assert!(
        answer.to_string().contains("the arm reaches 0.892 m"),
        "{answer}"
    );
    // Inside the arm's own base: close enough, but folded too far.
    let inside = Isometry3::translation(0.0, 0.0, 0.30);
    let answer = arm.solve(&inside, &model.settings.home).unwrap_err();
    assert!(answer.to_string().contains("unreachable"), "{answer}");
    assert!(!matches!(answer.reason, Reason::TooFar { .. }));
}
