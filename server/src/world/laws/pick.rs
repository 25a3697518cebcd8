//! A whole pick: approach, close, lift, wave, with the arm's own kinematics.

use super::*;
use crate::robot::PAD;
use crate::robot::control::GripperMap;
use crate::robot::kinematics::ArmKinematics;
use crate::snapshot::BodyRef;

/// Half extents of a bottle of 0.603 kg with 58 mm between the pads, shallow enough for the
/// inner knuckles to stay clear while the pads hold it at its middle.
const BOTTLE: [f64; 3] = [0.022, 0.029, 0.08];

struct Picker {
    world: World,
    arm: ArmKinematics,
    targets: Targets,
    base_from_house: Isometry3<f64>,
    /// Commanded pose of the end effector, in `house`.
    hand: Isometry3<f64>,
}

impl Picker {
    /// Moves the hand along a straight line in `duration` s, with smooth ends.
    fn line(&mut self, by: Vector3<f64>, duration: f64) {
        let from = self.hand;
        let ticks = (duration * 240.0) as usize;
        for k in 1..=ticks {
            let s = k as f64 / ticks as f64;
            let s = s * s * (3.0 - 2.0 * s);
            self.hand.translation.vector = from.translation.vector + by * s;
            let before = self.targets.arm_position;
            let wanted = self.base_from_house * self.hand;
            let answer = self.arm.solve_local(&wanted, &before, 0.1);
            self.targets.arm_position = answer.expect("within reach").joints;
            let after = self.targets.arm_position;
            self.targets.arm_velocity = std::array::from_fn(|i| (after[i] - before[i]) * 240.0);
            self.world.apply(&self.targets);
            self.world.step();
        }
        self.targets.arm_velocity = [0.0; 6];
        self.world.apply(&self.targets);
    }

    fn close(&mut self, force: f64, closed: f64) {
        self.targets.pad_force = force;
        let mut targets = self.targets;
        seconds(&mut self.world, 2.0, |world, t| {
            targets.knuckle_position = (0.5 * t).min(closed);
            targets.knuckle_velocity = if 0.5 * t < closed { 0.5 } else { 0.0 };
            world.apply(&targets);
        });
        targets.knuckle_velocity = 0.0;
        self.targets = targets;
        self.world.apply(&targets);
    }
}

#[test]
fn a_bottle_is_grasped_lifted_and_waved() {
    let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/robots");
    let mut tried = 0;
    for entry in std::fs::read_dir(robots).unwrap() {
        let folder = entry.unwrap().path();
        if !folder.join("robot.toml").is_file() {
            continue;
        }
        let robot = folder.file_name().unwrap().to_str().unwrap();
        tried += 1;
        let model = robot_model(robot);
        let gripper = &model.settings.gripper;
        for force in [20.0, gripper.force, gripper.max_force] {
            let lost = pick(&model, force);
            let place = format!("{robot} at {force} N");
            assert!(lost.drift < 0.5e-3, "{place} drifts by {} m", lost.drift);
            assert!(lost.lifted > 0.14, "{place} rises by {} m", lost.lifted);
            for pad in lost.pads {
                assert!(
                    (pad / force - 1.0).abs() < 0.1,
                    "{place}: a pad presses with {pad} N"
                );
            }
        }
    }
    assert!(tried > 1, "{tried} robots");
}

/// From the hand's frame to the middle of the pads along the hand, with the bottle between
/// them, metres.
fn pads(model: &RobotModel) -> f64 {
    let knuckle = GripperMap::new(model).knuckle(2.0 * BOTTLE[1]);
    let mut positions = vec![0.0; model.joints.len()];
    positions[model.roles.knuckles[0]] = knuckle;
    for (joint, position) in model.joints.iter().zip(0..) {
        if let Some((leader, multiplier, offset)) = joint.mimic {
            positions[position] = positions[leader] * multiplier + offset;
        }
    }
    let poses = model.link_poses(&positions);
    let tip = model.joints[model.roles.finger_tips[0]].child;
    let pad = model.links[tip].collision.iter().find(|c| c.name == PAD);
    let pad = pad.expect("a pad").part.pose;
    poses[model.roles.end_effector]
        .inv_mul(&(poses[tip] * pad))
        .translation
        .z
}

struct Outcome {
    drift: f64,
    lifted: f64,
    /// Forces of the pads on the bottle, N.
    pads: Vec<f64>,
}

