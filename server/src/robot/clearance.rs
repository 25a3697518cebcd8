//! Distance of the arm from the chair and from itself, from points on its collision shapes.
//!
//! For postures that are chosen once, not for the loop of control: the world finds contacts
//! there.

use nalgebra::{Isometry3, Point3, Vector3};
use wheelarm_proto::exact;

use super::{ARM_JOINTS, RobotModel};
use crate::geometry::{Part, Shape};

/// Spacing of the points on a shape, metres: the distance between two shapes is found to
/// about 2 mm.
const SPACING: f64 = 0.012;

/// Points on the arm, and what they may touch.
#[derive(Clone, Debug)]
pub struct ArmSurface {
    /// Link and point in its frame.
    points: Vec<(usize, Point3<f64>)>,
    /// For every link, the other links from which its distance counts.
    others: Vec<Vec<usize>>,
}

impl RobotModel {
    /// Points on the links that may collide, by `chair_contact_joints` and
    /// `self_contact_joints` of `robot.toml`.
    #[must_use]
    pub fn arm_surface(&self) -> ArmSurface {
        let settings = &self.settings.arm;
        // Moving joints of the arm down to a link; `None` for links of the chair.
        let depth = |link: usize| {
            let chain = self.chain(self.roles.arm_base, link)?;
            let moving = |joint: &&usize| self.roles.arm_index(**joint).is_some();
            Some(chain.iter().filter(moving).count())
        };
        let depths: Vec<usize> = (0..self.links.len())
            .map(|l| depth(l).unwrap_or(0))
            .collect();
        let others = |link: usize| {
            let counts = |other: &usize| {
                let (a, b) = (depths[link], depths[*other]);
                match b {
                    0 => a >= settings.chair_contact_joints as usize,
                    _ => a >= b + settings.self_contact_joints as usize,
                }
            };
            (0..self.links.len()).filter(counts).collect()
        };
        let moving = (0..self.links.len()).filter(|link| depths[*link] > 0);
        let points = moving.flat_map(|link| {
            let parts = self.links[link].collision.iter().map(|c| &c.part);
            let points = parts.flat_map(surface_points);
            points.map(move |point| (link, point)).collect::<Vec<_>>()
        });
        ArmSurface {
            points: points.collect(),
            others: (0..self.links.len()).map(others).collect(),
        }
    }

    /// Poses of all links in the chair with the arm at these positions, rad, and the
    /// gripper open.
    #[must_use]
    pub fn poses_at(&self, arm: &[f64; ARM_JOINTS]) -> Vec<Isometry3<f64>> {
        let mut positions = vec![0.0; self.joints.len()];
        for (&joint, &position) in self.roles.arm.iter().zip(arm) {
            positions[joint] = position;
        }
        self.link_poses(&positions)
    }
}

impl ArmSurface {
    /// Points on the arm in the chair, metres.
    pub fn placed<'a>(
        &'a self,
        poses: &'a [Isometry3<f64>],
    ) -> impl Iterator<Item = Point3<f64>> + 'a {
        let points = self.points.iter();
        points.map(|(link, point)| poses[*link] * point)
    }

    /// Least distance of the arm from the chair and from itself, metres; negative inside.
    #[must_use]
    pub fn distance(&self, model: &RobotModel, poses: &[Isometry3<f64>]) -> f64 {
        let mut least = f64::INFINITY;
        for (link, point) in &self.points {
            let at = poses[*link] * point;
            for &other in &self.others[*link] {
                let parts = model.links[other].collision.iter().map(|c| &c.part);
                for part in parts {
                    let local = (poses[other] * part.pose).inverse_transform_point(&at);
                    least = least.min(distance(&part.shape, &local));
                }
            }
        }
        least
    }
}

/// Distance of a point from a shape of a URDF in the frame of the shape, metres; negative
/// inside. Meshes, which robots do not collide with, are infinitely far.
fn distance(shape: &Shape, at: &Point3<f64>) -> f64 {
    let outside = |off: Vector3<f64>| off.map(|v| v.max(0.0)).norm() + off.max().min(0.0);
    match shape {
        Shape::Cuboid { half } => outside(at.coords.abs() - Vector3::from(*half)),
        Shape::Cylinder {
            radius,
            half_height,
        } => {
            let across = exact::hypot(at.x, at.y) - radius;
            outside(Vector3::new(
                across,
                f64::NEG_INFINITY,
                at.z.abs() - half_height,
            ))
        }
        Shape::Capsule {
            radius,
            half_height,
        } => {
            let along = (at.z.abs() - half_height).max(0.0);
            exact::hypot(exact::hypot(at.x, at.y), along) - radius
        }
        Shape::Sphere { radius } => at.coords.norm() - radius,
        _ => f64::INFINITY,
    }
}

