//! Contact forces: contacts press and never pull, and friction obeys Coulomb's law.
//!
//! A contact is an elastic foundation with a bristle. In a solution it is open, or a
//! spring along the normal with a `share` of the same spring along the surface: 1 where
//! it sticks, less where it slips, so that friction is `share` times the force of the
//! bent bristle (a secant of Coulomb's law). A spring of constant stiffness cannot gain
//! energy in an implicit step, unlike a prescribed friction force.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::elastic::Elastic;
use super::solver::Spring;

/// A solution is accepted when friction exceeds the Coulomb limit by at most this
/// factor; the excess is cut off.
const COULOMB: f64 = 1.005;
/// Slipping friction below this share of the limit could hold more.
const TIGHT: f64 = 0.9;
/// Friction above its limit is reduced to this share of it.
const AIM: f64 = 0.99;
/// Largest change of a solid's speed by a deformable in a tick, m/s.
const KICK: f64 = 0.5;
/// A solid that is pushed too hard receives this share of the allowed push.
const GENTLE: f64 = 0.9;
/// Largest h²k/m of all contacts of a solid: above it, a push computed before the solid
/// moves would throw it further than the contact is deep.
const HEAVY: f64 = 2.0;
/// Forces below this count as zero, N.
const NOTHING: f64 = 5e-4;

/// A point of the skin near a solid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ContactCandidate {
    /// Cell that carries the point, and the weights of its corners.
    pub cell: usize,
    pub weights: [f64; 4],
    /// Foundation, N/m.
    pub stiffness: f64,
    /// Coulomb coefficient.
    pub friction: f64,
    /// From the solid, unit.
    pub normal: Vector3<f64>,
    /// Distance from the solid at the start of the tick, metres, negative inside.
    pub gap: f64,
    /// Anchor of the bristle at the start of the tick; `None` for a new contact.
    pub anchor: Option<Vector3<f64>>,
    /// Velocity of the solid there, m/s.
    pub velocity: Vector3<f64>,
    /// Index of the solid.
    pub solid: usize,
}

/// Mobility of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mobility {
    /// Centre of mass, metres.
    pub centre: Vector3<f64>,
    /// Change of its velocity (linear, angular) per impulse at its centre of mass,
    /// including its joints; `None` for a fixed solid.
    pub inverse: Option<Matrix6<f64>>,
}

/// Result of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ContactForce {
    /// Force on the body along the normal, N.
    pub normal: f64,
    /// Friction on the body, N.
    pub drag: Vector3<f64>,
    /// Sum of both, N.
    pub force: Vector3<f64>,
    /// Anchor of the bristle on the solid after the tick, relative to the solid's pose
    /// at its start; `None` without contact.
    pub anchor: Option<Vector3<f64>>,
    /// Energy in the foundation and the bristle before and after the tick, J.
    pub energy: [f64; 2],
}

impl ContactForce {
    /// Whether all numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        let anchor = self.anchor.unwrap_or_default();
        self.force.iter().chain(&anchor).all(|x| x.is_finite())
    }
}

/// State of a contact in a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum FrictionState {
    Open,
    /// Closed, with this share of the bristle's stiffness, 0 to 1.
    Closed(f64),
}

impl Mobility {
    /// Change of the velocity at a point per impulse there, 1/kg.
    fn velocity_response(&self, point: &Vector3<f64>) -> Option<Matrix3<f64>> {
        let inverse = self.inverse?;
        let arm = (point - self.centre).cross_matrix();
        let (linear, mixed, angular) = (
            inverse.fixed_view::<3, 3>(0, 0),
            inverse.fixed_view::<3, 3>(0, 3),
            inverse.fixed_view::<3, 3>(3, 3),
        );
        Some(linear + mixed * arm - arm * mixed.transpose() - arm * angular * arm)
    }

    /// Largest change of its speed at any of the points under forces there for `h`
    /// seconds, m/s.
    fn kick<'a>(
        &self,
        forces: impl Iterator<Item = (&'a Vector3<f64>, Vector3<f64>)> + Clone,
        h: f64,
    ) -> f64 {
        let Some(inverse) = self.inverse else {
            return 0.0;
        };
        let mut impulse = Vector6::zeros();
        for (point, force) in forces.clone() {
            let rotation = (point - self.centre).cross(&force);
            impulse += Vector6::new(
                force.x, force.y, force.z, rotation.x, rotation.y, rotation.z,
            ) * h;
        }
        let change = inverse * impulse;
        let (linear, angular) = (change.xyz(), Vector3::new(change[3], change[4], change[5]));
        forces
            .map(|(point, _)| (linear + angular.cross(&(point - self.centre))).norm())
            .fold(0.0, f64::max)
    }
}

