//! Samples one scene of the home from a seed: poses, masses and friction of all
//! objects, friction of drawers, and the start of the chair.
//!
//! Independent of tasks: every task of the area has the same scene. The other areas of
//! the home are sampled too, each from its own stream, so that no view of them reveals
//! the area of the task. A scene is valid when every possible target can be grasped and
//! every region is free.

use nalgebra::{Isometry3, Vector3};
use wheelarm_planning::footprint_check::Pose2;
use wheelarm_planning::posture_routes::STOP_GOALS;

use super::area::{AreaSpec, Variant};
use super::arrangement::Arrangement;
use super::floor::{Floor, Start};
use super::grasp_reach::GraspReach;
use super::random::{fraction, number, stream};
use crate::scene::{Body, Placement, Resistance, Scene};

/// Sampled scenes before the best one is used.
const ATTEMPTS: usize = 400;
/// Places of possible targets out of the arm's reach before an area counts as out of reach:
/// where a twentieth of the places is in reach, one scene in two thousand is missed.
const OWN_MISSES: u32 = 150;
/// The same of the other areas of the home.
const OTHER_MISSES: u32 = 20;
/// Starts anywhere that are sampled until one has a path.
const STARTS: u32 = 6;

/// A sampled scene of an area, the same for all its tasks.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSample {
    /// One per entry of `Scene::objects`; `None` for a missing object.
    pub placements: Vec<Option<Placement>>,
    /// One per entry of `Scene::joints`.
    pub slides: Vec<Resistance>,
    /// One per entry of `Scene::joints`: its position, metres.
    pub positions: Vec<f64>,
    /// Pose of `wheelchair_root` in `house`.
    pub start: Isometry3<f64>,
    /// Positions of the arm's joints, radians; `None` for home.
    pub arm: Option<[f64; 6]>,
    /// Angle of the gripper's knuckle, radians; `None` for open.
    pub knuckle: Option<f64>,
    /// Number of scenes sampled until a valid one.
    pub attempts: usize,
    /// Remaining room, metres; negative when a target cannot be grasped.
    pub clearance: f64,
    /// A start was found, if requested.
    pub has_start: bool,
    /// Every possible target is in the arm's reach from free floor, if requested.
    pub has_reach: bool,
    /// Start poses that were rejected because of the person (count).
    pub rejected_starts: u32,
    /// Names of the other areas that were sampled.
    pub surroundings: Vec<String>,
}

impl SceneSample {
    /// Whether start and objects were found where the robot starts and grasps them.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.has_start && self.has_reach && self.clearance >= 0.0
    }
}

/// The variant that a seed selects among those that offer the requested objects, by
/// their probabilities; `share` is that of all but the first.
#[must_use]
pub fn variant<'a>(
    area: &'a AreaSpec,
    offering: &[&'a Variant],
    seed: u64,
    share: Option<f64>,
) -> Option<&'a Variant> {
    let first = area.variants.first()?;
    let others: f64 = area.variants[1..].iter().map(|v| v.share).sum();
    let scale = match share {
        Some(share) if others > 0.0 => share / others,
        _ => 1.0,
    };
    let share_of = |variant: &Variant| match variant.name == first.name {
        true => (1.0 - others * scale).max(0.0),
        false => variant.share * scale,
    };
    // From the largest: a variant that is not offered leaves its share to the others.
    let whole: f64 = offering.iter().map(|variant| share_of(variant)).sum();
    let mut left = fraction(&mut stream(&area.name, seed, "variant")) * whole;
    for variant in offering {
        left -= share_of(variant);
        if left < 0.0 {
            return Some(variant);
        }
    }
    offering.last().copied()
}

