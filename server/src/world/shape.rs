//! Collision shapes of `geometry` shapes.
//!
//! Shapes with an axis have it along z; the engine's have it along y. Curved walls
//! become polygons of equal cross section.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3, center};
use rapier3d::math::{Pose, Vector};
use rapier3d::prelude::SharedShape;
use wheelarm_proto::exact;

use super::convert::{point, pose, real};
use crate::geometry::{Part, Shape};

/// Sides of the polygon for a truncated cone.
const FRUSTUM_SIDES: usize = 24;
/// Wall pieces of a cup: fewer have prominent corners, more cost time.
const CUP_SIDES: usize = 16;
/// The wall of a cup begins this far above its foot, so that only the floor of the cup
/// carries it, metres.
const CUP_FOOT: f64 = 0.002;

/// Sides of the polygon for a person's capsule: the fewest whose flats are inside the
/// circle by at most `CAPSULE_FLAT`, or the last. The engine transforms every corner of
/// every capsule in every tick, for its bounding box.
const CAPSULE_SIDES: [usize; 3] = [6, 8, 10];
/// Metres. [choice: flesh yields by more]
const CAPSULE_FLAT: f64 = 0.002;
/// Up to this radius of the core a round end has one ring between wall and pole, above
/// it two, metres.
const CAPSULE_PLAIN_END: f64 = 0.04;
/// Largest rounding radius of its edges, metres.
const CAPSULE_RIM: f64 = 0.01;

/// An engine shape with its pose in the body.
pub(super) type Solid = (Pose, SharedShape);

/// The solids of a part whose cylinders have rims rounded by at most `rim` metres,
/// within the same extents; an error describes what is wrong with it.
///
/// A rounded solid is a core and a radius around it: up to that penetration, contacts
/// follow from the distance of the core. Once a sharp cylinder penetrates a large box,
/// the engine's search for the least depth (EPA, single precision) sometimes ends on
/// the wrong side, 80 mm deep.
pub(super) fn solids(part: &Part, rim: f64) -> Result<Vec<Solid>, String> {
    let at = |body_from_shape: &Isometry3<f64>, shape| Ok(vec![(pose(body_from_shape), shape)]);
    match &part.shape {
        Shape::Cuboid { half } => {
            positive("half extents", half)?;
            at(
                &part.pose,
                SharedShape::cuboid(real(half[0]), real(half[1]), real(half[2])),
            )
        }
        Shape::RoundedCuboid { half, radius } => {
            let core = half.map(|h| h - radius);
            positive("half extents less the radius", &core)?;
            positive("radius", &[*radius])?;
            at(
                &part.pose,
                SharedShape::round_cuboid(
                    real(core[0]),
                    real(core[1]),
                    real(core[2]),
                    real(*radius),
                ),
            )
        }
        Shape::Cylinder {
            radius,
            half_height,
        } => {
            positive("radius and half height", &[*radius, *half_height])?;
            let z_from_y = Isometry3::rotation(Vector3::x() * FRAC_PI_2);
            // The core must not vanish.
            let rim = rim.min(0.4 * radius).min(0.4 * half_height);
            let shape = if rim > 0.0 {
                SharedShape::round_cylinder(real(half_height - rim), real(radius - rim), real(rim))
            } else {
                SharedShape::cylinder(real(*half_height), real(*radius))
            };
            at(&(part.pose * z_from_y), shape)
        }
        Shape::Capsule {
            radius,
            half_height,
        } => {
            positive("radius and half height", &[*radius, *half_height])?;
            at(
                &part.pose,
                SharedShape::capsule_z(real(*half_height), real(*radius)),
            )
        }
        Shape::Sphere { radius } => {
            positive("radius", &[*radius])?;
            at(&part.pose, SharedShape::ball(real(*radius)))
        }
        Shape::Frustum {
            bottom_radius,
            top_radius,
            half_height,
        } => {
            positive(
                "radii and half height",
                &[*bottom_radius, *top_radius, *half_height],
            )?;
            let mut points = ring(FRUSTUM_SIDES, *bottom_radius, -half_height);
            points.extend(ring(FRUSTUM_SIDES, *top_radius, *half_height));
            at(&part.pose, hull(&points)?)
        }
        Shape::Cup {
            bottom_radius,
            top_radius,
            height,
            wall,
        } => cup(&part.pose, [*bottom_radius, *top_radius], *height, *wall),
        Shape::Lathe { .. } | Shape::Prism { .. } | Shape::PackedMesh { .. } => Err(
            "a surface of revolution, a prism or a mesh of a pack is for visuals only; give \
             collision parts of other shapes"
                .into(),
        ),
        Shape::Mesh { path, .. } => Err(format!(
            "mesh {path} has no vertices here; a scene uses its hulls, a robot collides as solids"
        )),
    }
}

