//! The elastic body: corotated linear tetrahedra (Müller & Gross 2004).
//!
//! Constant data of one body and its stiffness as a matrix of 3 x 3 blocks, without
//! contacts and time.

use nalgebra::{Matrix3, Vector3};

use super::lanes::{Block, Lanes, lanes};
use super::rotation::Rotation;
use crate::geometry::tetrahedra::Tetrahedra;

/// Material of a body.
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
    /// Gradients of the corners' weights in the rest shape, 1/m.
    gradients: [Vector3<f64>; 4],
    /// Rest volume, m³.
    volume: f64,
    /// Indices of its sixteen blocks in the matrix.
    pub blocks: [[usize; 4]; 4],
}

/// A body: its cells, masses and the sparsity of its matrix.
#[derive(Clone, Debug)]
pub struct Elastic {
    /// Rest positions of the nodes, metres, in the body's frame.
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
    /// A body of `mass` kg, distributed evenly over its volume.
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

    /// Updates the rotation of every cell from its deformation.
    #[cfg(test)]
    pub(super) fn extract_rotation(&self, position: &[Vector3<f64>], rotations: &mut [Rotation]) {
        for (cell, rotation) in self.cells.iter().zip(rotations) {
            rotation.extract_rotation(&self.deformation(cell, position));
        }
    }

    /// Updates the rotation of every cell from its deformation. Adds the elastic forces
    /// over `h` seconds to the nodes' impulses, N·s, and subtracts `stiff` times the
    /// stiffness times the velocities. Adds `stiff` times the stiffness to a matrix of
    /// blocks, N/m. Returns the elastic energy, J.
    pub(super) fn assemble(
        &self,
        [position, velocity]: [&[Vector3<f64>]; 2],
        rotations: &mut [Rotation],
        [h, stiff]: [f64; 2],
        impulse: &mut [Vector3<f64>],
        matrix: &mut [Block],
    ) -> f64 {
        let mut energy = 0.0;
        for (cell, rotation) in self.cells.iter().zip(rotations) {
            let deformation = self.deformation(cell, position);
            rotation.extract_rotation(&deformation);
            let r = rotation.matrix();
            let (stress, density) = self.stress(&(r.transpose() * deformation));
            energy += density * cell.volume;
            let resistance = self.resistance(&(r.transpose() * self.deformation(cell, velocity)));
            let push = r * (stress * h + resistance * stiff) * -cell.volume;
            for (i, g) in cell.nodes.iter().zip(&cell.gradients) {
                impulse[*i] += push * g;
            }
            let turned = cell.gradients.map(|g| lanes(&(r * g)));
            self.stiffen(cell, turned, (cell.volume * stiff) as f32, matrix);
        }
        energy
    }

    /// Adds a cell's stiffness times `scale` m³, for rotated gradients.
    fn stiffen(&self, cell: &Cell, turned: [Lanes; 4], scale: f32, matrix: &mut [Block]) {
        const UNIT: Block = [
            Lanes::new([1.0, 0.0, 0.0, 0.0]),
            Lanes::new([0.0, 1.0, 0.0, 0.0]),
            Lanes::new([0.0, 0.0, 1.0, 0.0]),
        ];
        let (lambda, mu) = (self.lambda as f32 * scale, self.mu as f32 * scale);
        let spread = |g: Lanes, by: f32| {
            let [x, y, z, _] = (g * Lanes::splat(by)).to_array();
            [x, y, z].map(Lanes::splat)
        };
        let bulk = turned.map(|g| spread(g, lambda));
        let shear = turned.map(|g| spread(g, mu));
        for (a, row) in cell.blocks.iter().enumerate() {
            for (b, &block) in row.iter().enumerate() {
                let (ga, gb) = (turned[a], turned[b]);
                let [x, y, z, _] = (ga * gb).to_array();
                let along = Lanes::splat(mu * (x + y + z));
                for (j, column) in matrix[block].iter_mut().enumerate() {
                    *column += ga * bulk[b][j] + gb * shear[a][j] + UNIT[j] * along;
                }
            }
        }
    }

    /// Subtracts `stiff` times the stiffness times changes of the velocities from the
    /// nodes' impulses, N·s.
    pub(super) fn resist(
        &self,
        changes: &[Vector3<f64>],
        rotations: &[Rotation],
        stiff: f64,
        impulse: &mut [Vector3<f64>],
    ) {
        for (cell, rotation) in self.cells.iter().zip(rotations) {
            let r = rotation.matrix();
            let resistance = self.resistance(&(r.transpose() * self.deformation(cell, changes)));
            let push = r * resistance * -(cell.volume * stiff);
            for (i, g) in cell.nodes.iter().zip(&cell.gradients) {
                impulse[*i] += push * g;
            }
        }
    }

    /// Derivative of the stress by the deformation, in the cell's own frame.
    fn resistance(&self, unturned: &Matrix3<f64>) -> Matrix3<f64> {
        let strain = (unturned + unturned.transpose()) * 0.5;
        strain * (2.0 * self.mu) + Matrix3::identity() * (self.lambda * strain.trace())
    }

    /// Stress in a cell's own frame, Pa, and energy density, J/m³, for a deformation
    /// without its rotation.
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

    /// Centre of mass for node positions, metres.
    #[must_use]
    pub fn centre(&self, position: &[Vector3<f64>]) -> Vector3<f64> {
        let weighted = position.iter().zip(&self.masses).map(|(x, m)| x * *m);
        weighted.sum::<Vector3<f64>>() / self.mass
    }

    /// Matrix whose rotation maps the rest shape closest to the node positions.
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
