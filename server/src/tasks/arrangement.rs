//! Places the objects of one area: upright within their ranges, or lying, stacked,
//! leaning or behind others by their probabilities, with room for the hand at every
//! possible target.

use std::cell::Cell;

use nalgebra::Isometry3;
use rand_chacha::ChaCha8Rng;

use super::area::{PlaceSpec, Range, Variant};
use super::grasp_clearance;
use super::grasp_reach::GraspReach;
use super::placement_clearance::{Clearance, PlacedOutline};
use super::random::{fraction, index, number, shuffle};
use super::rest::{self, Rest, Support, grounded, lying};
use crate::robot::CorridorSettings;
use crate::scene::{Body, Placement, Scene, Surface};

/// Poses sampled for one object before the scene is restarted.
const TRIES: usize = 30;
/// Room around a region, metres.
const REGION_GAP: f64 = 0.01;
/// Room between an object and the one that hides it, metres.
const BEHIND: Range = Range {
    min: 0.025,
    max: 0.08,
};
/// Offset along the edge between an object and the one that hides it, metres.
const BESIDE: Range = Range {
    min: -0.05,
    max: 0.05,
};

/// One object to place.
struct Item<'a> {
    place: &'a PlaceSpec,
    object: usize,
    surface: &'a Surface,
    /// Collision radius, metres.
    radius: f64,
}

impl Item<'_> {
    /// Placement order: larger values first.
    fn rank(&self) -> f64 {
        self.radius + if self.place.is_certain() { 1e3 } else { 0.0 }
    }
}

/// The objects of one area, and the bodies to check against.
pub(super) struct Arrangement<'a> {
    scene: &'a Scene,
    hand: &'a CorridorSettings,
    clearance: Clearance<'a>,
    items: Vec<Item<'a>>,
    regions: Vec<&'a Surface>,
    reach: Option<ReachLimit<'a>>,
}

/// The reach test of possible targets, and how many places may fail it.
struct ReachLimit<'a> {
    reach: GraspReach<'a>,
    misses_left: Cell<u32>,
}

/// A sampled pose, and the object that carries or supports it, if not the surface.
type Sampled = (Isometry3<f64>, Option<usize>);

