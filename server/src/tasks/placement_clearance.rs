//! Clearance between objects on surfaces: outlines on the floor plan and their
//! distances.

use nalgebra::{Isometry3, Point2, UnitComplex, UnitQuaternion, Vector2, Vector3};
use wheelarm_proto::exact;

use super::rest::heading;
use crate::geometry::Part;
use crate::scene::{Body, Bounds, Placement, Scene, Surface};

/// Smallest distance between two objects, metres.
const GAP: f64 = 0.02;

/// The outline of an object on the floor plan: a rectangle extended by a radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outline {
    /// Middle of the rectangle, metres.
    pub centre: Point2<f64>,
    /// Direction of its first axis.
    pub turn: UnitComplex<f64>,
    /// Half extents, metres.
    pub half: Vector2<f64>,
    /// Extension, metres.
    pub radius: f64,
}

impl Outline {
    /// Outline of an object in its own frame; a round object stays round.
    fn from_body(body: &Body) -> Self {
        let bounds = body.collision_bounds(&Isometry3::identity());
        let bounds = bounds.unwrap_or(Bounds {
            min: [0.0; 3].into(),
            max: [0.0; 3].into(),
        });
        let half = bounds.size().xy() / 2.0;
        let centre = (bounds.min + bounds.size() / 2.0).xy();
        let reach = body.footprint_radius();
        let round = centre.coords.norm() < 1e-3 && reach < half.max() * 1.02;
        Self {
            centre,
            turn: UnitComplex::identity(),
            half: if round { Vector2::zeros() } else { half },
            radius: if round { reach } else { 0.0 },
        }
    }

    /// Outline of bounds in `house`.
    fn filling(bounds: &Bounds) -> Self {
        Self {
            centre: (bounds.min + bounds.size() / 2.0).xy(),
            turn: UnitComplex::identity(),
            half: bounds.size().xy() / 2.0,
            radius: 0.0,
        }
    }

    /// The outline at a pose.
    fn posed(&self, pose: &Isometry3<f64>) -> Self {
        let forward = pose.rotation * Vector3::x();
        let turn = UnitComplex::new(exact::atan2(forward.y, forward.x));
        Self {
            centre: Point2::from(pose.translation.vector.xy()) + turn * self.centre.coords,
            turn: turn * self.turn,
            ..*self
        }
    }

    /// Half of the extent along a direction, without the radius.
    fn extent(&self, along: &Vector2<f64>) -> f64 {
        let local = self.turn.inverse() * along;
        local.x.abs() * self.half.x + local.y.abs() * self.half.y
    }

    /// Distance to another outline, metres, never more than the true one; negative when
    /// they overlap.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let between = other.centre - self.centre;
        let apart = |axis: Vector2<f64>| {
            between.dot(&axis).abs() - self.extent(&axis) - other.extent(&axis)
        };
        let (x, y) = (Vector2::x(), Vector2::y());
        let mut most = apart(self.turn * x)
            .max(apart(self.turn * y))
            .max(apart(other.turn * x))
            .max(apart(other.turn * y));
        if let Some(axis) = between.try_normalize(1e-9) {
            most = most.max(apart(axis));
        }
        most - self.radius - other.radius
    }
}

/// Outline and height of a placed object.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedOutline {
    pub outline: Outline,
    /// Highest point in `house`, metres.
    pub top: f64,
}

/// The objects and furniture of a scene that must keep clear of each other.
pub(super) struct Clearance<'a> {
    scene: &'a Scene,
    /// Outlines of the objects in their own frames, with their heights.
    outlines: Vec<(Outline, f64)>,
    /// Parts of the furniture.
    furniture: Vec<(Bounds, Outline)>,
}

impl<'a> Clearance<'a> {
    /// For a scene with its present optional furniture.
    pub(super) fn new(scene: &'a Scene) -> Self {
        let part_bounds = |body: &Body, part: &Part| {
            let mut piece = body.clone();
            piece.hulls.clear();
            piece.collision = vec![part.clone()];
            piece.collision_bounds(&body.pose)
        };
        let furniture = scene
            .furniture
            .iter()
            .flat_map(|body| {
                let parts = body.collision.iter().filter_map(|p| part_bounds(body, p));
                let hulls = body.hulls.iter();
                let hulls = hulls.filter_map(|hull| {
                    Bounds::of_points(hull.iter().map(|point| body.pose * point))
                });
                parts.chain(hulls).collect::<Vec<_>>()
            })
            .map(|bounds| (bounds, Outline::filling(&bounds)))
            .collect();
        let top = |body: &Body| {
            let bounds = body.collision_bounds(&Isometry3::identity());
            bounds.map_or(0.0, |bounds| bounds.max.z)
        };
        let objects = scene.objects.iter();
        Self {
            scene,
            outlines: objects
                .map(|body| (Outline::from_body(body), top(body)))
                .collect(),
            furniture,
        }
    }

    /// The outline of a placed object. For an object that is not upright it is the
    /// rectangle around it along its level axis.
    pub(super) fn standing(&self, object: usize, placement: &Placement) -> PlacedOutline {
        let up = placement.pose.rotation * Vector3::z();
        if up.z < 0.9999 {
            return self.turned(object, &placement.pose);
        }
        let (outline, top) = &self.outlines[object];
        PlacedOutline {
            outline: outline.posed(&placement.pose),
            top: placement.pose.translation.z + top,
        }
    }

    fn turned(&self, object: usize, pose: &Isometry3<f64>) -> PlacedOutline {
        let body = &self.scene.objects[object];
        let level = Isometry3::from_parts(
            pose.translation,
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading(pose)),
        );
        let bounds = body.collision_bounds(&level.inv_mul(pose));
        let bounds = bounds.unwrap_or(Bounds {
            min: [0.0; 3].into(),
            max: [0.0; 3].into(),
        });
        PlacedOutline {
            outline: Outline::filling(&bounds).posed(&level),
            top: pose.translation.z + bounds.max.z,
        }
    }

    /// The smallest distance of `object` on its surface to the edges, the furniture and
    /// the other objects except its `holder`, metres; negative for an overlap.
    pub(super) fn distance(
        &self,
        object: usize,
        holder: Option<usize>,
        surface: &Surface,
        placements: &[Option<Placement>],
    ) -> f64 {
        let Some(placement) = &placements[object] else {
            return f64::INFINITY;
        };
        let outline = self.standing(object, placement).outline;
        let mut least = f64::INFINITY;
        let others = placements.iter().enumerate();
        let others = others.filter(|(i, _)| *i != object && Some(*i) != holder);
        for (i, other) in others {
            if let Some(other) = other {
                let other = self.standing(i, other).outline;
                least = least.min(outline.distance(&other) - GAP);
            }
        }
        if least < 0.0 {
            return least;
        }
        let body = &self.scene.objects[object];
        let on = surface.edge.inverse() * placement.pose;
        let (Some(on), Some(own)) = (
            body.collision_bounds(&on),
            body.collision_bounds(&placement.pose),
        ) else {
            return f64::INFINITY;
        };
        least = least
            .min(on.min.x)
            .min(surface.depth - on.max.x)
            .min(surface.width / 2.0 - on.max.y)
            .min(surface.width / 2.0 + on.min.y);
        for (bounds, other) in &self.furniture {
            let level = own.max.z.min(bounds.max.z) - own.min.z.max(bounds.min.z);
            if level > 0.001 {
                least = least.min(outline.distance(other) - GAP);
            }
        }
        least
    }
}
