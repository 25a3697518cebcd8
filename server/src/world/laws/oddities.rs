//! Invalid input is reported or rejected without a panic.

use super::*;
use crate::snapshot::{Anomaly, BodyRef};
use crate::world::WorldError;

fn crate_on_floor(x: f64, z: f64) -> Body {
    let half = [0.1; 3];
    object(
        "crate",
        pose_at(x, 0.0, z),
        1.0,
        half,
        Shape::Cuboid { half },
    )
}

fn world(objects: Vec<Body>) -> World {
    let model = model();
    let (scene, placements) = scene(vec![floor()], objects);
    let start = Isometry3::identity();
    World::new(&model, &scene, &placements, &start, &model.settings.home).expect("a world")
}

#[test]
fn a_body_without_a_finite_state_is_reported() {
    let mut world = world(vec![crate_on_floor(3.0, 0.1), crate_on_floor(4.0, 0.1)]);
    world.step();
    let broken = world.scene_bodies.objects[0];
    let nowhere = rapier3d::math::Vector::new(f32::NAN, 0.0, 0.0);
    world.physics.bodies[broken].set_linvel(nowhere, true);
    for _ in 0..10 {
        world.step();
        let anomalies = world.snapshot().anomalies;
        assert_eq!(anomalies, [Anomaly::NotFinite(BodyRef::Object(0))]);
    }
    assert!(world.snapshot().links[0].linear.norm() < 0.01);
}

#[test]
fn an_object_that_falls_off_the_world_has_escaped() {
    let mut world = world(vec![crate_on_floor(10.5, 0.5)]);
    assert!(world.snapshot().anomalies.is_empty());
    seconds(&mut world, 1.5, |_, _| {});
    let anomalies = world.snapshot().anomalies;
    assert_eq!(anomalies, [Anomaly::Escaped(BodyRef::Object(0))]);
}

#[test]
fn invalid_targets_are_ignored() {
    let mut world = world(Vec::new());
    let home = model().settings.home;
    for bad in [f64::NAN, f64::INFINITY, 1e30] {
        let mut targets = hold(home);
        targets.arm_position[2] = bad;
        targets.wheel_velocity[0] = bad;
        targets.pad_force = bad;
        world.apply(&targets);
        seconds(&mut world, 0.2, |_, _| {});
    }
    let snapshot = world.snapshot();
    assert!(snapshot.anomalies.is_empty());
    assert!(snapshot.links.iter().all(|l| l.linear.norm() < 0.02));
}

#[test]
fn an_invalid_world_is_rejected_by_name() {
    let model = model();
    let start = Isometry3::identity();
    let refusal = |objects: Vec<Body>, drop_placement: bool| {
        let (scene, mut placements) = scene(vec![floor()], objects);
        if drop_placement {
            placements.pop();
        }
        match World::new(&model, &scene, &placements, &start, &model.settings.home) {
            Ok(_) => panic!("it was accepted"),
            Err(error) => error,
        }
    };
    let error = refusal(vec![crate_on_floor(3.0, 0.1)], true);
    assert!(matches!(
        error,
        WorldError::Placements {
            objects: 1,
            placements: 0,
            ..
        }
    ));

    let mut massless = crate_on_floor(3.0, 0.1);
    massless.mass = massless.mass.map(|m| MassProperties { mass: 0.0, ..m });
    let text = refusal(vec![massless], false).to_string();
    assert!(text.contains("crate") && text.contains('0'), "{text}");

    let mut flat = crate_on_floor(3.0, 0.1);
    flat.collision[0].shape = Shape::Cylinder {
        radius: -0.1,
        half_height: 0.1,
    };
    let text = refusal(vec![flat], false).to_string();
    assert!(text.contains("crate") && text.contains("-0.1"), "{text}");
}
