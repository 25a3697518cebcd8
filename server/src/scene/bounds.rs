//! Axis-aligned bounds of shapes in a given frame.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use super::Body;
use crate::geometry::{self, Part, Shape};

/// An axis-aligned box, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lowest corner.
    pub min: Point3<f64>,
    /// Highest corner.
    pub max: Point3<f64>,
}

impl Bounds {
    const EMPTY: Self = Self {
        min: Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        max: Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// Bounds of points; `None` without any.
    pub fn of_points(points: impl IntoIterator<Item = Point3<f64>>) -> Option<Self> {
        let bounds = points.into_iter().fold(Self::EMPTY, |b, p| Self {
            min: b.min.inf(&p),
            max: b.max.sup(&p),
        });
        (bounds.min.x <= bounds.max.x).then_some(bounds)
    }

    /// Union of both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.inf(&other.min),
            max: self.max.sup(&other.max),
        }
    }

    /// Whether they overlap by more than `slack` metres along every axis.
    #[must_use]
    pub fn overlaps(&self, other: &Self, slack: f64) -> bool {
        (0..3).all(|i| self.max[i].min(other.max[i]) - self.min[i].max(other.min[i]) > slack)
    }

    /// Lengths along x, y, z.
    #[must_use]
    pub fn size(&self) -> Vector3<f64> {
        self.max - self.min
    }
}

/// Bounds of a part of a body at `pose`; `None` for meshes, which collide as the body's
/// hulls.
fn of_part(pose: &Isometry3<f64>, part: &Part) -> Option<Bounds> {
    let at = pose * part.pose;
    let around = |extent: Vector3<f64>, offset: Vector3<f64>| {
        let centre = at * Point3::from(offset);
        Bounds {
            min: centre - extent,
            max: centre + extent,
        }
    };
    let axis = at.rotation * Vector3::z();
    // Half extents of a disc of radius r with this axis.
    let disc = |r: f64| axis.map(|c| r * (1.0 - c * c).max(0.0).sqrt());
    let segment = |half: f64| axis.abs() * half;
    // A ring of radius r at height z on the axis.
    let ring = |r: f64, z: f64| around(disc(r), Vector3::z() * z);
    Some(match &part.shape {
        Shape::Cuboid { half } | Shape::RoundedCuboid { half, .. } => {
            let turn = at.rotation.to_rotation_matrix().into_inner().abs();
            around(turn * Vector3::from(*half), Vector3::zeros())
        }
        Shape::Cylinder {
            radius,
            half_height,
        } => around(disc(*radius) + segment(*half_height), Vector3::zeros()),
        Shape::Capsule {
            radius,
            half_height,
        } => around(
            Vector3::repeat(*radius) + segment(*half_height),
            Vector3::zeros(),
        ),
        Shape::Sphere { radius } => around(Vector3::repeat(*radius), Vector3::zeros()),
        Shape::Frustum {
            bottom_radius,
            top_radius,
            half_height,
        } => ring(*bottom_radius, -half_height).union(&ring(*top_radius, *half_height)),
        Shape::Cup {
            bottom_radius,
            top_radius,
            height,
            ..
        } => ring(*bottom_radius, 0.0).union(&ring(*top_radius, *height)),
        Shape::Lathe { profile } => profile
            .iter()
            .map(|&[r, z]| ring(r, z))
            .reduce(|a, b| a.union(&b))?,
        Shape::Prism { outline, height } => {
            let corners = outline
                .iter()
                .flat_map(|[x, y]| [0.0, *height].map(|z| at * Point3::new(*x, *y, z)));
            Bounds::of_points(corners)?
        }
        Shape::Mesh { .. } | Shape::PackedMesh { .. } => return None,
    })
}

impl Body {
    /// Boxes around the colliding parts: body_from_box and half extents, metres. The box of a
    /// hull is aligned with the body.
    pub fn collision_boxes(&self) -> impl Iterator<Item = (Isometry3<f64>, Vector3<f64>)> + '_ {
        let parts = self.collision.iter().filter_map(|part| {
            let (centre, half) = geometry::bounds(&part.shape)?;
            Some((part.pose * Translation3::from(centre), half))
        });
        parts.chain(self.hull_boxes())
    }

    /// Boxes around the colliding hulls, aligned with the body: body_from_box and half
    /// extents, metres.
    pub(super) fn hull_boxes(&self) -> impl Iterator<Item = (Isometry3<f64>, Vector3<f64>)> + '_ {
        self.hulls.iter().filter_map(|hull| {
            let bounds = Bounds::of_points(hull.iter().copied())?;
            let half = bounds.size() / 2.0;
            Some((Isometry3::from((bounds.min + half).coords), half))
        })
    }

    /// Bounds of the colliding parts when the body is at `pose`; `None` when none
    /// collides.
    #[must_use]
    pub fn collision_bounds(&self, pose: &Isometry3<f64>) -> Option<Bounds> {
        let parts = self.collision.iter().filter_map(|part| of_part(pose, part));
        let meshes = Bounds::of_points(self.hulls.iter().flatten().map(|p| pose * p));
        parts.chain(meshes).reduce(|a, b| a.union(&b))
    }

    /// Height of the frame above the body's support, metres.
    #[must_use]
    pub fn standing_height(&self) -> f64 {
        self.collision_bounds(&Isometry3::identity())
            .map_or(0.0, |bounds| -bounds.min.z)
    }

    /// Collision radius about the body's z axis, metres.
    #[must_use]
    pub fn footprint_radius(&self) -> f64 {
        // Sixteen directions: within 2 % of the true circle for boxes.
        (0..16)
            .filter_map(|i| {
                let yaw = f64::from(i) * std::f64::consts::TAU / 16.0;
                let turn = Isometry3::rotation(Vector3::z() * yaw);
                self.collision_bounds(&turn)
            })
            .map(|b| b.max.x)
            .fold(0.0, f64::max)
    }
}
