//! Tests of the robot: it is stable, drives straight, turns accurately and holds its
//! arm; the same commands give the same bits.

use std::f64::consts::FRAC_PI_2;

use super::*;

/// Speed profile for a distance: a ramp up, a plateau, a ramp down, as a share of the
/// plateau at time `t` of `total`.
fn trapezoid(t: f64, ramp: f64, total: f64) -> f64 {
    (t / ramp).min((total - t) / ramp).clamp(0.0, 1.0)
}

/// Arm targets that move all joints at once, within their speed limits.
pub(super) fn wave(home: [f64; 6], t: f64) -> Targets {
    let mut targets = hold(home);
    let amplitude = [0.35, 0.2, 0.25, 0.3, 0.3, 0.24];
    let rate = [3.0, 2.5, 3.5, 4.0, 3.0, 5.0];
    for i in 0..6 {
        let (a, w) = (amplitude[i], rate[i]);
        // A smooth start: the amplitude grows over the first second.
        let (s, ds) = if t < 1.0 {
            (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t))
        } else {
            (1.0, 0.0)
        };
        targets.arm_position[i] += a * s * (w * t).sin();
        targets.arm_velocity[i] = a * (s * w * (w * t).cos() + ds * (w * t).sin());
    }
    targets
}

fn arm_error(world: &World, model: &RobotModel, target: &[f64; 6]) -> f64 {
    let snapshot = world.snapshot();
    let errors = model
        .roles
        .arm
        .into_iter()
        .zip(target)
        .map(|(joint, q)| (snapshot.joints[joint].position - q).abs());
    errors.fold(0.0, f64::max)
}

#[test]
fn the_chair_is_level_and_at_rest_and_the_arm_holds() {
    let (mut world, targets, start) = robot_alone();
    let model = model();
    seconds(&mut world, 10.0, |_, _| {});
    let snapshot = world.snapshot();
    let moved = start.inverse() * snapshot.links[0].pose;
    assert!(moved.translation.vector.norm() < 1e-3, "{moved}");
    assert!(moved.rotation.angle() < 1e-3, "{moved}");
    assert!(snapshot.links[0].linear.norm() < 1e-3);
    assert!(arm_error(&world, &model, &targets.arm_position) < 0.005);
    assert!(snapshot.anomalies.is_empty());
    assert!(snapshot.contacts.is_empty(), "{:?}", snapshot.contacts);
    // The drive of joint 2 carries the arm and the gripper (6.53 N·m at home by the makers' masses).
    let joint_2 = snapshot.joints[model.joint("joint_2").expect("joint_2")];
    assert!((joint_2.effort - 6.53).abs() < 0.05, "{}", joint_2.effort);
}

#[test]
fn link_poses_match_the_kinematics() {
    let (mut world, targets, _) = robot_alone();
    let model = model();
    let mut worst: f64 = 0.0;
    let mut tracking: f64 = 0.0;
    seconds(&mut world, 3.0, |world, t| {
        let mut now = wave(targets.arm_position, t);
        now.wheel_velocity = [1.0 * t, 0.5 * t];
        now.knuckle_position = 0.2 * t;
        now.knuckle_velocity = 0.2;
        tracking = tracking.max(arm_error(world, &model, &now.arm_position));
        world.apply(&now);
        if world.tick().is_multiple_of(48) {
            let snapshot = world.snapshot();
            let positions: Vec<f64> = snapshot.joints.iter().map(|j| j.position).collect();
            let root = snapshot.links[0].pose;
            for (pose, link) in model.link_poses(&positions).iter().zip(&snapshot.links) {
                let error = (root * pose).inverse() * link.pose;
                worst = worst.max(error.translation.vector.norm());
                worst = worst.max(error.rotation.angle());
            }
        }
    });
    assert!(worst < 1e-4, "links off by {worst} m or rad");
    assert!(tracking < 0.02, "arm lags by {tracking} rad");
}

