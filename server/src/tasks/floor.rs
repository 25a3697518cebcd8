//! Starts anywhere: where the chair fits in the home and from where it finds its
//! way to an area.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Translation3, Vector3};
use wheelarm_proto::exact;
use wheelarm_route::footprint_check::{FootprintCheck, Outline, Pose2};
use wheelarm_route::hybrid_a_star::{self, PathPreferences};
use wheelarm_route::obb::Obb;

use super::area::{AreaSpec, Range, Variant};
use super::random::{index, number, stream};
use crate::geometry::bounds;
use crate::robot::RobotModel;
use crate::scene::{Body, Scene};

/// Room around the chair where it starts, metres.
const ROOM: f64 = 0.10;
/// Places that are looked at.
const TRIES: usize = 400;
/// Poses that the search for a way looks at from one place: enough for the far
/// end of the home, and little where there is no way.
const NODES: usize = 6_000;
/// Distances of the chair's frame from the edge of a surface, or from furniture
/// that slides, at which it would stop there, metres.
const STOPS: [f64; 4] = [0.95, 1.15, 1.35, 1.6];
/// How the chair would drive: as the scripted operator, with no haste.
const PREFERENCES: PathPreferences = PathPreferences {
    radius: 0.8,
    margin: 0.05,
};

/// The floor of a home with one robot on it.
#[derive(Clone, Debug)]
pub struct Floor {
    pub(super) check: FootprintCheck,
    home: [f64; 6],
    postures: Vec<[f64; 6]>,
    /// Knuckle angle of the closed gripper, radians.
    closed: f64,
}

/// Where and how the robot starts.
pub(super) struct Start {
    pub pose: Isometry3<f64>,
    /// `None` for home.
    pub arm: Option<[f64; 6]>,
    /// `None` for open.
    pub knuckle: Option<f64>,
}

impl Floor {
    /// The floor of `scene` with the furniture that stands there.
    #[must_use]
    pub fn new(model: &RobotModel, scene: &Scene) -> Self {
        let settings = &model.settings;
        let outlines = settings.outlines.iter();
        let outlines = outlines.map(|o| (o.top, Outline { sides: o.footprint }));
        let mut check = FootprintCheck::of(outlines);
        for obb in scene.furniture.iter().flat_map(boxes) {
            check.put(obb.rectangle(), obb.heights());
        }
        Self {
            check,
            home: settings.home,
            postures: settings.postures.clone(),
            closed: settings.gripper.closed,
        }
    }

    /// A start anywhere, uniform over where the chair fits with room and has a
    /// way to the area; arm and gripper in any of their postures. `None` when
    /// none was found.
    pub(super) fn start(
        &self,
        area: &AreaSpec,
        variant: &Variant,
        scene: &Scene,
        seed: u64,
    ) -> Option<Start> {
        let goal = self.stop(area, variant, scene)?;
        let mut random = stream(&area.name, seed, "posture");
        let posture = index(&mut random, self.postures.len() + 1);
        let arm = self.postures.get(posture).copied().unwrap_or(self.home);
        let knuckle = [0.0, self.closed][index(&mut random, 2)];
        let mut random = stream(&area.name, seed, "anywhere");
        let [x0, x1, y0, y1] = self.check.bounds();
        let range = |min, max| Range { min, max };
        for _ in 0..TRIES {
            let place = Pose2 {
                x: number(&mut random, range(x0, x1)),
                y: number(&mut random, range(y0, y1)),
                heading: number(&mut random, range(-PI, PI)),
            };
            let free = self.check.is_free(&place, ROOM) && self.is_inside(scene, &place);
            let way = || {
                let check = &self.check;
                hybrid_a_star::has_path(check, place, goal, &PREFERENCES, NODES)
            };
            if free && way() {
                let pose = Isometry3::new(
                    Vector3::new(place.x, place.y, 0.0),
                    Vector3::z() * place.heading,
                );
                return Some(Start {
                    pose,
                    arm: Some(arm),
                    knuckle: Some(knuckle),
                });
            }
        }
        None
    }

    /// The rough seconds of the chair's way from `start` to where it would stop in
    /// front of an area; `None` when none is found.
    #[must_use]
    pub fn way_seconds(
        &self,
        start: &Isometry3<f64>,
        area: &AreaSpec,
        variant: &Variant,
        scene: &Scene,
    ) -> Option<f64> {
        let goal = self.stop(area, variant, scene)?;
        let forward = start.rotation * Vector3::x();
        let start = Pose2 {
            x: start.translation.x,
            y: start.translation.y,
            heading: exact::atan2(forward.y, forward.x),
        };
        let path = hybrid_a_star::rough_path(&self.check, start, goal, &PREFERENCES, NODES)?;
        Some(path.cost)
    }

    /// Whether a place lies on the floor, which is the first piece of furniture.
    fn is_inside(&self, scene: &Scene, place: &Pose2) -> bool {
        let floor = scene.furniture.first();
        let bounds = floor.and_then(|floor| floor.collision_bounds(&floor.pose));
        bounds.is_none_or(|bounds| {
            (bounds.min.x..=bounds.max.x).contains(&place.x)
                && (bounds.min.y..=bounds.max.y).contains(&place.y)
        })
    }

    /// Where the chair would stop in front of an area, facing it.
    fn stop(&self, area: &AreaSpec, variant: &Variant, scene: &Scene) -> Option<Pose2> {
        let surface = variant
            .places
            .first()
            .and_then(|place| scene.surface_named(&place.on, place.surface.as_deref()));
        let edge = match surface {
            Some(surface) => surface.edge,
            None => {
                let body = area.sliding(scene).next()?;
                let joint = scene.joint_of(scene.furniture_named(&body.name)?)?;
                let into = -joint.axis.into_inner();
                let turn = exact::atan2(into.y, into.x);
                Isometry3::new(body.pose.translation.vector, Vector3::z() * turn)
            }
        };
        let facing = edge.rotation * Vector3::x();
        STOPS.into_iter().find_map(|far| {
            let at = edge * Translation3::new(-far, 0.0, 0.0);
            let stop = Pose2 {
                x: at.translation.x,
                y: at.translation.y,
                heading: exact::atan2(facing.y, facing.x),
            };
            self.check.is_free(&stop, ROOM / 2.0).then_some(stop)
        })
    }
}

/// Boxes around the parts of furniture that collide, in `house`.
fn boxes(body: &Body) -> impl Iterator<Item = Obb> + '_ {
    body.collision.iter().filter_map(|part| {
        let (centre, half) = bounds(&part.shape)?;
        Some(Obb {
            pose: body.pose * part.pose * Translation3::from(centre),
            half,
            round: false,
        })
    })
}
