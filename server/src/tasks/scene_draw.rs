//! One scene of an area from a seed, whatever is asked for in it: what stands
//! where, how heavy and rough, how drawers slide, where the chair starts.
//!
//! Nothing here knows of tasks: whoever asks for something in the area finds the
//! same scene. It counts only when everything that may be asked for can be taken
//! and every region is free; one acceptance for all.

use nalgebra::{Isometry3, Vector3};
use rand_chacha::ChaCha8Rng;

use super::area::{AreaSpec, PlaceSpec, Variant};
use super::floor::{Floor, Start};
use super::placement_clearance::{Clearance, Standing};
use super::random::{fraction, number, shuffle, stream};
use super::takeable;
use crate::robot::CorridorSettings;
use crate::scene::{Body, Placement, Resistance, Scene, Surface};

/// Scenes that are begun before the best one is taken.
const ATTEMPTS: usize = 400;
/// Places that are tried for one object before the scene is begun anew.
const TRIES: usize = 30;
/// Room around a region, metres.
const REGION_GAP: f64 = 0.01;

/// What stands in an area, the same for all its tasks.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneDraw {
    /// One per entry of `Scene::objects`; `None` for what is not there.
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
    /// How many scenes were begun until one counted.
    pub attempts: usize,
    /// How much room is left, metres; below zero something cannot be taken.
    pub clearance: f64,
    /// A start was found where one was asked for.
    pub has_start: bool,
    /// Start poses that were rejected because of the person (count).
    pub rejected_starts: u32,
}

/// The variant of an area that a seed takes out of those that offer what is
/// asked for, by their shares; `share` is that of all but the first.
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
    // From the greatest: a variant that is not offered leaves its share to the others.
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

/// Draws a scene. The same seed gives the same scene on any machine. `scene`
/// holds the optional furniture of the variant and no other; with a `floor` the
/// robot starts anywhere on it.
#[must_use]
pub fn draw_scene(
    area: &AreaSpec,
    variant: &Variant,
    scene: &Scene,
    seed: u64,
    floor: Option<&Floor>,
) -> SceneDraw {
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
    let anywhere = floor.map(|floor| floor.start(area, variant, scene, seed));
    let has_start = anywhere.as_ref().is_none_or(Option::is_some);
    let start = match anywhere.flatten() {
        Some(start) => start,
        None => Start {
            pose: near,
            arm: None,
            knuckle: None,
            rejected: 0,
        },
    };
    let mut sliding = random("slides");
    let mut slides: Vec<_> = scene.joints.iter().map(|joint| joint.resistance).collect();
    let mut positions = vec![0.0; slides.len()];
    for slide in &area.slides {
        let drawn = Resistance {
            friction: number(&mut sliding, slide.friction),
            damping: number(&mut sliding, slide.damping),
        };
        let position = number(&mut sliding, slide.position);
        if let Some(joint) = scene.joint_named(&slide.joint) {
            slides[joint] = drawn;
            positions[joint] = position;
        }
    }
    let mut standing = random("places");
    let table = Table::new(&area.hand, variant, scene);
    let mut best: Option<(Vec<Option<Placement>>, f64)> = None;
    let mut attempts = 0;
    while attempts < ATTEMPTS {
        attempts += 1;
        let (placements, clearance) = table.attempt(&mut standing);
        if best.as_ref().is_none_or(|(_, most)| clearance > *most) {
            best = Some((placements, clearance));
        }
        if clearance >= 0.0 {
            break;
        }
    }
    let (placements, clearance) = best.unwrap_or_default();
    SceneDraw {
        placements,
        slides,
        positions,
        start: start.pose,
        arm: start.arm,
        knuckle: start.knuckle,
        attempts,
        clearance,
        has_start,
        rejected_starts: start.rejected,
    }
}

/// One thing that is placed.
struct Thing<'a> {
    place: &'a PlaceSpec,
    object: usize,
    surface: &'a Surface,
    /// Radius within which it collides, metres.
    radius: f64,
}

impl Thing<'_> {
    /// The greater, the earlier it is placed.
    fn rank(&self) -> f64 {
        self.radius + if self.place.is_certain() { 1e3 } else { 0.0 }
    }
}