#[test]
fn driving_a_metre_is_a_metre() {
    let (mut world, mut targets, start) = robot_alone();
    let model = model();
    // 0.5 m/s with ramps of 0.5 s: 2 s on the ground line, 1 m less the ramps.
    let (speed, ramp, total) = (0.5, 0.5, 2.5);
    seconds(&mut world, 3.0, |world, t| {
        let rate = speed * trapezoid(t, ramp, total) / model.settings.drive.wheel_radius;
        targets.wheel_velocity = [rate; 2];
        world.apply(&targets);
    });
    let snapshot = world.snapshot();
    let moved = start.inverse() * snapshot.links[0].pose;
    let p = moved.translation.vector;
    assert!((p.x - 1.0).abs() < 0.005, "{p}");
    assert!(p.y.abs() < 0.005 && p.z.abs() < 0.002, "{p}");
    assert!(moved.rotation.angle() < 0.005, "{}", moved.rotation.angle());
    for wheel in model.roles.wheels.into_iter().chain(model.roles.casters) {
        let rolled = snapshot.joints[wheel].position * model.settings.drive.wheel_radius;
        let name = &model.joints[wheel].name;
        assert!((rolled - p.x).abs() < 0.005, "{name} {rolled}");
    }
}

#[test]
fn a_quarter_turn_is_a_quarter_turn() {
    let (mut world, mut targets, start) = robot_alone();
    let model = model();
    let (rate, ramp) = (1.0, 0.5);
    let total = FRAC_PI_2 / rate + ramp;
    seconds(&mut world, 3.0, |world, t| {
        let spin = rate * trapezoid(t, ramp, total);
        let wheel = spin * model.settings.drive.track / 2.0 / model.settings.drive.wheel_radius;
        targets.wheel_velocity = [-wheel, wheel];
        world.apply(&targets);
    });
    let moved = start.inverse() * world.snapshot().links[0].pose;
    let (_, _, yaw) = moved.rotation.euler_angles();
    assert!((yaw - FRAC_PI_2).abs() < 0.01, "{yaw}");
    assert!(moved.translation.vector.norm() < 0.005, "{moved}");
}

#[test]
fn the_same_commands_give_the_same_bits_also_from_a_saved_state() {
    let run = |world: &mut World, from: f64, to: f64| {
        let home = model().settings.home;
        seconds(world, to - from, |world, t| {
            let mut targets = wave(home, from + t);
            targets.wheel_velocity = [2.0, 1.0];
            world.apply(&targets);
        });
    };
    let (mut first, _, _) = robot_alone();
    run(&mut first, 0.0, 1.0);
    let saved = first.save();
    assert!(
        saved.len() > 1000 && saved.len() < 200_000,
        "{}",
        saved.len()
    );
    let at_save = first.hash();
    run(&mut first, 1.0, 2.0);

    let (mut second, _, _) = robot_alone();
    run(&mut second, 0.0, 2.0);
    assert_eq!(first.hash(), second.hash());

    let (mut third, _, _) = robot_alone();
    third.restore(&saved).expect("its own state");
    assert_eq!(third.hash(), at_save);
    run(&mut third, 1.0, 2.0);
    assert_eq!(first.hash(), third.hash());
    assert_eq!(first.snapshot(), third.snapshot());
    assert!(third.restore(&saved[..100]).is_err());
}

/// The first number of a saved state is the version of the physics.
#[test]
fn a_saved_state_of_another_physics_version_is_rejected() {
    let (mut world, _, _) = robot_alone();
    let mut saved = world.save();
    assert_eq!(u32::from(saved[0]), wheelarm_proto::PHYSICS_VERSION);
    let before = world.hash();
    saved[0] = 1;
    let error = world.restore(&saved).expect_err("another version");
    let error = error.to_string();
    assert!(error.contains("physics version 1, this program"), "{error}");
    assert_eq!(world.hash(), before);
}

