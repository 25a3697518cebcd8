//! Tests of friction and speed limits: rolling, turning, and measured joint speeds.

use super::*;
use crate::snapshot::BodyRef;

/// Recorded speeds may exceed a limit by this factor.
const TOLERANCE: f64 = 1.001;

/// Largest measured speed of each joint with a limit, in units of it.
fn share_of_limits(world: &World, model: &RobotModel) -> f64 {
    let snapshot = world.snapshot();
    let roles = &model.roles;
    let joints = roles
        .arm
        .iter()
        .chain(&roles.knuckles)
        .chain(&roles.finger_tips);
    let shares = joints.map(|&joint| {
        let limit = model.joints[joint].limits.velocity;
        snapshot.joints[joint].velocity.abs() / limit
    });
    shares.fold(0.0, f64::max)
}

#[test]
fn thrust_at_constant_speed_is_rolling_resistance_and_wheel_friction() {
    let (mut world, mut targets, _) = robot_alone();
    let model = model();
    let drive = &model.settings.drive;
    let radius = model.settings.drive.wheel_radius;
    for direction in [1.0, -1.0] {
        targets.wheel_velocity = [direction * 0.3 / radius; 2];
        world.apply(&targets);
        seconds(&mut world, 2.0, |_, _| {});
        let (mut thrust, mut expected) = (0.0, 0.0);
        seconds(&mut world, 1.0, |world, _| {
            let snapshot = world.snapshot();
            let torques = model
                .roles
                .wheels
                .map(|wheel| snapshot.joints[wheel].effort);
            thrust += (torques[0] + torques[1]) / radius / 240.0;
            let [a, b, c, d] = world.wheels.loads(&world.physics);
            let rolling =
                drive.tyre_rolling_resistance * (a + b) + drive.caster_rolling_resistance * (c + d);
            expected += (rolling + 2.0 * drive.wheel_friction / radius) / 240.0;
        });
        assert!(expected > 10.0, "the wheels carry no load: {expected} N");
        assert!(
            (direction * thrust / expected - 1.0).abs() < 0.03,
            "thrust {thrust} N, expected {direction} times {expected} N"
        );
    }
}

#[test]
fn wheels_carry_the_weight_of_the_robot() {
    let (mut world, _, _) = robot_alone();
    seconds(&mut world, 2.0, |_, _| {});
    let loads: f64 = world.wheels.loads(&world.physics).iter().sum();
    let links = model().links.into_iter().filter_map(|link| link.inertial);
    let weight = links.map(|inertial| inertial.mass).sum::<f64>() * super::super::GRAVITY;
    assert!(
        (loads / weight - 1.0).abs() < 0.01,
        "{loads} N, weight {weight} N"
    );
}

/// Joint 1 is vertical, so that no weight loads it: at a constant speed its servo error
/// equals the friction, and the link receives no torque.
#[test]
fn the_tracking_error_at_constant_speed_is_friction_and_the_effort_is_the_links() {
    let (mut world, mut targets, _) = robot_alone();
    let model = model();
    let arm = &model.settings.arm;
    let joint = model.roles.arm[0];
    let start = targets.arm_position[0];
    for speed in [0.2, 0.6] {
        let begin = targets.arm_position[0];
        let (mut lag, mut effort, mut count) = (0.0, 0.0, 0.0);
        seconds(&mut world, 1.5, |world, t| {
            if t > 1.0 {
                let state = world.snapshot().joints[joint];
                lag += targets.arm_position[0] - state.position;
                effort += state.effort;
                count += 1.0;
            }
            let ramp = (t / 0.3).min(1.0);
            targets.arm_velocity[0] = speed * ramp;
            targets.arm_position[0] += speed * ramp / 240.0;
            world.apply(&targets);
        });
        assert!(targets.arm_position[0] - begin > 0.2, "from {start}");
        let (lag, effort) = (lag / count, effort / count);
        let expected = arm.dry_friction[0] + arm.viscous_friction[0] * speed;
        let torque = arm.stiffness[0] * lag;
        assert!(
            (torque / expected - 1.0).abs() < 0.08,
            "at {speed} rad/s the servo pulls with {torque} N·m, expected {expected}"
        );
        assert!(effort.abs() < 0.1, "{effort} N·m act on the link");
    }
}

#[test]
fn joints_keep_their_speed_limits_when_pushed_and_commanded_too_fast() {
    let (mut world, targets, _) = robot_alone();
    let model = model();
    let hand = model.joints[model.roles.arm[5]].child;
    let tip = model.joints[model.roles.finger_tips[0]].child;
    let mut most: f64 = 0.0;
    let pushes = [
        (hand, Vector3::new(0.0, 400.0, 0.0)),
        (hand, Vector3::new(-150.0, 0.0, 300.0)),
        (tip, Vector3::new(150.0, 0.0, 0.0)),
        (tip, Vector3::new(0.0, -150.0, 0.0)),
    ];
    for (link, force) in pushes {
        world.push(Some((BodyRef::Link(link), force)));
        seconds(&mut world, 0.15, |world, _| {
            most = most.max(share_of_limits(world, &model));
        });
        world.push(None);
        // The servo pulls the arm back from a large error.
        seconds(&mut world, 0.4, |world, _| {
            most = most.max(share_of_limits(world, &model));
        });
    }
    let mut far = targets;
    far.arm_position[0] += 1.0;
    far.arm_position[5] += 1.0;
    far.knuckle_position = 0.7;
    world.apply(&far);
    seconds(&mut world, 1.0, |world, _| {
        most = most.max(share_of_limits(world, &model));
    });
    assert!(most > 0.9, "no joint was fast: {most} of a limit");
    assert!(most <= TOLERANCE, "{most} of a limit");
}

#[test]
fn a_joint_that_is_struck_beyond_its_limit_is_braked_to_it() {
    let model = model();
    for joint in [
        model.roles.arm[3],
        model.roles.knuckles[0],
        model.roles.finger_tips[1],
    ] {
        let (mut world, _, _) = robot_alone();
        seconds(&mut world, 0.1, |_, _| {});
        world.spin(joint, 3.0 * model.joints[joint].limits.velocity);
        let mut most: f64 = 0.0;
        seconds(&mut world, 0.1, |world, t| {
            if t > 0.0 {
                most = most.max(share_of_limits(world, &model));
            }
        });
        let name = &model.joints[joint].name;
        assert!(
            most > 0.05 && most <= TOLERANCE,
            "{name}: {most} of its limit"
        );
    }
}
