//! The furniture as URDF against the physics.

use wheelarm_proto::furniture::JointMotion;

use super::super::convert::{from_pose, vector};
use super::super::engine;
use super::super::scene_bodies::SceneBodies;
use super::*;
use crate::scene::{FurnitureJoint, Resistance};

/// Pose of a link in the root at positions of the joints, computed from the text alone.
fn linked(robot: &urdf_rs::Robot, link: &str, position: &dyn Fn(&str) -> f64) -> Isometry3<f64> {
    let Some(joint) = robot.joints.iter().find(|joint| joint.child.link == link) else {
        return Isometry3::identity();
    };
    let ([x, y, z], [roll, pitch, yaw]) = (*joint.origin.xyz, *joint.origin.rpy);
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    let origin = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
    let axis = nalgebra::Unit::new_normalize(Vector3::from(*joint.axis.xyz));
    let at = position(&joint.name);
    let moved = match joint.joint_type {
        urdf_rs::JointType::Prismatic => Isometry3::from(axis.scale(at)),
        urdf_rs::JointType::Revolute => Isometry3::rotation(axis.scale(at)),
        _ => Isometry3::identity(),
    };
    linked(robot, &joint.parent.link, position) * origin * moved
}

#[test]
fn poses_of_moving_furniture_by_its_urdf_are_those_of_the_physics() {
    let turned = |x, y, z, yaw: f64| pose_at(x, y, z) * Isometry3::rotation(Vector3::z() * yaw);
    let half = [0.2, 0.02, 0.3];
    let cabinet = body(
        "cabinet",
        turned(1.0, 2.0, 0.4, 0.7),
        0.5,
        Shape::Cuboid { half },
    );
    let rest =
        cabinet.pose * Isometry3::new(Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.2, 0.5, 1.9));
    let mut mass = object("leaf", rest, 3.0, half, Shape::Cuboid { half })
        .mass
        .expect("its mass");
    mass.com = Point3::new(0.2, 0.0, 0.0);
    for (motion, axis) in [
        (JointMotion::Turns, Vector3::z_axis()),
        (JointMotion::Slides, Vector3::y_axis()),
        (
            JointMotion::Turns,
            nalgebra::Unit::new_normalize(Vector3::new(0.3, -0.8, 0.4)),
        ),
    ] {
        let leaf = body("leaf", rest, 0.5, Shape::Cuboid { half });
        let (mut scene, placements) = scene(vec![floor(), cabinet.clone(), leaf], Vec::new());
        scene.joints = vec![FurnitureJoint {
            name: "leaf_joint".into(),
            furniture: 2,
            carrier: 1,
            motion,
            axis,
            travel: 1.2,
            mass,
            resistance: Resistance {
                friction: 0.5,
                damping: 1.0,
            },
            start: 0.0,
        }];
        let robot = urdf_rs::read_from_string(&scene.furniture_urdf()).expect("a URDF");
        let mut physics = engine();
        physics.gravity = rapier3d::math::Vector::ZERO;
        let bodies = SceneBodies::insert(&mut physics, &scene, &placements).expect("bodies");
        let moving = &bodies.moving[0];
        let leaf = &mut physics.bodies[moving.handle];
        match motion {
            JointMotion::Turns => leaf.add_torque(vector(&axis.scale(3.0)), true),
            JointMotion::Slides => leaf.add_force(vector(&axis.scale(6.0)), true),
        }
        let mut farthest: f64 = 0.0;
        for _ in 0..240 {
            physics.step();
            let position = moving.state(&physics).position;
            farthest = farthest.max(position);
            let real = from_pose(physics.bodies[moving.handle].position());
            let found = linked(&robot, "leaf", &|name| match name {
                "leaf_joint" => position,
                _ => 0.0,
            });
            // The joints of the physics yield a little.
            let apart = (found.translation.vector - real.translation.vector).norm();
            assert!(apart < 2e-3, "{motion:?}: {apart} m at {position}");
            let angle = found.rotation.angle_to(&real.rotation);
            assert!(angle < 5e-3, "{motion:?}: {angle} rad at {position}");
        }
        assert!(farthest > 0.6, "{motion:?} moved by {farthest} only");
    }
}
