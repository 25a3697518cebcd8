//! Ray cast of the laser scanner against the collision shapes, all but those of the robot
//! and of the person in it.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Vector3};
use rapier3d::parry::query::Ray;
use rapier3d::prelude::{Aabb, Collider};
use wheelarm_proto::exact;

use super::World;
use super::contact::body_of;
use super::convert::{point, real, vector};
use super::gap::place;
use crate::geometry::Rays;
use crate::snapshot::BodyRef;

impl World {
    /// Distance along each ray of a scanner at `world_from_scanner` after the last tick,
    /// metres; +infinity beyond the greatest distance. Deformables are not seen.
    #[must_use]
    pub fn scan(&self, world_from_scanner: &Isometry3<f64>, rays: &Rays) -> Vec<f32> {
        let mut distances = vec![f32::INFINITY; rays.count];
        let origin = point(&world_from_scanner.translation.vector.into());
        let greatest = real(rays.greatest);
        for (_, collider) in self.physics.colliders.iter() {
            if !reflects(collider) {
                continue;
            }
            let pose = place(&self.physics, collider);
            let bounds = collider.shape().compute_aabb(&pose);
            let Some([from, to]) = angles(&bounds, world_from_scanner, rays.greatest) else {
                continue;
            };
            for i in rays.between(from, to) {
                let (sin, cos) = exact::sin_cos(rays.angle(i));
                let direction = world_from_scanner * Vector3::new(cos, sin, 0.0);
                let ray = Ray::new(origin, vector(&direction));
                let limit = distances[i].min(greatest);
                if let Some(distance) = collider.shape().cast_ray(&pose, &ray, limit, true) {
                    distances[i] = limit.min(distance);
                }
            }
        }
        distances
    }
}

/// Whether light meets a shape outside of the robot.
fn reflects(collider: &Collider) -> bool {
    let body = body_of(collider.user_data);
    !collider.is_sensor() && matches!(body, BodyRef::Object(_) | BodyRef::Furniture(_))
}

/// Angles about z of the scanner's frame between which a box may be, rad; `None` for a box
/// that the scanner's plane does not meet within its range.
fn angles(bounds: &Aabb, world_from_scanner: &Isometry3<f64>, greatest: f64) -> Option<[f64; 2]> {
    let corners = bounds.vertices().map(|corner| {
        let corner = [corner.x, corner.y, corner.z].map(f64::from);
        world_from_scanner.inverse_transform_point(&corner.into())
    });
    let heights = corners.iter().map(|corner| corner.z);
    let (below, above) = (
        heights.clone().any(|z| z <= 0.0),
        heights.clone().any(|z| z >= 0.0),
    );
    if !(below && above) {
        return None;
    }
    let middle = corners
        .iter()
        .fold(Vector3::zeros(), |sum, c| sum + c.coords)
        / 8.0;
    let reach = corners.iter().map(|corner| (corner.coords - middle).norm());
    if middle.norm() - reach.fold(0.0, f64::max) > greatest {
        return None;
    }
    // The box is convex: if it has the scanner beside it, its corners are within half a turn.
    let centre = exact::atan2(middle.y, middle.x);
    let (mut least, mut most) = (0.0_f64, 0.0_f64);
    for corner in &corners {
        let mut beside = exact::atan2(corner.y, corner.x) - centre;
        beside -= TAU * (beside / TAU).round();
        (least, most) = (least.min(beside), most.max(beside));
    }
    match most - least < PI {
        true => Some([centre + least, centre + most]),
        false => Some([centre - PI, centre + PI]),
    }
}
