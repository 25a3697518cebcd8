//! Tests of the control: limits hold for any intent, goals are reached, and a saved
//! state continues with the same bits.

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::robot::kinematics::ArmKinematics;
use crate::snapshot::BodyState;

const DT: f64 = 1.0 / PHYSICS_HZ as f64;

const ROBOTS: [&str; 2] = ["wheelarm", "wheelarm_wide"];

fn model() -> RobotModel {
    robot_model(ROBOTS[0])
}

fn robot_model(name: &str) -> RobotModel {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    RobotModel::load(&assets, name).unwrap()
}

/// The chair at a pose, with an arbitrary arm.
fn snapshot(model: &RobotModel, house_from_chair: Isometry3<f64>) -> Snapshot {
    let links = model
        .link_poses(&vec![0.0; model.joints.len()])
        .into_iter()
        .map(|pose| BodyState {
            pose: house_from_chair * pose,
            linear: Vector3::zeros(),
            angular: Vector3::zeros(),
        })
        .collect();
    Snapshot {
        tick: 0,
        joints: Vec::new(),
        links,
        objects: Vec::new(),
        skins: Vec::new(),
        furniture_joints: Vec::new(),
        sliding: Vec::new(),
        person: None,
        contacts: Vec::new(),
        anomalies: Vec::new(),
    }
}

fn arm(intent: ArmIntent) -> ControlInput {
    ControlInput {
        arm: Some(intent),
        ..ControlInput::default()
    }
}

fn base(linear: f64, angular: f64) -> ControlInput {
    ControlInput {
        base: Some(BaseIntent { linear, angular }),
        ..ControlInput::default()
    }
}

fn random_vector(random: &mut ChaCha8Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.random_range(-size..size))
}

/// All kinds of intents, near and far, some out of reach.
fn random_intent(random: &mut ChaCha8Rng, kinematics: &ArmKinematics, now: &[f64; 6]) -> ArmIntent {
    let frame = [
        IntentFrame::ArmBase,
        IntentFrame::EndEffector,
        IntentFrame::Wheelchair,
        IntentFrame::House,
    ][random.random_range(0..4)];
    let joints = now.map(|position| position + random.random_range(-1.5..1.5));
    match random.random_range(0..6) {
        0 => ArmIntent::Joints(joints),
        1 => ArmIntent::Pose {
            frame: IntentFrame::ArmBase,
            pose: kinematics.forward(&joints),
        },
        2 => ArmIntent::Pose {
            frame: IntentFrame::EndEffector,
            pose: Isometry3::new(random_vector(random, 0.4), random_vector(random, 0.6)),
        },
        3 => ArmIntent::Twist {
            frame,
            linear: random_vector(random, 0.6),
            angular: random_vector(random, 2.0),
        },
        4 => ArmIntent::Step {
            frame,
            translation: random_vector(random, 0.1),
            rotation: random_vector(random, 0.2),
        },
        _ => ArmIntent::Hold,
    }
}

#[test]
fn arm_limits_hold_for_any_sequence_of_intents() {
    let model = model();
    let kinematics = ArmKinematics::new(&model);
    let here = snapshot(&model, Isometry3::identity());
    let grasp = Isometry3::translation(0.0, 0.0, model.settings.tool_length);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut control = RobotControl::new(&model);
    let (mut position, mut velocity) = (model.settings.home, [0.0; 6]);
    let mut fastest = 0.0_f64;
    for _ in 0..400 {
        let intent = random_intent(&mut random, &kinematics, &position);
        let mut input = arm(intent);
        // From streams of one tick to intents that are nearly completed.
        for _ in 0..random.random_range(1..60) {
            for targets in control.update(&input, &here) {
                let before = kinematics.forward(&position) * grasp;
                let after = kinematics.forward(&targets.arm_position) * grasp;
                let tool = (after.translation.vector - before.translation.vector).norm() / DT;
                fastest = fastest.max(tool);
                assert!(
                    tool <= model.settings.arm.tool_speed,
                    "{tool} m/s: {intent:?}"
                );
                for i in 0..6 {
                    let (at, speed) = (targets.arm_position[i], targets.arm_velocity[i]);
                    assert!(kinematics.lower()[i] <= at && at <= kinematics.upper()[i]);
                    assert!(speed.abs() <= kinematics.speed()[i] + 1e-12);
                    let gain = (speed - velocity[i]).abs() / DT;
                    let allowed = model.settings.arm.acceleration;
                    assert!(gain <= allowed + 1e-9, "{gain} rad/s²: {intent:?}");
                    assert!((position[i] + speed * DT - at).abs() < 1e-12);
                }
                (position, velocity) = (targets.arm_position, targets.arm_velocity);
            }
            input = ControlInput::default();
        }
    }
    assert!(fastest > 0.4, "only {fastest} m/s was reached");
}

