//! Starts anywhere: poses where the chair fits in the home and from which a path to an
//! area exists. By the first rules of sampling each is searched for; by the maps
//! ([`Floor::by_maps`]) they are sampled from the floor map.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use wheelarm_pack::Indoors;
use wheelarm_planning::arm_access::FURTHEST;
use wheelarm_planning::floor_map::DRIVE_CLEARANCE;
use wheelarm_planning::footprint_check::{FootprintCheck, Limb, Outline, Pose2, occupied};
use wheelarm_planning::hybrid_a_star::{self, PathPreferences};
use wheelarm_planning::obb::Obb;
use wheelarm_planning::posture_routes::PostureRoutes;
use wheelarm_planning::postures::{Posture, changing};
use wheelarm_planning::reach_map::ReachMap;
use wheelarm_proto::exact;
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::settings::Starts;

use super::area::{AreaSpec, Range, StartSpec, Variant};
use super::drivable::{Drivable, Ground};
use super::grasp_reach::{GraspReach, Solid};
use super::pushing_arm::PushingArm;
use super::random::{index, number, stream};
use crate::people::{Capsule, HeadPose, Person};
use crate::robot::{CorridorSettings, OutlineSettings, RobotModel};
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

/// Outlines by height, bottom up: upper end in metres, and outline.
type Outlines = Vec<(f64, Outline)>;

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
    /// The travel posture, where the arm is clear of the person in it: outlines of the
    /// robot, and positions of the arm, radians.
    travel: Option<(Outlines, [f64; 6])>,
    /// The arm's base in the chair, x and y, metres.
    mount: [f64; 2],
    /// Least and greatest distance from the arm's base to a grasp, metres.
    pub(super) range: [f64; 2],
    pub(super) arm: PushingArm,
    /// Space that the hand needs.
    hand: CorridorSettings,
    maps: Option<Maps>,
}

/// What sampling by the maps needs.
#[derive(Clone, Debug)]
struct Maps {
    /// Whether starts are anywhere; otherwise they are near.
    is_anywhere: bool,
    ground: Ground,
    /// Boxes of the furniture.
    solids: Vec<Solid>,
    /// The arm's reach; `None` for a robot without a reach map.
    reach: Option<ReachMap>,
    /// The inside of the home; `None` where the scene has no rooms.
    indoors: Option<Indoors>,
    /// Bounds of the floor: x min, x max, y min, y max, metres.
    floor: Option<[f64; 4]>,
    /// Start of the scene.
    home: Pose2,
}

impl Maps {
    /// Whether a start may be at a place.
    fn is_inside(&self, place: &Pose2) -> bool {
        match &self.indoors {
            Some(indoors) => indoors.contains([place.x, place.y]),
            None => self.floor.is_none_or(|bounds| is_within(bounds, place)),
        }
    }
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
        let travel = settings.travel.as_ref();
        let reach = &settings.reach;
        Self {
            check: footprint_check(occupied(&outlines(&settings.outlines), &[]), scene),
            empty: None,
            home: settings.home,
            postures: settings.postures.clone(),
            closed: settings.gripper.closed,
            travel: travel.map(|travel| (outlines(&travel.outlines), travel.joints)),
            mount: [0, 1].map(|i| model.arm_mount().translation.vector[i]),
            range: [reach.nearest, reach.furthest.min(FURTHEST)],
            arm: PushingArm::new(model),
            hand: settings.gripper.corridor,
            maps: None,
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
        let limbs = limbs(person);
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
        let postures = postures.collect();
        let travel = empty.travel.as_ref().filter(|(_, arm)| way_home(arm));
        let travel = travel.map(|(outlines, arm)| (occupied(outlines, &limbs), *arm));
        let of_robot = outlines(&model.settings.outlines);
        Self {
            check: footprint_check(occupied(&of_robot, &limbs), scene),
            postures,
            travel,
            empty: Some(empty.check),
            ..empty
        }
    }

    /// The same floor for sampling by the maps: starts are uniform over the floor from which
    /// the area is reached, and objects are in the arm's `reach` from there.
    #[must_use]
    pub fn by_maps(self, scene: &Scene, reach: Option<ReachMap>, starts: Starts) -> Self {
        let home = on_floor(&scene.start);
        // Homes of packs start with closed doors and drawers. Ajar ones would leave no stop
        // before a worktop.
        let ajar = scene.pack.is_none();
        let levels = self.check.levels.iter();
        let outlines: Outlines = levels.map(|level| (level.top, level.outline)).collect();
        let bounded = |check| {
            let mut check = among(check, scene, ajar);
            let boxes = scene.furniture.iter().flat_map(collision_boxes);
            check.put_edges(boxes.map(|obb| (obb.rectangle(), obb.heights())));
            check
        };
        let of_outlines =
            |outlines: &Outlines| bounded(FootprintCheck::from_outlines(outlines.clone()));
        let travel = self.travel.as_ref();
        let routes = PostureRoutes {
            home: of_outlines(&outlines),
            stowed: travel.map(|(travel, _)| {
                let change = changing(&outlines, travel, self.mount);
                [of_outlines(travel), bounded(change)]
            }),
        };
        let ground = Ground::new(routes, &home);
        let solids = scene.furniture.iter().enumerate();
        let solids = solids.flat_map(|(furniture, body)| {
            collision_boxes(body).map(move |obb| Solid {
                furniture,
                outline: obb.rectangle(),
                heights: obb.heights(),
            })
        });
        let file = scene.pack.as_ref().and_then(|pack| pack.home());
        let maps = Maps {
            is_anywhere: starts == Starts::Anywhere,
            ground,
            solids: solids.collect(),
            reach,
            indoors: file.and_then(Indoors::of),
            floor: floor_bounds(scene),
            home,
        };
        Self {
            maps: Some(maps),
            ..self
        }
    }

