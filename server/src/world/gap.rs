//! Distances of the seated person to the robot, to objects and to furniture, between
//! the engine's own shapes: the input of the guard (`sim/person_guard`).

use nalgebra::Vector3;
use rapier3d::math::Pose;
use rapier3d::parry::bounding_volume::{Aabb, BoundingVolume as _};
use rapier3d::parry::query;
use rapier3d::prelude::{Collider, PhysicsWorld, QueryFilter, Shape, TypedShape};
use wheelarm_proto::TICKS_PER_CONTROL;

use super::World;
use super::contact::body_of;
use super::convert::{from_vector, real};
use crate::snapshot::BodyRef;

/// The nearest points of two shapes. Positions and directions are in `house`, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Body of the first shape.
    pub first: BodyRef,
    /// Body of the second shape.
    pub second: BodyRef,
    /// Point of the first shape that is nearest to the second.
    pub point: Vector3<f64>,
    /// Unit vector from the first shape to the second.
    pub normal: Vector3<f64>,
    /// Distance, m; negative: penetration depth.
    pub distance: f64,
    /// Speed at which the second shape moves towards the first on its own, m/s: the
    /// person's head. Motion of the chair is excluded.
    pub closing: f64,
    /// Corners of a box that contains the first shape.
    pub corners: [Vector3<f64>; 8],
}

/// A shape at a pose.
struct Placed<'a> {
    body: BodyRef,
    pose: Pose,
    shape: &'a dyn Shape,
    bounds: Aabb,
}

impl<'a> Placed<'a> {
    fn new(body: BodyRef, pose: Pose, shape: &'a dyn Shape) -> Self {
        let bounds = shape.compute_aabb(&pose);
        Self {
            body,
            pose,
            shape,
            bounds,
        }
    }

    /// The gap to another shape if it is below `range` metres. Measured between cores:
    /// for overlapping shapes the search for the depth (EPA, single precision)
    /// sometimes returns the wrong side, and rounded cores overlap only at deep
    /// penetration.
    fn gap(&self, other: &Self, range: f64) -> Option<Gap> {
        let (one, two) = (&self.pose, &other.pose);
        let ((own, rim), (others, other_rim)) = (core(self.shape), core(other.shape));
        let rims = rim + other_rim;
        let nearest = query::contact(one, own, two, others, real(range) + rims).ok()??;
        let distance = f64::from(nearest.dist - rims);
        let normal = from_vector(nearest.normal1);
        let point = from_vector(nearest.point1) + normal * f64::from(rim);
        let finite = normal.iter().chain(point.iter()).all(|x| x.is_finite());
        if !finite || distance.is_nan() || distance >= range {
            return None;
        }
        let own = self.shape.compute_local_aabb();
        let (centre, half) = (own.center(), own.half_extents());
        let corners = std::array::from_fn(|i| {
            let mut corner = centre;
            for axis in 0..3 {
                let sign = if i & (1 << axis) == 0 { -1.0 } else { 1.0 };
                corner[axis] += sign * half[axis];
            }
            from_vector(self.pose.transform_point(corner))
        });
        Some(Gap {
            first: self.body,
            second: other.body,
            point,
            normal,
            distance,
            closing: 0.0,
            corners,
        })
    }
}

/// A shape without its round rim, and the radius of the rim, metres.
fn core(shape: &dyn Shape) -> (&dyn Shape, f32) {
    match shape.as_typed_shape() {
        TypedShape::Capsule(capsule) => (&capsule.segment, capsule.radius),
        TypedShape::RoundCuboid(round) => (&round.inner_shape, round.border_radius),
        TypedShape::RoundCylinder(round) => (&round.inner_shape, round.border_radius),
        TypedShape::RoundConvexPolyhedron(round) => (&round.inner_shape, round.border_radius),
        _ => (shape, 0.0),
    }
}