#[test]
fn joint_goals_are_reached_together_and_exactly() {
    let model = model();
    let here = snapshot(&model, Isometry3::identity());
    let mut control = RobotControl::new(&model);
    let goal = [0.5, -0.4, 1.2, -0.8, 0.6, 2.0];
    let mut input = arm(ArmIntent::Joints(goal));
    let home = model.settings.home;
    let mut ticks = 0;
    while control.state().arm.position != goal || control.state().arm.velocity != [0.0; 6] {
        control.update(&input, &here);
        input = ControlInput::default();
        ticks += 1;
        assert!(ticks < 600, "not reached: {:?}", control.state().arm);
        let part = |i: usize| (control.state().arm.position[i] - home[i]) / (goal[i] - home[i]);
        for i in 1..6 {
            assert!(
                (part(i) - part(0)).abs() < 1e-6,
                "joints deviate from the line"
            );
        }
    }
    let beyond = [0.0, 2.5, 0.0, 0.0, 0.0, 0.0];
    control.update(&arm(ArmIntent::Joints(beyond)), &here);
    assert!(control.arm_problem().unwrap().contains("arm joint 2"));
}

#[test]
fn far_poses_are_reached_along_a_straight_line() {
    let model = model();
    let kinematics = ArmKinematics::new(&model);
    let here = snapshot(&model, Isometry3::identity());
    let mut control = RobotControl::new(&model);
    let start = kinematics.forward(&model.settings.home);
    let way = Vector3::new(-0.25, 0.15, -0.2);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.3, 0.4));
    let goal = Isometry3::from_parts(
        (start.translation.vector + way).into(),
        turn * start.rotation,
    );
    let mut input = arm(ArmIntent::Pose {
        frame: IntentFrame::ArmBase,
        pose: goal,
    });
    let mut ticks = 0;
    loop {
        control.update(&input, &here);
        input = ControlInput::default();
        let pose = kinematics.forward(&control.state().arm.position);
        let aside = (pose.translation.vector - start.translation.vector)
            .cross(&way.normalize())
            .norm();
        assert!(aside < 0.002, "{aside} m off the line");
        let left = pose.inv_mul(&goal);
        if left.translation.vector.norm() < 1e-6 && left.rotation.angle() < 1e-6 {
            break;
        }
        ticks += 1;
        assert!(ticks < 240, "not reached: {left}");
    }
    assert_eq!(control.arm_problem(), None);
    assert!(
        (control.desired_pose().inv_mul(&goal))
            .translation
            .vector
            .norm()
            < 1e-12
    );
}

#[test]
fn streamed_poses_do_not_jump_between_branches() {
    let model = model();
    let kinematics = ArmKinematics::new(&model);
    let here = snapshot(&model, Isometry3::identity());
    let mut control = RobotControl::new(&model);
    let start = kinematics.forward(&model.settings.home);
    // A circle of 0.12 m radius in 8 s.
    for tick in 0..480 {
        let angle = std::f64::consts::TAU * f64::from(tick) / 480.0;
        let offset = Vector3::new(0.12 * (angle.cos() - 1.0), 0.12 * angle.sin(), 0.0);
        let pose =
            Isometry3::from_parts((start.translation.vector + offset).into(), start.rotation);
        let frame = IntentFrame::ArmBase;
        control.update(&arm(ArmIntent::Pose { frame, pose }), &here);
        assert_eq!(control.arm_problem(), None);
        let now = kinematics.forward(&control.state().arm.position);
        let lag = (now.translation.vector - pose.translation.vector).norm();
        assert!(lag < 0.02, "{lag} m behind at tick {tick}");
    }
    for _ in 0..60 {
        control.update(&ControlInput::default(), &here);
    }
    for i in 0..6 {
        assert!((control.state().arm.position[i] - model.settings.home[i]).abs() < 0.05);
    }
}