/// The engine's own capsule with the axis from `a` to `b` in the body frame, metres. It
/// touches a wall in one or two points, and its bounding box is cheap.
pub(super) fn capsule(a: &Point3<f64>, b: &Point3<f64>, radius: f64) -> Result<Solid, String> {
    positive("radius", &[radius])?;
    let (at, half) = along(a, b);
    let shape = match half {
        0.0 => SharedShape::ball(real(radius)),
        _ => SharedShape::capsule_z(real(half), real(radius)),
    };
    Ok((pose(&at), shape))
}

/// A solid for a capsule on which objects may rest: a polygon with rings towards the
/// poles, of the same cross section.
///
/// The engine's own capsule is round along its axis: a box on two of them, for example,
/// gets other contact points and normals at every tick, rocks for ever and drifts away.
pub(super) fn supporting_capsule(
    a: &Point3<f64>,
    b: &Point3<f64>,
    radius: f64,
) -> Result<Solid, String> {
    positive("radius", &[radius])?;
    let (at, half) = along(a, b);
    let rim = CAPSULE_RIM.min(0.4 * radius);
    let core = radius - rim;
    let flat = |sides: usize| core - outer(sides, core) * exact::cos(PI / sides as f64);
    let [.., most] = CAPSULE_SIDES;
    let sides = CAPSULE_SIDES.into_iter();
    let sides = sides
        .clone()
        .find(|s| flat(*s) <= CAPSULE_FLAT)
        .unwrap_or(most);
    let latitudes: &[f64] = if core <= CAPSULE_PLAIN_END {
        &[0.0, FRAC_PI_4]
    } else {
        &[0.0, PI / 6.0, PI / 3.0]
    };
    let mut points = Vec::new();
    for latitude in latitudes {
        let (sin, cos) = exact::sin_cos(*latitude);
        for side in [-1.0, 1.0] {
            let height = side * (half + core * sin);
            points.extend(ring(sides, core * cos, height));
        }
    }
    for side in [-1.0, 1.0] {
        points.push(point(&Point3::new(0.0, 0.0, side * (half + core))));
    }
    let shape = SharedShape::round_convex_hull(&points, real(rim));
    let shape = shape.ok_or("no convex hull of a capsule")?;
    Ok((pose(&at), shape))
}

/// Middle of a segment with z along it, and half its length.
fn along(a: &Point3<f64>, b: &Point3<f64>) -> (Isometry3<f64>, f64) {
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &(b - a));
    let turn = turn.unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
    let at = Isometry3::from_parts(center(a, b).into(), turn);
    (at, (b - a).norm() / 2.0)
}

/// A convex solid through points in the body frame, metres.
pub(super) fn hull_of(points: &[Point3<f64>]) -> Result<Solid, String> {
    let points: Vec<Vector> = points.iter().map(point).collect();
    Ok((Pose::IDENTITY, hull(&points)?))
}

