//! Energy of the contacts between two ticks.
//!
//! A step foresees where the solids go; the engine then moves them as it must.
//! What they move further against the contacts' springs than was foreseen puts
//! energy into the springs that no work paid for. It is taken from what the
//! step before has dissipated; where that is not enough, the springs of the
//! coming step are softer (passivity-based control: an energy tank). What a step
//! makes from nothing, and what softer springs could not pay, stays owed.

use nalgebra::{Isometry3, Point3, Vector3};
use rapier3d::geometry::ColliderHandle;
use rapier3d::prelude::PhysicsWorld;
use serde::{Deserialize, Serialize};

use super::super::convert::from_pose;
use super::candidates::Near;
use super::contact_force::ContactForce;

/// What is left of the reserve after a tick: it forgets within half a second.
const KEEP: f64 = 0.95;
/// Most that the reserve holds, J: what is given back late counts as made from
/// nothing in a half-second that does not hold its loss, and 1 mJ is the law.
const MOST: f64 = 5e-4;
/// Energy that a tick may have for nothing, J.
const FREE: f64 = 3e-6;
/// Least share of the springs' stiffness.
const LEAST: f64 = 0.02;

/// A force on the object and where the solid had it.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Push {
    collider: ColliderHandle,
    house_from_solid: Isometry3<f64>,
    point: Vector3<f64>,
    force: Vector3<f64>,
}

/// What the step before left.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Tank {
    last: Option<Last>,
    /// Dissipated and not yet given back, J; negative: owed.
    reserve: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Last {
    /// Energy at its start, J.
    energy: f64,
    /// In the contacts at its end, as the step foresaw it, J.
    foreseen: f64,
    /// Work of the solids, as the step foresaw it, J.
    work: f64,
    pushes: Vec<Push>,
}

/// Energies of the object between two ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Passage {
    /// Work that the solids did since the last tick began, J.
    pub worked: f64,
    /// What the step before made from nothing, J; negative: dissipated.
    pub made: f64,
}

impl Tank {
    /// Forgets what came before: the object was set or damped from outside.
    pub(super) fn empty(&mut self) {
        *self = Self::default();
    }

    /// What is owed, J.
    pub(super) fn owes(&self) -> f64 {
        -self.reserve.min(0.0)
    }

    /// All its numbers, J, N and metres.
    pub(super) fn numbers(&self) -> Vec<f64> {
        let mut numbers = vec![self.reserve];
        if let Some(last) = &self.last {
            numbers.extend([last.energy, last.foreseen, last.work]);
            for push in &last.pushes {
                let place = &push.house_from_solid;
                numbers.extend(place.translation.vector.iter());
                numbers.extend(place.rotation.coords.iter());
                numbers.extend(push.point.iter().chain(&push.force));
            }
        }
        numbers
    }

    /// What came of the step before, now that the object holds `inner` J beside
    /// its contacts; `None` when there was none.
    pub(super) fn pass(&mut self, physics: &PhysicsWorld, inner: f64) -> Option<Passage> {
        let last = self.last.as_ref()?;
        let made = inner + last.foreseen - last.energy - last.work;
        self.reserve = (self.reserve.min(KEEP * self.reserve) - made).min(MOST);
        let worked = last.pushes.iter().map(|push| push.work(physics)).sum();
        Some(Passage { worked, made })
    }

    /// Share of the springs' stiffness in the coming step, which would begin
    /// with `contacts` J in them.
    pub(super) fn share(&mut self, passage: Option<Passage>, contacts: f64) -> f64 {
        let (Some(passage), Some(last)) = (passage, self.last.as_ref()) else {
            return 1.0;
        };
        let unpaid = contacts - last.foreseen - (passage.worked - last.work) - FREE;
        let owed = unpaid - self.reserve;
        if owed <= 0.0 {
            self.reserve = (-owed).min(self.reserve.max(0.0));
            return 1.0;
        }
        let paid = owed.min((1.0 - LEAST) * contacts);
        self.reserve = paid - owed;
        if paid > 0.0 {
            1.0 - paid / contacts
        } else {
            1.0
        }
    }

    /// Enters a step of `h` seconds that began with `inner` J beside the contacts.
    pub(super) fn enter(&mut self, inner: f64, near: &Near, forces: &[ContactForce], h: f64) {
        let candidates = near.candidates.iter().zip(forces);
        let acting = near.sites.iter().zip(forces);
        self.last = Some(Last {
            energy: inner + forces.iter().map(|p| p.energy[0]).sum::<f64>(),
            foreseen: forces.iter().map(|p| p.energy[1]).sum(),
            work: candidates.map(|(t, p)| p.force.dot(&t.velocity) * h).sum(),
            pushes: acting
                .filter(|(_, contact)| contact.force != Vector3::zeros())
                .map(|(site, contact)| Push {
                    collider: site.collider,
                    house_from_solid: site.house_from_solid,
                    point: site.point,
                    force: contact.force,
                })
                .collect(),
        });
    }
}

impl Push {
    /// Work of the solid on the object since, J.
    fn work(&self, physics: &PhysicsWorld) -> f64 {
        let Some(collider) = physics.colliders.get(self.collider) else {
            return 0.0;
        };
        let local = self
            .house_from_solid
            .inverse_transform_point(&Point3::from(self.point));
        let now = (from_pose(collider.position()) * local).coords;
        self.force.dot(&(now - self.point))
    }
}
