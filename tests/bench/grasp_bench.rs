//! Prints how a bottle of mustard drifts in the hand that waves it: the bottle
//! of the home, 0.603 kg, held at the grasp of its file.
//!
//! `cargo run --release -p wheelarm-tests --example grasp_bench -- [SECONDS] [NEWTON]`,
//! default 60 s and 60 N.

use std::path::Path;

use anyhow::{Context as _, Result, bail};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use wheelarm_server::geometry::{Part, Shape};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::robot::control::Targets;
use wheelarm_server::robot::kinematics::ArmKinematics;
use wheelarm_server::scene::{Placement, Scene};
use wheelarm_server::snapshot::BodyRef;
use wheelarm_server::world::World;

const ASSETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets");
/// Ticks of one second.
const SECOND: u64 = 240;

fn main() -> Result<()> {
    let model = RobotModel::load(Path::new(ASSETS), "wheelarm").context("loading the robot")?;
    let scene = Scene::load(Path::new(ASSETS), "home").context("loading the home")?;
    let number = |i: usize, default: f64| {
        std::env::args()
            .nth(i)
            .map_or(Ok(default), |text| text.parse::<f64>())
    };
    grasp(&model, &scene, number(1, 60.0)?, number(2, 60.0)?)
}

fn placed(scene: &Scene) -> Vec<Placement> {
    let place = |body: &wheelarm_server::scene::Body| Placement {
        pose: body.pose,
        mass: body.mass.map_or(0.0, |m| m.mass),
        friction: body.friction,
    };
    scene.objects.iter().map(place).collect()
}

/// All joints swing about `middle` within their speed limits.
fn wave(middle: &[f64; 6], t: f64, targets: &mut Targets) {
    let reach = [0.35, 0.2, 0.25, 0.3, 0.3, 0.24];
    let rate = [3.0, 2.5, 3.5, 4.0, 3.0, 5.0];
    let swell = t.min(1.0);
    for i in 0..6 {
        let (a, w) = (reach[i], rate[i]);
        targets.arm_position[i] = middle[i] + a * swell * (w * t).sin();
        let start = if t < 1.0 { a * (w * t).sin() } else { 0.0 };
        targets.arm_velocity[i] = a * swell * w * (w * t).cos() + start;
    }
}

fn resting(arm: &[f64; 6]) -> Targets {
    Targets {
        arm_position: *arm,
        arm_velocity: [0.0; 6],
        wheel_velocity: [0.0; 2],
        knuckle_position: 0.0,
        knuckle_velocity: 0.0,
        pad_force: 60.0,
    }
}

fn seconds(tick: u64) -> f64 {
    tick as f64 / SECOND as f64
}

/// The mustard bottle of the home on a pedestal between the open pads: they
/// close, the hand lifts it and turns away, then waves it.
fn grasp(model: &RobotModel, scene: &Scene, duration: f64, force: f64) -> Result<()> {
    let home = model.settings.home;
    let mut scene = scene.clone();
    scene.objects.retain(|o| o.name == "mustard");
    let bottle = scene.objects.first().context("the home has no mustard")?;
    let grasp = bottle.grasps.first().context("the mustard has no grasp")?;
    let hand = model
        .link(&model.settings.end_effector_link)
        .context("the robot has no hand")?;
    let base = model
        .link(&model.settings.arm_base_link)
        .context("the robot has no arm base")?;
    let arm = ArmKinematics::new(model);
    let root_from_base = model.link_poses(&vec![0.0; model.joints.len()])[base];
    let house_from_hand = scene.start * root_from_base * arm.forward(&home);
    let pads = Translation3::new(0.0, 0.0, model.settings.tool_length);
    // Upright: the hand at home is level to half a degree only.
    let mut house_from_bottle = house_from_hand * pads * grasp.pose.inverse();
    let (_, _, yaw) = house_from_bottle.rotation.euler_angles();
    house_from_bottle.rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw);
    let foot = house_from_bottle.translation.z - bottle.standing_height();
    let mut pedestal = scene.furniture[0].clone();
    pedestal.name = "pedestal".into();
    let place = house_from_bottle.translation;
    pedestal.pose = Isometry3::translation(place.x, place.y, foot / 2.0);
    pedestal.collision = vec![Part {
        pose: Isometry3::identity(),
        shape: Shape::Cuboid {
            half: [0.03, 0.03, foot / 2.0],
        },
    }];
    scene.furniture.push(pedestal);
    let mut placement = placed(&scene);
    placement[0].pose = house_from_bottle;
    let mut world = World::new(model, &scene, &placement, &scene.start, &home)?;
    let relative = |world: &World| {
        let snapshot = world.snapshot();
        snapshot.links[hand].pose.inverse() * snapshot.objects[0].pose
    };
    let before = relative(&world);

    let mut targets = resting(&home);
    targets.pad_force = force;
    for tick in 0..2 * SECOND {
        let angle = 0.5 * seconds(tick);
        let closed = model.settings.gripper.closed;
        targets.knuckle_position = angle.min(closed);
        targets.knuckle_velocity = if angle < closed { 0.5 } else { 0.0 };
        world.apply(&targets);
        world.step();
    }
    targets.knuckle_velocity = 0.0;
    let moved = before.inverse() * relative(&world);
    println!(
        "closed with {force} N: the bottle moved {:.2} mm, the pads press with {:.1?} N",
        moved.translation.vector.norm() * 1e3,
        world
            .snapshot()
            .contacts
            .iter()
            .filter(|c| matches!(c.first, BodyRef::Link(_)))
            .map(|c| c.force.norm())
            .collect::<Vec<_>>()
    );
    let held = relative(&world);
    let mut middle = home;
    for tick in 1..=2 * SECOND {
        // Up by 0.15 m in the first second, then aside by 0.8 rad.
        let (up, aside) = (seconds(tick).min(1.0), (seconds(tick) - 1.0).max(0.0));
        let wanted = Translation3::new(0.0, 0.0, 0.15 * up) * arm.forward(&home);
        let solution = arm.solve_local(&wanted, &middle, 0.1);
        let Ok(solution) = solution else {
            bail!("the lift is out of reach");
        };
        middle = solution.joints;
        targets.arm_position = middle;
        targets.arm_position[0] += 0.8 * aside;
        world.apply(&targets);
        world.step();
    }
    middle = targets.arm_position;
    let mut worst: f64 = 0.0;
    for second in 0..duration as u64 {
        for tick in 0..SECOND {
            wave(&middle, second as f64 + seconds(tick), &mut targets);
            world.apply(&targets);
            world.step();
        }
        let drift = held.inverse() * relative(&world);
        worst = worst.max(drift.translation.vector.norm());
        if (second + 1) % 10 == 0 {
            println!(
                "{:3} s: {:.4} mm, {:.4} degrees, worst {:.4} mm",
                second + 1,
                drift.translation.vector.norm() * 1e3,
                drift.rotation.angle().to_degrees(),
                worst * 1e3
            );
        }
    }
    Ok(())
}