/// Samples a scene. The same seed gives the same scene on any machine. `scene` contains
/// the optional furniture of the variant and no other; with a `floor` the robot starts
/// anywhere on it, and with its maps objects are where the robot grasps them.
#[must_use]
pub fn sample_scene(
    area: &AreaSpec,
    variant: &Variant,
    scene: &Scene,
    seed: u64,
    floor: Option<&Floor>,
) -> SceneSample {
    let random = |purpose: &str| stream(&area.name, seed, purpose);
    let mut near = random("start");
    let near = Isometry3::new(
        Vector3::new(
            number(&mut near, area.start.x),
            number(&mut near, area.start.y),
            0.0,
        ),
        Vector3::z() * number(&mut near, area.start.yaw),
    );
    let around = surroundings(area, seed);
    let mut slides: Vec<_> = scene.joints.iter().map(|joint| joint.resistance).collect();
    let mut positions = vec![0.0; slides.len()];
    for area in [area]
        .into_iter()
        .chain(around.iter().map(|(area, _)| *area))
    {
        let mut sliding = stream(&area.name, seed, "slides");
        for slide in &area.slides {
            let resistance = Resistance {
                friction: number(&mut sliding, slide.friction),
                damping: number(&mut sliding, slide.damping),
            };
            let position = number(&mut sliding, slide.position);
            if let Some(joint) = scene.joint_named(&slide.joint) {
                slides[joint] = resistance;
                positions[joint] = position;
            }
        }
    }
    let drivable = floor.and_then(|floor| floor.drivable(area));
    let reach = floor.zip(drivable.as_ref());
    let reach = reach.and_then(|(floor, drivable)| floor.grasp_reach(drivable));
    let mut placed = Placed::new(area, scene, reach);
    let mut has_reach = placed.add(area, variant, seed, OWN_MISSES);
    for (area, variant) in &around {
        if !placed.add(area, variant, seed, OTHER_MISSES) {
            // The task needs none of these.
            placed.add_anywhere(area, variant, seed);
        }
    }
    let near = Start {
        pose: near,
        arm: None,
        knuckle: None,
        rejected: 0,
    };
    let stops = placed.stops(variant);
    let has_path = |start: &Start| {
        let floor = floor.zip(drivable.as_ref());
        floor.is_none_or(|(floor, drivable)| {
            let start = (&start.pose, start.arm);
            let mut stops = stops.iter();
            stops.all(|stops| floor.has_path(drivable, start, stops))
        })
    };
    // From nearby first: it takes little time.
    has_reach = has_reach && has_path(&near);
    let mut has_start = true;
    let start = match floor.filter(|floor| floor.is_anywhere()) {
        Some(floor) => {
            let starts =
                (0..STARTS).map_while(|attempt| floor.start(area, variant, scene, (seed, attempt)));
            // By the first rules of sampling a start has a path.
            let mut starts = starts.filter(|start| !has_reach || has_path(start));
            let found = starts.next();
            has_start = found.is_some();
            found.unwrap_or(near)
        }
        None => near,
    };
    SceneSample {
        placements: placed.placements,
        slides,
        positions,
        start: start.pose,
        arm: start.arm,
        knuckle: start.knuckle,
        attempts: placed.attempts,
        clearance: placed.clearance,
        has_start,
        has_reach,
        rejected_starts: start.rejected,
        surroundings: around.iter().map(|(area, _)| area.name.clone()).collect(),
    }
}

/// The other areas to sample: one per piece of furniture, by their probabilities, each
/// in a variant without optional furniture, which is reserved for the task's area.
fn surroundings(area: &AreaSpec, seed: u64) -> Vec<(&AreaSpec, &Variant)> {
    let mut groups: Vec<(&str, Vec<&AreaSpec>)> = Vec::new();
    for other in &area.surroundings {
        match groups.iter_mut().find(|(on, _)| *on == other.carrier()) {
            Some((_, group)) => group.push(other),
            None => groups.push((other.carrier(), vec![other])),
        }
    }
    let groups = groups.into_iter().filter(|(on, _)| *on != area.carrier());
    let chosen = groups.filter_map(|(on, group)| {
        let mut left = fraction(&mut stream("home", seed, on));
        let chosen = group.into_iter().find(|other| {
            left -= other.elsewhere;
            left < 0.0
        })?;
        let variants = chosen.variants.iter().filter(|v| v.furniture.is_empty());
        let variants: Vec<&Variant> = variants.collect();
        Some((chosen, variant(chosen, &variants, seed, None)?))
    });
    chosen.collect()
}

