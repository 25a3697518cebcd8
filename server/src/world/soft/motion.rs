//! Motion of an elastic body: one implicit step a tick, contacts included.
//!
//! The velocities after the tick solve `(M + h (h + d) K) v = M v0 + h (f + p)`
//! with the stiffness K of the corotated cells and the pressure p of the
//! contacts at the end of the tick, by conjugate gradients. A contact is an
//! elastic foundation with a bristle: normal pressure never pulls, friction
//! never exceeds the Coulomb limit; which contacts press, stick or slip is
//! found by repeating the solution.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::elastic::Elastic;
use super::turn::Turn;

/// Solutions per tick, until the contacts agree.
const ROUNDS: usize = 4;
/// Most conjugate-gradient steps of a solution.
const STEPS: usize = 80;
/// Error of the velocities at which a solution is good, m/s; it weighs the
/// motion of the whole ten times less than that of a node.
const GOOD: f64 = 1e-6;
/// Friction that changes by less than this part has settled.
const SETTLED: f64 = 0.02;

/// Everything that a tick changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Nodes in `house`, metres.
    pub position: Vec<Vector3<f64>>,
    /// m/s.
    pub velocity: Vec<Vector3<f64>>,
    /// Rotation of every cell.
    pub(super) turns: Vec<Turn>,
    /// Rotation of the whole.
    pub(super) whole: Turn,
}

/// A point of the skin near a solid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Touch {
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
    /// Where the bristle stands at the start of the tick; `None` for a new contact.
    pub anchor: Option<Vector3<f64>>,
    /// Velocity of the solid there, m/s.
    pub solid: Vector3<f64>,
}

/// What a touch did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pressed {
    /// Force on the body, N.
    pub force: Vector3<f64>,
    /// Where the bristle stands on the solid after the tick, given for the place
    /// that the solid had at its start; `None` where nothing touches.
    pub anchor: Option<Vector3<f64>>,
}

impl Pressed {
    /// Whether all numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        let anchor = self.anchor.unwrap_or_default();
        self.force.iter().chain(&anchor).all(|x| x.is_finite())
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Grip {
    Open,
    Stick,
    /// Friction on the body, N.
    Slip(Vector3<f64>),
}

/// Scratch memory of the solver.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    elastic: Vec<Matrix3<f64>>,
    matrix: Vec<Matrix3<f64>>,
    inverse: Vec<Matrix3<f64>>,
    force: Vec<Vector3<f64>>,
    right: Vec<Vector3<f64>>,
    residual: Vec<Vector3<f64>>,
    direction: Vec<Vector3<f64>>,
    product: Vec<Vector3<f64>>,
    /// Conjugate-gradient steps since the start.
    pub steps: u64,
}

impl State {
    /// At rest with its frame at `house_from_body`.
    #[must_use]
    pub fn placed(body: &Elastic, house_from_body: &nalgebra::Isometry3<f64>) -> Self {
        let q = house_from_body.rotation;
        let turn = Turn::new([q.i, q.j, q.k, q.w]);
        let place = |x: &Vector3<f64>| (house_from_body * nalgebra::Point3::from(*x)).coords;
        Self {
            position: body.rest.iter().map(place).collect(),
            velocity: vec![Vector3::zeros(); body.nodes()],
            turns: vec![turn; body.cells.len()],
            whole: turn,
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
        let moving = self.velocity.iter().zip(&body.masses);
        let kinetic = moving.map(|(v, m)| 0.5 * m * v.norm_squared()).sum();
        (body.energy(&self.position, &self.turns), kinetic)
    }
}

impl Touch {
    fn at(&self, body: &Elastic, of: &[Vector3<f64>]) -> Vector3<f64> {
        let nodes = body.cells[self.cell].nodes.iter().zip(&self.weights);
        nodes.map(|(i, w)| of[*i] * *w).sum()
    }

    /// Part of a vector along the surface.
    fn along(&self, v: &Vector3<f64>) -> Vector3<f64> {
        v - self.normal * self.normal.dot(v)
    }

