//! Tests of joint signals: velocity is the rate of the position at the tick itself,
//! effort is the torque that moves the arm, and links move consistently with their
//! joints.

use std::collections::VecDeque;

use super::robot::wave;
use super::*;
use crate::snapshot::{BodyState, JointState, Snapshot};

const DT: f64 = 1.0 / 240.0;

/// Indices of the recorded joints in the model.
fn joints(model: &RobotModel) -> Vec<usize> {
    model
        .roles
        .joints
        .iter()
        .map(|recorded| recorded.joint)
        .collect()
}

/// Motion in addition to the arm.
#[derive(Clone, Copy, Debug)]
struct Beside {
    gripper: bool,
    chair: bool,
}

const ALL: Beside = Beside {
    gripper: true,
    chair: true,
};

/// The arm moves; the chair may drive a curve, the gripper close and open.
fn moving(beside: Beside, mut each: impl FnMut(&Snapshot)) {
    let (mut world, targets, _) = robot_alone();
    each(&world.snapshot());
    for tick in 1..=(240 * 4) {
        // Targets are those of the end of a tick, as from the control.
        let t = f64::from(tick) * DT;
        let mut now = wave(targets.arm_position, t);
        if beside.chair {
            let ramp = (t / 0.5).min(1.0);
            now.wheel_velocity = [2.0 * ramp, 1.2 * ramp];
        }
        if beside.gripper {
            now.knuckle_position = 0.3 * (1.0 - (1.6 * t).cos());
            now.knuckle_velocity = 0.48 * (1.6 * t).sin();
        }
        world.apply(&now);
        world.step();
        each(&world.snapshot());
    }
}

/// Over any second, the velocities of neighbouring ticks (trapezoids) integrate to the
/// travel. A lag of 1 ms would show as 1 mrad for each rad/s gained.
#[test]
fn joint_velocities_integrate_to_the_travel_in_any_second() {
    let model = model();
    let joints = joints(&model);
    let mut sums = vec![0.0; joints.len()];
    let mut worst = vec![0.0_f64; joints.len()];
    let mut last: Option<Vec<JointState>> = None;
    let mut second = VecDeque::new();
    moving(ALL, |snapshot| {
        let now: Vec<JointState> = joints.iter().map(|&j| snapshot.joints[j]).collect();
        for (i, now) in now.iter().enumerate() {
            if let Some(last) = &last {
                sums[i] += 0.5 * (last[i].velocity + now.velocity) * DT;
            }
        }
        second.push_back((sums.clone(), now.clone()));
        if second.len() > 240 {
            second.pop_front();
        }
        let (sums_before, before) = &second[0];
        for i in 0..joints.len() {
            let way = now[i].position - before[i].position;
            let error = way - (sums[i] - sums_before[i]);
            worst[i] = worst[i].max(error.abs());
        }
        last = Some(now);
    });
    let errors: Vec<String> = joints
        .iter()
        .zip(&worst)
        .map(|(&joint, error)| format!("{} {:.4}", model.joints[joint].name, error * 1e3))
        .collect();
    println!("worst error over a second, mrad: {}", errors.join(", "));
    assert!(worst.iter().all(|e| *e < 1e-4), "mrad: {errors:?}");
}

/// Linear momentum and angular momentum about the house's origin of one link.
fn momentum(inertial: &crate::robot::Inertial, link: &BodyState) -> (Vector3<f64>, Vector3<f64>) {
    let com = link.pose * inertial.com;
    let arm = com.coords - link.pose.translation.vector;
    let linear = (link.linear + link.angular.cross(&arm)) * inertial.mass;
    let turn = link.pose.rotation.to_rotation_matrix();
    let spin = turn * inertial.inertia * turn.transpose() * link.angular;
    (linear, com.coords.cross(&linear) + spin)
}

