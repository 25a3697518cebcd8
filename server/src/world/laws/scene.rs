//! Objects and furniture, without the robot.

use rapier3d::prelude::{PhysicsWorld, RigidBodyHandle};
use wheelarm_proto::furniture::JointMotion;

use super::super::contact::contacts;
use super::super::convert::{from_pose, from_vector, vector};
use super::super::scene_bodies::SceneBodies;
use super::super::{GRAVITY, engine};
use super::*;
use crate::scene::{FurnitureJoint, Resistance};
use crate::snapshot::BodyRef;

fn scene_bodies(furniture: Vec<Body>, objects: Vec<Body>) -> (PhysicsWorld, SceneBodies) {
    let (scene, placements) = scene(furniture, objects);
    let mut physics = engine();
    let scene_bodies =
        SceneBodies::insert(&mut physics, &scene, &placements).expect("the bodies of the scene");
    (physics, scene_bodies)
}

fn run(physics: &mut PhysicsWorld, seconds: f64) {
    for _ in 0..(seconds * 240.0).round() as usize {
        physics.step();
    }
}

fn place(physics: &PhysicsWorld, handle: RigidBodyHandle) -> Isometry3<f64> {
    from_pose(physics.bodies[handle].position())
}

fn ball(name: &str, pose: Isometry3<f64>, mass: f64) -> Body {
    object(name, pose, mass, [0.05; 3], Shape::Sphere { radius: 0.05 })
}

#[test]
fn a_ball_falls_with_constant_acceleration() {
    let (mut physics, scene_bodies) =
        scene_bodies(vec![], vec![ball("ball", pose_at(-9.0, 3.0, 10.0), 0.3)]);
    run(&mut physics, 1.0);
    let fallen = 10.0 - place(&physics, scene_bodies.objects[0]).translation.z;
    // The integrator is symplectic Euler with substeps of 1/960 s.
    let expected = 0.5 * GRAVITY * (1.0 + 1.0 / 960.0);
    assert!((fallen - expected).abs() < 1e-3, "{fallen} {expected}");
    let speed = physics.bodies[scene_bodies.objects[0]].linvel().z;
    assert!((f64::from(speed) + GRAVITY).abs() < 1e-4, "{speed}");
}

#[test]
fn a_collision_keeps_momentum() {
    let balls = vec![
        ball("light", pose_at(-0.3, 0.01, 0.0), 0.2),
        ball("heavy", pose_at(0.0, 0.0, 0.0), 0.5),
    ];
    let (mut physics, scene_bodies) = scene_bodies(vec![], balls);
    physics.gravity = rapier3d::math::Vector::ZERO;
    physics.bodies[scene_bodies.objects[0]].set_linvel(vector(&Vector3::new(1.0, 0.0, 0.0)), true);
    let momenta = |physics: &PhysicsWorld| {
        let mut linear = Vector3::zeros();
        let mut angular = Vector3::zeros();
        for handle in &scene_bodies.objects {
            let body = &physics.bodies[*handle];
            let p = from_vector(body.linvel()) * f64::from(body.mass());
            let spin = body.mass_properties().local_mprops.principal_inertia().x;
            linear += p;
            angular += from_vector(body.translation()).cross(&p)
                + from_vector(body.angvel()) * f64::from(spin);
        }
        (linear, angular)
    };
    physics.step();
    let before = momenta(&physics);
    run(&mut physics, 0.6);
    let after = momenta(&physics);
    let struck = physics.bodies[scene_bodies.objects[1]].linvel().x;
    assert!(struck > 0.1, "they met: {struck}");
    assert!((after.0 - before.0).norm() < 1e-5, "{before:?} {after:?}");
    // Friction acts at one point in space on both, up to the depth of the contact.
    assert!((after.1 - before.1).norm() < 1e-4, "{before:?} {after:?}");
}