/// What is placed, and what it is held against.
struct Table<'a> {
    scene: &'a Scene,
    hand: &'a CorridorSettings,
    clearance: Clearance<'a>,
    things: Vec<Thing<'a>>,
    regions: Vec<&'a Surface>,
    /// What is not drawn: at its place in the scene.
    fixed: Vec<Option<Placement>>,
}

impl<'a> Table<'a> {
    fn new(hand: &'a CorridorSettings, variant: &'a Variant, scene: &'a Scene) -> Self {
        let fixed = |body: &Body| {
            let drawn = variant.place(&body.name).is_some();
            (!drawn && !body.optional).then(|| Placement::of(body))
        };
        // Names were checked when the area was read.
        let things = variant.places.iter().filter_map(|place| {
            let object = scene.object_named(&place.object)?;
            Some(Thing {
                place,
                object,
                radius: scene.objects[object].footprint_radius(),
                surface: scene.surface_named(&place.on, place.surface.as_deref())?,
            })
        });
        let regions = variant.regions.iter();
        Self {
            scene,
            hand,
            clearance: Clearance::new(scene),
            things: things.collect(),
            regions: regions
                .filter_map(|name| scene.surface_named(name, None))
                .collect(),
            fixed: scene.objects.iter().map(fixed).collect(),
        }
    }

    /// Places everything once, in any order, and says how much room is left.
    fn attempt(&self, random: &mut ChaCha8Rng) -> (Vec<Option<Placement>>, f64) {
        let mut placements = self.fixed.clone();
        let mut order: Vec<&Thing<'_>> = Vec::new();
        for thing in &self.things {
            if fraction(random) < thing.place.chance {
                order.push(thing);
            }
        }
        shuffle(random, &mut order);
        // Large things first, as who packs does; what may be missing fills the rest.
        order.sort_by(|a, b| b.rank().total_cmp(&a.rank()));
        let mut least = f64::INFINITY;
        for (placed, thing) in order.iter().enumerate() {
            let mut best = (None, f64::NEG_INFINITY);
            for _ in 0..TRIES {
                let placement = standing(random, thing, &self.scene.objects[thing.object]);
                placements[thing.object] = Some(placement);
                let clearance = self.room(thing, &order[..=placed], &placements);
                if clearance > best.1 {
                    best = (Some(placement), clearance);
                }
                if clearance >= 0.0 {
                    break;
                }
            }
            placements[thing.object] = best.0;
            least = least.min(best.1);
            if least < 0.0 {
                break;
            }
        }
        (placements, least)
    }

    /// How much room there is with `thing` where it is placed: to the others, on
    /// the regions, and for the hand to everything that may be asked for.
    fn room(
        &self,
        thing: &Thing<'_>,
        placed: &[&Thing<'_>],
        placements: &[Option<Placement>],
    ) -> f64 {
        let mut least = self.clearance.of(thing.object, thing.surface, placements);
        if least < 0.0 {
            return least;
        }
        let stands = |object: usize| {
            let placement = placements[object].as_ref()?;
            Some(self.clearance.standing(object, placement))
        };
        let own: Vec<Standing> = stands(thing.object).into_iter().collect();
        for region in &self.regions {
            least = least.min(takeable::region_room(region, REGION_GAP, &own));
        }
        for target in placed.iter().filter(|target| target.place.is_certain()) {
            if least < 0.0 {
                return least;
            }
            let others = placed.iter().filter(|other| other.object != target.object);
            let others: Vec<Standing> = others.filter_map(|other| stands(other.object)).collect();
            if let Some(placement) = &placements[target.object] {
                let body = &self.scene.objects[target.object];
                let room =
                    takeable::room(self.hand, body, &placement.pose, target.surface, &others);
                least = least.min(room);
            }
        }
        least
    }
}

fn standing(random: &mut ChaCha8Rng, thing: &Thing<'_>, body: &Body) -> Placement {
    let place = thing.place;
    let (inwards, along, yaw) = (
        number(random, place.inwards),
        number(random, place.along),
        number(random, place.yaw),
    );
    let usual = Placement::of(body);
    let lift = Isometry3::translation(0.0, 0.0, body.standing_height());
    Placement {
        pose: thing.surface.standing(inwards, along, yaw) * lift,
        mass: place.mass.map_or(usual.mass, |range| number(random, range)),
        friction: place
            .friction
            .map_or(usual.friction, |range| number(random, range)),
    }
}