#[test]
fn twists_move_along_the_axes_of_their_frame_and_hold_stops() {
    let model = model();
    let kinematics = ArmKinematics::new(&model);
    let yaw = UnitQuaternion::from_euler_angles(0.0, 0.0, -1.1);
    let chair = Isometry3::from_parts(Vector3::new(-6.6, 3.4, 0.0).into(), yaw);
    let there = snapshot(&model, chair);
    let house_from_base = there.links[model.link(&model.settings.arm_base_link).unwrap()].pose;
    let home = kinematics.forward(&model.settings.home);
    let direction = Vector3::new(0.6, 0.0, 0.8);
    for (frame, base_from_frame) in [
        (IntentFrame::ArmBase, UnitQuaternion::identity()),
        (IntentFrame::EndEffector, home.rotation),
        (
            IntentFrame::Wheelchair,
            (chair.inverse() * house_from_base).rotation.inverse(),
        ),
        (IntentFrame::House, house_from_base.rotation.inverse()),
    ] {
        let mut control = RobotControl::new(&model);
        let mut input = arm(ArmIntent::Twist {
            frame,
            linear: direction * 0.1,
            angular: Vector3::zeros(),
        });
        for _ in 0..60 {
            control.update(&input, &there);
            input = ControlInput::default();
        }
        let pose = kinematics.forward(&control.state().arm.position);
        let moved = pose.translation.vector - home.translation.vector;
        // One second at 0.1 m/s less the ramp of 0.1 s.
        let expected = base_from_frame * direction * 0.095;
        assert!(
            (moved - expected).norm() < 1e-3,
            "{frame:?}: {moved} for {expected}"
        );
        assert!(pose.rotation.angle_to(&home.rotation) < 2e-3);
        control.update(&arm(ArmIntent::Hold), &there);
        for _ in 0..30 {
            control.update(&ControlInput::default(), &there);
        }
        assert_eq!(control.state().arm.velocity, [0.0; 6]);
    }
}

#[test]
fn a_twist_out_of_reach_is_reported_and_does_not_run_away() {
    let model = model();
    let kinematics = ArmKinematics::new(&model);
    let here = snapshot(&model, Isometry3::identity());
    let mut control = RobotControl::new(&model);
    let twist = |speed: f64| ArmIntent::Twist {
        frame: IntentFrame::ArmBase,
        linear: Vector3::new(speed, 0.0, 0.0),
        angular: Vector3::zeros(),
    };
    for _ in 0..600 {
        control.update(&arm(twist(-0.3)), &here);
        // The elbow is at rest before it is straight.
        assert!(control.state().arm.position[2] > -0.01);
    }
    assert!(control.arm_problem().unwrap().contains("not followed"));
    let stretched = kinematics.forward(&control.state().arm.position);
    let lead = control
        .desired_pose()
        .inv_mul(&stretched)
        .translation
        .vector
        .norm();
    assert!(lead < 0.03, "the target leads by {lead} m");
    // The way back begins at once.
    for _ in 0..120 {
        control.update(&arm(twist(0.3)), &here);
    }
    let back = kinematics.forward(&control.state().arm.position);
    assert!(back.translation.x - stretched.translation.x > 0.25);
    assert_eq!(control.arm_problem(), None);
}

#[test]
fn steps_add_up_and_unreachable_poses_are_reported() {
    let model = model();
    let here = snapshot(&model, Isometry3::identity());
    let mut control = RobotControl::new(&model);
    let start = control.desired_pose();
    for _ in 0..10 {
        control.update(
            &arm(ArmIntent::Step {
                frame: IntentFrame::Wheelchair,
                translation: Vector3::new(0.01, 0.0, 0.0),
                rotation: Vector3::new(0.0, 0.0, 0.02),
            }),
            &here,
        );
    }
    // Forward on the chair is backward in the arm's base.
    let pose = control.desired_pose();
    let moved = pose.translation.vector - start.translation.vector;
    assert!((moved - Vector3::new(-0.1, 0.0, 0.0)).norm() < 1e-9);
    let turned = start.rotation.rotation_to(&pose.rotation);
    let tool_axis = start.rotation * Vector3::z();
    assert!((turned.scaled_axis() - tool_axis * 0.2).norm() < 1e-9);
    let far = Isometry3::translation(-2.0, 0.0, 0.5);
    let frame = IntentFrame::ArmBase;
    control.update(&arm(ArmIntent::Pose { frame, pose: far }), &here);
    assert!(
        control
            .arm_problem()
            .unwrap()
            .contains("the arm reaches 0.892 m")
    );
    for _ in 0..60 {
        control.update(&ControlInput::default(), &here);
    }
    assert_eq!(control.state().arm.velocity, [0.0; 6]);
    control.update(&arm(ArmIntent::Hold), &here);
    assert_eq!(control.arm_problem(), None);
}