/// A box on a slope, with friction 0.5 of both: it stays below the friction angle and
/// slides beyond it with the acceleration g (sin a - mu cos a).
#[test]
fn a_block_slides_beyond_the_friction_angle_only() {
    let slide = |angle: f64| {
        let tilt = Isometry3::rotation(Vector3::y() * angle);
        let half = [2.0, 1.0, 0.1];
        let slope = body(
            "slope",
            tilt * pose_at(0.0, 0.0, -0.1),
            0.5,
            Shape::Cuboid { half },
        );
        let half = [0.05, 0.05, 0.03];
        let mut block = object(
            "block",
            tilt * pose_at(0.0, 0.0, 0.03),
            0.4,
            half,
            Shape::Cuboid { half },
        );
        block.friction = 0.5;
        let (mut physics, scene_bodies) = scene_bodies(vec![slope], vec![block]);
        run(&mut physics, 0.5);
        let early = tilt.inverse() * place(&physics, scene_bodies.objects[0]);
        let force = contacts(&physics);
        let v0 = f64::from(physics.bodies[scene_bodies.objects[0]].linvel().length());
        run(&mut physics, 0.5);
        let late = tilt.inverse() * place(&physics, scene_bodies.objects[0]);
        let v1 = f64::from(physics.bodies[scene_bodies.objects[0]].linvel().length());
        (
            late.translation.x - early.translation.x,
            (v1 - v0) / 0.5,
            force,
        )
    };
    let limit = 0.5f64.atan();
    let (moved, _, force) = slide(limit - 0.02);
    assert!(moved.abs() < 1e-3, "{moved}");
    // At rest the slope carries the block: force on the second body, here the slope.
    assert_eq!(force.len(), 1);
    assert_eq!(force[0].first, BodyRef::Object(0));
    assert_eq!(force[0].second, BodyRef::Furniture(0));
    let weight = Vector3::new(0.0, 0.0, -0.4 * GRAVITY);
    assert!(
        (force[0].force - weight).norm() < 0.02 * weight.norm(),
        "{force:?}"
    );

    let angle: f64 = limit + 0.1;
    let (_, acceleration, _) = slide(angle);
    let expected = GRAVITY * (angle.sin() - 0.5 * angle.cos());
    assert!(
        (acceleration / expected - 1.0).abs() < 0.02,
        "{acceleration} {expected}"
    );
}

/// A drawer pulled by a constant force: below its dry friction it stays shut, above it
/// reaches the speed at which viscous friction balances the rest.
#[test]
fn a_drawer_resists_with_dry_and_viscous_friction() {
    let half = [0.2, 0.2, 0.05];
    let drawer = body(
        "drawer",
        pose_at(1.0, 0.0, 0.5),
        0.5,
        Shape::Cuboid { half },
    );
    let moving = object("drawer", drawer.pose, 2.5, half, Shape::Cuboid { half });
    let (mut scene, placements) = scene(vec![floor(), drawer], Vec::new());
    for (friction, damping) in [(3.0, 6.0), (8.0, 14.0)] {
        scene.joints = vec![FurnitureJoint {
            name: "drawer_joint".into(),
            furniture: 1,
            carrier: 0,
            motion: JointMotion::Slides,
            axis: Vector3::x_axis(),
            travel: 3.0,
            mass: moving.mass.expect("it has mass"),
            resistance: Resistance { friction, damping },
            start: 0.0,
        }];
        let mut physics = engine();
        let scene_bodies = SceneBodies::insert(&mut physics, &scene, &placements)
            .expect("the bodies of the scene");
        let mut pull = |force: f64, seconds: f64| {
            let force = vector(&Vector3::new(force, 0.0, 0.0));
            let body = &mut physics.bodies[scene_bodies.moving[0].handle];
            body.reset_forces(true);
            body.add_force(force, true);
            run(&mut physics, seconds);
            scene_bodies.moving[0].state(&physics)
        };
        let held = pull(friction - 0.5, 1.0);
        assert!(held.position < 2e-3, "{held:?}");
        let sliding = pull(friction + 2.0, 2.0);
        let expected = 2.0 / damping * (1.0 - (-2.0 * damping / 2.5).exp());
        let ratio = sliding.velocity / expected;
        assert!(
            (ratio - 1.0).abs() < 0.03,
            "{sliding:?}, not {expected} m/s"
        );
    }
}