/// Points on a shape of a URDF, in the frame of its link.
fn surface_points(part: &Part) -> Vec<Point3<f64>> {
    let steps = |length: f64| (length / SPACING).ceil().max(1.0) as i32;
    let share = |i: i32, n: i32| f64::from(i) / f64::from(n);
    let mut points = Vec::new();
    match &part.shape {
        Shape::Cuboid { half } => {
            let counts = half.map(|half| steps(2.0 * half));
            for i in 0..=counts[0] {
                for j in 0..=counts[1] {
                    for k in 0..=counts[2] {
                        let index = [i, j, k];
                        let is_face = (0..3).any(|a| index[a] == 0 || index[a] == counts[a]);
                        if is_face {
                            let at = |a: usize| (2.0 * share(index[a], counts[a]) - 1.0) * half[a];
                            points.push(Point3::new(at(0), at(1), at(2)));
                        }
                    }
                }
            }
        }
        Shape::Cylinder {
            radius,
            half_height,
        } => round(&mut points, *radius, [-half_height, *half_height], true),
        Shape::Capsule {
            radius,
            half_height,
        } => {
            // The caps as rings of a sphere.
            let reach = half_height + radius;
            let rings = steps(2.0 * reach);
            for ring in 0..=rings {
                let z = (2.0 * share(ring, rings) - 1.0) * reach;
                let cap = (z.abs() - half_height).max(0.0);
                let across = (radius * radius - cap * cap).max(0.0).sqrt();
                round(&mut points, across, [z, z], false);
            }
        }
        Shape::Sphere { radius } => {
            let rings = steps(2.0 * radius);
            for ring in 0..=rings {
                let z = (2.0 * share(ring, rings) - 1.0) * radius;
                let across = (radius * radius - z * z).max(0.0).sqrt();
                round(&mut points, across, [z, z], false);
            }
        }
        _ => {}
    }
    points.iter().map(|point| part.pose * point).collect()
}

/// Points around the z axis between two heights, with the flat ends if `is_closed`.
fn round(points: &mut Vec<Point3<f64>>, radius: f64, [low, high]: [f64; 2], is_closed: bool) {
    let turn = std::f64::consts::TAU;
    let mut ring = |radius: f64, z: f64| {
        let count = (turn * radius / SPACING).ceil().max(1.0) as i32;
        for i in 0..count {
            let (sin, cos) = exact::sin_cos(turn * f64::from(i) / f64::from(count));
            points.push(Point3::new(radius * cos, radius * sin, z));
        }
    };
    let rings = ((high - low) / SPACING).ceil() as i32;
    for i in 0..=rings {
        let z = low + (high - low) * f64::from(i) / f64::from(rings.max(1));
        ring(radius, z);
    }
    let inner = (radius / SPACING).ceil() as i32;
    for i in (0..inner).filter(|_| is_closed) {
        let radius = radius * f64::from(i) / f64::from(inner);
        ring(radius, low);
        ring(radius, high);
    }
}

#[cfg(test)]
mod tests {
    use wheelarm_planning::floor_map::CHANGE_CLEARANCE;
    use wheelarm_planning::footprint_check::Outline;
    use wheelarm_planning::postures::changing;

    use super::*;
    use crate::robot::OutlineSettings;

    #[test]
    fn points_lie_on_their_shapes() {
        let shapes = [
            Shape::Cuboid {
                half: [0.05, 0.1, 0.02],
            },
            Shape::Cylinder {
                radius: 0.046,
                half_height: 0.1,
            },
            Shape::Capsule {
                radius: 0.03,
                half_height: 0.1,
            },
            Shape::Sphere { radius: 0.05 },
        ];
        for shape in shapes {
            let pose = Isometry3::new(Vector3::new(0.3, -0.2, 1.0), Vector3::x() * 0.7);
            let part = Part { pose, shape };
            let points = surface_points(&part);
            assert!(points.len() > 50, "{:?}", part.shape);
            for point in points {
                let local = pose.inverse_transform_point(&point);
                assert!(distance(&part.shape, &local).abs() < 1e-9, "{local:?}");
            }
        }
    }

