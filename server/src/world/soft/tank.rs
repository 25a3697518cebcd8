//! Energy of the contacts between two ticks.
//!
//! A step predicts the motion of the solids; the engine's actual motion differs.
//! Additional motion against the contacts' springs adds energy that no work paid for.
//! It is taken from the energy that the previous step dissipated; if that is not
//! enough, the springs of the next step are softened (passivity-based control: an
//! energy tank). Energy created by a step, and any deficit that softer springs could
//! not cover, remains as debt.

use nalgebra::{Isometry3, Point3, Vector3};
use rapier3d::geometry::ColliderHandle;
use rapier3d::prelude::PhysicsWorld;
use serde::{Deserialize, Serialize};

use super::super::convert::from_pose;
use super::candidates::TickCandidates;
use super::contact_force::ContactForce;

/// Share of the reserve that remains after a tick: it decays within half a second.
const KEEP: f64 = 0.95;
/// Largest reserve, J: energy returned later than half a second after its loss would
/// count as created, and the law allows 1 mJ.
const MOST: f64 = 5e-4;
/// Energy that a tick may create, J.
const FREE: f64 = 3e-6;
/// Smallest share of the springs' stiffness.
const LEAST: f64 = 0.02;

/// A force on the object and its application point on the solid.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Push {
    collider: ColliderHandle,
    house_from_solid: Isometry3<f64>,
    point: Vector3<f64>,
    force: Vector3<f64>,
}

/// Result of the previous step.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Tank {
    last: Option<LastTick>,
    /// Dissipated and not yet returned, J; negative: debt.
    reserve: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct LastTick {
    /// Energy at its start, J.
    energy: f64,
    /// Predicted energy in the contacts at its end, J.
    foreseen: f64,
    /// Predicted work of the solids, J.
    work: f64,
    pushes: Vec<Push>,
}

/// Energies of the object between two ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TickEnergies {
    /// Work of the solids since the last tick began, J.
    pub worked: f64,
    /// Energy created by the previous step, J; negative: dissipated.
    pub made: f64,
}

impl Tank {
    /// Resets the history: the object was set or damped from outside.
    pub(super) fn empty(&mut self) {
        *self = Self::default();
    }

    /// The debt, J.
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

    /// Balance of the previous step, given that the object now contains `inner` J
    /// without its contacts; `None` without a previous step.
    pub(super) fn pass(&mut self, physics: &PhysicsWorld, inner: f64) -> Option<TickEnergies> {
        let last = self.last.as_ref()?;
        let made = inner + last.foreseen - last.energy - last.work;
        self.reserve = (self.reserve.min(KEEP * self.reserve) - made).min(MOST);
        let worked = last.pushes.iter().map(|push| push.work(physics)).sum();
        Some(TickEnergies { worked, made })
    }

    /// Share of the springs' stiffness in the next step, which would begin with
    /// `contacts` J in them.
    pub(super) fn share(&mut self, passage: Option<TickEnergies>, contacts: f64) -> f64 {
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

    /// Records a step of `h` seconds that began with `inner` J without the contacts.
    pub(super) fn enter(
        &mut self,
        inner: f64,
        near: &TickCandidates,
        forces: &[ContactForce],
        h: f64,
    ) {
        let candidates = near.candidates.iter().zip(forces);
        let acting = near.sites.iter().zip(forces);
        self.last = Some(LastTick {
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
    /// Work of the solid on the object since then, J.
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
