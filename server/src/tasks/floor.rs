//! Starts anywhere: poses where the chair fits in the home and from which a path to an
//! area exists.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Translation3, Vector3};
use wheelarm_planning::floor_map::DRIVE_CLEARANCE;
use wheelarm_planning::footprint_check::{FootprintCheck, Limb, Outline, Pose2, occupied};
use wheelarm_planning::hybrid_a_star::{self, PathPreferences};
use wheelarm_planning::obb::Obb;
use wheelarm_proto::exact;
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::settings::Starts;

use super::area::{AreaSpec, Range, Variant};
use super::random::{index, number, stream};
use crate::people::{Capsule, HeadPose, Person};
use crate::robot::RobotModel;
use crate::scene::{Body, Scene};

/// Clearance around the chair at its start, metres.
const ROOM: f64 = 0.10;
/// Number of sampled places.
const TRIES: usize = 400;
/// Rounds of sampled places for a start with the target in view.
const SEEN_TRIES: u64 = 8;
/// Nodes that the path search expands per place: enough for the far end of the home,
/// and little where no path exists.
const NODES: usize = 6_000;
/// Distances of the chair's frame from the edge of a surface, or from furniture
/// on a joint, at which it would stop, metres.
const STOPS: [f64; 4] = [0.95, 1.15, 1.35, 1.6];
/// Furniture on a joint blocks the chair's path out to this position, metres.
const AJAR: f64 = 0.12;
/// The same of furniture that turns, radians.
const AJAR_TURN: f64 = 0.35;
/// Samples of the arm's path home from a posture.
const WAY_HOME: u32 = 20;
/// Driving preferences, as of the scripted operator without haste.
const PREFERENCES: PathPreferences = PathPreferences {
    radius: 0.8,
    margin: DRIVE_CLEARANCE,
};

/// The floor of a home with one robot on it.
#[derive(Clone, Debug)]
pub struct Floor {
    /// The chair, with the person if it is occupied.
    pub(super) check: FootprintCheck,
    /// The empty chair; `None` when `check` is that already.
    empty: Option<FootprintCheck>,
    home: [f64; 6],
    /// Postures of the arm that are clear of the person.
    postures: Vec<[f64; 6]>,
    /// Knuckle angle of the closed gripper, radians.
    closed: f64,
}

/// Start of the robot.
pub(super) struct Start {
    pub pose: Isometry3<f64>,
    /// `None` for home.
    pub arm: Option<[f64; 6]>,
    /// `None` for open.
    pub knuckle: Option<f64>,
    /// Places sampled before and rejected because of the person.
    pub rejected: u32,
}

impl Floor {
    /// The floor of `scene` with its furniture, for an empty chair.
    #[must_use]
    pub fn new(model: &RobotModel, scene: &Scene) -> Self {
        let settings = &model.settings;
        Self {
            check: footprint_check(model, scene, &[]),
            empty: None,
            home: settings.home,
            postures: settings.postures.clone(),
            closed: settings.gripper.closed,
        }
    }

    /// The floor for a chair with `person`: knees, shins, feet and elbows are part of
    /// the footprint. `is_clear` tests whether the arm is clear of the person with its
    /// joints at these positions, radians. A posture counts only when the straight path
    /// home in joint space is clear too.
    #[must_use]
    pub fn occupied(
        model: &RobotModel,
        scene: &Scene,
        person: &Person,
        is_clear: impl Fn(&[f64; 6]) -> bool,
    ) -> Self {
        let head = HeadPose::default();
        let limb = |capsule: &Capsule| Limb {
            ends: person.ends(capsule, &head).map(|end| end.coords.into()),
            radius: capsule.radius,
        };
        let limbs: Vec<Limb> = person.capsules.iter().map(limb).collect();
        let empty = Self::new(model, scene);
        let way_home = |posture: &[f64; 6]| {
            (0..=WAY_HOME).all(|step| {
                let share = f64::from(step) / f64::from(WAY_HOME);
                is_clear(&std::array::from_fn(|i| {
                    posture[i] + (empty.home[i] - posture[i]) * share
                }))
            })
        };
        let postures = empty.postures.iter().copied().filter(way_home);
        Self {
            check: footprint_check(model, scene, &limbs),
            postures: postures.collect(),
            empty: Some(empty.check),
            ..empty
        }
    }

    /// Samples a start uniformly over the poses where the chair fits with clearance and
    /// has a path to the area, with arm and gripper in any of their postures. `None`
    /// when none was found.
    pub(super) fn start(
        &self,
        area: &AreaSpec,
        variant: &Variant,
        scene: &Scene,
        seed: u64,
    ) -> Option<Start> {
        self.start_where(area, variant, scene, seed, &|_| true)
    }