    /// Whether starts are sampled anywhere.
    pub(super) fn is_anywhere(&self) -> bool {
        self.maps.as_ref().is_none_or(|maps| maps.is_anywhere)
    }

    /// The floor that the chair gets to from the near start of an area; `None` without maps.
    pub(super) fn drivable(&self, area: &AreaSpec) -> Option<Drivable> {
        let maps = self.maps.as_ref()?;
        Some(Drivable::new(
            &maps.ground,
            &middle(&area.start),
            &maps.home,
        ))
    }

    /// The test whether objects are in the arm's reach from a floor; `None` without a reach
    /// map.
    pub(super) fn grasp_reach<'a>(&'a self, drivable: &'a Drivable) -> Option<GraspReach<'a>> {
        let maps = self.maps.as_ref()?;
        Some(GraspReach {
            reach: maps.reach.as_ref()?,
            range: self.range,
            drivable,
            solids: &maps.solids,
            hand: self.hand,
        })
    }

    /// Whether the chair has a path from `start`, with its arm at these positions, to one of
    /// `stops`.
    pub(super) fn has_path(
        &self,
        drivable: &Drivable,
        (start, arm): (&Isometry3<f64>, Option<[f64; 6]>),
        stops: &[Pose2],
    ) -> bool {
        let travel = self.travel.as_ref().map(|(_, travel)| *travel);
        let posture = match arm.is_some() && arm == travel {
            true => Posture::Travel,
            false => Posture::Home,
        };
        drivable.has_path((&on_floor(start), posture), stops)
    }

    /// Samples a start uniformly over the floor that the chair gets to. The arm is in the
    /// travel posture where the chair is not free with the arm at home. With `stowed`, only
    /// poses of the travel posture, or only the others.
    fn start_on_maps(
        &self,
        area: &AreaSpec,
        (seed, attempt): (u64, u32),
        stowed: Option<bool>,
        accepts: &dyn Fn(&Isometry3<f64>) -> bool,
    ) -> Option<Start> {
        let maps = self.maps.as_ref()?;
        let drivable = self.drivable(area)?;
        let accepts = |pose: &Pose2, posture| {
            maps.is_inside(pose)
                && stowed.is_none_or(|stowed| stowed == (posture == Posture::Travel))
                && accepts(&standing(pose))
        };
        let mut random = match attempt {
            0 => stream(&area.name, seed, "anywhere on the maps"),
            _ => stream(&area.name, seed, &format!("anywhere on the maps {attempt}")),
        };
        let (pose, posture) = drivable.sample(&mut random, &accepts)?;
        let (arm, knuckle) = self.sampled_posture(area, seed);
        let arm = match (posture, &self.travel) {
            (Posture::Travel, Some((_, travel))) => *travel,
            _ => arm,
        };
        Some(Start {
            pose: standing(&pose),
            arm: Some(arm),
            knuckle: Some(knuckle),
            rejected: 0,
        })
    }

    /// Positions of the arm and of the knuckle that a seed samples, radians.
    fn sampled_posture(&self, area: &AreaSpec, seed: u64) -> ([f64; 6], f64) {
        let mut random = stream(&area.name, seed, "posture");
        // Home is the last; it is clear of every person who fits the chair.
        let posture = index(&mut random, self.postures.len() + 1);
        let arm = self.postures.get(posture).copied().unwrap_or(self.home);
        (arm, [0.0, self.closed][index(&mut random, 2)])
    }

