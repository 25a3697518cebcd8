//! Law: distances of the laser scanner are those of an independent ray cast, in double
//! precision and from the shapes' equations.

use super::*;
use crate::geometry::{Rays, bounds};

/// Largest difference, metres.
const TOLERANCE: f64 = 1e-3;

const RAYS: Rays = Rays {
    first: -std::f64::consts::PI,
    step: std::f64::consts::TAU / 720.0,
    count: 720,
    greatest: 12.0,
};

/// Distance to a box along a ray from `origin`, in the box's frame.
fn to_box(half: [f64; 3], origin: &Point3<f64>, along: &Vector3<f64>) -> Option<f64> {
    let (mut enters, mut leaves) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let sides = [-half[axis], half[axis]].map(|side| (side - origin[axis]) / along[axis]);
        if along[axis] == 0.0 {
            if origin[axis].abs() > half[axis] {
                return None;
            }
            continue;
        }
        enters = enters.max(sides[0].min(sides[1]));
        leaves = leaves.min(sides[0].max(sides[1]));
    }
    (enters <= leaves).then_some(enters)
}

/// Smaller non-negative solution of `a t² + 2 b t + c = 0`.
fn smaller_root(a: f64, b: f64, c: f64) -> Option<f64> {
    let d = b * b - a * c;
    let root = (-b - d.sqrt()) / a;
    (d >= 0.0 && root >= 0.0).then_some(root)
}

/// Distance to a sphere about the frame's origin.
fn to_sphere(radius: f64, origin: &Point3<f64>, along: &Vector3<f64>) -> Option<f64> {
    let from = origin.coords;
    smaller_root(1.0, from.dot(along), from.norm_squared() - radius * radius)
}

/// Distance to the wall of an upright cylinder about z, for rays that stay between its ends.
fn to_wall(radius: f64, origin: &Point3<f64>, along: &Vector3<f64>) -> Option<f64> {
    let (from, to) = (origin.coords.xy(), along.xy());
    smaller_root(
        to.norm_squared(),
        from.dot(&to),
        from.norm_squared() - radius * radius,
    )
}

/// Whether a shape has this height, metres: others are above or below level rays.
fn is_beside(place: &Isometry3<f64>, shape: &Shape, height: f64) -> bool {
    let Some((centre, half)) = bounds(shape) else {
        return true;
    };
    let middle = (place * Point3::from(centre)).z;
    let turned = place.rotation.to_rotation_matrix();
    let up: f64 = (0..3)
        .map(|axis| turned[(2, axis)].abs() * half[axis])
        .sum();
    (middle - up..=middle + up).contains(&height)
}

/// Distance along a ray to the bodies at their poses.
fn independent<'a>(
    bodies: impl Iterator<Item = (&'a Body, Isometry3<f64>)>,
    origin: &Point3<f64>,
    along: &Vector3<f64>,
) -> f64 {
    let mut nearest = f64::INFINITY;
    for (body, world_from_body) in bodies {
        for part in &body.collision {
            let place = world_from_body * part.pose;
            let (from, to) = (
                place.inverse_transform_point(origin),
                place.inverse_transform_vector(along),
            );
            let met = match part.shape {
                Shape::Cuboid { half } => to_box(half, &from, &to),
                _ if !is_beside(&place, &part.shape, origin.z) => None,
                Shape::Sphere { radius } => to_sphere(radius, &from, &to),
                Shape::Cylinder { radius, .. } => to_wall(radius, &from, &to),
                // No equation: the rays near it are not compared.
                ref other => {
                    let radius = bounds(other).map_or(f64::INFINITY, |(_, half)| half.norm());
                    match to_wall(radius, &from, &to) {
                        Some(_) => return f64::NAN,
                        None => None,
                    }
                }
            };
            nearest = nearest.min(met.unwrap_or(f64::INFINITY));
        }
    }
    nearest
}