#[test]
fn wheel_speeds_and_motion_are_inverse() {
    let wheels = DriveGeometry::new(&model().settings);
    let motion = BaseIntent {
        linear: 0.31,
        angular: -0.7,
    };
    let back = wheels.motion(wheels.wheel_speeds(&motion));
    assert!((back.linear - motion.linear).abs() < 1e-15);
    assert!((back.angular - motion.angular).abs() < 1e-15);
    // A turn to the left: the right wheel runs faster.
    let [left, right] = wheels.wheel_speeds(&BaseIntent {
        linear: 0.0,
        angular: 1.0,
    });
    assert!((right - 0.248 / 0.1325).abs() < 1e-12 && left == -right);
}

#[test]
fn the_chair_keeps_its_profile_for_any_sequence_of_commands() {
    let model = model();
    let here = snapshot(&model, Isometry3::identity());
    let drive = model.settings.drive;
    let wheels = DriveGeometry::new(&model.settings);
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let mut control = RobotControl::new(&model);
    let mut now = BaseIntent::default();
    for _ in 0..500 {
        let input = if random.random_bool(0.2) {
            base(0.0, 0.0)
        } else {
            base(
                random.random_range(-2.0..2.0),
                random.random_range(-3.0..3.0),
            )
        };
        for _ in 0..random.random_range(1..40) {
            for targets in control.update(&input, &here) {
                let next = wheels.motion(targets.wheel_velocity);
                assert!(-0.5 - 1e-9 <= next.linear && next.linear <= 0.5 + 1e-9);
                assert!(next.angular.abs() <= 1.0 + 1e-9);
                let stop = input.base == Some(BaseIntent::default());
                let change = (next.linear - now.linear) / DT;
                let (least, most) = if now.linear > 1e-9 {
                    (-drive.forward_deceleration, drive.forward_acceleration)
                } else if now.linear < -1e-9 {
                    let braking = if stop {
                        drive.stop_deceleration
                    } else {
                        drive.backward_deceleration
                    };
                    (-drive.backward_acceleration, braking)
                } else {
                    (-drive.backward_acceleration, drive.forward_acceleration)
                };
                assert!(
                    least - 1e-9 <= change && change <= most + 1e-9,
                    "{change} m/s²"
                );
                let turn = ((next.angular - now.angular) / DT).abs();
                let braking = if stop {
                    drive.stop_turn_deceleration
                } else {
                    drive.turn_deceleration
                };
                let slows = next.angular.abs() < now.angular.abs();
                let most = if slows {
                    braking
                } else {
                    drive.turn_acceleration
                };
                assert!(turn <= most + 1e-9, "{turn} rad/s²");
                now = next;
            }
        }
    }
}

#[test]
fn the_chair_stops_within_045_seconds() {
    let model = model();
    let here = snapshot(&model, Isometry3::identity());
    for (linear, angular) in [(0.5, 0.0), (-0.5, 0.0), (0.0, 1.0), (0.5, -1.0)] {
        let mut control = RobotControl::new(&model);
        for _ in 0..240 {
            control.update(&base(linear, angular), &here);
        }
        let fast = control.base_velocity_command();
        assert!((fast.linear - linear).abs() < 1e-9 && (fast.angular - angular).abs() < 1e-9);
        for _ in 0..27 {
            control.update(&base(0.0, 0.0), &here);
        }
        assert_eq!(control.base_velocity_command(), BaseIntent::default());
    }
}

#[test]
fn the_gripper_map_matches_the_manufacturers_geometry() {
    let map = GripperMap::new(&model());
    // Knuckle in rad, opening in mm, way of a pad per angle in m.
    let table = [
        (0.0, 85.00, 0.0434),
        (0.1, 75.96, 0.0469),
        (0.2, 66.26, 0.0499),
        (0.3, 56.01, 0.0525),
        (0.4, 45.31, 0.0545),
        (0.5, 34.26, 0.0559),
        (0.6, 22.98, 0.0568),
        (0.7, 11.58, 0.0571),
        (0.7929, 0.97, 0.0569),
        (0.8, 0.16, 0.0569),
    ];
    for (knuckle, opening, lever) in table {
        assert!(
            (map.opening(knuckle) * 1e3 - opening).abs() < 0.01,
            "{knuckle} rad"
        );
        assert!((map.lever(knuckle) - lever).abs() < 1e-4);
        assert!((map.knuckle(map.opening(knuckle)) - knuckle).abs() < 1e-12);
    }
    assert!(
        map.knuckle(0.2) < 0.0,
        "wider than open is beyond the range"
    );
}