/// All contact candidates of a tick, during its solution.
pub(super) struct ContactSolution<'a> {
    candidates: &'a [ContactCandidate],
    solids: &'a [Mobility],
    /// Positions of the points at the start of the tick, metres.
    points: Vec<Vector3<f64>>,
    friction_states: Vec<FrictionState>,
    /// Share of the foundation's stiffness at each solid, 0 to 1.
    softened: Vec<f64>,
    h: f64,
}

impl<'a> ContactSolution<'a> {
    /// The contacts for a body that keeps its velocity.
    pub(super) fn new(
        body: &Elastic,
        position: &[Vector3<f64>],
        velocity: &[Vector3<f64>],
        candidates: &'a [ContactCandidate],
        solids: &'a [Mobility],
        h: f64,
    ) -> Self {
        let points: Vec<_> = candidates
            .iter()
            .map(|t| t.interpolate(body, position))
            .collect();
        let mut solution = Self {
            candidates,
            solids,
            points,
            friction_states: vec![FrictionState::Open; candidates.len()],
            softened: vec![1.0; solids.len()],
            h,
        };
        let mut burden = vec![0.0; solids.len()];
        for (i, t) in candidates.iter().enumerate() {
            let (normal, bristle) = solution.trial(body, velocity, i);
            if normal > 0.0 {
                solution.friction_states[i] =
                    FrictionState::Closed(share(t.friction * normal, bristle.norm()));
                if let Some(give) = solids[t.solid].velocity_response(&solution.points[i]) {
                    burden[t.solid] += h * h * t.stiffness * give.trace();
                }
            }
        }
        for (soft, burden) in solution.softened.iter_mut().zip(burden) {
            *soft = (HEAVY / burden.max(HEAVY)).min(1.0);
        }
        solution
    }

    /// Initial energy of the contacts, J.
    pub(super) fn energy(&self) -> f64 {
        let all = self.candidates.iter().zip(&self.points).enumerate();
        all.map(|(i, (t, point))| self.stiffness(i) * t.strained(point))
            .sum()
    }

    /// Reduces the stiffness of all contacts to a share.
    pub(super) fn soften(&mut self, share: f64) {
        for soft in &mut self.softened {
            *soft *= share;
        }
    }

    fn stiffness(&self, i: usize) -> f64 {
        let t = &self.candidates[i];
        t.stiffness * self.softened[t.solid]
    }

    /// Normal force and the force of the whole bristle at the end of the tick, N.
    fn trial(&self, body: &Elastic, velocity: &[Vector3<f64>], i: usize) -> (f64, Vector3<f64>) {
        let t = &self.candidates[i];
        let stiffness = self.stiffness(i);
        let moved = (t.interpolate(body, velocity) - t.velocity) * self.h;
        let normal = -stiffness * (t.gap + t.normal.dot(&moved));
        let bristle = (t.bend(&self.points[i]) - t.along(&moved)) * stiffness;
        (normal, bristle)
    }