/// The placed objects, area by area.
struct Placed<'a> {
    scene: &'a Scene,
    reach: Option<GraspReach<'a>>,
    placements: Vec<Option<Placement>>,
    attempts: usize,
    clearance: f64,
}

impl<'a> Placed<'a> {
    /// Objects that no area names are at their place in the scene.
    fn new(area: &AreaSpec, scene: &'a Scene, reach: Option<GraspReach<'a>>) -> Self {
        let areas = || [area].into_iter().chain(&area.surroundings);
        let is_named = |body: &Body| {
            let mut variants = areas().flat_map(|area| &area.variants);
            variants.any(|variant| variant.place(&body.name).is_some())
        };
        let fixed =
            |body: &Body| (!body.optional && !is_named(body)).then(|| Placement::from_body(body));
        Self {
            scene,
            reach,
            placements: scene.objects.iter().map(fixed).collect(),
            attempts: 0,
            clearance: f64::INFINITY,
        }
    }

    /// Stops of the chair for each possible target of an area that has grasps; nothing without
    /// a reach map.
    fn stops(&self, variant: &Variant) -> Vec<Vec<Pose2>> {
        let Some(reach) = self.reach else {
            return Vec::new();
        };
        let certain = variant.places.iter().filter(|place| place.is_certain());
        let stops = certain.filter_map(|place| {
            let object = self.scene.object_named(&place.object)?;
            let body = &self.scene.objects[object];
            let pose = self.placements[object]?.pose;
            let surface = (self.scene).surface_named(&place.on, place.surface.as_deref())?;
            (!body.grasps.is_empty())
                .then(|| reach.stops((body, &pose, surface), false, STOP_GOALS))
        });
        stops.collect()
    }

    /// Places the objects of one more area, and retries until there is room. Adds nothing and
    /// returns false after `misses` places of possible targets out of the arm's reach.
    fn add(&mut self, area: &AreaSpec, variant: &Variant, seed: u64, misses: u32) -> bool {
        self.arrange(area, variant, seed, self.reach.zip(Some(misses)))
    }

    /// The same without regard to the arm's reach.
    fn add_anywhere(&mut self, area: &AreaSpec, variant: &Variant, seed: u64) {
        self.arrange(area, variant, seed, None);
    }

    fn arrange(
        &mut self,
        area: &AreaSpec,
        variant: &Variant,
        seed: u64,
        reach: Option<(GraspReach<'_>, u32)>,
    ) -> bool {
        let mut random = stream(&area.name, seed, "places");
        let taken: Vec<bool> = self.placements.iter().map(Option::is_some).collect();
        let mut arrangement = Arrangement::new(&area.hand, variant, self.scene, &taken);
        if let Some((reach, misses)) = reach {
            arrangement = arrangement.in_reach(reach, misses);
        }
        let mut best: Option<(Vec<Option<Placement>>, f64)> = None;
        for _ in 0..ATTEMPTS {
            self.attempts += 1;
            let (placements, clearance) = arrangement.attempt(&mut random, &self.placements);
            if arrangement.is_out_of_reach() {
                return false;
            }
            if best.as_ref().is_none_or(|(_, most)| clearance > *most) {
                best = Some((placements, clearance));
            }
            if clearance >= 0.0 {
                break;
            }
        }
        if let Some((placements, clearance)) = best {
            self.placements = placements;
            self.clearance = self.clearance.min(clearance);
        }
        true
    }
}
