//! The elastic body: corotated linear tetrahedra (Müller & Gross 2004).
//!
//! Constant data of one body and its stiffness as a matrix of 3 x 3 blocks.
//! Nothing here knows contacts or time.

use nalgebra::{Matrix3, Vector3};

use super::rotation::Rotation;
use crate::geometry::tetrahedra::Tetrahedra;

/// What a body is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elasticity {
    /// Young's modulus, Pa.
    pub young_modulus: f64,
    /// Poisson's ratio, below 0.5.
    pub poisson_ratio: f64,
    /// Stress per strain rate over stress per strain, seconds.
    pub damping: f64,
}

/// One tetrahedron.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    /// Its corners.
    pub nodes: [usize; 4],
    /// Gradients of the corners' weights at rest, 1/m.
    gradients: [Vector3<f64>; 4],
    /// At rest, m³.
    volume: f64,
    /// Where its sixteen blocks stand in the matrix.
    pub blocks: [[usize; 4]; 4],
}

/// A body: its cells, masses and the pattern of its matrix.
#[derive(Clone, Debug)]
pub struct Elastic {
    /// Nodes at rest, metres, in the body's frame.
    pub rest: Vec<Vector3<f64>>,
    /// Mass of each node, kg.
    pub masses: Vec<f64>,
    /// Sum of the masses, kg.
    pub mass: f64,
    /// Damping time, seconds.
    pub damping: f64,
    pub(super) cells: Vec<Cell>,
    lambda: f64,
    mu: f64,
    /// First block of each row of the matrix, and one past the last.
    pub(super) rows: Vec<usize>,
    /// Column of each block.
    pub(super) columns: Vec<usize>,
    /// Block on the diagonal of each row.
    pub(super) diagonal: Vec<usize>,
}

impl Elastic {
    /// A body of `mass` kg, spread evenly over its volume.
    #[must_use]
    pub fn new(mesh: &Tetrahedra, material: &Elasticity, mass: f64) -> Self {
        let n = mesh.nodes.len();
        let mut near: Vec<Vec<usize>> = (0..n).map(|i| vec![i]).collect();
        for cell in &mesh.cells {
            for &a in cell {
                near[a].extend(cell.iter().filter(|b| **b != a));
            }
        }
        let (mut rows, mut columns, mut diagonal) = (vec![0], Vec::new(), Vec::new());
        for (i, row) in near.iter_mut().enumerate() {
            row.sort_unstable();
            row.dedup();
            let place = row.binary_search(&i).unwrap_or(0);
            diagonal.push(columns.len() + place);
            columns.extend_from_slice(row);
            rows.push(columns.len());
        }
        let block = |a: usize, b: usize| rows[a] + near[a].binary_search(&b).unwrap_or(0);
        let volume: f64 = mesh.cells.iter().map(|c| mesh.volume(c)).sum();
        let mut masses = vec![0.0; n];
        let cells = mesh
            .cells
            .iter()
            .map(|&nodes| {
                let inverse = mesh.edges(&nodes).try_inverse().unwrap_or_default();
                let [b, c, d] = [0, 1, 2].map(|i| inverse.row(i).transpose());
                let own = mesh.volume(&nodes);
                for i in nodes {
                    masses[i] += mass * own / volume / 4.0;
                }
                Cell {
                    nodes,
                    gradients: [-(b + c + d), b, c, d],
                    volume: own,
                    blocks: nodes.map(|a| nodes.map(|b| block(a, b))),
                }
            })
            .collect();
        let (e, nu) = (material.young_modulus, material.poisson_ratio);
        Self {
            rest: mesh.nodes.iter().map(|p| p.coords).collect(),
            masses,
            mass,
            damping: material.damping,
            cells,
            lambda: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
            mu: e / (2.0 * (1.0 + nu)),
            rows,
            columns,
            diagonal,
        }
    }

