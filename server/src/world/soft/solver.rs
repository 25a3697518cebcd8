//! The linear system of a tick: blocks of 3 x 3, conjugate gradients.
//!
//! The residual and the velocities are kept in double precision; the change of the
//! velocities is computed in single precision (`lanes`).

use nalgebra::{Matrix3, Vector3};

use super::elastic::Elastic;
use super::lanes::{Block, Lanes, block, inverse, lanes, sum, times};
use super::rotation::Rotation;

/// Largest number of conjugate-gradient steps of a solution.
const STEPS: u64 = 80;
/// Velocity error of an accepted solution, m/s; it weighs rigid motion ten times less
/// than that of a node.
const GOOD: f64 = 1e-6;
/// Share of [`GOOD`] requested from single precision.
const REQUESTED: f64 = 0.5;
/// Change of the velocities, m/s, after which the residual is recomputed: single
/// precision has a relative error of about 1e-7 of the change.
const TRUSTED: f64 = 0.05;

/// A contact in the linear system: a spring from a point of the body to a target that
/// moves with the solid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spring {
    /// Cell that carries the point, and the weights of its corners.
    pub cell: usize,
    pub weights: [f64; 4],
    /// Change of the impulse on the point per velocity, N·s²/m.
    pub block: Matrix3<f64>,
    /// Impulse on the point at rest, N·s.
    pub push: Vector3<f64>,
}

/// The linear system and its scratch memory.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    /// Masses, stiffness and the active springs.
    pub(super) matrix: Vec<Block>,
    /// Inverses of the diagonal blocks; zero for held nodes.
    inverse: Vec<Block>,
    /// Residual of the former velocities without springs, N·s; filled by the step.
    pub(super) force: Vec<Vector3<f64>>,
    /// The same for the present velocities.
    rest: Vec<Vector3<f64>>,
    /// The same with springs.
    left: Vec<Vector3<f64>>,
    springs: Vec<Spring>,
    /// Blocks before the springs were added, in the order of their change.
    covered: Vec<(usize, Block)>,
    is_covered: Vec<bool>,
    is_held: Vec<bool>,
    residual: Vec<Lanes>,
    change: Vec<Lanes>,
    direction: Vec<Lanes>,
    product: Vec<Lanes>,
    /// Change of the velocities since `rest` was computed, m/s.
    moved: f64,
    /// Conjugate-gradient steps since the start.
    pub steps: u64,
    /// Solutions since the start.
    pub solutions: u64,
    /// Ticks whose contacts did not converge.
    pub unsettled: u64,
}

/// Parameters of the stiffness of a tick.
#[derive(Clone, Copy)]
pub(super) struct Tick<'a> {
    pub body: &'a Elastic,
    pub rotations: &'a [Rotation],
    /// Factor of the stiffness, s².
    pub stiff: f64,
    /// Former velocities, m/s.
    pub before: &'a [Vector3<f64>],
}

impl Scratch {
    /// Allocates and sets everything to zero.
    pub(super) fn prepare(&mut self, body: &Elastic) {
        let n = body.nodes();
        self.matrix.clear();
        self.matrix.resize(body.columns.len(), Block::default());
        self.force.clear();
        self.force.resize(n, Vector3::zeros());
        self.springs.clear();
        self.covered.clear();
        self.is_covered.clear();
        self.is_covered.resize(body.cells.len(), false);
        for lanes in [
            &mut self.residual,
            &mut self.change,
            &mut self.direction,
            &mut self.product,
        ] {
            lanes.resize(n, Lanes::default());
        }
    }

    /// Adds the mass of a node.
    pub(super) fn weigh(&mut self, body: &Elastic, node: usize) {
        let mass = body.masses[node] as f32;
        let mut lane = [0.0; 4];
        for (j, column) in self.matrix[body.diagonal[node]].iter_mut().enumerate() {
            lane[j] = mass;
            *column += Lanes::new(lane);
            lane[j] = 0.0;
        }
    }

    /// Starts with the system that the step has filled in; held nodes keep their
    /// velocities.
    pub(super) fn begin(&mut self, body: &Elastic, held: &[usize]) {
        self.rest.clone_from(&self.force);
        self.moved = 0.0;
        self.is_held.clear();
        self.is_held.resize(body.nodes(), false);
        for &i in held {
            self.is_held[i] = true;
        }
        self.inverse.clear();
        self.inverse.resize(body.nodes(), Block::default());
        for i in 0..body.nodes() {
            self.invert(body, i);
        }
    }

    /// Replaces the springs of the system.
    pub(super) fn put_springs(&mut self, body: &Elastic, springs: impl Iterator<Item = Spring>) {
        let last = std::mem::take(&mut self.springs);
        for (block, before) in self.covered.drain(..).rev() {
            self.matrix[block] = before;
        }
        for spring in &last {
            self.is_covered[spring.cell] = false;
        }
        self.springs.extend(springs);
        for spring in &self.springs {
            let cell = &body.cells[spring.cell];
            let blocks = cell.blocks.iter().flatten();
            if !std::mem::replace(&mut self.is_covered[spring.cell], true) {
                let matrix = &self.matrix;
                let before = blocks.clone().map(|&block| (block, matrix[block]));
                self.covered.extend(before);
            }
            let own = block(&spring.block);
            for (a, row) in cell.blocks.iter().enumerate() {
                for (b, &place) in row.iter().enumerate() {
                    let weight = Lanes::splat((spring.weights[a] * spring.weights[b]) as f32);
                    for (column, own) in self.matrix[place].iter_mut().zip(&own) {
                        *column += *own * weight;
                    }
                }
            }
        }
        // The nodes with former or present springs.
        let mut cells: Vec<usize> = last.iter().chain(&self.springs).map(|s| s.cell).collect();
        cells.dedup();
        for cell in cells {
            for node in body.cells[cell].nodes {
                self.invert(body, node);
            }
        }
    }