    /// Samples a start uniformly over the poses where the chair fits with clearance and
    /// has a path to the area, with arm and gripper in any of their postures. `None`
    /// when none was found. By the maps, each `attempt` gives another start.
    pub(super) fn start(
        &self,
        area: &AreaSpec,
        variant: &Variant,
        scene: &Scene,
        (seed, attempt): (u64, u32),
    ) -> Option<Start> {
        match &self.maps {
            Some(_) => self.start_on_maps(area, (seed, attempt), None, &|_| true),
            None => self.start_where(area, variant, scene, seed, &|_| true),
        }
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
        let mut rejected = 0;
        let (arm, knuckle) = self.sampled_posture(area, seed);
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

    /// Samples a start that `sees` the target with the arm at these positions, radians:
    /// anywhere, or near the area with its own heading. `None` when none was found.
    pub(crate) fn start_in_view(
        &self,
        area: &AreaSpec,
        variant: &Variant,
        scene: &Scene,
        (seed, starts, arm): (u64, Starts, Option<[f64; 6]>),
        sees: &dyn Fn(&Isometry3<f64>) -> bool,
    ) -> Option<Isometry3<f64>> {
        if starts == Starts::Anywhere && self.maps.is_some() {
            let travel = self.travel.as_ref().map(|(_, travel)| *travel);
            let stowed = arm.is_some() && arm == travel;
            let start = self.start_on_maps(area, (seed, 0), Some(stowed), sees);
            return Some(start?.pose);
        }
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
        let start = on_floor(start);
        if let Some(drivable) = self.drivable(area) {
            return drivable.seconds(&start, &goal);
        }
        let path = hybrid_a_star::rough_path(&self.check, start, goal, &PREFERENCES, NODES)?;
        Some(path.cost)
    }

    /// Whether a place is on the floor.
    fn is_inside(&self, scene: &Scene, place: &Pose2) -> bool {
        floor_bounds(scene).is_none_or(|bounds| is_within(bounds, place))
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

/// The limbs of a person in the chair.
fn limbs(person: &Person) -> Vec<Limb> {
    let head = HeadPose::default();
    let limb = |capsule: &Capsule| Limb {
        ends: person.ends(capsule, &head).map(|end| end.coords.into()),
        radius: capsule.radius,
    };
    person.capsules.iter().map(limb).collect()
}

/// Outlines of the chair with its arm at home and the person in it, by height, bottom up.
pub(super) fn chair_outlines(model: &RobotModel, person: Option<&Person>) -> Outlines {
    let limbs = person.map_or_else(Vec::new, limbs);
    occupied(&outlines(&model.settings.outlines), &limbs)
}

/// Outlines by height, bottom up.
pub(super) fn outlines(settings: &[OutlineSettings]) -> Outlines {
    let outline = |o: &OutlineSettings| (o.top, Outline { sides: o.footprint });
    settings.iter().map(outline).collect()
}

/// Bounds of the floor, which is the first piece of furniture: x min, x max, y min, y max,
/// metres.
fn floor_bounds(scene: &Scene) -> Option<[f64; 4]> {
    let floor = scene.furniture.first()?;
    let bounds = floor.collision_bounds(&floor.pose)?;
    Some([bounds.min.x, bounds.max.x, bounds.min.y, bounds.max.y])
}

fn is_within([x0, x1, y0, y1]: [f64; 4], place: &Pose2) -> bool {
    (x0..=x1).contains(&place.x) && (y0..=y1).contains(&place.y)
}

/// A pose of the chair on the floor plan.
pub(super) fn on_floor(pose: &Isometry3<f64>) -> Pose2 {
    let forward = pose.rotation * Vector3::x();
    Pose2 {
        x: pose.translation.x,
        y: pose.translation.y,
        heading: exact::atan2(forward.y, forward.x),
    }
}

/// `wheelchair_root` in `house` at a pose on the floor plan.
fn standing(pose: &Pose2) -> Isometry3<f64> {
    let (sin, cos) = exact::sin_cos(pose.heading / 2.0);
    Isometry3::from_parts(
        Translation3::new(pose.x, pose.y, 0.0),
        UnitQuaternion::new_normalize(Quaternion::new(cos, 0.0, 0.0, sin)),
    )
}

/// The middle of the ranges of a near start.
fn middle(start: &StartSpec) -> Pose2 {
    let middle = |range: Range| f64::midpoint(range.min, range.max);
    Pose2 {
        x: middle(start.x),
        y: middle(start.y),
        heading: middle(start.yaw),
    }
}

/// Footprint check of a chair with these outlines among the furniture of `scene`.
fn footprint_check(outlines: Outlines, scene: &Scene) -> FootprintCheck {
    among(FootprintCheck::from_outlines(outlines), scene, true)
}

/// The same footprint among the furniture of `scene`, with doors and drawers also `ajar`.
pub(super) fn among(mut check: FootprintCheck, scene: &Scene, ajar: bool) -> FootprintCheck {
    for (index, body) in scene.furniture.iter().enumerate() {
        let joint = scene.joint_of(index).filter(|_| ajar);
        let out = joint.map(|joint| {
            let ajar = match joint.motion {
                JointMotion::Slides => AJAR,
                JointMotion::Turns => AJAR_TURN.min(joint.travel),
            };
            Body {
                pose: joint.pose(&body.pose, ajar),
                ..body.clone()
            }
        });
        for obb in [Some(body), out.as_ref()]
            .into_iter()
            .flatten()
            .flat_map(collision_boxes)
        {
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
