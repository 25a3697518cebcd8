//! Tetrahedra that fill a solid: a lattice of cubes, five in each, whose outer nodes
//! are moved onto the surface. Independent of the material.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Point3, Vector3};

use super::plush::Plush;

/// A tetrahedral mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tetrahedra {
    /// Corners, metres.
    pub nodes: Vec<Point3<f64>>,
    /// Four corners each, of positive volume.
    pub cells: Vec<[usize; 4]>,
}

/// A point as a mean of the corners of a tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Embedded {
    /// Index of the tetrahedron.
    pub cell: usize,
    /// Weights of its corners; their sum is 1, some are negative for a point outside.
    pub weights: [f64; 4],
}

/// The corner tetrahedra and the central one of a cube with corners numbered x + 2 y +
/// 4 z; neighbouring cubes alternate.
const EVEN: [[usize; 4]; 5] = [
    [0, 3, 5, 6],
    [1, 0, 3, 5],
    [2, 0, 3, 6],
    [4, 0, 5, 6],
    [7, 3, 5, 6],
];
const ODD: [[usize; 4]; 5] = [
    [1, 2, 4, 7],
    [0, 1, 2, 4],
    [3, 1, 2, 7],
    [5, 1, 4, 7],
    [6, 2, 4, 7],
];
/// Smallest filled share of a cube that is kept.
const FILLED: f64 = 0.4;
/// Samples along each edge of a cube to compute its filled share.
const SAMPLES: usize = 4;
/// Smallest share of its lattice volume that a tetrahedron keeps when its corners move
/// onto the surface.
const THINNEST: f64 = 0.3;

type Cube = [i32; 3];

impl Tetrahedra {
    /// A box of `count` cubes of `pitch` metres along x, y, z from the origin.
    #[must_use]
    pub fn block(count: [i32; 3], pitch: f64) -> Self {
        let mut cubes = BTreeSet::new();
        for x in 0..count[0] {
            for y in 0..count[1] {
                for z in 0..count[2] {
                    cubes.insert([x, y, z]);
                }
            }
        }
        Self::from_cubes(&cubes, &Point3::origin(), pitch).0
    }

    /// The tetrahedral mesh of a toy, in cubes of `pitch` metres; parts that are not
    /// connected by a face are dropped.
    #[must_use]
    pub fn tet_mesh(toy: &Plush, pitch: f64) -> Self {
        let (low, high) = toy.bounds();
        // Symmetric about x = 0, where a toy's two halves meet.
        let across = (high.x.max(-low.x) / pitch).ceil();
        let origin = Point3::new(-across * pitch, low.y, low.z);
        let extent = Vector3::new(2.0 * across * pitch, high.y - low.y, high.z - low.z);
        let count = extent.map(|e| (e / pitch).ceil() as i32);
        let mut cubes = BTreeSet::new();
        for x in 0..count.x {
            for y in 0..count.y {
                for z in 0..count.z {
                    let cube = [x, y, z];
                    if filled(toy, &origin, pitch, cube) >= FILLED {
                        cubes.insert(cube);
                    }
                }
            }
        }
        let cubes = largest_piece(&cubes);
        let (mut mesh, outer) = Self::from_cubes(&cubes, &origin, pitch);
        mesh.move_onto(toy, &outer, pitch);
        mesh
    }

    /// The cells of cubes, and whether each node is on their surface.
    fn from_cubes(cubes: &BTreeSet<Cube>, origin: &Point3<f64>, pitch: f64) -> (Self, Vec<bool>) {
        let mut mesh = Self::default();
        let mut known: BTreeMap<Cube, usize> = BTreeMap::new();
        let mut around: Vec<usize> = Vec::new();
        for cube in cubes {
            let corners: [usize; 8] = std::array::from_fn(|i| {
                let bit = |axis: usize| cube[axis] + ((i >> axis) & 1) as i32;
                let at = [bit(0), bit(1), bit(2)];
                let node = *known.entry(at).or_insert_with(|| {
                    let offset = Vector3::from(at.map(f64::from)) * pitch;
                    mesh.nodes.push(origin + offset);
                    around.push(0);
                    mesh.nodes.len() - 1
                });
                around[node] += 1;
                node
            });
            let even = (cube[0] + cube[1] + cube[2]).rem_euclid(2) == 0;
            for tetrahedron in if even { EVEN } else { ODD } {
                let mut cell = tetrahedron.map(|i| corners[i]);
                if mesh.volume(&cell) < 0.0 {
                    cell.swap(2, 3);
                }
                mesh.cells.push(cell);
            }
        }
        let outer = around.iter().map(|&n| n < 8).collect();
        (mesh, outer)
    }

