//! Tests of the gripper: holding and slipping.

use rapier3d::parry::query;

use super::super::convert::{from_pose, from_vector};
use super::*;
use crate::snapshot::BodyRef;

/// Half extents of a bottle of 0.603 kg with 58 mm between the pads, shallow enough for the
/// inner knuckles to stay clear while the pads hold it at its middle.
const BOTTLE: [f64; 3] = [0.022, 0.029, 0.08];
const MASS: f64 = 0.603;
const FRICTION: f64 = 0.6;

struct Grasp {
    world: World,
    model: RobotModel,
    targets: Targets,
    hand: usize,
}

/// The robot at home holds a bottle, its pads closed with a force of `force` N; the
/// pedestal of the bottle has been removed.
fn grasp(shape: Shape, force: f64) -> Grasp {
    let pads = pose_at(0.0, 0.0, 0.137);
    let mut bottle = object("bottle", Isometry3::identity(), MASS, BOTTLE, shape);
    bottle.friction = FRICTION;
    let turn = |hand: &Isometry3<f64>, chair: &Isometry3<f64>| {
        Isometry3::from_parts((hand * pads).translation, chair.rotation)
    };
    grasp_body(bottle, BOTTLE[2], turn, force)
}

/// The robot at home holds an object of the assets by its first grasp.
fn grasp_asset(kind: &str, force: f64) -> Grasp {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let body = crate::scene::object(&assets, kind).expect("an object");
    let hand_from_object =
        pose_at(0.0, 0.0, model().settings.tool_length) * body.grasps[0].pose.inverse();
    // The frame of these objects is at the centre of the bottom.
    grasp_body(body, 0.0, |hand, _| hand * hand_from_object, force)
}

/// The object is placed at `place(hand, chair)`, on a pedestal `below` metres under its
/// frame, until the pads have closed.
fn grasp_body(
    mut held: Body,
    below: f64,
    place: impl Fn(&Isometry3<f64>, &Isometry3<f64>) -> Isometry3<f64>,
    force: f64,
) -> Grasp {
    let model = model();
    let home = model.settings.home;
    let hand = model
        .link(&model.settings.end_effector_link)
        .expect("the hand");
    let (world, targets, _) = robot_alone();
    let snapshot = world.snapshot();
    let start = snapshot.links[0].pose;
    held.pose = place(&snapshot.links[hand].pose, &start);

    let on = held.pose.translation;
    let height = (on.z - below) / 2.0;
    let half = [0.03, 0.03, height];
    let under = pose_at(on.x, on.y, height);
    let pedestal = body("pedestal", under, 0.6, Shape::Cuboid { half });
    let (scene, placements) = scene(vec![floor(), pedestal], vec![held]);
    let world = World::new(&model, &scene, &placements, &start, &home).expect("a world");
    let mut grasp = Grasp {
        world,
        model,
        targets,
        hand,
    };
    grasp.close(force);
    let bodies = &mut grasp.world.physics.bodies;
    let fixed: Vec<_> = bodies.iter().filter(|(_, b)| b.is_fixed()).collect();
    let pedestal = fixed[1].0;
    bodies[pedestal].set_enabled(false);
    seconds(&mut grasp.world, 0.2, |_, _| {});
    grasp
}

impl Grasp {
    fn close(&mut self, force: f64) {
        let targets = &mut self.targets;
        targets.pad_force = force;
        seconds(&mut self.world, 2.0, |world, t| {
            targets.knuckle_position = (0.5 * t).min(0.7929);
            targets.knuckle_velocity = if 0.5 * t < 0.7929 { 0.5 } else { 0.0 };
            world.apply(targets);
        });
        self.targets.knuckle_velocity = 0.0;
    }

    fn hand_from_bottle(&self) -> Isometry3<f64> {
        let snapshot = self.world.snapshot();
        snapshot.links[self.hand].pose.inverse() * snapshot.objects[0].pose
    }

