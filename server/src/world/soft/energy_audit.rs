//! Audit of every tick: contact laws and the energy balance.
//!
//! The audit only reads: it has no effect on the motion, the saved state or the hash.

use std::collections::VecDeque;

use super::contact_force::ContactCandidate;
use super::motion::TickResult;
use super::tank::TickEnergies;

/// Ticks of the longer energy window: half a second.
const WINDOW: usize = 120;
/// Allowed energy gain in a tick, J, and as a share of the present energy.
const TICK_RISE: (f64, f64) = (1e-3, 0.01);
/// The same over the window, relative to the initial energy and the work done.
const WINDOW_RISE: (f64, f64) = (1e-3, 0.02);

/// The worst values of a deformable since its world was created.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WorstValues {
    /// Smallest normal force of a contact point, N; the law is 0 or more.
    pub normal: f64,
    /// Largest ratio of friction to the Coulomb limit of a contact point; the law is
    /// 1.001 or less.
    pub friction: f64,
    /// Largest change of a solid's speed in a tick, m/s; the law is 0.5 or less.
    pub kick: f64,
    /// Unexplained energy gain in a tick beyond 1 mJ and 1 %, J, with the solids at
    /// their initial velocity; the law is 0 or less.
    pub rise: f64,
    /// Unexplained energy gain in half a second beyond 1 mJ and 2 %, J, with the
    /// solids' actual motion; the law is 0 or less.
    pub window_rise: f64,
    /// Fastest node, m/s.
    pub speed: f64,
    /// Largest energy without potential energy, J.
    pub energy: f64,
    /// Ticks in which the contacts were softened, so that no energy was created.
    pub softened: u64,
    /// Ticks whose contacts did not converge.
    pub unsettled: u64,
    /// Solutions of the linear system, over all ticks.
    pub solutions: u64,
    /// Conjugate-gradient steps, over all ticks.
    pub steps: u64,
    /// Ticks.
    pub ticks: u64,
}

/// Energy at the start of a tick, J.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Energy {
    pub kinetic: f64,
    pub elastic: f64,
    pub height: f64,
    pub contacts: f64,
}

impl Energy {
    fn without_height(&self) -> f64 {
        self.kinetic + self.elastic + self.contacts
    }

    fn all(&self) -> f64 {
        self.without_height() + self.height
    }
}

/// The audit of one deformable.
#[derive(Clone, Debug, Default)]
pub(super) struct EnergyAudit {
    worst: WorstValues,
    before: Option<Energy>,
    /// Energy at the start of each tick, and the work of the solids in it, J.
    ticks: VecDeque<(Energy, f64)>,
}

impl EnergyAudit {
    /// The worst values since the start.
    pub(super) fn worst(&self) -> WorstValues {
        self.worst
    }

    /// Resets the history: the object was set or damped from outside.
    pub(super) fn restart(&mut self) {
        self.before = None;
        self.ticks.clear();
    }

    /// Adds a tick: the energy at its start, the passage from the previous tick, the
    /// contacts and their forces.
    pub(super) fn enter(
        &mut self,
        energy: Energy,
        passage: Option<TickEnergies>,
        candidates: &[ContactCandidate],
        done: &TickResult,
        speed: f64,
    ) {
        let worst = &mut self.worst;
        worst.ticks += 1;
        worst.softened += u64::from(done.share < 1.0);
        worst.speed = worst.speed.max(speed);
        worst.energy = worst.energy.max(energy.without_height());
        worst.kick = worst.kick.max(done.kick);
        if let (Some(before), Some(passage)) = (self.before, passage) {
            let (least, part) = TICK_RISE;
            let beyond = passage.made - least - part * before.without_height();
            worst.rise = worst.rise.max(beyond);
            self.ticks.push_back((before, passage.worked));
            if self.ticks.len() > WINDOW {
                self.ticks.pop_front();
            }
            if let (WINDOW, Some((then, _))) = (self.ticks.len(), self.ticks.front()) {
                let work: f64 = self.ticks.iter().map(|(_, work)| work).sum();
                let moved: f64 = self.ticks.iter().map(|(_, work)| work.abs()).sum();
                let (least, part) = WINDOW_RISE;
                let rise = energy.all() - then.all() - work;
                let beyond = rise - least - part * (then.without_height() + moved);
                worst.window_rise = worst.window_rise.max(beyond);
            }
        }
        for (candidate, contact) in candidates.iter().zip(&done.forces) {
            worst.normal = worst.normal.min(contact.normal);
            let limit = candidate.friction * contact.normal;
            let drag = contact.drag.norm();
            if drag > 1e-6 {
                worst.friction = worst.friction.max(drag / limit.max(1e-9));
            }
        }
        self.before = Some(energy);
    }
}
