//! Oriented bounding boxes (OBB), some of them cylinders: objects for a planner.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use wheelarm_proto::exact;

use super::footprint_check::Rectangle;

/// An oriented bounding box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obb {
    /// Pose of the centre, in `house` or in an object's frame.
    pub pose: Isometry3<f64>,
    /// Half extents, metres.
    pub half: Vector3<f64>,
    /// Whether it is a cylinder about its own z axis, with `half.x` as radius.
    pub round: bool,
}

impl Obb {
    /// A box along the axes between two opposite corners, the lower one first.
    #[must_use]
    pub fn between(from: [f64; 3], to: [f64; 3]) -> Self {
        let [from, to] = [from, to].map(Vector3::from);
        Self {
            pose: Translation3::from((from + to) / 2.0).into(),
            half: (to - from) / 2.0,
            round: false,
        }
    }

    /// Distance from `point` to the surface; 0 inside, metres.
    #[must_use]
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        let local = self.pose.inverse_transform_point(point).coords;
        let outside = if self.round {
            Vector3::new(
                exact::hypot(local.x, local.y) - self.half.x,
                0.0,
                local.z.abs() - self.half.z,
            )
        } else {
            local.abs() - self.half
        };
        outside.map(|v| v.max(0.0)).norm()
    }

    /// Radius of its bounding sphere, metres.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.half.norm()
    }

    /// Its corners in the frame of its pose.
    pub fn corners(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        (0..8).map(|i| {
            let sign = |bit: usize| if i & bit == 0 { -1.0 } else { 1.0 };
            let corner = Vector3::new(sign(1), sign(2), sign(4)).component_mul(&self.half);
            self.pose * Point3::from(corner)
        })
    }

    /// Lowest and highest point, metres.
    #[must_use]
    pub fn heights(&self) -> [f64; 2] {
        self.corners()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |h, p| {
                [h[0].min(p.z), h[1].max(p.z)]
            })
    }

    /// The box of an object at `pose`.
    #[must_use]
    pub fn at(&self, pose: &Isometry3<f64>) -> Self {
        Self {
            pose: pose * self.pose,
            ..*self
        }
    }

    /// Outline on the floor: exact for upright boxes, otherwise the bounding rectangle.
    #[must_use]
    pub fn rectangle(&self) -> Rectangle {
        let up = self.pose.rotation * Vector3::z();
        if up.z.abs() > 0.999 {
            let along = self.pose.rotation * Vector3::x();
            let length = along.xy().norm();
            return Rectangle {
                centre: [self.pose.translation.x, self.pose.translation.y],
                half: [self.half.x, self.half.y],
                along: [along.x / length, along.y / length],
            };
        }
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for p in self.corners() {
            for (i, v) in [p.x, p.y].into_iter().enumerate() {
                low[i] = low[i].min(v);
                high[i] = high[i].max(v);
            }
        }
        Rectangle {
            centre: [
                f64::midpoint(low[0], high[0]),
                f64::midpoint(low[1], high[1]),
            ],
            half: [(high[0] - low[0]) / 2.0, (high[1] - low[1]) / 2.0],
            along: [1.0, 0.0],
        }
    }
}