    /// How far the bristle is bent at the start of the tick.
    fn bend(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.anchor
            .map_or_else(Vector3::zeros, |a| self.along(&(a - point)))
    }
}

/// One tick of `h` seconds under `load` N on each node; nodes in `held` keep
/// their velocity.
pub(super) fn step(
    body: &Elastic,
    state: &mut State,
    touches: &[Touch],
    load: impl Fn(usize) -> Vector3<f64>,
    held: &[usize],
    h: f64,
    scratch: &mut Scratch,
) -> Vec<Pressed> {
    scratch.prepare(body);
    body.follow(&state.position, &mut state.turns);
    // An implicit step damps as much as a damping time of its own length.
    let stiff = h * (h + (body.damping - h).max(0.0));
    body.assemble(
        &state.position,
        &state.turns,
        stiff,
        &mut scratch.force,
        &mut scratch.elastic,
    );
    for i in 0..body.nodes() {
        let m = body.masses[i];
        scratch.elastic[body.diagonal[i]] += Matrix3::identity() * m;
        scratch.force[i] = state.velocity[i] * m + (scratch.force[i] + load(i)) * h;
    }
    let points: Vec<Vector3<f64>> = touches
        .iter()
        .map(|t| t.at(body, &state.position))
        .collect();
    let mut grips: Vec<Grip> = touches
        .iter()
        .map(|t| {
            let closing = t.at(body, &state.velocity) - t.solid;
            if t.gap + h * t.normal.dot(&closing) < 0.0 {
                Grip::Stick
            } else {
                Grip::Open
            }
        })
        .collect();
    for round in 0..ROUNDS {
        scratch.add_touches(body, touches, &points, &grips, h);
        scratch.hold(body, held, &state.velocity);
        scratch.solve(body, &mut state.velocity);
        if round + 1 == ROUNDS {
            break;
        }
        let last = round + 2 == ROUNDS;
        let mut settled = true;
        for ((t, point), grip) in touches.iter().zip(&points).zip(&mut grips) {
            let next = t.next_grip(body, &state.velocity, point, *grip, h, last);
            settled &= same(*grip, next);
            *grip = next;
        }
        if settled {
            break;
        }
    }
    let pressed = touches
        .iter()
        .zip(&points)
        .zip(&grips)
        .map(|((t, point), grip)| t.pressed(body, &state.velocity, point, *grip, h))
        .collect();
    for (x, v) in state.position.iter_mut().zip(&state.velocity) {
        *x += v * h;
    }
    let carried = body.carried(&state.position);
    state.whole.follow(&carried);
    pressed
}

fn same(a: Grip, b: Grip) -> bool {
    match (a, b) {
        (Grip::Slip(a), Grip::Slip(b)) => (a - b).norm() <= SETTLED * b.norm() + 1e-6,
        _ => a == b,
    }
}

impl Touch {
    /// Normal force and the bristle's force at the end of the tick, N.
    fn forces(
        &self,
        body: &Elastic,
        velocity: &[Vector3<f64>],
        point: &Vector3<f64>,
        h: f64,
    ) -> (f64, Vector3<f64>) {
        let moved = (self.at(body, velocity) - self.solid) * h;
        let normal = -self.stiffness * (self.gap + self.normal.dot(&moved));
        let bristle = (self.bend(point) - self.along(&moved)) * self.stiffness;
        (normal, bristle)
    }

    fn next_grip(
        &self,
        body: &Elastic,
        velocity: &[Vector3<f64>],
        point: &Vector3<f64>,
        grip: Grip,
        h: f64,
        last: bool,
    ) -> Grip {
        let (normal, bristle) = self.forces(body, velocity, point, h);
        if normal <= 0.0 {
            return Grip::Open;
        }
        let limit = self.friction * normal;
        let pull = bristle.norm();
        let sliding = matches!(grip, Grip::Slip(_)) && last;
        if pull <= limit && !sliding {
            Grip::Stick
        } else {
            Grip::Slip(bristle * (limit / pull.max(1e-12)).min(1.0))
        }
    }

    fn pressed(
        &self,
        body: &Elastic,
        velocity: &[Vector3<f64>],
        point: &Vector3<f64>,
        grip: Grip,
        h: f64,
    ) -> Pressed {
        let (normal, bristle) = self.forces(body, velocity, point, h);
        let drag = match grip {
            Grip::Open => return Pressed::default(),
            Grip::Stick => bristle,
            Grip::Slip(drag) => drag,
        };
        if normal <= 0.0 {
            return Pressed {
                force: self.normal * normal + drag,
                anchor: None,
            };
        }
        // Seen from the solid, which moves too.
        let end = point + (self.at(body, velocity) - self.solid) * h;
        Pressed {
            force: self.normal * normal + drag,
            anchor: Some(end + drag / self.stiffness),
        }
    }
}

impl Scratch {
    fn prepare(&mut self, body: &Elastic) {
        let n = body.nodes();
        for blocks in [&mut self.elastic, &mut self.matrix] {
            blocks.clear();
            blocks.resize(body.columns.len(), Matrix3::zeros());
        }
        self.inverse.resize(n, Matrix3::zeros());
        for vectors in [
            &mut self.force,
            &mut self.right,
            &mut self.residual,
            &mut self.direction,
            &mut self.product,
        ] {
            vectors.clear();
            vectors.resize(n, Vector3::zeros());
        }
    }

