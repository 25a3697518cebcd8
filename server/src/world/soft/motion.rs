//! Motion of an elastic body: one implicit step per tick, contacts included.
//!
//! The velocities after the tick solve `(M + h (h + d) K) v = M v0 + h (f + p)` by
//! conjugate gradients. K is the stiffness of the corotated cells, p the pressure of
//! the contacts at the end of the tick. Repeated solutions find which contacts press
//! and how much their bristles hold: at first in both directions, then only by
//! releasing, until every contact obeys its laws.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::contact_force::{ContactCandidate, ContactForce, ContactSolution, Mobility};
use super::elastic::Elastic;
use super::rotation::Rotation;
use super::solver::{Scratch, Tick};

/// Solutions in which contacts may still close and hold more.
const FREE: usize = 3;
/// Largest number of solutions of a tick.
const ROUNDS: usize = 16;

/// State of an elastic body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Nodes in `house`, metres.
    pub position: Vec<Vector3<f64>>,
    /// m/s.
    pub velocity: Vec<Vector3<f64>>,
    /// Rotation of every cell.
    pub(super) rotations: Vec<Rotation>,
    /// Rotation of the whole body.
    pub(super) whole: Rotation,
}

impl State {
    /// At rest with its frame at `house_from_body`.
    #[must_use]
    pub fn placed(body: &Elastic, house_from_body: &nalgebra::Isometry3<f64>) -> Self {
        let q = house_from_body.rotation;
        let rotation = Rotation::new([q.i, q.j, q.k, q.w]);
        let place = |x: &Vector3<f64>| (house_from_body * nalgebra::Point3::from(*x)).coords;
        Self {
            position: body.rest.iter().map(place).collect(),
            velocity: vec![Vector3::zeros(); body.nodes()],
            rotations: vec![rotation; body.cells.len()],
            whole: rotation,
        }
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let mut all = self.position.iter().chain(&self.velocity);
        all.all(|v| v.iter().all(|x| x.is_finite()))
    }

    /// The elastic and the kinetic energy, J.
    #[must_use]
    pub fn energy(&self, body: &Elastic) -> (f64, f64) {
        let elastic = body.energy(&self.position, &self.rotations);
        (elastic, self.kinetic_energy(body))
    }

    /// The kinetic energy, J.
    #[must_use]
    pub fn kinetic_energy(&self, body: &Elastic) -> f64 {
        let moving = self.velocity.iter().zip(&body.masses);
        moving.map(|(v, m)| 0.5 * m * v.norm_squared()).sum()
    }

    /// Speed of the fastest node, m/s.
    #[must_use]
    pub fn fastest(&self) -> f64 {
        let speeds = self.velocity.iter().map(Vector3::norm_squared);
        speeds.fold(0.0, f64::max).sqrt()
    }
}

/// Result of a tick.
pub(super) struct TickResult {
    /// Force at every contact.
    pub forces: Vec<ContactForce>,
    /// Elastic energy at the start, J.
    pub elastic: f64,
    /// Largest change of a solid's speed, m/s.
    pub kick: f64,
    /// Share of the contacts' stiffness, 0 to 1.
    pub share: f64,
}

/// Loads on a body during a tick.
pub(super) struct TickLoads<'a, L, S> {
    /// Points of the skin near solids, and those solids.
    pub candidates: &'a [ContactCandidate],
    pub solids: &'a [Mobility],
    /// Force on each node, N.
    pub load: L,
    /// Nodes that keep their velocity.
    pub held: &'a [usize],
    /// Receives the elastic energy and the initial energy of the contacts, J, and
    /// returns a share of their stiffness.
    pub soften: S,
}

/// One tick of `h` seconds.
pub(super) fn step(
    body: &Elastic,
    state: &mut State,
    acting: TickLoads<'_, impl Fn(usize) -> Vector3<f64>, impl FnOnce(f64, f64) -> f64>,
    h: f64,
    scratch: &mut Scratch,
) -> TickResult {
    let TickLoads {
        candidates,
        solids,
        load,
        held,
        soften,
    } = acting;
    scratch.prepare(body);
    // An implicit step damps like a damping time equal to its length.
    let stiff = h * (h + (body.damping - h).max(0.0));
    let elastic = body.assemble(
        [&state.position, &state.velocity],
        &mut state.rotations,
        [h, stiff],
        &mut scratch.force,
        &mut scratch.matrix,
    );
    for i in 0..body.nodes() {
        scratch.force[i] += load(i) * h;
        scratch.weigh(body, i);
    }
    scratch.begin(body, held);
    let mut solution = ContactSolution::new(
        body,
        &state.position,
        &state.velocity,
        candidates,
        solids,
        h,
    );
    let share = soften(elastic, solution.energy());
    solution.soften(share);
    let before = state.velocity.clone();
    let tick = Tick {
        body,
        rotations: &state.rotations,
        stiff,
        before: &before,
    };
    for round in 0..ROUNDS {
        scratch.put_springs(body, solution.springs());
        scratch.solve(tick, &mut state.velocity);
        if round + 1 == ROUNDS {
            scratch.unsettled += 1;
        } else if solution.agree(body, &state.velocity, round >= FREE) {
            break;
        }
    }
    let forces = solution.forces(body, &state.velocity);
    let kick = solution.kicks(&forces).into_iter().fold(0.0, f64::max);
    for (x, v) in state.position.iter_mut().zip(&state.velocity) {
        *x += v * h;
    }
    let carried = body.carried(&state.position);
    state.whole.extract_rotation(&carried);
    TickResult {
        forces,
        elastic,
        kick,
        share,
    }
}

/// Contact forces of a body at rest.
pub(super) fn standing(
    body: &Elastic,
    state: &State,
    candidates: &[ContactCandidate],
    solids: &[Mobility],
    h: f64,
) -> Vec<ContactForce> {
    let (position, velocity) = (&state.position, &state.velocity);
    ContactSolution::new(body, position, velocity, candidates, solids, h).forces(body, velocity)
}