    /// The chair drives in it: the arm must keep away from chair and itself there, and on the
    /// straight way home, and stay within the outlines of the posture.
    #[test]
    fn travel_postures_are_clear_of_chair_and_arm_up_to_home() {
        let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let model = RobotModel::load(&assets, "wheelarm").expect("a robot");
        let travel = model.settings.travel.as_ref().expect("a travel posture");
        let surface = model.arm_surface();
        let home = model.settings.home;
        for step in 0..=20 {
            let share = f64::from(step) / 20.0;
            let arm =
                std::array::from_fn(|i| travel.joints[i] + (home[i] - travel.joints[i]) * share);
            let poses = model.poses_at(&arm);
            let gap = surface.distance(&model, &poses);
            assert!(gap > 0.04, "{gap} m at {share}");
        }
        let poses = model.poses_at(&travel.joints);
        for point in surface.placed(&poses) {
            let outline = travel.outlines.iter().find(|o| point.z <= o.top);
            let [back, front, right, left] = outline.expect("an outline").footprint;
            let is_within = (back - 0.004..=front + 0.004).contains(&point.x)
                && (right - 0.004..=left + 0.004).contains(&point.y);
            assert!(is_within, "{point:?}");
        }
    }

    /// The chair is at rest for it, and keeps `CHANGE_CLEARANCE`.
    #[test]
    fn arm_stays_within_the_footprint_of_a_change_of_posture() {
        let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let model = RobotModel::load(&assets, "wheelarm").expect("a robot");
        let settings = &model.settings;
        let travel = settings.travel.as_ref().expect("a travel posture");
        let outlines = |list: &[OutlineSettings]| {
            let one = |o: &OutlineSettings| (o.top, Outline { sides: o.footprint });
            list.iter().map(one).collect::<Vec<_>>()
        };
        let mount = model.arm_mount().translation;
        let check = changing(
            &outlines(&settings.outlines),
            &outlines(&travel.outlines),
            [mount.x, mount.y],
        );
        let surface = model.arm_surface();
        let mut furthest = 0.0_f64;
        for step in 0..=20 {
            let share = f64::from(step) / 20.0;
            let home = settings.home;
            let arm =
                std::array::from_fn(|i| travel.joints[i] + (home[i] - travel.joints[i]) * share);
            let poses = model.poses_at(&arm);
            for point in surface.placed(&poses) {
                let is_within = check.levels.iter().any(|level| {
                    let [back, front, right, left] = level.outline.sides;
                    (level.bottom..=level.top).contains(&point.z)
                        && (back - CHANGE_CLEARANCE..=front + CHANGE_CLEARANCE).contains(&point.x)
                        && (right - CHANGE_CLEARANCE..=left + CHANGE_CLEARANCE).contains(&point.y)
                });
                assert!(is_within, "{point:?} at {share}");
                furthest = furthest.max(point.y);
            }
        }
        // It needs nearly all of the room.
        let sides = check.levels.iter().map(|level| level.outline.sides[3]);
        let left = sides.fold(0.0, f64::max);
        assert!(left - furthest < 0.07, "{furthest} m of {left} m");
    }

    #[test]
    fn distances_are_signed() {
        let cuboid = Shape::Cuboid { half: [1.0; 3] };
        assert!((distance(&cuboid, &Point3::new(1.3, 1.4, 0.0)) - 0.5).abs() < 1e-12);
        assert!((distance(&cuboid, &Point3::new(0.9, 0.0, 0.0)) + 0.1).abs() < 1e-12);
        let cylinder = Shape::Cylinder {
            radius: 1.0,
            half_height: 2.0,
        };
        assert!((distance(&cylinder, &Point3::new(0.0, 1.3, 2.4)) - 0.5).abs() < 1e-12);
        assert!((distance(&cylinder, &Point3::new(0.0, 0.0, 1.9)) + 0.1).abs() < 1e-12);
    }
}
