//! Clearance between things that are placed on surfaces: footprints and what they keep clear of.

use nalgebra::{Isometry3, Point2, UnitComplex, Vector2, Vector3};
use wheelarm_proto::exact;

use super::spec::TaskSpec;
use crate::geometry::Part;
use crate::scene::{Body, Bounds, Placement, Scene, Surface};

/// Least distance between two objects, metres.
const GAP: f64 = 0.02;
/// Half of the width that the open gripper needs on its way to the target, metres.
const LANE: f64 = 0.09;
/// Half of the length of the gripper's way before the target, metres.
const LANE_LENGTH: f64 = 0.5;

/// The outline of a thing on the floor plan: a rectangle grown by a radius.
#[derive(Clone, Copy, Debug)]
struct Footprint {
    /// Middle of the rectangle, metres.
    centre: Point2<f64>,
    /// Direction of its first axis.
    turn: UnitComplex<f64>,
    /// Half extents, metres.
    half: Vector2<f64>,
    /// What it is grown by, metres.
    radius: f64,
}

impl Footprint {
    /// Of an object in its own frame; what is round stays round.
    fn of(body: &Body) -> Self {
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

    /// Of something that fills bounds in `house`.
    fn filling(bounds: &Bounds) -> Self {
        Self {
            centre: (bounds.min + bounds.size() / 2.0).xy(),
            turn: UnitComplex::identity(),
            half: bounds.size().xy() / 2.0,
            radius: 0.0,
        }
    }

    /// The same at a pose.
    fn at(&self, pose: &Isometry3<f64>) -> Self {
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

    /// Distance to another outline, metres, never more than the true one; below
    /// zero when they overlap.
    fn distance(&self, other: &Self) -> f64 {
        let between = other.centre - self.centre;
        let mut axes = vec![
            self.turn * Vector2::x(),
            self.turn * Vector2::y(),
            other.turn * Vector2::x(),
            other.turn * Vector2::y(),
        ];
        axes.extend(between.try_normalize(1e-9));
        axes.iter()
            .map(|axis| between.dot(axis).abs() - self.extent(axis) - other.extent(axis))
            .fold(f64::NEG_INFINITY, f64::max)
            - self.radius
            - other.radius
    }
}

/// What the objects of a task must keep clear of.
pub(super) struct PlacementClearance<'a> {
    scene: &'a Scene,
    outlines: Vec<Footprint>,
    /// Parts of the furniture.
    furniture: Vec<(Bounds, Footprint)>,
    /// Way of the hand to the region in which the target is put.
    region: Option<Footprint>,
}

impl<'a> PlacementClearance<'a> {
    pub(super) fn new(spec: &TaskSpec, scene: &'a Scene) -> Self {
        let part_bounds = |body: &Body, part: &Part| {
            let mut piece = body.clone();
            piece.hulls.clear();
            piece.collision = vec![part.clone()];
            piece.collision_bounds(&body.pose)
        };
        let furniture = scene
            .furniture
            .iter()
            .filter(|body| !body.optional || spec.region_name() == Some(body.name.as_str()))
            .flat_map(|body| {
                let parts = body.collision.iter().filter_map(|p| part_bounds(body, p));
                let mut hulls = body.clone();
                hulls.collision.clear();
                parts
                    .chain(hulls.collision_bounds(&body.pose))
                    .collect::<Vec<_>>()
            })
            .map(|bounds| (bounds, Footprint::filling(&bounds)))
            .collect();
        Self {
            scene,
            outlines: scene.objects.iter().map(Footprint::of).collect(),
            furniture,
            region: spec.region(scene).map(|region| {
                let outwards = -(region.edge.rotation * Vector3::x()).xy();
                lane(
                    Point2::from(region.centre().translation.vector.xy()),
                    outwards,
                    region.width / 2.0,
                )
            }),
        }
    }

    /// The least distance that `object` on its surface leaves to what already
    /// stands there, metres; below zero something overlaps.
    pub(super) fn clearance(
        &self,
        object: usize,
        surface: &Surface,
        placements: &[Option<Placement>],
        target: Option<(usize, &Surface)>,
    ) -> f64 {
        let Some(placement) = &placements[object] else {
            return f64::INFINITY;
        };
        let body = &self.scene.objects[object];
        let on = surface.edge.inverse() * placement.pose;
        let (Some(on), Some(own)) = (
            body.collision_bounds(&on),
            body.collision_bounds(&placement.pose),
        ) else {
            return f64::INFINITY;
        };
        let mut least = on
            .min
            .x
            .min(surface.depth - on.max.x)
            .min(surface.width / 2.0 - on.max.y)
            .min(surface.width / 2.0 + on.min.y);
        let outline = self.outlines[object].at(&placement.pose);
        for (bounds, other) in &self.furniture {
            let level = own.max.z.min(bounds.max.z) - own.min.z.max(bounds.min.z);
            if level > 0.001 {
                least = least.min(outline.distance(other) - GAP);
            }
        }
        let others = placements.iter().enumerate().filter(|(i, _)| *i != object);
        for (i, other) in others {
            if let Some(other) = other {
                let other = self.outlines[i].at(&other.pose);
                least = least.min(outline.distance(&other) - GAP);
            }
        }
        let Some((target, carrier)) = target else {
            return least;
        };
        let way = self.approach(target, carrier, placements);
        if target == object {
            let others = placements.iter().enumerate().filter(|(i, _)| *i != target);
            for (way, (i, other)) in way.iter().flat_map(|w| others.clone().map(move |o| (w, o))) {
                if let Some(other) = other {
                    let other = self.outlines[i].at(&other.pose);
                    least = least.min(way.distance(&other));
                }
            }
        } else {
            for way in way.iter().chain(&self.region) {
                least = least.min(way.distance(&outline));
            }
        }
        least
    }

    /// The lane of the hand from the target out over the approach edge, along
    /// the grasp that fits that side best.
    fn approach(
        &self,
        target: usize,
        surface: &Surface,
        placements: &[Option<Placement>],
    ) -> Option<Footprint> {
        let pose = placements[target].as_ref()?.pose;
        let inwards = (surface.edge.rotation * Vector3::x()).xy();
        let direction = self.scene.objects[target]
            .grasps
            .iter()
            .map(|grasp| {
                let z = pose.rotation * grasp.pose.rotation * Vector3::z();
                // From above the arm comes over the edge all the same.
                if grasp.symmetric || z.xy().norm() < 0.5 {
                    inwards
                } else {
                    z.xy()
                }
            })
            .max_by(|a, b| a.dot(&inwards).total_cmp(&b.dot(&inwards)))?;
        let from = Point2::from(pose.translation.vector.xy());
        Some(lane(from, -direction.normalize(), LANE))
    }
}

/// A lane that begins at a point and is twice as wide as `half`.
fn lane(from: Point2<f64>, direction: Vector2<f64>, half: f64) -> Footprint {
    Footprint {
        centre: from + direction * LANE_LENGTH,
        turn: UnitComplex::new(exact::atan2(direction.y, direction.x)),
        half: Vector2::new(LANE_LENGTH, 0.0),
        radius: half,
    }
}