    fn invert(&mut self, body: &Elastic, node: usize) {
        if !self.is_held[node] {
            self.inverse[node] = inverse(&self.matrix[body.diagonal[node]]);
        }
    }

    /// Conjugate gradients from the present velocities, until the residual is accepted.
    pub(super) fn solve(&mut self, tick: Tick<'_>, velocity: &mut [Vector3<f64>]) {
        self.solutions += 1;
        let good = GOOD * GOOD * tick.body.mass;
        let mut left = STEPS;
        loop {
            let size = self.residual_norm(tick.body, velocity);
            if size <= good || left == 0 || !size.is_finite() {
                return;
            }
            let taken = self.descend(tick.body, size, good * REQUESTED * REQUESTED, left);
            self.steps += taken;
            left -= taken;
            let mut furthest: f32 = 0.0;
            for (v, change) in velocity.iter_mut().zip(&self.change) {
                let change = change.to_array();
                for (v, change) in v.iter_mut().zip(change) {
                    *v += f64::from(change);
                    furthest = furthest.max(change.abs());
                }
            }
            self.moved += f64::from(furthest);
            if self.moved > TRUSTED {
                self.work_out(tick, velocity);
            } else {
                self.take_over(tick.body, velocity);
            }
        }
    }

    /// Converts the residual to lanes; returns its norm.
    fn residual_norm(&mut self, body: &Elastic, velocity: &[Vector3<f64>]) -> f64 {
        self.left.clone_from(&self.rest);
        press(&mut self.left, &self.springs, body, velocity, 1.0);
        let mut size = Lanes::default();
        for i in 0..body.nodes() {
            let residual = lanes(&self.left[i]);
            self.residual[i] = residual;
            self.direction[i] = times(&self.inverse[i], residual);
            size += residual * self.direction[i];
        }
        f64::from(sum(size))
    }

    /// Iterates from zero change until `good`, at most `most` steps; returns their
    /// number.
    fn descend(&mut self, body: &Elastic, size: f64, good: f64, most: u64) -> u64 {
        let good = good as f32;
        let mut size = size as f32;
        self.change.fill(Lanes::default());
        for taken in 1..=most {
            let mut curve = Lanes::default();
            for i in 0..body.nodes() {
                let blocks = body.rows[i]..body.rows[i + 1];
                let product = row(
                    &self.matrix[blocks.clone()],
                    &body.columns[blocks],
                    &self.direction,
                );
                self.product[i] = product;
                curve += product * self.direction[i];
            }
            let far = Lanes::splat(size / sum(curve));
            let mut next = Lanes::default();
            for i in 0..body.nodes() {
                self.change[i] += self.direction[i] * far;
                let residual = self.residual[i] - self.product[i] * far;
                self.residual[i] = residual;
                let wanted = times(&self.inverse[i], residual);
                self.product[i] = wanted;
                next += residual * wanted;
            }
            let next = sum(next);
            if next <= good || !next.is_finite() {
                return taken;
            }
            let keep = Lanes::splat(next / size);
            for (direction, wanted) in self.direction.iter_mut().zip(&self.product) {
                *direction = *wanted + *direction * keep;
            }
            size = next;
        }
        most
    }

    /// Adopts the residual of single precision.
    fn take_over(&mut self, body: &Elastic, velocity: &[Vector3<f64>]) {
        for (i, rest) in self.rest.iter_mut().enumerate() {
            if !self.is_held[i] {
                let [x, y, z, _] = self.residual[i].to_array().map(f64::from);
                *rest = Vector3::new(x, y, z);
            }
        }
        press(&mut self.rest, &self.springs, body, velocity, -1.0);
    }

    /// Recomputes the residual without springs in double precision.
    fn work_out(&mut self, tick: Tick<'_>, velocity: &[Vector3<f64>]) {
        self.moved = 0.0;
        let changes = velocity.iter().zip(tick.before).map(|(now, v)| now - v);
        let changes: Vec<Vector3<f64>> = changes.collect();
        self.rest.clone_from(&self.force);
        let masses = tick.body.masses.iter().zip(&changes);
        for (rest, (mass, change)) in self.rest.iter_mut().zip(masses) {
            *rest -= change * *mass;
        }
        tick.body
            .resist(&changes, tick.rotations, tick.stiff, &mut self.rest);
    }
}

/// Adds the impulses of springs at velocities, times `sign`.
fn press(
    to: &mut [Vector3<f64>],
    springs: &[Spring],
    body: &Elastic,
    velocity: &[Vector3<f64>],
    sign: f64,
) {
    for spring in springs {
        let nodes = body.cells[spring.cell].nodes;
        let corners = nodes.iter().zip(&spring.weights);
        let speed: Vector3<f64> = corners.clone().map(|(&i, w)| velocity[i] * *w).sum();
        let impulse = (spring.push - spring.block * speed) * sign;
        for (&i, weight) in corners {
            to[i] += impulse * *weight;
        }
    }
}

fn row(blocks: &[Block], columns: &[usize], of: &[Lanes]) -> Lanes {
    let (mut x, mut y, mut z) = (Lanes::default(), Lanes::default(), Lanes::default());
    for (block, &column) in blocks.iter().zip(columns) {
        let [a, b, c, _] = of[column].to_array();
        x += block[0] * Lanes::splat(a);
        y += block[1] * Lanes::splat(b);
        z += block[2] * Lanes::splat(c);
    }
    x + y + z
}
