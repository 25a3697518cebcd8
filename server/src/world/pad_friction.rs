//! Friction of the finger pads at position level.
//!
//! The solver's friction acts on velocities, so a held object creeps. Each touching
//! pair of colliders with a pad keeps a bristle: the relative pose of their first
//! contact. Every contact point requests the tangent velocity that restores it; the
//! solver grants it within the Coulomb limit. A bristle bent by more than [`LONGEST`]
//! slides along, so slip happens exactly at the Coulomb limit.

use std::collections::BTreeMap;

use parking_lot::Mutex;
use rapier3d::geometry::ColliderHandle;
use rapier3d::math::Pose;
use rapier3d::pipeline::{ContactModificationContext, PhysicsHooks};
use serde::{Deserialize, Serialize};

/// Share of the drift corrected in one tick.
const GAIN: f32 = 0.3;
/// Largest bend of a bristle, metres.
const LONGEST: f32 = 0.001;

/// One touching pair.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Bristle {
    /// first_from_second without slip.
    rest: Pose,
    /// Tick at which the pair last touched.
    touched: u64,
}

/// Key of a pair: index and generation of both colliders, which orders them the same in every run.
type Pair = [u32; 4];

/// The bristles of all pads, with the current tick.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Bristles {
    tick: u64,
    pairs: BTreeMap<Pair, Bristle>,
}

impl Bristles {
    /// Numbers included in the state hash.
    pub(super) fn bits(&self) -> impl Iterator<Item = u32> + '_ {
        self.pairs.values().flat_map(|b| {
            let (t, r) = (b.rest.translation, b.rest.rotation);
            [t.x, t.y, t.z, r.x, r.y, r.z, r.w].map(f32::to_bits)
        })
    }
}

/// The engine's hook.
#[derive(Debug)]
pub(super) struct GripFriction {
    dt: f32,
    bristles: Mutex<Bristles>,
}

impl GripFriction {
    /// Without contacts. `dt` is the length of a tick, seconds.
    pub(super) fn new(dt: f32) -> Self {
        Self {
            dt,
            bristles: Mutex::default(),
        }
    }

    /// Call before each tick: removes separated pairs.
    pub(super) fn begin_tick(&mut self) {
        let bristles = self.bristles.get_mut();
        bristles.tick += 1;
        let last = bristles.tick - 1;
        bristles.pairs.retain(|_, b| b.touched >= last);
    }

    /// A copy of the state.
    pub(super) fn state(&self) -> Bristles {
        self.bristles.lock().clone()
    }

    /// Restores a saved state.
    pub(super) fn restore(&mut self, state: Bristles) {
        *self.bristles.get_mut() = state;
    }
}

impl PhysicsHooks for GripFriction {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        let (first, second) = (context.collider1, context.collider2);
        let house_from_first = *context.colliders[first].position();
        let house_from_second = *context.colliders[second].position();
        let Some(manifold) = context.rigid_mut() else {
            return;
        };
        if manifold.solver_contacts.is_empty() {
            return;
        }
        let mut bristles = self.bristles.lock();
        let tick = bristles.tick;
        let now = house_from_first.inv_mul(&house_from_second);
        let bristle = bristles
            .pairs
            .entry(pair(first, second))
            .or_insert(Bristle {
                rest: now,
                touched: tick,
            });
        bristle.touched = tick;

        let wanted = house_from_first * bristle.rest;
        let normal = *manifold.normal;
        let mut longest: f32 = 0.0;
        for contact in manifold.solver_contacts.iter_mut() {
            let point = contact.anchor2;
            let home = wanted * house_from_second.inverse_transform_point(point);
            let mut bend = home - point;
            bend -= normal * bend.dot(normal);
            longest = longest.max(bend.length());
            contact.tangent_velocity = bend * (GAIN / self.dt);
        }
        if longest > LONGEST {
            let slide = 1.0 - LONGEST / longest;
            bristle.rest = bristle.rest.lerp(&now, slide);
        }
    }
}

fn pair(first: ColliderHandle, second: ColliderHandle) -> Pair {
    let (a, b) = (first.into_raw_parts(), second.into_raw_parts());
    [a.0, a.1, b.0, b.1]
}