    fn add_touches(
        &mut self,
        body: &Elastic,
        touches: &[Touch],
        points: &[Vector3<f64>],
        grips: &[Grip],
        h: f64,
    ) {
        self.matrix.copy_from_slice(&self.elastic);
        self.right.copy_from_slice(&self.force);
        for ((t, point), grip) in touches.iter().zip(points).zip(grips) {
            let across = t.normal * t.normal.transpose();
            // At the end of the tick the point wants to be on the surface and,
            // where it sticks, at its bristle; both move with the solid.
            let reach = t.solid * h;
            let lift = t.normal * (-t.gap);
            let (block, pull) = match grip {
                Grip::Open => continue,
                Grip::Stick => (Matrix3::identity(), lift + t.bend(point) + reach),
                Grip::Slip(drag) => (across, lift + across * reach + drag / t.stiffness),
            };
            let push = pull * (t.stiffness * h);
            let block = block * (t.stiffness * h * h);
            let cell = &body.cells[t.cell];
            for a in 0..4 {
                self.right[cell.nodes[a]] += push * t.weights[a];
                for b in 0..4 {
                    self.matrix[cell.blocks[a][b]] += block * (t.weights[a] * t.weights[b]);
                }
            }
        }
    }

    /// Rows of held nodes say that nothing changes.
    fn hold(&mut self, body: &Elastic, held: &[usize], velocity: &[Vector3<f64>]) {
        for &i in held {
            for block in body.rows[i]..body.rows[i + 1] {
                let j = body.columns[block];
                self.matrix[block] = Matrix3::zeros();
                for other in body.rows[j]..body.rows[j + 1] {
                    if body.columns[other] == i {
                        let blocked = self.matrix[other];
                        self.right[j] -= blocked * velocity[i];
                        self.matrix[other] = Matrix3::zeros();
                    }
                }
            }
            self.matrix[body.diagonal[i]] = Matrix3::identity();
            self.right[i] = velocity[i];
        }
    }

    /// Conjugate gradients from the velocities before.
    fn solve(&mut self, body: &Elastic, velocity: &mut [Vector3<f64>]) {
        let good = GOOD * GOOD * body.mass;
        for i in 0..body.nodes() {
            let block = self.matrix[body.diagonal[i]];
            self.inverse[i] = block.try_inverse().unwrap_or_default();
        }
        let mut size = 0.0;
        for i in 0..body.nodes() {
            let residual = self.right[i] - self.row(body, i, velocity);
            let wanted = self.inverse[i] * residual;
            self.residual[i] = residual;
            self.direction[i] = wanted;
            size += residual.dot(&wanted);
        }
        for _ in 0..STEPS {
            if size <= good || !size.is_finite() {
                break;
            }
            self.steps += 1;
            let mut curve = 0.0;
            for i in 0..body.nodes() {
                self.product[i] = self.row(body, i, &self.direction);
                curve += self.product[i].dot(&self.direction[i]);
            }
            let far = size / curve;
            let mut next = 0.0;
            for (i, velocity) in velocity.iter_mut().enumerate().take(body.nodes()) {
                *velocity += self.direction[i] * far;
                self.residual[i] -= self.product[i] * far;
                next += self.residual[i].dot(&(self.inverse[i] * self.residual[i]));
            }
            let keep = next / size;
            for i in 0..body.nodes() {
                self.direction[i] = self.inverse[i] * self.residual[i] + self.direction[i] * keep;
            }
            size = next;
        }
    }

    fn row(&self, body: &Elastic, i: usize, of: &[Vector3<f64>]) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for block in body.rows[i]..body.rows[i + 1] {
            sum += self.matrix[block] * of[body.columns[block]];
        }
        sum
    }
}