fn pick(model: &RobotModel, force: f64) -> Outcome {
    let home = model.settings.home;
    let stand = pose_at(1.2, 0.36, TABLE_TOP + BOTTLE[2]);
    let shape = Shape::RoundedCuboid {
        half: BOTTLE,
        radius: 0.01,
    };
    let bottle = object("bottle", stand, 0.603, BOTTLE, shape);
    let (scene, placements) = scene(vec![floor(), table(0.9)], vec![bottle]);
    let start = Isometry3::identity();

    // The hand level, pointing forward, its pads 0.12 m in front of the bottle.
    let forward = UnitQuaternion::from_matrix(&Matrix3::new(
        0.0, 0.0, 1.0, //
        1.0, 0.0, 0.0, //
        0.0, 1.0, 0.0,
    ));
    let pads = Vector3::new(pads(model) + 0.12, 0.0, 0.0);
    let hand = Isometry3::from_parts(Translation3::from(stand.translation.vector - pads), forward);
    let arm = ArmKinematics::new(model);
    let base = model.link(&model.settings.arm_base_link).expect("arm base");
    let base_from_house = model.link_poses(&vec![0.0; model.joints.len()])[base].inverse();
    let joints = arm
        .solve(&(base_from_house * hand), &home)
        .expect("within reach")
        .joints;
    let world = World::new(model, &scene, &placements, &start, &joints).expect("a world");
    let mut picker = Picker {
        world,
        arm,
        targets: hold(joints),
        base_from_house,
        hand,
    };

    let hand_link = model
        .link(&model.settings.end_effector_link)
        .expect("the hand");
    let hand_from_bottle = |world: &World| {
        let snapshot = world.snapshot();
        snapshot.links[hand_link].pose.inverse() * snapshot.objects[0].pose
    };
    picker.line(Vector3::new(0.12, 0.0, 0.0), 1.0);
    picker.close(force, model.settings.gripper.closed);
    picker.line(Vector3::new(0.0, 0.0, 0.15), 1.0);
    let lifted = picker.world.snapshot().objects[0].pose.translation.z - stand.translation.z;
    let held = hand_from_bottle(&picker.world);
    let mut drift: f64 = 0.0;
    for _ in 0..2 {
        for by in [[0.0, 0.15, 0.05], [-0.1, -0.3, 0.0], [0.1, 0.15, -0.05]] {
            picker.line(Vector3::from(by), 0.7);
            let moved = held.inverse() * hand_from_bottle(&picker.world);
            drift = drift.max(moved.translation.vector.norm());
        }
    }
    let snapshot = picker.world.snapshot();
    assert!(snapshot.anomalies.is_empty());
    let closing = snapshot.links[hand_link].pose.rotation * Vector3::x();
    let contacts = snapshot.contacts.iter();
    let on_bottle = contacts.filter(|contact| contact.second == BodyRef::Object(0));
    let pads = on_bottle.map(|contact| contact.force.dot(&closing).abs());
    Outcome {
        drift,
        lifted,
        pads: pads.collect(),
    }
}

/// The arm is commanded to push its hand through the seat of its own chair.
#[test]
fn the_arm_does_not_pass_through_the_chair() {
    let model = model();
    let arm = ArmKinematics::new(&model);
    let base = model.link(&model.settings.arm_base_link).expect("arm base");
    let base_from_root = model.link_poses(&vec![0.0; model.joints.len()])[base].inverse();
    let down = UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0);
    let above = Isometry3::from_parts(Translation3::new(0.2, 0.0, 0.85), down);
    let joints = arm
        .solve(&(base_from_root * above), &model.settings.home)
        .expect("within reach")
        .joints;
    let (scene, placements) = scene(vec![floor()], Vec::new());
    let start = Isometry3::identity();
    let world = World::new(&model, &scene, &placements, &start, &joints).expect("a world");
    let mut picker = Picker {
        world,
        arm,
        targets: hold(joints),
        base_from_house: base_from_root,
        hand: above,
    };
    picker.line(Vector3::new(0.0, 0.0, -0.3), 2.0);
    seconds(&mut picker.world, 1.0, |_, _| {});
    let snapshot = picker.world.snapshot();
    let hand = model
        .link(&model.settings.end_effector_link)
        .expect("the hand");
    // Seat at 0.5325 m; the open finger tips reach 0.1494 m beyond the hand.
    let tips = snapshot.links[hand].pose * Point3::new(0.0, 0.0, 0.1494);
    assert!(tips.z > 0.5325 - 0.02, "tips at {}", tips.z);
    assert!(!snapshot.contacts.is_empty() && snapshot.anomalies.is_empty());
    for link in &snapshot.links {
        assert!(link.linear.norm() < 0.05, "still moving: {}", link.linear);
    }
}