    /// Moves the outer nodes onto the skin, less far where a cell would collapse.
    fn move_onto(&mut self, toy: &Plush, outer: &[bool], pitch: f64) {
        let lattice = self.clone();
        let way: Vec<Vector3<f64>> = lattice
            .nodes
            .iter()
            .zip(outer)
            .map(|(node, outer)| {
                if *outer {
                    (toy.nearest(node) - node).cap_magnitude(0.6 * pitch)
                } else {
                    Vector3::zeros()
                }
            })
            .collect();
        let mut share = vec![1.0; way.len()];
        for _ in 0..12 {
            for (i, node) in self.nodes.iter_mut().enumerate() {
                *node = lattice.nodes[i] + way[i] * share[i];
            }
            let mut sound = true;
            for cell in &lattice.cells {
                if self.volume(cell) < THINNEST * lattice.volume(cell) {
                    sound = false;
                    for &i in cell {
                        share[i] *= 0.7;
                    }
                }
            }
            if sound {
                return;
            }
        }
        self.nodes = lattice.nodes;
    }

    /// Signed volume of a cell, m³.
    #[must_use]
    pub fn volume(&self, cell: &[usize; 4]) -> f64 {
        self.edges(cell).determinant() / 6.0
    }

    /// Edges from the first corner of a cell to the others, as columns, metres.
    #[must_use]
    pub fn edges(&self, cell: &[usize; 4]) -> Matrix3<f64> {
        let [a, b, c, d] = cell.map(|i| self.nodes[i]);
        Matrix3::from_columns(&[b - a, c - a, d - a])
    }

    /// The cells that contain points, or are closest to them.
    #[must_use]
    pub fn embed(&self, points: &[Point3<f64>]) -> Vec<Embedded> {
        let inverses: Vec<Matrix3<f64>> = self
            .cells
            .iter()
            .map(|cell| self.edges(cell).try_inverse().unwrap_or_default())
            .collect();
        let place = |p: &Point3<f64>| {
            let mut best = Embedded {
                cell: 0,
                weights: [f64::NEG_INFINITY; 4],
            };
            let mut depth = f64::NEG_INFINITY;
            for (cell, inverse) in inverses.iter().enumerate() {
                let w = inverse * (p - self.nodes[self.cells[cell][0]]);
                let weights = [1.0 - w.x - w.y - w.z, w.x, w.y, w.z];
                let least = weights.iter().copied().fold(f64::INFINITY, f64::min);
                if least > depth {
                    depth = least;
                    best = Embedded { cell, weights };
                }
            }
            best
        };
        points.iter().map(place).collect()
    }
}

/// Share of a cube inside the toy.
fn filled(toy: &Plush, origin: &Point3<f64>, pitch: f64, cube: Cube) -> f64 {
    let mut inside = 0.0;
    let step = pitch / SAMPLES as f64;
    for i in 0..SAMPLES.pow(3) {
        let at = [i % SAMPLES, i / SAMPLES % SAMPLES, i / SAMPLES / SAMPLES];
        let offset = Vector3::from_fn(|axis, _| {
            f64::from(cube[axis]) * pitch + (at[axis] as f64 + 0.5) * step
        });
        if toy.distance(&(origin + offset)) < 0.0 {
            inside += 1.0;
        }
    }
    inside / SAMPLES.pow(3) as f64
}

/// The largest set of cubes connected by faces.
fn largest_piece(cubes: &BTreeSet<Cube>) -> BTreeSet<Cube> {
    let mut left = cubes.clone();
    let mut largest = BTreeSet::new();
    while let Some(first) = left.pop_first() {
        let mut piece = BTreeSet::from([first]);
        let mut open = vec![first];
        while let Some(cube) = open.pop() {
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut next = cube;
                    next[axis] += step;
                    if left.remove(&next) {
                        piece.insert(next);
                        open.push(next);
                    }
                }
            }
        }
        if piece.len() > largest.len() {
            largest = piece;
        }
    }
    largest
}