#[track_caller]
fn compare(scan: &[f32], expected: impl Fn(usize) -> f64) -> usize {
    let mut met = 0;
    for (i, &distance) in scan.iter().enumerate() {
        let (distance, expected) = (f64::from(distance), expected(i));
        if expected.is_nan() {
            continue;
        }
        let beyond = distance.is_infinite() && expected > RAYS.greatest - TOLERANCE;
        met += usize::from(distance.is_finite());
        assert!(
            beyond || (distance - expected).abs() < TOLERANCE,
            "ray {i}: {distance} m, expected {expected} m"
        );
    }
    met
}

fn along(at: &Isometry3<f64>, ray: usize) -> Vector3<f64> {
    let angle = RAYS.angle(ray);
    at * Vector3::new(angle.cos(), angle.sin(), 0.0)
}

#[test]
fn distances_equal_an_independent_ray_cast_also_to_moving_bodies() {
    let turned = |x: f64, y: f64, turn: f64| {
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, turn);
        Isometry3::from_parts(Translation3::new(x, y, 0.5), turn)
    };
    let wall = |name: &str, pose| {
        body(
            name,
            pose,
            0.6,
            Shape::Cuboid {
                half: [0.05, 1.5, 0.5],
            },
        )
    };
    let post = Shape::Cylinder {
        radius: 0.03,
        half_height: 0.5,
    };
    let furniture = vec![
        floor(),
        wall("ahead", turned(3.0, 0.4, 0.3)),
        wall("behind", turned(-4.0, 0.2, 1.2)),
        wall("on the seam", turned(-2.0, -0.1, -0.2)),
        wall("far", turned(13.0, 0.0, 0.0)),
        body("post", turned(1.5, 1.0, 0.0), 0.6, post),
    ];
    let ball = Shape::Sphere { radius: 0.15 };
    let falling = object("ball", pose_at(0.9, -1.2, 0.9), 0.4, [0.15; 3], ball);
    let (scene, placements) = scene(furniture, vec![falling]);
    let (model, start) = (model(), pose_at(0.2, -0.1, 0.0));
    let home = model.settings.home;
    let mut world = World::new(&model, &scene, &placements, &start, &home).expect("a world");
    let (mut met_ball, tilt) = (0, UnitQuaternion::from_euler_angles(0.01, -0.02, 2.0));
    for _ in 0..6 {
        for _ in 0..16 {
            world.step();
        }
        let snapshot = world.snapshot();
        let level = snapshot.links[0].pose * pose_at(0.3, 0.0, 0.22);
        let tilted = Isometry3::from_parts(level.translation, tilt);
        for at in [level, tilted] {
            let origin = Point3::from(at.translation.vector);
            let bodies = || {
                let furniture = scene.furniture.iter().map(|body| (body, body.pose));
                let objects = snapshot.objects.iter().map(|object| object.pose);
                furniture.chain(scene.objects.iter().zip(objects))
            };
            let distances = world.scan(&at, &RAYS);
            let met = compare(&distances, |ray| {
                independent(bodies(), &origin, &along(&at, ray))
            });
            assert!(met > 200, "{met} rays meet something");
            let without = |ray| independent(bodies().take(6), &origin, &along(&at, ray));
            let at_ball = |&ray: &usize| without(ray) - f64::from(distances[ray]) > 0.1;
            met_ball += (0..RAYS.count).filter(at_ball).count();
        }
    }
    assert!(met_ball > 20, "{met_ball} rays meet the falling ball");
}

#[test]
fn distances_in_the_home_equal_an_independent_ray_cast_without_the_robot() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let home = Scene::load(&assets, "home").expect("the home of this repository");
    let placements: Vec<Placement> = Vec::new();
    let (model, furnished) = (
        model(),
        Scene {
            objects: Vec::new(),
            ..home
        },
    );
    let arm = model.settings.home;
    let world =
        World::new(&model, &furnished, &placements, &furnished.start, &arm).expect("a world");
    let at = furnished.start * pose_at(0.3, 0.0, 0.22);
    let origin = Point3::from(at.translation.vector);
    let bodies = || furnished.furniture.iter().map(|body| (body, body.pose));
    let met = compare(&world.scan(&at, &RAYS), |ray| {
        independent(bodies(), &origin, &along(&at, ray))
    });
    assert!(met > 400, "{met} rays meet something");
}