/// A cup: a floor and a ring of wall pieces.
fn cup(
    body_from_cup: &Isometry3<f64>,
    [bottom, top]: [f64; 2],
    height: f64,
    wall: f64,
) -> Result<Vec<Solid>, String> {
    positive("radii, height and wall", &[bottom, top, height, wall])?;
    positive(
        "radii and height less the wall",
        &[bottom - wall, top - wall, height - wall],
    )?;
    let place = pose(body_from_cup);
    let radius = |z: f64| bottom + (top - bottom) * z / height;
    // The engine uses only four neighbouring corners of a hull's face: on a floor of
    // sixteen corners a cup would wobble on a sliver.
    let floor = Part {
        pose: body_from_cup * Isometry3::translation(0.0, 0.0, wall / 2.0),
        shape: Shape::Cylinder {
            radius: bottom,
            half_height: wall / 2.0,
        },
    };
    let mut solids = self::solids(&floor, 0.0)?;

    let foot = CUP_FOOT.min(wall);
    let rings = [
        ring(CUP_SIDES, radius(foot), foot),
        ring(CUP_SIDES, radius(foot) - wall, foot),
        ring(CUP_SIDES, top, height),
        ring(CUP_SIDES, top - wall, height),
    ];
    for i in 0..CUP_SIDES {
        let j = (i + 1) % CUP_SIDES;
        let corners: Vec<Vector> = rings.iter().flat_map(|r| [r[i], r[j]]).collect();
        solids.push((place, hull(&corners)?));
    }
    Ok(solids)
}

/// Distance of the corners from the centre of a regular polygon with the area of the
/// circle.
fn outer(sides: usize, radius: f64) -> f64 {
    let step = TAU / sides as f64;
    radius * (step / exact::sin(step)).sqrt()
}

/// Corners of a regular polygon with the area of the circle.
fn ring(sides: usize, radius: f64, z: f64) -> Vec<Vector> {
    let step = TAU / sides as f64;
    let corner = outer(sides, radius);
    (0..sides)
        .map(|i| step * i as f64)
        .map(|a| {
            Vector::new(
                real(corner * exact::cos(a)),
                real(corner * exact::sin(a)),
                real(z),
            )
        })
        .collect()
}

fn hull(points: &[Vector]) -> Result<SharedShape, String> {
    SharedShape::convex_hull(points).ok_or_else(|| "its points have no convex hull".into())
}

fn positive(what: &str, values: &[f64]) -> Result<(), String> {
    if values.iter().all(|v| v.is_finite() && *v > 0.0) {
        Ok(())
    } else {
        Err(format!("{what} must be positive, got {values:?}"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::convert::from_vector;
    use super::*;

    /// From a child's thumb to the widest chest: along the sides a capsule's solid
    /// matches the capsule within millimetres, and its ends have its length.
    #[test]
    fn a_capsule_is_nearly_round() {
        for radius in [0.0145, 0.025, 0.05, 0.0731, 0.1, 0.1337, 0.1744] {
            let (a, b) = (Point3::new(0.1, 0.0, 0.3), Point3::new(0.1, 0.2, 0.3));
            let (body_from_solid, solid) = supporting_capsule(&a, &b, radius).expect("a solid");
            let round = solid.as_round_convex_polyhedron().expect("a polygon");
            let points = round.inner_shape.points();
            // Fewer than half of those of sixteen sides with three rings, except for
            // trunks.
            assert!(points.len() <= if radius < 0.09 { 50 } else { 62 });
            let reach = |towards: Vector3<f64>| {
                let far = points.iter().map(|p| {
                    let p = from_vector((body_from_solid * *p) - point(&a));
                    p.dot(&towards)
                });
                far.fold(f64::MIN, f64::max) + f64::from(round.border_radius)
            };
            let beyond = |towards: Vector3<f64>| {
                let ends = towards.dot(&(b - a)).max(0.0);
                reach(towards) - ends - radius
            };
            for step in 0..360 {
                let (sin, cos) = exact::sin_cos(f64::from(step) * PI / 180.0);
                let side = beyond(Vector3::new(cos, 0.0, sin));
                assert!((-0.003..0.006).contains(&side), "{radius} m: {side} m");
                for other in [Vector3::new(cos, sin, 0.0), Vector3::new(0.0, sin, cos)] {
                    let end = beyond(other);
                    assert!((-0.009..0.006).contains(&end), "{radius} m: {end} m");
                }
            }
            for along in [Vector3::y(), -Vector3::y()] {
                assert!(beyond(along).abs() < 1e-6);
            }
        }
    }
}