impl<'a> Arrangement<'a> {
    /// For a variant of an area; objects for which `taken` holds are elsewhere.
    pub(super) fn new(
        hand: &'a CorridorSettings,
        variant: &'a Variant,
        scene: &'a Scene,
        taken: &[bool],
    ) -> Self {
        // Names were checked when the area was loaded.
        let items = variant.places.iter().filter_map(|place| {
            let object = scene.object_named(&place.object)?;
            (!taken[object]).then_some(())?;
            Some(Item {
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
            items: items.collect(),
            regions: regions
                .filter_map(|name| scene.surface_named(name, None))
                .collect(),
            reach: None,
        }
    }

    /// The same with every possible target where the robot grasps it, until `misses` sampled
    /// places are out of reach.
    pub(super) fn in_reach(self, reach: GraspReach<'a>, misses: u32) -> Self {
        let misses_left = Cell::new(misses);
        let reach = Some(ReachLimit { reach, misses_left });
        Self { reach, ..self }
    }

    /// Whether too many places were out of reach.
    pub(super) fn is_out_of_reach(&self) -> bool {
        let reach = self.reach.as_ref();
        reach.is_some_and(|reach| reach.misses_left.get() == 0)
    }

    /// Places every object once, in random order, and returns the remaining room.
    /// `fixed` are the objects that are not sampled.
    pub(super) fn attempt(
        &self,
        random: &mut ChaCha8Rng,
        fixed: &[Option<Placement>],
    ) -> (Vec<Option<Placement>>, f64) {
        let mut placements = fixed.to_vec();
        let mut order: Vec<&Item<'_>> = Vec::new();
        for item in &self.items {
            if fraction(random) < item.place.chance {
                order.push(item);
            }
        }
        shuffle(random, &mut order);
        // Large objects first; optional ones fill the rest.
        order.sort_by(|a, b| b.rank().total_cmp(&a.rank()));
        let mut least = f64::INFINITY;
        for (placed, item) in order.iter().enumerate() {
            let rest = Rest::sample(&item.place.rest, random);
            let mut best = (None, f64::NEG_INFINITY);
            for _ in 0..TRIES {
                if self.is_out_of_reach() {
                    break;
                }
                let (pose, holder) = self
                    .rested(random, rest, item, &order[..placed], &placements)
                    .unwrap_or_else(|| (self.upright(random, item), None));
                let placement = self.weighed(random, item, pose);
                placements[item.object] = Some(placement);
                let clearance = self.room(item, holder, &order[..=placed], &placements);
                if clearance > best.1 {
                    best = (Some(placement), clearance);
                }
                if clearance >= 0.0 {
                    break;
                }
            }
            placements[item.object] = best.0;
            least = least.min(best.1);
            if least < 0.0 {
                break;
            }
        }
        (placements, least)
    }

    /// A pose other than upright; `None` when no support exists.
    fn rested(
        &self,
        random: &mut ChaCha8Rng,
        rest: Rest,
        item: &Item<'_>,
        placed: &[&Item<'_>],
        placements: &[Option<Placement>],
    ) -> Option<Sampled> {
        let body = &self.scene.objects[item.object];
        match rest {
            Rest::Upright => None,
            Rest::Lying => {
                let turns = lying(body, item.place.is_certain());
                let turn = *turns.get(index(random, turns.len()))?;
                Some((self.within(random, item) * grounded(body, turn), None))
            }
            Rest::Stacked | Rest::Leaning => {
                let supports = placed.iter().filter(|on| !on.place.is_certain());
                let supports = supports.filter_map(|on| {
                    let pose = placements[on.object]?.pose;
                    let body = &self.scene.objects[on.object];
                    let support = Support::top_of(body, &pose)?;
                    // Not on top of a stack.
                    let grounded = support.top.translation.z - support.height
                        < on.surface.edge.translation.z + 1e-3;
                    let fits = match rest {
                        Rest::Stacked => Support::carries(body, &pose),
                        _ => support.can_support(),
                    };
                    (grounded && fits).then_some((on.object, support))
                });
                let supports: Vec<_> = supports.collect();
                let (object, support) = supports.get(index(random, supports.len()))?;
                let pose = match rest {
                    Rest::Stacked => {
                        rest::stacked(random, body, &support.top, item.place.rest.lies > 0.0)
                    }
                    _ => rest::leaning(random, body, support)?,
                };
                Some((pose, Some(*object)))
            }
            Rest::Hidden => {
                let before = placed.iter().filter(|other| {
                    other.place.is_certain() && other.surface.furniture == item.surface.furniture
                });
                let before: Vec<_> = before.collect();
                let before = before.get(index(random, before.len()))?;
                let pose = placements[before.object]?.pose;
                let at = (item.surface.edge.inverse() * pose).translation;
                let inwards = at.x + before.radius + item.radius + number(random, BEHIND);
                let along = at.y + number(random, BESIDE);
                let yaw = number(random, item.place.yaw);
                let place = item.surface.standing(inwards, along, yaw);
                Some((place * lifted(body), None))
            }
        }
    }

    fn upright(&self, random: &mut ChaCha8Rng, item: &Item<'_>) -> Isometry3<f64> {
        self.within(random, item) * lifted(&self.scene.objects[item.object])
    }

    /// A pose within the ranges of an object.
    fn within(&self, random: &mut ChaCha8Rng, item: &Item<'_>) -> Isometry3<f64> {
        let place = item.place;
        let (inwards, along, yaw) = (
            number(random, place.inwards),
            number(random, place.along),
            number(random, place.yaw),
        );
        item.surface.standing(inwards, along, yaw)
    }

    fn weighed(&self, random: &mut ChaCha8Rng, item: &Item<'_>, pose: Isometry3<f64>) -> Placement {
        let usual = Placement::from_body(&self.scene.objects[item.object]);
        let mut or = |range: Option<Range>, usual| range.map_or(usual, |r| number(random, r));
        Placement {
            pose,
            mass: or(item.place.mass, usual.mass),
            friction: or(item.place.friction, usual.friction),
        }
    }

    /// The room that `item` leaves: to all others except its `holder`, to the regions,
    /// and for the hand at every possible target.
    fn room(
        &self,
        item: &Item<'_>,
        holder: Option<usize>,
        placed: &[&Item<'_>],
        placements: &[Option<Placement>],
    ) -> f64 {
        let mut least = self
            .clearance
            .distance(item.object, holder, item.surface, placements);
        if least < 0.0 {
            return least;
        }
        let standing = |object: usize| {
            let placement = placements[object].as_ref()?;
            Some(self.clearance.standing(object, placement))
        };
        let own: Vec<PlacedOutline> = standing(item.object).into_iter().collect();
        for region in &self.regions {
            least = least.min(grasp_clearance::region_room(region, REGION_GAP, &own));
        }
        for target in placed.iter().filter(|target| target.place.is_certain()) {
            if least < 0.0 {
                return least;
            }
            let others = placed.iter().filter(|other| other.object != target.object);
            let others: Vec<PlacedOutline> =
                others.filter_map(|other| standing(other.object)).collect();
            if let Some(placement) = &placements[target.object] {
                let body = &self.scene.objects[target.object];
                let room = grasp_clearance::room(
                    self.hand,
                    body,
                    &placement.pose,
                    target.surface,
                    &others,
                );
                least = least.min(room);
            }
        }
        match least >= 0.0 && !self.is_reached(item, placements) {
            true => -1.0,
            false => least,
        }
    }

    /// Whether the robot grasps a possible target where it is.
    fn is_reached(&self, item: &Item<'_>, placements: &[Option<Placement>]) -> bool {
        let Some((limit, placement)) = self.reach.as_ref().zip(placements[item.object]) else {
            return true;
        };
        let body = &self.scene.objects[item.object];
        let is_reached = !item.place.is_certain()
            || (limit.reach).can_grasp(body, &placement.pose, item.surface);
        if !is_reached {
            let left = limit.misses_left.get();
            limit.misses_left.set(left.saturating_sub(1));
        }
        is_reached
    }
}

/// Transform from the support point of an object to its frame.
fn lifted(body: &Body) -> Isometry3<f64> {
    Isometry3::translation(0.0, 0.0, body.standing_height())
}