    fn pad_forces(&self) -> Vec<f64> {
        let snapshot = self.world.snapshot();
        let on_bottle = |c: &&crate::snapshot::Contact| {
            matches!(c.first, BodyRef::Link(_)) && c.second == BodyRef::Object(0)
        };
        let hand = snapshot.links[self.hand].pose.rotation;
        let closing = hand * Vector3::x();
        let pads = snapshot.contacts.iter().filter(on_bottle);
        pads.map(|c| c.force.dot(&closing).abs()).collect()
    }
}

#[test]
fn the_pads_press_with_the_commanded_force() {
    for force in [20.0, 60.0, 235.0] {
        let grasp = grasp(Shape::Cuboid { half: BOTTLE }, force);
        let pads = grasp.pad_forces();
        assert_eq!(pads.len(), 2, "{pads:?}");
        for pad in pads {
            assert!(
                (pad / force - 1.0).abs() < 0.05,
                "{pad} N, commanded {force} N"
            );
        }
    }
}

/// Shortened from the 60 s of `examples/grasp_bench.rs` to 10 s for each shape.
#[test]
fn a_waved_bottle_stays_in_the_hand() {
    let half = BOTTLE;
    let shapes = [
        Shape::RoundedCuboid { half, radius: 0.01 },
        Shape::Cylinder {
            radius: 0.033,
            half_height: half[2],
        },
    ];
    for shape in shapes {
        let mut grasp = grasp(shape.clone(), 60.0);
        let rest = grasp.hand_from_bottle();
        let home = grasp.model.settings.home;
        let mut worst: f64 = 0.0;
        let closed = grasp.targets;
        for second in 0..10 {
            seconds(&mut grasp.world, 1.0, |world, t| {
                let wave = robot::wave(home, f64::from(second) + t);
                world.apply(&Targets {
                    arm_position: wave.arm_position,
                    arm_velocity: wave.arm_velocity,
                    ..closed
                });
            });
            let drift = rest.inverse() * grasp.hand_from_bottle();
            worst = worst.max(drift.translation.vector.norm());
        }
        assert!(worst < 0.5e-3, "{shape:?} drifts by {worst} m");
    }
}

/// Two pads carry the weight up to 2 mu F.
#[test]
fn a_bottle_slips_at_the_coulomb_limit() {
    let limit = MASS * super::super::GRAVITY / (2.0 * FRICTION);
    for (share, slips) in [(0.8, true), (1.25, false)] {
        let mut grasp = grasp(Shape::Cuboid { half: BOTTLE }, 60.0);
        let rest = grasp.hand_from_bottle();
        grasp.targets.pad_force = share * limit;
        grasp.world.apply(&grasp.targets);
        seconds(&mut grasp.world, 2.0, |_, _| {});
        let slip = (rest.inverse() * grasp.hand_from_bottle())
            .translation
            .vector
            .norm();
        if slips {
            assert!(slip > 0.05, "holds at {share} of the limit: {slip} m");
        } else {
            assert!(slip < 0.5e-3, "slips at {share} of the limit: {slip} m");
        }
    }
}

/// A grasp is restored from a saved state with the same bits.
#[test]
fn a_grasp_survives_saving() {
    let mut first = grasp(Shape::Cuboid { half: BOTTLE }, 60.0);
    let mut second = grasp(Shape::Cuboid { half: BOTTLE }, 20.0);
    let saved = first.world.save();
    second.world.restore(&saved).expect("the same world");
    for world in [&mut first.world, &mut second.world] {
        seconds(world, 0.5, |_, _| {});
    }
    assert_eq!(first.world.hash(), second.world.hash());
}