#[test]
fn a_wall_stops_the_chair() {
    let model = model();
    let half = [0.1, 2.0, 0.5];
    let wall = body("wall", pose_at(1.1, 0.0, 0.5), 0.5, Shape::Cuboid { half });
    let (scene, placements) = scene(vec![floor(), wall], Vec::new());
    let home = model.settings.home;
    let start = Isometry3::identity();
    // The hand extends beyond the chair; fold it back.
    let arm = [3.0, home[1], home[2], home[3], home[4], home[5]];
    let mut world = World::new(&model, &scene, &placements, &start, &arm).expect("a world");
    let mut targets = hold(arm);
    targets.wheel_velocity = [0.3 / model.settings.drive.wheel_radius; 2];
    world.apply(&targets);
    seconds(&mut world, 3.0, |_, _| {});
    let snapshot = world.snapshot();
    // The plate of the chair ends at 0.7925 m, the wall begins at 1 m.
    let gap = 1.0 - 0.7925 - snapshot.links[0].pose.translation.x;
    assert!(gap.abs() < 0.01, "{gap}");
    assert!(snapshot.links[0].pose.translation.z.abs() < 0.01);
    let push: f64 = snapshot.contacts.iter().map(|c| c.force.x).sum();
    // Two drives of 30 N·m on wheels of 0.1325 m.
    let thrust = 2.0 * model.settings.drive.wheel_torque / model.settings.drive.wheel_radius;
    assert!(push > 0.0 && push < 1.1 * thrust, "{push} {thrust}");
}

/// A double pendulum on a fixed pivot keeps its energy through 5 s of chaotic motion.
#[test]
fn a_double_pendulum_keeps_its_energy() {
    use super::super::body::{RobotBody, Surface};
    use super::super::convert::from_vector;
    use super::super::{GRAVITY, engine};
    use crate::robot::{Inertial, Joint, JointKind, Limits, Link};

    let mut model = model();
    let link = |name: &str, mass: f64| Link {
        name: name.into(),
        inertial: Some(Inertial {
            mass,
            com: Point3::new(0.0, 0.0, -0.2),
            inertia: Matrix3::from_diagonal(&Vector3::new(0.02, 0.02, 0.001)) * mass,
        }),
        collision: Vec::new(),
        visual: Vec::new(),
    };
    let joint = |parent: usize, z: f64| Joint {
        name: format!("joint {parent}"),
        kind: JointKind::Continuous,
        parent,
        child: parent + 1,
        origin: pose_at(0.0, 0.0, z),
        axis: Vector3::y_axis(),
        limits: Limits {
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            velocity: 1.0,
            effort: 1.0,
        },
        mimic: None,
    };
    model.links = vec![link("pivot", 1.0), link("upper", 1.5), link("lower", 1.0)];
    model.joints = vec![joint(0, 0.0), joint(1, -0.4)];
    let mut physics = engine();
    let swing = |j: usize| [1.3, 0.4][j];
    let start = pose_at(0.0, 0.0, 2.0);
    let robot = RobotBody::insert(&mut physics, &model, &start, swing, |_| Surface::Shell)
        .expect("a pendulum");
    physics.bodies[robot.handles[0]].set_body_type(rapier3d::prelude::RigidBodyType::Fixed, true);
    let energy = |physics: &rapier3d::prelude::PhysicsWorld| {
        robot.handles[1..]
            .iter()
            .map(|h| {
                let body = &physics.bodies[*h];
                let mass = f64::from(body.mass());
                let spin = f64::from(body.angvel().y);
                let height = f64::from(body.center_of_mass().z);
                0.5 * mass * from_vector(body.linvel()).norm_squared()
                    + 0.5 * 0.02 * mass * spin * spin
                    + mass * GRAVITY * height
            })
            .sum::<f64>()
    };
    physics.step();
    let before = energy(&physics);
    // Potential energy available for motion: from the start to hanging.
    let deepest = GRAVITY * (1.5 * (2.0 - 0.2) + 1.0 * (2.0 - 0.6));
    let swing = before - deepest;
    let (mut gain, mut loss): (f64, f64) = (0.0, 0.0);
    let mut lowest: f64 = f64::INFINITY;
    for _ in 0..(5 * 240) {
        physics.step();
        let change = (energy(&physics) - before) / swing;
        gain = gain.max(change);
        loss = loss.max(-change);
        lowest = lowest.min(f64::from(
            physics.bodies[robot.handles[2]].center_of_mass().z,
        ));
    }
    assert!(lowest < 1.5, "it swung down to {lowest}");
    // The energy oscillates by 0.5 % with the step, and 0.3 % per second are lost.
    assert!(gain < 0.005 && loss < 0.05, "gain {gain}, loss {loss}");
}
