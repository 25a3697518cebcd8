//! The linear system of a tick: blocks of 3 x 3, conjugate gradients.

use nalgebra::{Matrix3, Vector3};

use super::elastic::Elastic;

/// Most conjugate-gradient steps of a solution.
const STEPS: usize = 80;
/// Error of the velocities at which a solution is good, m/s; it weighs the
/// motion of the whole ten times less than that of a node.
const GOOD: f64 = 1e-6;

/// A contact as the system sees it: a spring from a point of the body to a
/// target that moves with the solid.
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

/// The system, and scratch memory to solve it.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    /// Masses and stiffness without contacts; filled by the step.
    pub(super) elastic: Vec<Matrix3<f64>>,
    matrix: Vec<Matrix3<f64>>,
    inverse: Vec<Matrix3<f64>>,
    /// Right side without contacts; filled by the step.
    pub(super) force: Vec<Vector3<f64>>,
    right: Vec<Vector3<f64>>,
    residual: Vec<Vector3<f64>>,
    direction: Vec<Vector3<f64>>,
    product: Vec<Vector3<f64>>,
    /// Conjugate-gradient steps since the start.
    pub steps: u64,
    /// Solutions since the start.
    pub solutions: u64,
    /// Ticks whose contacts did not come to agree.
    pub unsettled: u64,
}

impl Scratch {
    /// Makes room and sets everything to zero.
    pub(super) fn prepare(&mut self, body: &Elastic) {
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

    /// The body's own system with contacts in it.
    pub(super) fn add_springs(&mut self, body: &Elastic, springs: impl Iterator<Item = Spring>) {
        self.matrix.copy_from_slice(&self.elastic);
        self.right.copy_from_slice(&self.force);
        for spring in springs {
            let cell = &body.cells[spring.cell];
            for a in 0..4 {
                self.right[cell.nodes[a]] += spring.push * spring.weights[a];
                for b in 0..4 {
                    self.matrix[cell.blocks[a][b]] +=
                        spring.block * (spring.weights[a] * spring.weights[b]);
                }
            }
        }
    }

    /// Rows of held nodes say that nothing changes.
    pub(super) fn hold(&mut self, body: &Elastic, held: &[usize], velocity: &[Vector3<f64>]) {
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
    pub(super) fn solve(&mut self, body: &Elastic, velocity: &mut [Vector3<f64>]) {
        self.solutions += 1;
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