    fn deformation(&self, cell: &Cell, position: &[Vector3<f64>]) -> Matrix3<f64> {
        let mut f = Matrix3::zeros();
        for (i, g) in cell.nodes.iter().zip(&cell.gradients) {
            f += position[*i] * g.transpose();
        }
        f
    }

    /// Lets the rotation of every cell follow its deformation.
    pub(super) fn extract_rotation(&self, position: &[Vector3<f64>], rotations: &mut [Rotation]) {
        for (cell, rotation) in self.cells.iter().zip(rotations) {
            rotation.extract_rotation(&self.deformation(cell, position));
        }
    }

    /// Adds the elastic forces on the nodes, N, and `scale` times the stiffness,
    /// N/m, to a matrix of blocks; returns the elastic energy, J.
    pub(super) fn assemble(
        &self,
        position: &[Vector3<f64>],
        rotations: &[Rotation],
        scale: f64,
        force: &mut [Vector3<f64>],
        matrix: &mut [Matrix3<f64>],
    ) -> f64 {
        let mut energy = 0.0;
        for (cell, rotation) in self.cells.iter().zip(rotations) {
            let r = rotation.matrix();
            let (stress, density) =
                self.stress(&(r.transpose() * self.deformation(cell, position)));
            energy += density * cell.volume;
            let push = r * stress * -cell.volume;
            let turned = cell.gradients.map(|g| r * g);
            for (i, g) in cell.nodes.iter().zip(&cell.gradients) {
                force[*i] += push * g;
            }
            let (lambda, mu) = (
                self.lambda * cell.volume * scale,
                self.mu * cell.volume * scale,
            );
            for (a, row) in cell.blocks.iter().enumerate() {
                for (b, &block) in row.iter().enumerate() {
                    let (ga, gb) = (turned[a], turned[b]);
                    let along = mu * ga.dot(&gb);
                    let out = &mut matrix[block];
                    for i in 0..3 {
                        for j in 0..3 {
                            out[(i, j)] += lambda * ga[i] * gb[j] + mu * gb[i] * ga[j];
                        }
                        out[(i, i)] += along;
                    }
                }
            }
        }
        energy
    }

    /// Stress of a cell's own frame, Pa, and density of energy, J/m³, at a
    /// deformation with its rotation taken out.
    fn stress(&self, unturned: &Matrix3<f64>) -> (Matrix3<f64>, f64) {
        let strain = (unturned + unturned.transpose()) * 0.5 - Matrix3::identity();
        let stress =
            strain * (2.0 * self.mu) + Matrix3::identity() * (self.lambda * strain.trace());
        (stress, stress.dot(&strain) / 2.0)
    }

    /// Elastic energy, J.
    #[must_use]
    pub fn energy(&self, position: &[Vector3<f64>], rotations: &[Rotation]) -> f64 {
        let of = |(cell, rotation): (&Cell, &Rotation)| {
            let unturned = rotation.matrix().transpose() * self.deformation(cell, position);
            self.stress(&unturned).1 * cell.volume
        };
        self.cells.iter().zip(rotations).map(of).sum()
    }

    /// Centre of mass of nodes at positions, metres.
    #[must_use]
    pub fn centre(&self, position: &[Vector3<f64>]) -> Vector3<f64> {
        let weighted = position.iter().zip(&self.masses).map(|(x, m)| x * *m);
        weighted.sum::<Vector3<f64>>() / self.mass
    }

    /// Matrix whose rotation carries the body at rest nearest to nodes at positions.
    pub(super) fn carried(&self, position: &[Vector3<f64>]) -> Matrix3<f64> {
        let (from, to) = (self.centre(&self.rest), self.centre(position));
        let nodes = self.rest.iter().zip(position).zip(&self.masses);
        let sum: Matrix3<f64> = nodes
            .map(|((rest, x), m)| (x - to) * (rest - from).transpose() * *m)
            .sum();
        sum / sum.norm().max(1e-12)
    }

    /// Number of nodes.
    pub(super) fn nodes(&self) -> usize {
        self.rest.len()
    }
}