    /// The springs of the next solution.
    pub(super) fn springs(&self) -> impl Iterator<Item = Spring> + '_ {
        let h = self.h;
        self.candidates
            .iter()
            .enumerate()
            .filter_map(move |(i, t)| {
                let FrictionState::Closed(share) = self.friction_states[i] else {
                    return None;
                };
                let across = t.normal * t.normal.transpose();
                let along = (Matrix3::identity() - across) * share;
                // At the end of the tick the point should be on the surface and at its
                // bristle; both move with the solid.
                let pull = t.normal * -t.gap
                    + t.bend(&self.points[i]) * share
                    + (across + along) * t.velocity * h;
                let stiffness = self.stiffness(i) * h;
                Some(Spring {
                    cell: t.cell,
                    weights: t.weights,
                    block: (across + along) * (stiffness * h),
                    push: pull * stiffness,
                })
            })
    }

    /// Checks the contacts against a solution: returns whether all obey their laws.
    /// Others are changed for the next solution; with `giving` a contact only opens or
    /// holds less, so that the iteration ends.
    pub(super) fn agree(
        &mut self,
        body: &Elastic,
        velocity: &[Vector3<f64>],
        giving: bool,
    ) -> bool {
        let mut agreed = true;
        for i in 0..self.candidates.len() {
            let (normal, bristle) = self.trial(body, velocity, i);
            let limit = self.candidates[i].friction * normal.max(0.0);
            let pull = bristle.norm();
            let next = match self.friction_states[i] {
                FrictionState::Open if giving || normal <= 0.0 => continue,
                FrictionState::Open => FrictionState::Closed(share(limit, pull)),
                FrictionState::Closed(_) if normal < -NOTHING => FrictionState::Open,
                FrictionState::Closed(now) if now * pull > COULOMB * limit + NOTHING => {
                    FrictionState::Closed(AIM * limit / pull)
                }
                FrictionState::Closed(now)
                    if !giving && now < 1.0 && now * pull < TIGHT * limit =>
                {
                    FrictionState::Closed(share(AIM * limit, pull))
                }
                FrictionState::Closed(_) => continue,
            };
            self.friction_states[i] = next;
            agreed = false;
        }
        let kicks = self.kicks(&self.forces(body, velocity));
        for (soft, kick) in self.softened.iter_mut().zip(kicks) {
            if kick > KICK {
                *soft *= GENTLE * KICK / kick;
                agreed = false;
            }
        }
        agreed
    }

    /// Largest change of speed of every solid, m/s.
    pub(super) fn kicks(&self, forces: &[ContactForce]) -> Vec<f64> {
        let of = |solid: usize| {
            let candidates = self.candidates.iter().zip(&self.points).zip(forces);
            candidates
                .filter(move |((t, _), _)| t.solid == solid)
                .map(|((_, point), contact)| (point, -contact.force))
        };
        let solids = self.solids.iter().enumerate();
        solids.map(|(s, solid)| solid.kick(of(s), self.h)).collect()
    }

    /// Force at every contact of a solution. Without convergence the excess is cut off.
    pub(super) fn forces(&self, body: &Elastic, velocity: &[Vector3<f64>]) -> Vec<ContactForce> {
        let all = 0..self.candidates.len();
        all.map(|i| self.contact_force(body, velocity, i)).collect()
    }

    fn contact_force(&self, body: &Elastic, velocity: &[Vector3<f64>], i: usize) -> ContactForce {
        let t = &self.candidates[i];
        let stiffness = self.stiffness(i);
        let before = stiffness * t.strained(&self.points[i]);
        let open = ContactForce {
            energy: [before, 0.0],
            ..ContactForce::default()
        };
        let FrictionState::Closed(share) = self.friction_states[i] else {
            return open;
        };
        let (normal, bristle) = self.trial(body, velocity, i);
        if normal <= 0.0 {
            return open;
        }
        let (limit, pull) = (t.friction * normal, share * bristle.norm());
        let kept = if pull > limit { limit / pull } else { 1.0 };
        let drag = bristle * (share * kept);
        // Relative to the solid, which moves too.
        let end = self.points[i] + (t.interpolate(body, velocity) - t.velocity) * self.h;
        let after = (normal * normal + drag.norm_squared()) / (2.0 * stiffness);
        ContactForce {
            normal,
            drag,
            force: t.normal * normal + drag,
            anchor: Some(end + drag / stiffness),
            energy: [before, after],
        }
    }
}

/// Share of a bristle that pulls with `pull` N and may hold `limit` N.
fn share(limit: f64, pull: f64) -> f64 {
    if pull <= limit { 1.0 } else { limit / pull }
}

impl ContactCandidate {
    fn interpolate(&self, body: &Elastic, of: &[Vector3<f64>]) -> Vector3<f64> {
        let nodes = body.cells[self.cell].nodes.iter().zip(&self.weights);
        nodes.map(|(i, w)| of[*i] * *w).sum()
    }

    /// Tangential part of a vector.
    fn along(&self, v: &Vector3<f64>) -> Vector3<f64> {
        v - self.normal * self.normal.dot(v)
    }

    /// Bend of the bristle at the start of the tick.
    fn bend(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.anchor
            .map_or_else(Vector3::zeros, |a| self.along(&(a - point)))
    }

    /// Energy of the foundation and of the bristle at the start of the tick per
    /// stiffness, m².
    fn strained(&self, point: &Vector3<f64>) -> f64 {
        if self.gap < 0.0 {
            0.5 * (self.gap * self.gap + self.bend(point).norm_squared())
        } else {
            0.0
        }
    }
}
