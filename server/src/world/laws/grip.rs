//! The gripper: what it holds, and when it lets slip.

use super::*;
use crate::snapshot::BodyRef;

/// Half extents of a mustard bottle: 0.603 kg, 58 mm between the pads.
const BOTTLE: [f64; 3] = [0.048, 0.029, 0.08];
const MASS: f64 = 0.603;
const FRICTION: f64 = 0.6;

struct Grasp {
    world: World,
    model: RobotModel,
    targets: Targets,
    hand: usize,
}

/// The robot at home holds a bottle, its pads closed with a force of `force`
/// N; the pedestal that carried the bottle until then is gone.
fn grasp(shape: Shape, force: f64) -> Grasp {
    let model = model();
    let home = model.settings.home;
    let hand = model
        .link(&model.settings.end_effector_link)
        .expect("the hand");
    let (world, targets, _) = robot_alone();
    let pads = world.snapshot().links[hand].pose * at(0.0, 0.0, 0.137);
    let start = world.snapshot().links[0].pose;

    let upright = Isometry3::from_parts(pads.translation, start.rotation);
    let mut bottle = object("bottle", upright, MASS, BOTTLE, shape);
    bottle.friction = FRICTION;
    let height = (pads.translation.z - BOTTLE[2]) / 2.0;
    let half = [0.03, 0.03, height];
    let under = at(pads.translation.x, pads.translation.y, height);
    let pedestal = body("pedestal", under, 0.6, Shape::Cuboid { half });
    let (scene, placements) = scene(vec![floor(), pedestal], vec![bottle]);
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
fn the_pads_press_as_hard_as_asked() {
    for force in [20.0, 60.0, 235.0] {
        let grasp = grasp(Shape::Cuboid { half: BOTTLE }, force);
        let pads = grasp.pad_forces();
        assert_eq!(pads.len(), 2, "{pads:?}");
        for pad in pads {
            assert!((pad / force - 1.0).abs() < 0.05, "{pad} N, asked {force} N");
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

/// What is held stays held through a saved state, to the bit.
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