/// The drive torque at each arm joint by the Newton-Euler equations between two
/// neighbouring ticks, with gravity as the only external force, N·m.
fn newton_euler_torque(model: &RobotModel, before: &Snapshot, after: &Snapshot) -> [f64; 6] {
    std::array::from_fn(|i| {
        let joint = &model.joints[model.roles.arm[i]];
        let mut beyond = vec![false; model.links.len()];
        beyond[joint.child] = true;
        for other in &model.joints {
            beyond[other.child] |= beyond[other.parent];
        }
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for (index, link) in model.links.iter().enumerate() {
            let Some(inertial) = link.inertial.as_ref().filter(|_| beyond[index]) else {
                continue;
            };
            let (p0, l0) = momentum(inertial, &before.links[index]);
            let (p1, l1) = momentum(inertial, &after.links[index]);
            let com = |s: &Snapshot| (s.links[index].pose * inertial.com).coords;
            let com = (com(before) + com(after)) * 0.5;
            let weight = Vector3::new(0.0, 0.0, -super::super::GRAVITY * inertial.mass);
            force += (p1 - p0) / DT - weight;
            moment += (l1 - l0) / DT - com.cross(&weight);
        }
        let pivot = |s: &Snapshot| s.links[joint.child].pose.translation.vector;
        let axis = |s: &Snapshot| s.links[joint.child].pose * joint.axis.into_inner();
        let pivot = (pivot(before) + pivot(after)) * 0.5;
        let axis = (axis(before) + axis(after)) * 0.5;
        axis.dot(&(moment - pivot.cross(&force)))
    })
}

/// Largest and root mean square difference, N·m, of the arm's efforts from
/// [`newton_euler_torque`].
fn effort_errors(beside: Beside) -> ([f64; 6], [f64; 6]) {
    let model = model();
    let mut last: Option<Snapshot> = None;
    let (mut worst, mut squares, mut count) = ([0.0_f64; 6], [0.0; 6], 0.0);
    moving(beside, |snapshot| {
        // The first ticks let the chair settle.
        if let Some(last) = last.as_ref().filter(|s| s.tick > 24) {
            count += 1.0;
            for (i, torque) in newton_euler_torque(&model, last, snapshot)
                .into_iter()
                .enumerate()
            {
                let joint = model.roles.arm[i];
                let error = snapshot.joints[joint].effort - torque;
                worst[i] = worst[i].max(error.abs());
                squares[i] += error * error;
            }
        }
        last = Some(snapshot.clone());
    });
    (worst, squares.map(|sum: f64| (sum / count).sqrt()))
}

/// M·Δv/Δt + h = effort, from the snapshots only.
#[test]
fn arm_effort_is_the_torque_that_moves_the_arm() {
    let alone = Beside {
        gripper: false,
        chair: false,
    };
    let with_gripper = Beside {
        gripper: true,
        chair: false,
    };
    let mut errors = Vec::new();
    for beside in [alone, with_gripper, ALL] {
        let (worst, rms) = effort_errors(beside);
        println!("{beside:?}: effort off by {worst:.3?} N·m, rms {rms:.3?}");
        errors.push((worst, rms));
    }
    // The chair rocks on its wheels under the arm, and contacts of the wheels give the
    // engine another velocity than that of the motion.
    for (worst, rms) in &errors[..2] {
        assert!(rms.iter().all(|e| *e < 0.13), "{rms:.3?}");
        assert!(worst.iter().all(|e| *e < 0.5), "{worst:.3?}");
    }
    assert!(errors[2].1.iter().all(|e| *e < 0.13));
}

/// Before the first tick the drives already hold the arm.
#[test]
fn the_first_state_contains_the_torque_that_holds_the_arm() {
    let (mut world, _, _) = robot_alone();
    let model = model();
    let effort = |world: &World| -> Vec<f64> {
        let snapshot = world.snapshot();
        let joints = joints(&model);
        joints[4..10]
            .iter()
            .map(|&j| snapshot.joints[j].effort)
            .collect()
    };
    let first = effort(&world);
    seconds(&mut world, 2.0, |_, _| {});
    let held = effort(&world);
    println!("first {first:.2?}, after 2 s {held:.2?}");
    for (first, held) in first.iter().zip(&held) {
        assert!((first - held).abs() < 0.05, "{first} {held}");
    }
}

/// The twist of a link follows from that of its parent and the joint's velocity.
#[test]
fn links_move_consistently_with_their_joints() {
    let model = model();
    let (mut worst_linear, mut worst_angular) = (0.0_f64, 0.0_f64);
    moving(ALL, |snapshot| {
        for (index, joint) in model.joints.iter().enumerate() {
            let (parent, child) = (&snapshot.links[joint.parent], &snapshot.links[joint.child]);
            let arm = child.pose.translation.vector - parent.pose.translation.vector;
            let linear = parent.linear + parent.angular.cross(&arm);
            let turn = child.pose * joint.axis.into_inner() * snapshot.joints[index].velocity;
            worst_linear = worst_linear.max((child.linear - linear).norm());
            worst_angular = worst_angular.max((child.angular - parent.angular - turn).norm());
        }
    });
    println!("worst {worst_linear:.6} m/s, {worst_angular:.6} rad/s");
    assert!(worst_linear < 1e-6 && worst_angular < 1e-6);
}