impl World {
    /// Gaps below `range` metres between these links and objects and the person, posed
    /// as in the coming control tick. Empty without a person.
    #[must_use]
    pub fn gaps_to_person(&self, bodies: &[BodyRef], range: f64) -> Vec<Gap> {
        let Some(seated) = &self.seated else {
            return Vec::new();
        };
        let movers = self.placed(bodies);
        let coming = seated.capsules(&self.physics, self.tick + TICKS_PER_CONTROL);
        let mut gaps = Vec::new();
        for (index, collider, pose) in coming {
            let capsule = Placed::new(BodyRef::Person(index), pose, collider.shape());
            let near = capsule.bounds.loosened(real(range));
            for mover in movers.iter().filter(|m| m.bounds.intersects(&near)) {
                let Some(mut gap) = mover.gap(&capsule, range) else {
                    continue;
                };
                // The same point of the capsule at its present pose.
                let at = gap.point + gap.normal * gap.distance;
                let now = place(&self.physics, collider);
                if now != pose {
                    let on = pose.inverse_transform_point(super::convert::vector(&at));
                    let moved = at - from_vector(now.transform_point(on));
                    let control = f64::from(self.physics.integration_parameters.dt)
                        * TICKS_PER_CONTROL as f64;
                    gap.closing = -moved.dot(&gap.normal) / control;
                }
                gaps.push(gap);
            }
        }
        gaps
    }

    /// Gaps below `range` metres between the person, with these links and objects, and
    /// furniture other than the floor. Unordered.
    #[must_use]
    pub fn gaps_to_furniture(&self, bodies: &[BodyRef], range: f64) -> Vec<Gap> {
        let mut movers = self.placed(bodies);
        if let Some(seated) = &self.seated {
            let capsules = seated.capsules(&self.physics, self.tick);
            movers.extend(capsules.into_iter().map(|(index, collider, pose)| {
                Placed::new(BodyRef::Person(index), pose, collider.shape())
            }));
        }
        let bounds = movers.iter().map(|mover| mover.bounds);
        let Some(all) = bounds.reduce(|one, other| one.merged(&other)) else {
            return Vec::new();
        };
        let physics = &self.physics;
        let pipeline = physics.broad_phase.as_query_pipeline(
            physics.narrow_phase.query_dispatcher(),
            &physics.bodies,
            &physics.colliders,
            QueryFilter::default(),
        );
        let mut gaps = Vec::new();
        for (_, collider) in pipeline.intersect_aabb_conservative(all.loosened(real(range))) {
            let body = body_of(collider.user_data);
            if !matches!(body, BodyRef::Furniture(index) if index != 0) {
                continue;
            }
            let solid = Placed::new(body, place(physics, collider), collider.shape());
            let near = solid.bounds.loosened(real(range));
            let movers = movers.iter().filter(|m| m.bounds.intersects(&near));
            gaps.extend(movers.filter_map(|mover| mover.gap(&solid, range)));
        }
        gaps
    }

    /// The shapes of links and objects.
    fn placed(&self, bodies: &[BodyRef]) -> Vec<Placed<'_>> {
        let mut placed = Vec::new();
        for &body in bodies {
            let Some(handle) = self.handle(body) else {
                continue;
            };
            let colliders = self.physics.bodies[handle].colliders().iter();
            let colliders = colliders.filter_map(|c| self.physics.colliders.get(*c));
            // Links without relative motion share an engine body.
            let own = colliders.filter(|c| body_of(c.user_data) == body);
            placed.extend(own.map(|c| Placed::new(body, place(&self.physics, c), c.shape())));
        }
        placed
    }
}

/// Pose of a shape after the last tick.
pub(super) fn place(physics: &PhysicsWorld, collider: &Collider) -> Pose {
    let body = collider.parent().and_then(|body| physics.bodies.get(body));
    match (body, collider.position_wrt_parent()) {
        (Some(body), Some(own)) => *body.position() * *own,
        _ => *collider.position(),
    }
}