/// A door under a constant torque: below its dry friction it stays closed, above it
/// reaches the turn rate at which viscous friction balances the rest, and it stops at
/// its limit.
#[test]
fn a_door_resists_with_dry_and_viscous_friction_and_stops_at_its_limit() {
    let half = [0.2, 0.01, 0.3];
    let door = body("door", pose_at(1.0, 0.0, 0.5), 0.5, Shape::Cuboid { half });
    let mut mass = object("door", door.pose, 4.0, half, Shape::Cuboid { half })
        .mass
        .expect("it has mass");
    // The hinge is at the frame's origin, the leaf beside it.
    mass.com = nalgebra::Point3::new(0.2, 0.0, 0.0);
    let about_hinge = mass.inertia[(2, 2)] + 4.0 * 0.04;
    let (mut scene, placements) = scene(vec![floor(), door], Vec::new());
    for (friction, damping, travel) in [(0.4, 0.5, 3.0), (1.0, 2.0, 0.5)] {
        scene.joints = vec![FurnitureJoint {
            name: "door_joint".into(),
            furniture: 1,
            carrier: 0,
            motion: JointMotion::Turns,
            axis: Vector3::z_axis(),
            travel,
            mass,
            resistance: Resistance { friction, damping },
            start: 0.0,
        }];
        let mut physics = engine();
        let scene_bodies = SceneBodies::insert(&mut physics, &scene, &placements)
            .expect("the bodies of the scene");
        let mut turn = |torque: f64, seconds: f64| {
            let torque = vector(&Vector3::new(0.0, 0.0, torque));
            let body = &mut physics.bodies[scene_bodies.moving[0].handle];
            body.reset_torques(true);
            body.add_torque(torque, true);
            run(&mut physics, seconds);
            scene_bodies.moving[0].state(&physics)
        };
        let held = turn(friction - 0.1, 1.0);
        assert!(held.position.abs() < 5e-3, "{held:?}");
        let turning = turn(friction + 0.2, 0.5);
        let expected = 0.2 / damping * (1.0 - (-0.5 * damping / about_hinge).exp());
        let ratio = turning.velocity / expected;
        assert!(
            (ratio - 1.0).abs() < 0.05,
            "{turning:?}, not {expected} rad/s"
        );
        let stopped = turn(friction + 3.0, 6.0);
        assert!(
            (stopped.position - travel).abs() < 0.02,
            "{stopped:?}, not at {travel} rad"
        );
    }
}

#[test]
fn objects_on_a_table_stay_at_rest() {
    let top = TABLE_TOP;
    let half = [0.036, 0.082, 0.1065];
    let round = [0.048, 0.029, 0.08];
    let cup = Shape::Cup {
        bottom_radius: 0.030,
        top_radius: 0.039,
        height: 0.105,
        wall: 0.003,
    };
    let objects = vec![
        object(
            "can",
            pose_at(0.3, -0.6, top + 0.051),
            0.349,
            [0.034, 0.034, 0.051],
            Shape::Cylinder {
                radius: 0.0339,
                half_height: 0.051,
            },
        ),
        object(
            "box",
            pose_at(0.3, -0.2, top + half[2]),
            0.411,
            half,
            Shape::Cuboid { half },
        ),
        object(
            "bottle",
            pose_at(0.3, 0.2, top + round[2]),
            0.603,
            round,
            Shape::RoundedCuboid {
                half: round,
                radius: 0.01,
            },
        ),
        object(
            "cup",
            pose_at(0.3, 0.6, top),
            0.08,
            [0.035, 0.035, 0.0525],
            cup,
        ),
        object(
            "cone",
            pose_at(0.6, 0.0, top + 0.05),
            0.3,
            [0.03, 0.03, 0.05],
            Shape::Frustum {
                bottom_radius: 0.04,
                top_radius: 0.02,
                half_height: 0.05,
            },
        ),
    ];
    let (mut physics, scene_bodies) = scene_bodies(vec![floor(), table(0.0)], objects.clone());
    run(&mut physics, 10.0);
    for (handle, object) in scene_bodies.objects.iter().zip(&objects) {
        let moved = object.pose.inverse() * place(&physics, *handle);
        let (distance, angle) = (moved.translation.vector.norm(), moved.rotation.angle());
        println!(
            "{}: {:.4} mm {:.4} deg",
            object.name,
            distance * 1e3,
            angle.to_degrees()
        );
        assert!(distance < 1e-3, "{} crept {distance} m", object.name);
        assert!(
            angle < 1f64.to_radians(),
            "{} turned {angle} rad",
            object.name
        );
    }
    let carried: f64 = contacts(&physics).iter().map(|c| c.force.z).sum();
    let weight = -GRAVITY * (0.349 + 0.411 + 0.603 + 0.08 + 0.3);
    assert!((carried / weight - 1.0).abs() < 0.02, "{carried} {weight}");
}