/// In every tick the reported contact forces of a held object sum to m (a - g), at rest
/// and while the arm moves it.
#[test]
fn contact_forces_of_a_held_object_sum_to_its_weight_and_acceleration() {
    for kind in ["glass_bottle", "silver_bottle", "meat_can"] {
        let mut grasp = grasp_asset(kind, 40.0);
        let (home, closed) = (grasp.model.settings.home, grasp.targets);
        let handle = grasp.world.scene_bodies.objects[0];
        let mut worst: f64 = 0.0;
        for tick in 0..360_u32 {
            let time = f64::from(tick) / 240.0;
            let wave = robot::wave(home, (time - 0.5).max(0.0));
            grasp.world.apply(&Targets {
                arm_position: wave.arm_position,
                arm_velocity: wave.arm_velocity,
                ..closed
            });
            let velocity = |world: &World| from_vector(world.physics.bodies[handle].linvel());
            let before = velocity(&grasp.world);
            grasp.world.step();
            let acceleration = (velocity(&grasp.world) - before) * 240.0;
            let mass = f64::from(grasp.world.physics.bodies[handle].mass());
            let expected = (acceleration + Vector3::z() * super::super::GRAVITY) * mass;
            let contacts = grasp.world.snapshot().contacts;
            let on_object = contacts.iter().filter(|c| c.second == BodyRef::Object(0));
            let sum: Vector3<f64> = on_object.map(|c| c.force).sum();
            worst = worst.max((sum - expected).norm());
        }
        assert!(worst < 0.1, "{kind}: off by {worst} N");
    }
}

/// Objects with the deepest grasps: the inner knuckles stay outside, and closing does
/// not push the object away.
#[test]
fn inner_knuckles_stay_outside_a_held_object() {
    for kind in ["crackers", "meat_can", "mustard", "sugar_box"] {
        let grasp = grasp_asset(kind, 40.0);
        let world = &grasp.world;
        let links = world.snapshot().links;
        let object = &world.physics.bodies[world.scene_bodies.objects[0]];
        let mut knuckles = 0;
        for (_, knuckle) in world.physics.colliders.iter() {
            let tag = super::super::contact::body_of(knuckle.user_data);
            let BodyRef::Link(link) = tag else { continue };
            let name = &grasp.model.links[link].name;
            if !name.contains("inner_knuckle") {
                continue;
            }
            knuckles += 1;
            let part = &grasp.model.links[link].collision[0].part.pose;
            let off = from_pose(knuckle.position()).inverse() * links[link].pose * part;
            assert!(
                off.translation.vector.norm() < 5e-4 && off.rotation.angle() < 0.02,
                "{name} is off by {off}"
            );
            for solid in object.colliders() {
                let solid = &world.physics.colliders[*solid];
                let (a, b) = (knuckle.position(), solid.position());
                let contact = query::contact(a, knuckle.shape(), b, solid.shape(), 0.0);
                let depth = contact.expect("known shapes").map_or(0.0, |c| -c.dist);
                assert!(depth < 1e-3, "{name} is {depth} m inside {kind}");
            }
        }
        assert_eq!(knuckles, 2);
        let grasped = grasp.hand_from_bottle().inverse()
            * pose_at(0.0, 0.0, grasp.model.settings.tool_length);
        let body = crate::scene::object(
            &Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets"),
            kind,
        );
        let grasp = body.expect("an object").grasps[0].pose;
        let moved = (grasp.inverse() * grasped).translation.vector;
        assert!(
            moved.z.abs() < 3e-3,
            "{kind} moves by {moved} m while the pads close"
        );
    }
}

/// An object deeper in the hand than the knuckles allow is pushed out.
#[test]
fn inner_knuckles_push_out_an_object_that_is_too_deep() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let can = crate::scene::object(&assets, "meat_can").expect("an object");
    let deep =
        pose_at(0.0, 0.0, model().settings.tool_length - 0.017) * can.grasps[0].pose.inverse();
    let grasp = grasp_body(can, 0.0, |hand, _| hand * deep, 40.0);
    let moved = (deep.inverse() * grasp.hand_from_bottle())
        .translation
        .vector;
    assert!(moved.norm() > 5e-3, "it moves by {moved} m only");
}