#[test]
fn gripper_moves_within_its_limits_and_lands_exactly() {
    for robot in ROBOTS {
        gripper_moves_within_its_limits(&robot_model(robot));
    }
}

fn gripper_moves_within_its_limits(model: &RobotModel) {
    let here = snapshot(model, Isometry3::identity());
    let limits = &model.settings.gripper;
    let mut control = RobotControl::new(model);
    let (mut position, mut velocity) = (0.0, 0.0);
    for (knuckle, ticks) in [(0.6, 100), (0.1, 20), (2.0, 200), (0.0, 5), (0.3, 100)] {
        let input = ControlInput {
            gripper: Some(GripperIntent {
                knuckle,
                max_force: Some(500.0),
            }),
            ..ControlInput::default()
        };
        for _ in 0..ticks {
            for targets in control.update(&input, &here) {
                let (at, speed) = (targets.knuckle_position, targets.knuckle_velocity);
                assert!((0.0..=limits.closed).contains(&at));
                assert!(speed.abs() <= limits.speed);
                assert!((speed - velocity).abs() <= limits.acceleration * DT + 1e-12);
                assert!((position + speed * DT - at).abs() < 1e-12);
                assert!(targets.pad_force == limits.max_force);
                (position, velocity) = (at, speed);
            }
        }
        if ticks >= 100 {
            assert!((position - knuckle.min(limits.closed)).abs() < 1e-12 && velocity == 0.0);
        }
    }
}

#[test]
fn a_saved_state_continues_with_the_same_bits() {
    let model = model();
    let kinematics = ArmKinematics::new(&model);
    let here = snapshot(&model, Isometry3::identity());
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut first = RobotControl::new(&model);
    for round in 0..40 {
        let now = first.state().arm.position;
        let mut input = arm(random_intent(&mut random, &kinematics, &now));
        input.base = base(random.random_range(-1.0..1.0), 0.4).base;
        first.update(&input, &here);
        let bytes = postcard::to_stdvec(first.state()).unwrap();
        let mut second = RobotControl::new(&model);
        second.restore(postcard::from_bytes(&bytes).unwrap());
        for _ in 0..10 {
            let (one, other) = (
                first.update(&ControlInput::default(), &here),
                second.update(&ControlInput::default(), &here),
            );
            assert_eq!(one, other, "round {round}");
        }
        assert_eq!(
            postcard::to_stdvec(first.state()),
            postcard::to_stdvec(second.state())
        );
    }
}

#[test]
fn non_finite_intents_are_ignored() {
    let model = model();
    let here = snapshot(&model, Isometry3::identity());
    let mut control = RobotControl::new(&model);
    let before = control.state().clone();
    let nan = f64::NAN;
    control.update(&arm(ArmIntent::Joints([nan; 6])), &here);
    control.update(&base(nan, 0.0), &here);
    let twist = ArmIntent::Twist {
        frame: IntentFrame::House,
        linear: Vector3::new(nan, 0.0, 0.0),
        angular: Vector3::zeros(),
    };
    control.update(&arm(twist), &here);
    assert_eq!(control.state(), &before);
    let speeds = Vector6::from(control.state().arm.velocity);
    assert_eq!(speeds, Vector6::zeros());
}

#[test]
fn a_cap_of_zero_means_no_force_and_none_the_default() {
    let model = model();
    let here = snapshot(&model, Isometry3::identity());
    let usual = model.settings.gripper.force;
    let mut control = RobotControl::new(&model);
    for (max_force, expected) in [(Some(0.0), 0.0), (Some(7.5), 7.5), (None, usual)] {
        let input = ControlInput {
            gripper: Some(GripperIntent {
                knuckle: 0.3,
                max_force,
            }),
            ..ControlInput::default()
        };
        let targets = control.update(&input, &here);
        assert!(targets.iter().all(|t| t.pad_force == expected));
    }
}
