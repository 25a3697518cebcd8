//! Tests of laws of mechanics, on small synthetic scenes.

mod friction;
mod furniture_urdf;
mod grip;
mod oddities;
mod people;
mod pick;
mod robot;
mod scan;
mod scene;
mod signals;
mod soft;

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::settings::ObjectSplit;

use super::World;
use crate::geometry::{Part, Shape};
use crate::robot::RobotModel;
use crate::robot::control::Targets;
use crate::scene::{Body, Lighting, MassProperties, Placement, RoomCamera, Scene};

/// Top of the test table, metres.
const TABLE_TOP: f64 = 0.81;

fn model() -> RobotModel {
    robot_model("wheelarm")
}

fn robot_model(name: &str) -> RobotModel {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    RobotModel::load(&assets, name).expect("the robot of this repository loads")
}

fn pose_at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}

fn body(name: &str, pose: Isometry3<f64>, friction: f64, shape: Shape) -> Body {
    Body {
        name: name.into(),
        area: String::new(),
        category: String::new(),
        colour: String::new(),
        noun: String::new(),
        pose,
        mass: None,
        friction,
        collision: vec![Part {
            pose: Isometry3::identity(),
            shape,
        }],
        hulls: Vec::new(),
        soft: None,
        visual: Vec::new(),
        grasps: Vec::new(),
        tip: None,
        optional: false,
    }
}

fn floor() -> Body {
    let half = [10.0, 10.0, 0.5];
    body(
        "floor",
        pose_at(0.0, 0.0, -0.5),
        0.8,
        Shape::Cuboid { half },
    )
}

/// A table of 0.8 m by 2.2 m with its near edge at `x`.
fn table(x: f64) -> Body {
    let half = [0.4, 1.1, 0.02];
    let pose = pose_at(x + 0.4, 0.0, TABLE_TOP - 0.02);
    body("table", pose, 0.6, Shape::Cuboid { half })
}

/// A uniform solid of a mass; the inertia is that of its bounding box.
fn object(name: &str, pose: Isometry3<f64>, mass: f64, box_half: [f64; 3], shape: Shape) -> Body {
    let [x, y, z] = box_half.map(|h| 4.0 * h * h / 12.0 * mass);
    let com = match shape {
        Shape::Cup { .. } => Point3::new(0.0, 0.0, box_half[2]),
        _ => Point3::origin(),
    };
    Body {
        mass: Some(MassProperties {
            mass,
            com,
            inertia: Matrix3::from_diagonal(&Vector3::new(y + z, x + z, x + y)),
        }),
        ..body(name, pose, 0.6, shape)
    }
}

fn scene(furniture: Vec<Body>, objects: Vec<Body>) -> (Scene, Vec<Placement>) {
    let placements = objects
        .iter()
        .map(|o| Placement {
            pose: o.pose,
            mass: o.mass.expect("objects have mass").mass,
            friction: o.friction,
        })
        .collect();
    let scene = Scene {
        name: "laws".into(),
        pack: None,
        object_packs: Vec::new(),
        object_split: ObjectSplit::default(),
        furniture,
        objects,
        surfaces: Vec::new(),
        places: Vec::new(),
        handles: Vec::new(),
        joints: Vec::new(),
        lighting: Lighting {
            sun_direction: [0.0, 0.0, 1.0],
            sun: [1.0; 3],
            sky: [1.0; 3],
            ground: [1.0; 3],
        },
        start: Isometry3::identity(),
        room_camera: RoomCamera {
            pose: Isometry3::identity(),
            horizontal_fov: 1.0,
        },
        files: Vec::new(),
    };
    (scene, placements)
}

/// The robot at home on an empty floor, as far from the origin as in the home.
fn robot_alone() -> (World, Targets, Isometry3<f64>) {
    let model = model();
    let (scene, placements) = scene(vec![floor()], Vec::new());
    let start = Isometry3::from_parts(
        Translation3::new(-6.635, 3.389, 0.0),
        UnitQuaternion::from_euler_angles(0.0, 0.0, -std::f64::consts::FRAC_PI_2),
    );
    let home = model.settings.home;
    let world = World::new(&model, &scene, &placements, &start, &home).expect("a world");
    (world, hold(home), start)
}

fn hold(arm: [f64; 6]) -> Targets {
    Targets {
        arm_position: arm,
        arm_velocity: [0.0; 6],
        wheel_velocity: [0.0; 2],
        knuckle_position: 0.0,
        knuckle_velocity: 0.0,
        pad_force: 60.0,
    }
}

fn seconds(world: &mut World, s: f64, mut each: impl FnMut(&mut World, f64)) {
    let ticks = (s * 240.0).round() as u64;
    for k in 0..ticks {
        each(world, k as f64 / 240.0);
        world.step();
    }
}