    /// As `start`, restricted to poses that `accepts` holds for.
    fn start_where(
        &self,
        area: &AreaSpec,
        variant: &Variant,
        scene: &Scene,
        seed: u64,
        accepts: &dyn Fn(&Isometry3<f64>) -> bool,
    ) -> Option<Start> {
        let goal = self.stop(area, variant, scene)?;
        let mut random = stream(&area.name, seed, "posture");
        let mut rejected = 0;
        // Home is the last; it is clear of every person who fits the chair.
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
            let pose = Isometry3::new(
                Vector3::new(place.x, place.y, 0.0),
                Vector3::z() * place.heading,
            );
            if !accepts(&pose) {
                continue;
            }
            let free = self.check.is_free(&place, ROOM) && self.is_inside(scene, &place);
            let way = || {
                let check = &self.check;
                hybrid_a_star::has_path(check, place, goal, &PREFERENCES, NODES)
            };
            let empty = self.empty.as_ref().filter(|_| !free);
            if empty.is_some_and(|check| check.is_free(&place, ROOM))
                && self.is_inside(scene, &place)
            {
                rejected += 1;
            }
            if free && way() {
                return Some(Start {
                    pose,
                    arm: Some(arm),
                    knuckle: Some(knuckle),
                    rejected,
                });
            }
        }
        None
    }

    /// Samples a start that `sees` the target: anywhere, or near the area with its own
    /// heading. `None` when none was found.
    pub(crate) fn start_in_view(
        &self,
        area: &AreaSpec,
        variant: &Variant,
        scene: &Scene,
        (seed, starts): (u64, Starts),
        sees: &dyn Fn(&Isometry3<f64>) -> bool,
    ) -> Option<Isometry3<f64>> {
        if starts == Starts::Anywhere {
            // Few places have the target in view: continue the stream.
            let tries = (0..SEEN_TRIES).map(|more| seed ^ (more << 48));
            let mut found = tries.map(|seed| self.start_where(area, variant, scene, seed, sees));
            return found.find_map(|start| Some(start?.pose));
        }
        let mut random = stream(&area.name, seed, "view");
        let near = &area.start;
        for _ in 0..TRIES {
            let place = Pose2 {
                x: number(&mut random, near.x),
                y: number(&mut random, near.y),
                heading: number(&mut random, Range { min: -PI, max: PI }),
            };
            let pose = Isometry3::new(
                Vector3::new(place.x, place.y, 0.0),
                Vector3::z() * place.heading,
            );
            if sees(&pose) && self.check.is_free(&place, ROOM) {
                return Some(pose);
            }
        }
        None
    }

    /// Poses on a grid of `spacing` metres and eight headings from which the chair
    /// could start.
    #[cfg(test)]
    pub(crate) fn start_poses(
        &self,
        area: &AreaSpec,
        variant: &Variant,
        scene: &Scene,
        spacing: f64,
    ) -> Vec<Pose2> {
        let goal = self.stop(area, variant, scene).expect("a place to stop");
        let [x0, x1, y0, y1] = self.check.bounds();
        let steps = |from: f64, to: f64| 0..((to - from) / spacing) as usize;
        let cells = steps(x0, x1).flat_map(|i| steps(y0, y1).map(move |j| (i, j)));
        let poses = cells.flat_map(|(i, j)| {
            (0..8).map(move |k| Pose2 {
                x: x0 + i as f64 * spacing,
                y: y0 + j as f64 * spacing,
                heading: f64::from(k) * PI / 4.0,
            })
        });
        let starts = |place: &Pose2| {
            self.check.is_free(place, ROOM)
                && self.is_inside(scene, place)
                && hybrid_a_star::has_path(&self.check, *place, goal, &PREFERENCES, NODES)
        };
        poses.filter(starts).collect()
    }

    /// Estimated driving time from `start` to a stop in front of an area, s; `None`
    /// without a path.
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

    /// Whether a place is on the floor, which is the first piece of furniture.
    fn is_inside(&self, scene: &Scene, place: &Pose2) -> bool {
        let floor = scene.furniture.first();
        let bounds = floor.and_then(|floor| floor.collision_bounds(&floor.pose));
        bounds.is_none_or(|bounds| {
            (bounds.min.x..=bounds.max.x).contains(&place.x)
                && (bounds.min.y..=bounds.max.y).contains(&place.y)
        })
    }

    /// The pose at which the chair would stop in front of an area, facing it.
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
                // A drawer is pulled along its axis; a door is approached as its handle is.
                let (at, into) = match (joint.motion, body.grasps.first()) {
                    (JointMotion::Turns, Some(grasp)) => {
                        let handle = body.pose * grasp.pose;
                        (handle.translation.vector, handle.rotation * Vector3::z())
                    }
                    _ => (body.pose.translation.vector, -joint.axis.into_inner()),
                };
                let turn = exact::atan2(into.y, into.x);
                Isometry3::new(at, Vector3::z() * turn)
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

/// Footprint check of the chair against the furniture of `scene`, including the
/// person's limbs.
fn footprint_check(model: &RobotModel, scene: &Scene, limbs: &[Limb]) -> FootprintCheck {
    let outlines = model.settings.outlines.iter();
    let outlines: Vec<_> = outlines
        .map(|o| (o.top, Outline { sides: o.footprint }))
        .collect();
    let mut check = FootprintCheck::from_outlines(occupied(&outlines, limbs));
    for (index, body) in scene.furniture.iter().enumerate() {
        let mut out = body.clone();
        if let Some(joint) = scene.joint_of(index) {
            let ajar = match joint.motion {
                JointMotion::Slides => AJAR,
                JointMotion::Turns => AJAR_TURN.min(joint.travel),
            };
            out.pose = joint.pose(&out.pose, ajar);
        }
        for obb in collision_boxes(body).chain(collision_boxes(&out)) {
            check.put(obb.rectangle(), obb.heights());
        }
    }
    check
}

/// Boxes around the colliding parts of furniture, in `house`.
pub fn collision_boxes(body: &Body) -> impl Iterator<Item = Obb> + '_ {
    body.collision_boxes().map(|(body_from_box, half)| Obb {
        pose: body.pose * body_from_box,
        half,
        round: false,
    })
}
